//! What must hold whatever the walls: Galilei, mirrors, momentum, energy.

use super::*;
use crate::common::{balls, bits, G, MASS};
use carom_core::options::Method;
use carom_core::wall::{Ball, Cone, Cylinder, Disc, Rectangle};

/// A tub with a lid, a funnel, a shelf and a knob in it, and a handful of balls.
fn tub() -> ModelInput {
    let mut start = Vec::new();
    for k in 0..9 {
        let angle = 0.7 * f64::from(k);
        let reach = 0.09 + 0.02 * f64::from(k % 3);
        start.push([
            reach * angle.cos(),
            reach * angle.sin(),
            0.3 + 0.07 * f64::from(k),
        ]);
    }
    let mut input = balls(&start, &[]);
    input.gravity = [0.0, 0.0, -G];
    input.laws = vec![
        (0, 0, [0.2, 0.6, 0.0, 0.0, 0.0]),
        (0, 1, [0.3, 0.5, 0.0, 1e-3, 1e-3]),
    ];
    for (k, v) in input.velocity.iter_mut().enumerate() {
        *v = [0.3 - 0.1 * k as f64, 0.05 * k as f64, -0.2];
    }
    let at = |z: f64| DVec3::new(0.0, 0.0, z);
    for shape in [
        Shape::Cylinder(Cylinder {
            centre: at(0.6),
            axis: DVec3::Z,
            radius: 0.25,
            half: 0.6,
            inside: true,
        }),
        Shape::Disc(Disc {
            centre: at(0.0),
            normal: DVec3::Z,
            radius: 0.25,
            hole: 0.0,
        }),
        Shape::Cone(Cone {
            point: at(0.12),
            axis: DVec3::Z,
            radius: 0.08,
            radius_end: 0.25,
            length: 0.1,
            inside: true,
        }),
        Shape::Rectangle(Rectangle {
            centre: DVec3::new(0.15, 0.03, 0.28),
            normal: DVec3::new(-0.28, 0.0, 0.96),
            side: DVec3::Y,
            half: [0.06, 0.05],
        }),
        Shape::Ball(Ball {
            centre: DVec3::new(-0.1, 0.05, 0.3),
            radius: 0.05,
            inside: false,
        }),
    ] {
        add_wall(&mut input, shape);
    }
    input
}

/// Everything moves with one constant velocity: what happens is the same.
#[test]
fn the_same_in_a_moving_tub() {
    let drift = DVec3::new(0.75, -0.5, 0.25);
    let until = 0.3;
    for method in [Method::Nsga, Method::MoreauJean, Method::Penalty] {
        let o = Options {
            method,
            penalty_young_modulus: 1e7,
            ..options(1e-3)
        };
        let still = run(&tub(), o.clone(), until);
        let mut input = tub();
        for v in &mut input.velocity {
            *v = (DVec3::from(*v) + drift).to_array();
        }
        let line = |v: f64| Scalar::Polynomial(vec![0.0, v]);
        let motion = translation(line(drift.x), line(drift.y), line(drift.z));
        input.wall_motion = (0..5).map(|w| (w, motion.clone())).collect();
        let moved = run(&input, o, until);
        let back = |i: usize| moved.state.position[i] - until * drift;
        let far = (0..9).map(|i| (back(i) - still.state.position[i]).length());
        let far = far.fold(0.0, f64::max);
        // Collisions multiply the rounding.
        assert!(still.monitors.contacts.sum > 100);
        assert!(far < 1e-11 * R, "{method:?} {far:e}");

        let lost = |s: &Simulation| {
            // Gravity works on what the tub lifts.
            s.monitors.energy_final - s.monitors.energy_initial - s.monitors.energy_work
        };
        let lifted = 9.0 * MASS * G * drift.z * until;
        let given: DVec3 = (0..9)
            .map(|i| MASS * (moved.state.velocity[i]))
            .sum::<DVec3>()
            - input
                .velocity
                .iter()
                .map(|v| MASS * DVec3::from(*v))
                .sum::<DVec3>();
        let carried = drift.dot(given) + lifted;
        close(moved.monitors.energy_work, carried, 1e-9);
        close(lost(&moved), lost(&still), 1e-9);
        if method == Method::Nsga {
            assert_eq!(
                (still.monitors.energy_rises, moved.monitors.energy_rises),
                (0, 0)
            );
        }
    }
}

