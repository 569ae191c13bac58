//! Moving walls: piston, table, belt, turntable, drum.

use super::*;
use crate::common::{balls, on_floor, G, MASS};
use carom_core::options::{Impact, Method};
use carom_core::wall::{Cylinder, Disc, Rectangle};

fn piston(speed: f64, e: f64) -> ModelInput {
    let mut input = balls(&[[R, 0.0, 0.0]], &[([0.0; 3], [1.0, 0.0, 0.0])]);
    input.laws = vec![(0, 1, [0.0, e, 0.0, 0.0, 0.0])];
    let forward = Scalar::Polynomial(vec![0.0, speed]);
    let motion = translation(forward, Scalar::zero(), Scalar::zero());
    input.wall_motion = vec![(0, motion)];
    input
}

#[test]
fn a_piston_pushes_and_strikes() {
    // A ball at rest that a piston touches, and one that flies against it.
    for &impact in Impact::ALL {
        for (e, u) in [
            (0.0, 0.0),
            (0.5, 0.0),
            (1.0, 0.0),
            (0.25, 0.75),
            (1.0, 0.75),
        ] {
            let speed = 0.5;
            let mut input = piston(speed, e);
            input.velocity[0] = [-u, 0.0, 0.0];
            let o = Options {
                impact,
                ..options(1e-3)
            };
            let mut s = run(&input, o, 0.1);
            let v = speed + e * (speed + u);
            close(s.state.velocity[0].x, v, 1e-15);
            let block = s.take_block();
            close(
                -block.walls.iter().step_by(6).sum::<f64>(),
                MASS * (v + u),
                1e-15,
            );
            // The piston gives its impulse at its speed; what is lost is the impact.
            close(s.monitors.energy_work, MASS * (v + u) * speed, 1e-15);
            assert_eq!(s.monitors.energy_rises, 0, "{e} {u}");
            let lost = 0.5 * MASS * (1.0 - e * e) * (speed + u).powi(2);
            let balance = s.monitors.energy_initial + s.monitors.energy_work - lost;
            close(s.monitors.energy_final, balance, 1e-15);
            if e == 0.0 {
                close(s.state.position[0].x, R + speed * 0.1, 1e-15);
            }
        }
    }
}

#[test]
fn other_methods_know_the_piston_too() {
    for (method, bound) in [(Method::MoreauJean, 1e-15), (Method::Penalty, 0.02)] {
        for e in [0.5, 1.0] {
            let mut input = piston(0.5, e);
            input.velocity[0] = [-0.25, 0.0, 0.0];
            let o = Options {
                method,
                ..options(1e-3)
            };
            let s = run(&input, o, 0.05);
            let v = 0.5 + e * 0.75;
            close(s.state.velocity[0].x, v, bound);
            close(
                s.monitors.energy_work,
                MASS * (v + 0.25) * 0.5,
                bound * MASS,
            );
        }
    }
}

/// A table that is lifted with a constant acceleration carries a ball exactly, and gives what the ball gains.
#[test]
fn an_accelerating_table_carries_exactly() {
    let (a, h) = (3.0, 1e-3);
    let mut input = on_floor([0.3, 0.7, 0.0, 1e-3, 0.0]);
    let lift = translation(
        Scalar::zero(),
        Scalar::zero(),
        Scalar::Polynomial(vec![0.0, 0.0, 0.5 * a]),
    );
    input.wall_motion = vec![(0, lift)];
    let mut s = run(&input, options(h), 0.2);
    let t = 0.2;
    close(s.state.position[0].z, R + 0.5 * a * t * t, 1e-15);
    close(s.state.velocity[0].z, a * t, 1e-14);
    for c in &s.take_block().contacts {
        close(c.impulse.z, MASS * (G + a) * h, 1e-14 * MASS);
    }
    let work = MASS * (G + a) * 0.5 * a * t * t;
    close(s.monitors.energy_work, work, 1e-13);
    close(
        s.monitors.energy_final - s.monitors.energy_initial,
        work,
        1e-13,
    );
    assert_eq!(s.monitors.energy_rises, 0);
}

