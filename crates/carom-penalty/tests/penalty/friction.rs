//! Friction, rolling and rest.

use crate::common::{advance, balls, on_floor, G, MASS, R};
use crate::{close, energies, options, run};
use carom_core::options::PenaltyFriction;
use carom_core::{ModelInput, Options};
use carom_laws::Scalar;
use carom_penalty::elastic::Elastic;

#[test]
fn friction_is_coulombs_in_an_oblique_impact() {
    let mu = 0.1;
    for friction in [PenaltyFriction::Regularised, PenaltyFriction::Spring] {
        for (angle, slides) in [(0.05f64, false), (0.2, false), (0.6, true), (1.2, true)] {
            let mut input = ModelInput {
                laws: vec![(0, 1, [mu, 0.8, 0.0, 0.0, 0.0])],
                ..balls(&[[0.0, 0.0, 1.5 * R]], &[([0.0; 3], [0.0, 0.0, 1.0])])
            };
            let v = [2.0 * angle.sin(), 0.0, -2.0 * angle.cos()];
            input.velocity[0] = v;
            let o = Options {
                penalty_friction: friction,
                ..options(1e-3)
            };
            let mut s = run(&input, o, 0.03);
            let block = s.take_block();
            let p = block.impacts[0].impact.impulse;
            close(p.z, MASS * 1.8 * 2.0 * angle.cos(), 1e-3 * MASS);
            assert!(p.x.abs() <= mu * p.z * (1.0 + 1e-12));
            let after = s.state.velocity[0];
            let slip = after.x - R * s.state.angular_velocity[0].y;
            if slides {
                close(p.x, -mu * p.z, 2e-3 * mu * p.z);
            } else if friction == PenaltyFriction::Regularised {
                // The slip ends: 2/7 of it goes into the impulse.
                close(p.x, -MASS * v[0] * 2.0 / 7.0, 2e-3 * MASS);
                close(slip, 0.0, 2e-3);
            }
            let lost = 0.5 * MASS * 4.0 - s.monitors.energy_final;
            let work: f64 = block.contacts.iter().flat_map(|c| c.work).sum();
            close(-work, lost, 1e-12);
        }
    }
}

#[test]
fn friction_is_coulombs_to_second_order_where_the_force_ends_early() {
    // With e near 0 the force is next to none over most of the rebound, and neither pulls nor holds more than mu of itself.
    let mu = 0.2;
    for (friction, e) in [
        (PenaltyFriction::Regularised, 0.1),
        (PenaltyFriction::Regularised, 0.0),
        (PenaltyFriction::Spring, 0.1),
    ] {
        let made = |resolution: u32| {
            let mut input = ModelInput {
                laws: vec![(0, 1, [mu, e, 0.0, 0.0, 0.0])],
                ..balls(&[[0.0, 0.0, 1.51234 * R]], &[([0.0; 3], [0.0, 0.0, 1.0])])
            };
            input.velocity[0] = [2.0, 0.0, -1.0];
            let o = Options {
                penalty_friction: friction,
                penalty_resolution: resolution,
                ..options(1e-3)
            };
            let mut s = run(&input, o, 0.03);
            for c in s.take_block().contacts {
                let p = c.impulse;
                assert!(p.z >= 0.0);
                // To a rounding of the momentum in each half of a substep.
                assert!(p.x.abs() <= mu * p.z + 1e-13 * MASS, "{e}: {p}");
            }
            s.state.velocity[0].x
        };
        let fine = made(6400);
        let errors = [50, 100, 200, 400].map(|resolution| (made(resolution) - fine).abs());
        let order = (errors[0] / errors[3]).log2() / 3.0;
        assert!((1.8..2.3).contains(&order), "{friction:?} {e}: {errors:?}");
        assert!(errors[0] < 5e-5, "{friction:?} {e}: {errors:?}");
    }
}

