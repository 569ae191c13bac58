//! Pieces of surfaces have two faces.

use super::*;
use crate::common::{balls, G};
use carom_core::wall::{Cone, Cylinder, Disc, Rectangle};

fn sheets() -> [Shape; 4] {
    let [centre, normal] = [DVec3::ZERO, DVec3::Z];
    [
        Shape::Rectangle(Rectangle {
            centre,
            normal,
            side: DVec3::X,
            half: [1.0, 1.0],
        }),
        Shape::Disc(Disc {
            centre,
            normal,
            radius: 1.0,
            hole: 0.0,
        }),
        Shape::Cylinder(Cylinder {
            centre: DVec3::Z,
            axis: DVec3::Y,
            radius: 1.0,
            half: 1.0,
            inside: true,
        }),
        Shape::Cone(Cone {
            point: DVec3::new(0.0, -1.0, 1.0),
            axis: DVec3::Y,
            radius: 1.0,
            radius_end: 1.0,
            length: 2.0,
            inside: true,
        }),
    ]
}

fn thrown(wall: Shape, height: f64, speed: f64) -> ModelInput {
    let mut input = balls(&[[0.0, 0.0, height]], &[]);
    input.laws = vec![(0, 1, [0.3, 0.5, 0.0, 0.0, 0.0])];
    input.velocity[0] = [0.0, 0.0, -speed * height.signum()];
    add_wall(&mut input, wall);
    input
}

/// Whatever it travels in a step, whatever the phase of the steps.
#[test]
fn a_ball_thrown_at_either_face_comes_back_with_e() {
    let h = 1e-3;
    for wall in sheets() {
        for travel in [0.01, 0.3, 0.7, 0.99, 1.0, 1.7, 2.3] {
            for start in [2.0, 2.31, 2.77] {
                let speed = travel * R / h;
                for side in [-1.0, 1.0] {
                    let input = thrown(wall, side * start * R, speed);
                    let s = run(&input, options(h), (8.0 / travel).ceil() * h);
                    let v = s.state.velocity[0];
                    close(v.z, 0.5 * side * speed, 1e-9 * speed);
                    assert!(
                        side * s.state.position[0].z > R,
                        "{wall:?} {travel} {start}"
                    );
                    assert_eq!(s.monitors.missed_impacts, 0);
                }
            }
        }
    }
}

/// A plate carries a ball above it, and below it where that falls upwards: mirror images to the last bit.
#[test]
fn both_faces_of_a_plate_are_alike() {
    let [up, down] = [1.0, -1.0].map(|side| {
        let mut input = thrown(sheets()[0], side * 1.5 * R, 0.4);
        input.gravity = [0.1 * G, 0.0, -side * G];
        input.velocity[0][0] = 0.3;
        run(&input, options(1e-3), 0.5)
    });
    let mirrored = |v: DVec3| DVec3::new(v.x, v.y, -v.z);
    assert_eq!(up.state.position[0], mirrored(down.state.position[0]));
    assert_eq!(up.state.velocity[0], mirrored(down.state.velocity[0]));
    let [a, b] = [&up, &down].map(|s| s.state.angular_velocity[0]);
    assert_eq!(a, DVec3::new(-b.x, -b.y, b.z));
}

/// A paddle that comes from behind takes a resting ball along.
#[test]
fn a_plate_that_moves_backwards_pushes_what_is_behind_it() {
    let mut input = thrown(sheets()[0], -1.5 * R, 0.0);
    input.laws[0].2[1] = 0.0;
    let motion = translation(Scalar::zero(), Scalar::zero(), law("-0.5 * t"));
    input.wall_motion = vec![(0, motion)];
    let s = run(&input, options(1e-3), 0.2);
    close(s.state.velocity[0].z, -0.5, 1e-9);
    close(s.state.position[0].z, -0.5 * 0.2 - R, 1e-3 * R);
}