/// Walls that turn and shake: nothing is lost of the momentum, and the balls do not gain more than the walls give.
#[test]
fn momentum_and_energy_balance_with_turning_walls() {
    let mut input = tub();
    let spin = rotation(DVec3::Z, DVec3::ZERO, Scalar::Polynomial(vec![0.0, 3.0]));
    let shake = translation(Scalar::zero(), Scalar::zero(), law("0.01 * sin(20 * t)"));
    let tilt = rotation(
        DVec3::Y,
        DVec3::new(0.15, 0.0, 0.28),
        law("0.2 * sin(9 * t)"),
    );
    let belt = WallMotion {
        surface_rotation: Some((DVec3::X, DVec3::new(-0.1, 0.05, 0.3), 5.0)),
        ..WallMotion::default()
    };
    input.wall_motion = vec![(0, spin), (1, shake), (3, tilt), (4, belt)];
    let momentum = |v: &[DVec3]| MASS * v.iter().sum::<DVec3>();
    let before = momentum(
        &input
            .velocity
            .iter()
            .map(|v| DVec3::from(*v))
            .collect::<Vec<_>>(),
    );
    let until = 1.0;
    let mut s = run(&input, options(1e-3), until);
    let walls = s.take_block().walls;
    let mut given = DVec3::ZERO;
    for six in walls.chunks(6) {
        given += DVec3::new(six[0], six[1], six[2]);
    }
    let weight = DVec3::new(0.0, 0.0, -9.0 * MASS * G * until);
    let after = momentum(&s.state.velocity);
    assert!(
        (before + weight - given - after).length() < 1e-12,
        "{given} {after}"
    );
    // Of walls that change their velocity the work is right to second order in each step.
    let m = &s.monitors;
    assert!(
        m.energy_max_rise < 1e-5 * m.energy_scale,
        "{:e}",
        m.energy_max_rise / m.energy_scale
    );
    assert!(m.penetration_relative < 1e-8 && m.unconverged + m.halvings == 0);
}

/// The mirror image of a scene runs as the mirror image of its run.
#[test]
fn mirrors() {
    let mirror = |v: DVec3| DVec3::new(-v.x, v.y, v.z);
    let axial = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
    let mut input = tub();
    input.position.truncate(1);
    for list in [&mut input.velocity, &mut input.angular_velocity] {
        list.truncate(1);
    }
    for list in [&mut input.radius, &mut input.mass, &mut input.inertia] {
        list.truncate(1);
    }
    input.orientation.truncate(1);
    input.material.truncate(1);
    let spin = rotation(DVec3::Z, DVec3::ZERO, Scalar::Polynomial(vec![0.0, 3.0]));
    let tilt = |axis: DVec3| rotation(axis, DVec3::new(0.0, 0.0, 0.1), law("0.2 * sin(9 * t)"));
    input.wall_motion = vec![(0, spin), (2, tilt(DVec3::new(0.6, 0.8, 0.0)))];
    let mut image = input.clone();
    let flip = |v: &mut Vec<[f64; 3]>| v.iter_mut().for_each(|v| v[0] = -v[0]);
    flip(&mut image.position);
    flip(&mut image.velocity);
    for (shape, _) in &mut image.walls {
        match shape {
            Shape::Rectangle(w) => {
                w.centre = mirror(w.centre);
                w.normal = mirror(w.normal);
            }
            Shape::Ball(w) => w.centre = mirror(w.centre),
            _ => {}
        }
    }
    for (_, motion) in &mut image.wall_motion {
        if let Some(r) = &mut motion.rotation {
            r.axis = axial(r.axis);
        }
    }
    let (a, b) = (
        run(&input, options(1e-3), 0.6),
        run(&image, options(1e-3), 0.6),
    );
    assert!(a.monitors.contacts.sum > 50);
    assert_eq!(mirror(a.state.position[0]), b.state.position[0]);
    assert_eq!(mirror(a.state.velocity[0]), b.state.velocity[0]);
    assert_eq!(
        axial(a.state.angular_velocity[0]),
        b.state.angular_velocity[0]
    );
}

/// In pieces, with a fresh neighbour list each, the same bits.
#[test]
fn a_run_goes_on_bit_for_bit() {
    let mut input = tub();
    let shake = translation(Scalar::zero(), Scalar::zero(), law("0.05 * sin(20 * t)"));
    let spin = rotation(DVec3::Z, DVec3::ZERO, Scalar::Polynomial(vec![0.0, 3.0]));
    input.wall_motion = vec![(0, spin.clone()), (1, shake), (2, spin)];
    let whole = run(&input, options(1e-3), 0.4);
    let mut last = run(&input, options(1e-3), 0.1);
    for until in [0.15, 0.3, 0.4] {
        let mut next = simulation(&input, options(1e-3));
        next.state = last.state.clone();
        go_on(&mut next, until);
        last = next;
    }
    assert_eq!(bits(&whole), bits(&last));
}