#[test]
fn a_sliding_ball_comes_to_roll_at_five_sevenths() {
    let (mu, v0) = (0.25, 2.0);
    for friction in [PenaltyFriction::Regularised, PenaltyFriction::Spring] {
        for e in [0.0, 0.8] {
            let mut input = on_floor([mu, e, 0.0, 0.0, 0.0]);
            input.velocity[0] = [v0, 0.0, 0.0];
            let o = Options {
                penalty_friction: friction,
                ..options(1e-3)
            };
            let end = 2.0 * v0 / (7.0 * mu * G);
            let mut s = run(&input, o, (0.5 * end / 1e-3).round() * 1e-3);
            let t = s.time();
            close(s.state.velocity[0].x, v0 - mu * G * t, 1e-3 * v0);
            assert!(advance(&mut s, (end / 1e-3) as u64).is_none());
            close(s.state.velocity[0].x, 5.0 / 7.0 * v0, 1e-3 * v0);
            close(s.state.angular_velocity[0].y * R, 5.0 / 7.0 * v0, 1e-3 * v0);
            // The floor carries the weight, without chatter: in every step, not only on average.
            let block = s.take_block();
            assert!(block.impacts.is_empty(), "{}", block.impacts.len());
            let late = &block.contacts[block.contacts.len() - 200..];
            let sum: f64 = late.iter().map(|c| c.impulse.z).sum();
            close(sum, 200.0 * MASS * G * 1e-3, 2e-2 * MASS * G * 0.2);
            if e == 0.0 {
                assert!(late.iter().all(|c| c.impulse.z > 0.5 * MASS * G * 1e-3));
            }
            close(s.state.position[0].z, R, 1e-5);
        }
    }
}

#[test]
fn a_ball_at_rest_stays_and_its_substep_follows_its_own_oscillation() {
    let mut s = run(&on_floor([0.3, 0.0, 0.0, 1e-3, 1e-3]), options(1e-3), 1.0);
    assert!(s.state.velocity[0].length() < 1e-4);
    assert!(s.state.position[0].truncate().length() < 1e-12);
    let block = s.take_block();
    assert!(block.impacts.is_empty());
    // Half a period of the linear oscillation about the load, and Hertz's contact time of the same energy, are alike.
    let k = Elastic::new(&Options::default()).stiffness(1.0 / R);
    let depth = (MASS * G / k).powf(2.0 / 3.0);
    let half_period = std::f64::consts::PI / (1.5 * G / depth).sqrt();
    let last = block.steps.last().unwrap();
    close(last.penetration, depth, 0.02 * depth);
    let substep = 1e-3 / f64::from(last.substeps);
    assert!(
        (0.5..2.0).contains(&(50.0 * substep / half_period)),
        "{substep:e}"
    );
}

#[test]
fn rolling_and_spinning_resistance_brake() {
    let (rho, delta) = (1e-3, 5e-4);
    let mut input = on_floor([0.3, 0.0, 0.0, rho, delta]);
    input.velocity[0] = [1.0, 0.0, 0.0];
    input.angular_velocity[0] = [0.0, 1.0 / R, 30.0];
    let s = run(&input, options(1e-3), 0.5);
    // a = rho g/(r (1 + kappa)); w_z' = delta m g/I.
    close(s.state.velocity[0].x, 1.0 - 0.5 * rho * G / (1.4 * R), 2e-3);
    let spin = 30.0 - 0.5 * delta * G / (0.4 * R * R);
    close(s.state.angular_velocity[0].z, spin, 2e-3 * 30.0);
}

#[test]
fn friction_may_follow_the_slip() {
    // mu = 0.1 + 0.05 v: v' = -g mu(u) with u' = -3.5 g mu(u).
    let mut input = on_floor([0.0, 0.0, 0.0, 0.0, 0.0]);
    input.friction_law = vec![Some(Scalar::Polynomial(vec![0.1, 0.05]))];
    input.velocity[0] = [2.0, 0.0, 0.0];
    let t = 0.2;
    let s = run(&input, options(1e-3), t);
    let u = (2.0 + 2.0) * (-3.5 * G * 0.05 * t).exp() - 2.0;
    let v = &s.state.velocity[0];
    close(v.x - R * s.state.angular_velocity[0].y, u, 2e-3);
    close(v.x, 2.0 - (2.0 - u) / 3.5, 1e-3);
}

#[test]
fn a_spring_at_a_frictionless_contact_stores_nothing() {
    // A collision that crosses a plane at speed, watched from within.
    let mut input = ModelInput {
        laws: vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])],
        ..balls(&[[0.0, 0.0, 1.1 * R]], &[([0.0; 3], [0.0, 0.0, 1.0])])
    };
    input.velocity[0] = [10.0, 0.0, -1.0];
    let o = Options {
        penalty_friction: PenaltyFriction::Spring,
        ..options(2e-5)
    };
    let mut s = run(&input, o, 0.01);
    let start = 0.5 * MASS * 101.0;
    for e in energies(&mut s) {
        close(e, start, 1e-4 * start);
    }
    close(s.state.velocity[0].z, 1.0, 1e-3);
}