/// A table that shakes by less than g never lets the ball go; by more, the ball leaves where the table falls faster.
#[test]
fn a_shaken_table_throws_at_the_right_time() {
    let omega = 30.0;
    let thrown = |gamma: f64, h: f64, until: f64| {
        let amplitude = gamma * G / (omega * omega);
        let mut input = on_floor([0.3, 0.0, 0.0, 0.0, 0.0]);
        let up = law(&format!("{amplitude:?} * sin({omega:?} * t)"));
        input.wall_motion = vec![(0, translation(Scalar::zero(), Scalar::zero(), up))];
        // The table starts with a jolt: so does the ball.
        input.velocity[0] = [0.0, 0.0, amplitude * omega];
        let s = run(&input, options(h), until);
        (s, amplitude)
    };
    let (s, amplitude) = thrown(0.9, 1e-3, 0.5);
    close(
        s.state.position[0].z,
        R + amplitude * (omega * 0.5f64).sin(),
        1e-14,
    );
    close(
        s.state.velocity[0].z,
        amplitude * omega * (omega * 0.5f64).cos(),
        1e-13,
    );
    // Free from sin(omega t_1) = 1/gamma on.
    let gamma: f64 = 2.0;
    let leaves = (1.0 / gamma).asin() / omega;
    let until = 0.06;
    let error = |h: f64| {
        let (s, amplitude) = thrown(gamma, h, until);
        let (sin, cos) = (omega * leaves).sin_cos();
        let flight = until - leaves;
        let z = R + amplitude * (sin + omega * cos * flight) - 0.5 * G * flight * flight;
        (s.state.position[0].z - z).abs()
    };
    // In the step in which it leaves the ball may be held or thrown by what the acceleration changes in one step.
    let jerk = gamma * G * omega * (omega * leaves).cos();
    for h in [4e-4, 2e-4, 6e-5, 2e-5] {
        let bound = 0.5 * jerk * h * h * (until - leaves);
        let found = error(h);
        assert!(found < bound, "{h}: {found:e} {bound:e}");
    }
}

/// A ball put on a moving belt: slips under mu g until it rolls with 2/7 of the belt's speed.
#[test]
fn a_belt_takes_a_ball_along() {
    let (mu, u, h) = (0.25, 1.5, 1e-3);
    let conveyor = WallMotion {
        surface_velocity: DVec3::new(u, 0.0, 0.0),
        ..WallMotion::default()
    };
    // The material alone, and a wall that moves as a whole.
    let sliding = Scalar::Polynomial(vec![0.0, u]);
    let whole = translation(sliding, Scalar::zero(), Scalar::zero());
    let plate = Shape::Rectangle(Rectangle {
        centre: DVec3::ZERO,
        normal: DVec3::Z,
        side: DVec3::Y,
        half: [10.0, 10.0],
    });
    for (motion, finite) in [
        (&conveyor, false),
        (&whole, false),
        (&conveyor, true),
        (&whole, true),
    ] {
        let mut input = on_floor([mu, 0.0, 0.0, 0.0, 0.0]);
        if finite {
            input.plane_point.clear();
            input.plane_normal.clear();
            input.plane_material.clear();
            add_wall(&mut input, plate);
        }
        input.wall_motion = vec![(0, motion.clone())];
        let mut s = simulation(&input, options(h));
        let rolls = 2.0 * u / (7.0 * mu * G);
        for n in (10..(rolls / h) as u32).step_by(10) {
            let t = f64::from(n) * h;
            go_on(&mut s, t);
            close(s.state.velocity[0].x, mu * G * t, 1e-13);
            close(s.state.position[0].x, 0.5 * mu * G * t * t, 1e-13);
            close(
                s.state.angular_velocity[0].y,
                -mu * G * t / (0.4 * R),
                1e-11,
            );
        }
        go_on(&mut s, 2.0 * rolls);
        close(s.state.velocity[0].x, 2.0 * u / 7.0, 1e-13);
        close(
            s.state.velocity[0].x - R * s.state.angular_velocity[0].y,
            u,
            1e-13,
        );
        close(s.state.position[0].z, R, 1e-15);
        assert_eq!(s.monitors.energy_rises, 0);
        // The belt's impulse is what the ball has, and its work force times way of the belt.
        let block = s.take_block();
        let given: f64 = block.walls.iter().step_by(6).sum();
        close(-given, MASS * 2.0 * u / 7.0, 1e-14);
        close(s.monitors.energy_work, -given * u, 1e-14);
    }
}

/// A ball that rolls on a turntable runs in a circle with 2/7 of the table's angular velocity, whatever its speed.
#[test]
fn a_ball_on_a_turntable_runs_in_circles() {
    let omega = 7.0;
    let x0 = DVec3::new(0.4, 0.0, R);
    let v0 = DVec3::new(0.1, 0.3, 0.0);
    let table = Shape::Disc(Disc {
        centre: DVec3::new(0.1, 0.05, 0.0),
        normal: DVec3::Z,
        radius: 3.0,
        hole: 0.0,
    });
    let centre = DVec3::new(0.1, 0.05, 0.0);
    let turns = rotation(DVec3::Z, centre, Scalar::Polynomial(vec![0.0, omega]));
    let surface = WallMotion {
        surface_rotation: Some((DVec3::Z, centre, omega)),
        ..WallMotion::default()
    };
    let error = |h: f64, motion: &WallMotion, plane: bool| {
        let floor = [([0.0; 3], [0.0, 0.0, 1.0])];
        let mut input = balls(&[x0.to_array()], if plane { &floor } else { &[] });
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![(0, 1, [1.0, 0.0, 0.0, 0.0, 0.0])];
        if !plane {
            add_wall(&mut input, table);
        }
        input.wall_motion = vec![(0, motion.clone())];
        input.velocity[0] = v0.to_array();
        // Rolling: v - r z x w = omega z x (x - c).
        let wall = omega * DVec3::Z.cross(x0 - centre);
        input.angular_velocity[0] = (DVec3::Z.cross(v0 - wall) / R).to_array();
        let until = 1.0;
        let s = run(&input, options(h), until);
        // v' = 2/7 omega z x v.
        let rate = 2.0 / 7.0 * omega;
        let (sin, cos) = (rate * until).sin_cos();
        let side = DVec3::Z.cross(v0);
        let expected = x0 + (sin * v0 + (1.0 - cos) * side) / rate;
        (s.state.position[0] - expected).length()
    };
    for (motion, plane) in [
        (&turns, true),
        (&turns, false),
        (&surface, false),
        (&surface, true),
    ] {
        let errors = [error(4e-3, motion, plane), error(2e-3, motion, plane)];
        let found = order(errors);
        assert!(errors[1] < 2e-3 && found > 0.95, "{found} {errors:?}");
    }
}

