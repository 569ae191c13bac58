//! Curved and finite walls: rolling in bowls and drums, orbits in a cone, over an edge.

use super::*;
use crate::common::{balls, G, MASS};
use carom_core::wall::{Ball, Cone, Cylinder, Rectangle};

const WIDE: f64 = 0.5;

/// One ball at `x` under gravity at one wall.
fn at(wall: Shape, x: DVec3, law: [f64; 5]) -> ModelInput {
    let mut input = balls(&[x.to_array()], &[]);
    input.gravity = [0.0, 0.0, -G];
    input.laws = vec![(0, 1, law)];
    add_wall(&mut input, wall);
    input
}

fn bowl() -> Shape {
    Shape::Ball(Ball {
        centre: DVec3::ZERO,
        radius: WIDE,
        inside: true,
    })
}

fn trough(half: f64) -> Shape {
    Shape::Cylinder(Cylinder {
        centre: DVec3::ZERO,
        axis: DVec3::Y,
        radius: WIDE,
        half,
        inside: true,
    })
}

/// A ball in a bowl or a trough is a pendulum of length R - r, slower by 7/5 where it rolls.
#[test]
fn a_ball_in_a_bowl_swings_with_the_right_period() {
    let (l, start, until) = (WIDE - R, 0.1, 2.0);
    for wall in [bowl(), trough(f64::INFINITY), trough(1.0)] {
        for (mu, inertia) in [(0.0, 0.0), (0.5, SHARE)] {
            let error = |h: f64| {
                let x = l * DVec3::new(f64::sin(start), 0.0, -f64::cos(start));
                let s = run(&at(wall, x, [mu, 0.0, 0.0, 0.0, 0.0]), options(h), until);
                let at = s.state.position[0];
                close(at.length(), l, s.model.options.gap_tolerance * R);
                close(at.y, 0.0, 1e-14);
                let rate = G / (l * (1.0 + inertia));
                let [angle, _] = integrate([start, 0.0], until, |a| -rate * a.sin());
                (at.x.atan2(-at.z) - angle).abs()
            };
            let errors = [error(5e-4), error(2.5e-4)];
            assert!(
                errors[1] < 1e-5 * start && order(errors) > 1.9,
                "{mu} {errors:?}"
            );
        }
    }
}

/// From the top of a cylinder or a ball it rolls down until it leaves at cos(angle) = 10/17.
#[test]
fn a_ball_rolls_off_a_hill() {
    let hills = [
        Shape::Ball(Ball {
            centre: DVec3::ZERO,
            radius: WIDE,
            inside: false,
        }),
        Shape::Cylinder(Cylinder {
            centre: DVec3::ZERO,
            axis: DVec3::Y,
            radius: WIDE,
            half: 1.0,
            inside: false,
        }),
    ];
    let l = WIDE + R;
    for wall in hills {
        let angle: f64 = 0.3;
        let x = l * DVec3::new(angle.sin(), 0.0, angle.cos());
        let input = at(wall, x, [500.0, 0.0, 0.0, 0.0, 0.0]);
        let rate = G / (1.4 * l);
        let error = |h: f64| {
            let s = run(&input, options(h), 0.25);
            let at = s.state.position[0];
            let [a, _] = integrate([angle, 0.0], 0.25, |a| rate * a.sin());
            assert!(a.cos() > 10.0 / 17.0);
            (at.x.atan2(at.z) - a).abs()
        };
        let errors = [error(1e-3), error(5e-4)];
        assert!(errors[1] < 1e-3 && order(errors) > 0.9, "{errors:?}");
        // From rest at 0.3: 7/10 v^2 = g l (cos 0.3 - cos a) and v^2 = g l cos a.
        let mut s = simulation(&input, options(5e-4));
        go_on(&mut s, 0.7);
        let steps = s.take_block().steps;
        let last = steps.iter().rposition(|r| r.contacts > 0).expect("contact");
        let mut again = simulation(&input, options(5e-4));
        go_on(&mut again, (last + 1) as f64 * 5e-4);
        let at = again.state.position[0];
        let leaves = 10.0 / 17.0 * angle.cos();
        close((at.z / l).acos(), leaves.acos(), 5e-3);
    }
}

/// Without friction a ball in a cone circles at the height that belongs to its speed: v^2 = g rho/tan(alpha).
#[test]
fn a_ball_orbits_in_a_cone() {
    let (rise, widens) = (1.0f64, 0.8f64);
    let cone = Shape::Cone(Cone {
        point: DVec3::ZERO,
        axis: DVec3::Z,
        radius: 0.0,
        radius_end: widens,
        length: rise,
        inside: true,
    });
    let slant = rise.hypot(widens);
    let (cos, sin) = (rise / slant, widens / slant);
    // The centre stands r inwards from the surface at half height.
    let rho = 0.5 * widens - R * cos;
    let x = DVec3::new(rho, 0.0, 0.5 * rise + R * sin);
    let speed = (G * rho * cos / sin).sqrt();
    let until = 1.0;
    let error = |h: f64| {
        let mut input = at(cone, x, [0.0; 5]);
        input.velocity[0] = [0.0, speed, 0.0];
        let s = run(&input, options(h), until);
        let (s1, c1) = (speed / rho * until).sin_cos();
        (s.state.position[0] - DVec3::new(rho * c1, rho * s1, x.z)).length()
    };
    let errors = [error(1e-3), error(5e-4)];
    assert!(errors[1] < 0.02 && order(errors) > 0.9, "{errors:?}");
}

