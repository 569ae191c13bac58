//! Impulses on walls, and refusals.

use super::*;
use crate::common::{balls, compile, on_floor, G, MASS};
use carom_core::outcome::Failure;
use carom_core::wall::{Cylinder, Disc, Rectangle};

#[test]
fn walls_are_recorded_when_they_move_or_on_demand() {
    let law = [0.3, 0.0, 0.0, 0.0, 0.0];
    let mut s = run(&on_floor(law), options(1e-3), 0.01);
    assert!(s.take_block().walls.is_empty());
    let mut asked = on_floor(law);
    asked.record_walls = true;
    let mut s = run(&asked, options(1e-3), 0.01);
    let walls = s.take_block().walls;
    assert_eq!(walls.len(), 6 * 10);
    for six in walls.chunks(6) {
        close(six[2], -MASS * G * 1e-3, 1e-18);
        assert_eq!(
            [six[0], six[1], six[3], six[4], six[5]].map(f64::abs),
            [0.0; 5]
        );
    }
}

/// Weight at a lever from the wall's place, which moves with the wall.
#[test]
fn torques_count_from_the_place_of_the_wall() {
    let x = DVec3::new(0.3, -0.2, R);
    let mut input = balls(&[x.to_array()], &[]);
    input.gravity = [0.0, 0.0, -G];
    input.laws = vec![(0, 1, [0.0; 5])];
    let plate = Shape::Rectangle(Rectangle {
        centre: DVec3::ZERO,
        normal: DVec3::Z,
        side: DVec3::X,
        half: [5.0, 5.0],
    });
    let wall = add_wall(&mut input, plate);
    let away = translation(
        Scalar::Polynomial(vec![0.0, 2.0]),
        Scalar::zero(),
        Scalar::zero(),
    );
    input.wall_motion = vec![(wall, away)];
    let mut s = run(&input, options(1e-3), 0.2);
    let weight = MASS * G * 1e-3;
    for (n, six) in s.take_block().walls.chunks(6).enumerate() {
        // The weight acts half-way through each step.
        let place = 2.0 * 1e-3 * (n as f64 + 0.5);
        close(six[3], 0.2 * weight, 1e-15);
        close(six[4], (0.3 - place) * weight, 1e-15);
    }
}

/// A heap in a tub: bottom and side together carry its weight, to the rounding of the impulses.
#[test]
fn a_heap_weighs_what_its_balls_weigh() {
    let n = 6;
    let start: Vec<[f64; 3]> = (0..n)
        .map(|k| {
            let (layer, angle) = (k / 3, 2.1 * f64::from(k % 3) + 0.4 * f64::from(k / 3));
            let z = R + 2.2 * R * f64::from(layer);
            [1.3 * R * angle.cos(), 1.3 * R * angle.sin(), z]
        })
        .collect();
    let mut input = balls(&start, &[]);
    input.gravity = [0.0, 0.0, -G];
    let law = [0.4, 0.2, 0.0, 2e-3, 2e-3];
    input.laws = vec![(0, 0, law), (0, 1, law)];
    input.record_walls = true;
    let (centre, axis, radius) = (DVec3::ZERO, DVec3::Z, 2.6 * R);
    add_wall(
        &mut input,
        Shape::Disc(Disc {
            centre,
            normal: axis,
            radius,
            hole: 0.0,
        }),
    );
    let tube = Cylinder {
        centre,
        axis,
        radius,
        half: 0.5,
        inside: true,
    };
    add_wall(&mut input, Shape::Cylinder(tube));
    let mut s = run(&input, options(1e-3), 1.0);
    let walls = s.take_block().walls;
    let mut given = DVec3::ZERO;
    for six in walls.chunks(6) {
        given += DVec3::new(six[0], six[1], six[2]);
    }
    let momentum = MASS * s.state.velocity.iter().sum::<DVec3>();
    let weight = DVec3::new(0.0, 0.0, -f64::from(n) * MASS * G);
    assert!((weight - momentum - given).length() < 1e-12);
    let last = &walls[walls.len() - 12..];
    close(
        last[2] + last[8],
        1e-3 * weight.z,
        1e-6 * weight.length() * 1e-3,
    );
    assert!(s.state.velocity.iter().all(|v| v.length() < 1e-6));
}

#[test]
fn a_motion_that_is_no_number_stops_the_run_with_its_wall() {
    let mut input = on_floor([0.3, 0.0, 0.0, 0.0, 0.0]);
    let up = translation(
        Scalar::zero(),
        Scalar::zero(),
        law("sqrt(0.0105 - t) - sqrt(0.0105)"),
    );
    input.wall_motion = vec![(0, up)];
    let mut s = simulation(&input, options(1e-3));
    let outcome = crate::common::advance(&mut s, 100);
    let outcome = outcome.expect("the law has no number");
    assert_eq!(outcome.failure, Failure::Load);
    assert_eq!((outcome.step, s.state.step), (11, 10));
    // Walls are numbered after the spheres.
    assert_eq!(outcome.bodies, [s.model.bodies() as u32]);
    let message = outcome.message.unwrap_or_default();
    assert!(message.contains("not finite"), "{message}");
}

#[test]
fn unusable_walls_are_named() {
    let disc = Disc {
        centre: DVec3::ZERO,
        normal: DVec3::Z,
        radius: 1.0,
        hole: 0.0,
    };
    let plate = Rectangle {
        centre: DVec3::ZERO,
        normal: DVec3::Z,
        side: DVec3::X,
        half: [1.0, 1.0],
    };
    for (shape, expected) in [
        (Shape::Disc(Disc { hole: 1.0, ..disc }), "hole of wall 0"),
        (
            Shape::Disc(Disc {
                radius: -1.0,
                ..disc
            }),
            "radius of wall 0",
        ),
        (
            Shape::Disc(Disc {
                normal: DVec3::ZERO,
                ..disc
            }),
            "normal of wall 0",
        ),
        (
            Shape::Disc(Disc {
                centre: DVec3::NAN,
                ..disc
            }),
            "point of wall 0",
        ),
        (
            Shape::Rectangle(Rectangle {
                side: DVec3::Z,
                ..plate
            }),
            "side of wall 0",
        ),
        (
            Shape::Rectangle(Rectangle {
                half: [1.0, 0.0],
                ..plate
            }),
            "size of wall 0",
        ),
    ] {
        let mut input = on_floor([0.0; 5]);
        add_wall(&mut input, shape);
        let error = compile(&input, options(1e-3))
            .expect_err("refused")
            .to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    let mut input = on_floor([0.0; 5]);
    input.wall_motion = vec![(1, WallMotion::default())];
    let error = compile(&input, options(1e-3))
        .expect_err("refused")
        .to_string();
    assert!(error.contains("there are 1 walls"), "{error}");
    input.wall_motion = vec![(0, rotation(2.0 * DVec3::Z, DVec3::ZERO, Scalar::zero()))];
    let error = compile(&input, options(1e-3))
        .expect_err("refused")
        .to_string();
    assert!(error.contains("unit axis"), "{error}");
}