/// In a turning drum a ball with rolling resistance stays where the slope carries it: tan(angle) = rho/r; one whose resistance
/// keeps it from rolling slips at tan(angle) = mu.
#[test]
fn a_ball_stays_in_a_turning_drum() {
    let (radius, omega) = (0.4, 2.0);
    let drum = Cylinder {
        centre: DVec3::ZERO,
        axis: DVec3::Y,
        radius,
        half: 1.0,
        inside: true,
    };
    let turns = rotation(DVec3::Y, DVec3::ZERO, Scalar::Polynomial(vec![0.0, omega]));
    let surface = WallMotion {
        surface_rotation: Some((DVec3::Y, DVec3::ZERO, omega)),
        ..WallMotion::default()
    };
    for motion in [turns, surface] {
        for (mu, rho, tan, spin) in [
            (0.9, 0.25 * R, 0.25, omega * radius / R),
            (0.3, 2.0 * R, 0.3, omega),
        ] {
            // About +y the lowest part of the drum moves towards -x, and carries the ball up there.
            let angle: f64 = f64::atan(tan);
            let x = (radius - R) * DVec3::new(-angle.sin(), 0.0, -angle.cos());
            let error = |h: f64| {
                let mut input = balls(&[x.to_array()], &[]);
                input.gravity = [0.0, 0.0, -G];
                input.laws = vec![(0, 1, [mu, 0.0, 0.0, rho, 0.0])];
                add_wall(&mut input, Shape::Cylinder(drum));
                input.wall_motion = vec![(0, motion.clone())];
                input.angular_velocity[0] = [0.0, spin, 0.0];
                let mut s = run(&input, options(h), 0.5);
                close(s.state.angular_velocity[0].y, spin, 1e-4 * spin);
                // The drum carries the weight, and its drive the torque of it about the axis.
                let walls = s.take_block().walls;
                let last = &walls[walls.len() - 6..];
                close(last[2], -MASS * G * h, 1e-6 * MASS * G * h);
                let lever = (radius - R) * angle.sin();
                close(last[4], -MASS * G * h * lever, 1e-4 * MASS * G * h * lever);
                let turned: f64 = walls[4..].iter().step_by(6).sum();
                close(
                    s.monitors.energy_work,
                    -turned * omega,
                    1e-7 * turned.abs() * omega,
                );
                (s.state.position[0] - x).length()
            };
            let errors = [error(2e-3), error(1e-3)];
            assert!(errors[1] < 2e-5 * R, "{tan} {errors:?}");
            assert!(
                errors[1] < 1e-9 * R || order(errors) > 1.8,
                "{tan} {errors:?}"
            );
        }
    }
}

/// A ball that can neither slip nor roll rides on a plate that tilts.
#[test]
fn a_ball_rides_on_a_tilting_plate() {
    let plate = Shape::Rectangle(Rectangle {
        centre: DVec3::ZERO,
        normal: DVec3::Z,
        side: DVec3::X,
        half: [1.0, 1.0],
    });
    let x0 = DVec3::new(0.2, 0.1, R);
    let axis = DVec3::new(0.6, 0.8, 0.0);
    for plane in [false, true] {
        let error = |h: f64| {
            let floor = [([0.0; 3], [0.0, 0.0, 1.0])];
            let mut input = balls(&[x0.to_array()], if plane { &floor } else { &[] });
            input.gravity = [0.0, 0.0, -G];
            input.laws = vec![(0, 1, [2.0, 0.0, 0.0, 3.0 * R, 3.0 * R])];
            if !plane {
                add_wall(&mut input, plate);
            }
            let swing = rotation(
                axis,
                DVec3::new(0.0, 0.0, -0.1),
                law("0.2 * (1 - cos(5 * t))"),
            );
            input.wall_motion = vec![(0, swing)];
            let s = run(&input, options(h), 0.5);
            let angle = 0.2 * (1.0 - 2.5f64.cos());
            let about = DVec3::new(0.0, 0.0, -0.1);
            let turn = glam::DQuat::from_axis_angle(axis, angle);
            let expected = about + turn * (x0 - about);
            (s.state.position[0] - expected).length()
        };
        let errors = [error(4e-3), error(2e-3)];
        assert!(errors[1] < 1e-3 * R && order(errors) > 0.9, "{errors:?}");
    }
}