fn plate() -> Shape {
    Shape::Rectangle(Rectangle {
        centre: DVec3::new(-1.0, 0.0, 0.0),
        normal: DVec3::Z,
        side: DVec3::X,
        half: [1.0, 0.5],
    })
}

/// Faster than sqrt(g r) a ball flies off an edge at once; slow, it turns about the edge until v^2 = g r cos(angle).
#[test]
fn a_ball_rolls_over_an_edge() {
    let fast = 1.2 * (G * R).sqrt();
    let h = 1e-4;
    let rolling = |v: f64, x: f64, mu: f64| {
        let mut input = at(plate(), DVec3::new(x, 0.1, R), [mu, 0.0, 0.0, 0.0, 0.0]);
        input.velocity[0] = [v, 0.0, 0.0];
        input.angular_velocity[0] = [0.0, v / R, 0.0];
        input
    };
    let s = run(&rolling(fast, -0.1, 0.5), options(h), 0.3);
    let flight = 0.3 - 0.1 / fast;
    close(s.state.position[0].x, 0.3 * fast - 0.1, 1e-4);
    close(
        s.state.position[0].z,
        R - 0.5 * G * flight * flight,
        G * flight * h,
    );
    close(s.state.velocity[0].x, fast, 1e-3 * fast);
    let slow = 0.05;
    let energy = slow * slow / (G * R);
    let cos = (10.0 / 7.0 + energy) * 7.0 / 17.0;
    let expected = (G * R * cos).sqrt() * cos;
    let error = |h: f64| {
        let s = run(&rolling(slow, -0.01, 50.0), options(h), 0.6);
        let at = s.state.position[0];
        assert!(at.z < -0.1 && at.x > 0.0, "{at}");
        (s.state.velocity[0].x - expected).abs() / expected
    };
    let errors = [error(4e-4), error(1e-4)];
    assert!(errors[1] < 0.01, "{errors:?}");
}

/// A ball above a face never notices that the face ends somewhere: the same bits as on an infinite plane.
#[test]
fn a_large_rectangle_is_a_plane() {
    let mut on_plate = at(
        plate(),
        DVec3::new(-1.3, 0.1, 2.0 * R),
        [0.3, 0.6, 0.0, 0.0, 0.0],
    );
    on_plate.velocity[0] = [1.0, 0.2, 0.0];
    on_plate.angular_velocity[0] = [3.0, -20.0, 5.0];
    let mut on_plane = on_plate.clone();
    on_plane.walls.clear();
    on_plane.plane_point = vec![[0.0; 3]];
    on_plane.plane_normal = vec![[0.0, 0.0, 1.0]];
    on_plane.plane_material = vec![1];
    let (a, b) = (
        run(&on_plate, options(1e-3), 0.5),
        run(&on_plane, options(1e-3), 0.5),
    );
    let difference = (a.state.position[0] - b.state.position[0]).length();
    assert!(difference < 1e-12, "{difference:e}");
    close(
        (a.state.angular_velocity[0] - b.state.angular_velocity[0]).length(),
        0.0,
        1e-9,
    );
}

/// Four balls dropped into a funnel, each the mirror image of another, stay that to the last bit; what they give the
/// funnel sideways cancels.
#[test]
fn a_funnel_is_symmetric() {
    let funnel = Shape::Cone(Cone {
        point: DVec3::ZERO,
        axis: DVec3::Z,
        radius: 0.05,
        radius_end: 0.4,
        length: 0.3,
        inside: true,
    });
    let start: Vec<[f64; 3]> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        .iter()
        .map(|(sx, sy)| [sx * 0.13, sy * 0.21, 0.36])
        .collect();
    let mut input = balls(&start, &[]);
    input.gravity = [0.0, 0.0, -G];
    input.laws = vec![(0, 1, [0.4, 0.3, 0.1, 1e-3, 1e-3]), (0, 0, [0.0; 5])];
    input.record_walls = true;
    add_wall(&mut input, funnel);
    let mut s = run(&input, options(1e-3), 0.25);
    let first = s.state.position[0];
    assert!(first.z < 0.25, "{first}");
    for (k, sign) in [(-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].iter().enumerate() {
        let mirror = DVec3::new(sign.0, sign.1, 1.0);
        assert_eq!(s.state.position[k + 1], mirror * first);
        assert_eq!(s.state.velocity[k + 1], mirror * s.state.velocity[0]);
    }
    let walls = s.take_block().walls;
    let given: Vec<f64> = (0..6)
        .map(|k| walls.iter().skip(k).step_by(6).sum())
        .collect();
    let fallen: f64 = s.state.velocity.iter().map(|v| v.z).sum();
    close(given[2], -(4.0 * MASS * G * 0.25 + MASS * fallen), 1e-12);
    for k in [0, 1, 3, 4, 5] {
        close(given[k], 0.0, 1e-15);
    }
}
