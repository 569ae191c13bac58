//! The step at the level of the core: exact discrete values, the same bits twice, failures that leave no trace.

mod common;

use carom_core::options::{Impact, OnNonconvergence, Solver};
use carom_core::outcome::{Failure, Level};
use carom_core::Options;
use common::{advance, balls, bits, on_floor, rack, simulation, G, MASS, R};
use glam::DVec3;

const H: f64 = 1e-3;

fn options(step: f64) -> Options {
    Options {
        step,
        ..Options::default()
    }
}

fn close(a: f64, b: f64, bound: f64) {
    assert!(
        (a - b).abs() <= bound,
        "{a:e} and {b:e} differ by {:e}",
        a - b
    );
}

#[test]
fn a_ball_at_rest_has_the_exact_impulses() {
    for solver in [Solver::Auto, Solver::Newton] {
        let o = Options {
            solver,
            ..options(H)
        };
        let mut s = simulation(&on_floor([0.3, 0.7, 0.0, 1e-3, 1e-3]), o);
        assert!(advance(&mut s, 200).is_none());
        let block = s.take_block();
        assert_eq!(block.contacts.len(), 200);
        assert!(block.impacts.is_empty());
        for c in &block.contacts {
            assert_eq!(c.key, (0, 1));
            close(c.impulse.z, MASS * G * H, 1e-15 * MASS * G * H);
            // The gap is known to the rounding of r.
            close(c.position_impulse.z, MASS * G * H * H / 2.0, MASS * 4e-18);
            close(c.impulse.truncate().length() + c.moment.length(), 0.0, 0.0);
            // Per step gravity gains m (g h)^2 / 2, which the floor takes.
            close(c.work[0], -0.5 * MASS * (G * H).powi(2), 1e-20);
        }
        for r in &block.steps {
            assert_eq!((r.contacts, r.islands, r.impact_problems), (1, 1, 1));
            assert_eq!(r.fallbacks + r.unconverged + r.halvings + r.truncated, 0);
        }
        assert!(s.state.velocity[0].length() <= 1e-17);
        close(s.state.position[0].z, R, 1e-17);
    }
}

#[test]
fn a_sliding_ball_follows_the_discrete_parabola() {
    let (mu, v0) = (0.25, 2.0);
    let mut input = on_floor([mu, 0.0, 0.0, 0.0, 0.0]);
    input.velocity[0] = [v0, 0.0, 0.0];
    let mut s = simulation(&input, options(H));
    for n in 1..=200u32 {
        assert!(advance(&mut s, 1).is_none());
        let t = f64::from(n) * H;
        let bound = f64::from(n) * 5e-16;
        close(s.state.velocity[0].x, v0 - mu * G * t, bound);
        close(s.state.position[0].x, v0 * t - mu * G * t * t / 2.0, bound);
        close(
            s.state.angular_velocity[0].y,
            mu * G * t / (0.4 * R),
            100.0 * bound,
        );
    }
    // Until 2 v0/(7 mu g); then it rolls with 5/7 of its speed.
    let end = 2.0 * v0 / (7.0 * mu * G);
    assert!(advance(&mut s, (end / H) as u64).is_none());
    close(s.state.velocity[0].x, 5.0 / 7.0 * v0, 1e-13);
    close(
        s.state.velocity[0].x,
        R * s.state.angular_velocity[0].y,
        1e-14,
    );
}

#[test]
fn flight_is_exact_for_any_damping_and_step() {
    let v = DVec3::new(1.0, -2.0, 3.0);
    for spectral_radius in [0.0, 0.5, 0.8, 0.99] {
        for h in [1e-2, 1e-3] {
            let mut input = balls(&[[0.0, 0.0, 10.0]], &[]);
            input.gravity = [0.5, 0.0, -G];
            input.velocity[0] = v.to_array();
            input.angular_velocity[0] = [0.0, 4.0, 0.0];
            let mut s = simulation(
                &input,
                Options {
                    spectral_radius,
                    ..options(h)
                },
            );
            assert!(advance(&mut s, 100).is_none());
            let (t, g) = (100.0 * h, DVec3::from(input.gravity));
            close((s.state.velocity[0] - v - t * g).length(), 0.0, 2e-13);
            let x = DVec3::new(0.0, 0.0, 10.0) + t * v + 0.5 * t * t * g;
            close((s.state.position[0] - x).length(), 0.0, 2e-13);
            // Rotation by w t about y.
            close(s.state.orientation[0].y.abs(), (2.0 * t).sin().abs(), 1e-13);
            close(s.time(), t, 1e-15);
        }
    }
}

#[test]
fn three_touching_balls_by_each_law() {
    for (impact, expected, problems) in [
        (Impact::Sequence, [0.0, 0.0, 2.0], 2),
        (Impact::SequencePaper, [0.0, 0.0, 2.0], 2),
        (Impact::OneShot, [-2.0 / 3.0, 4.0 / 3.0, 4.0 / 3.0], 1),
        (Impact::Poisson, [-2.0 / 3.0, 4.0 / 3.0, 4.0 / 3.0], 2),
    ] {
        let mut input = balls(&[[0.0; 3], [2.0 * R, 0.0, 0.0], [4.0 * R, 0.0, 0.0]], &[]);
        input.laws = vec![(0, 0, [0.0, 1.0, 0.0, 0.0, 0.0])];
        input.velocity[0] = [2.0, 0.0, 0.0];
        let mut s = simulation(
            &input,
            Options {
                impact,
                ..options(1e-4)
            },
        );
        assert!(advance(&mut s, 20).is_none());
        for (v, x) in s.state.velocity.iter().zip(expected) {
            close(v.x, x, 1e-15);
            assert_eq!((v.y, v.z), (0.0, 0.0));
        }
        let block = s.take_block();
        assert_eq!(block.steps[0].impact_problems, problems);
        assert_eq!(s.monitors.energy_rises, 0);
        close(s.monitors.energy_final, s.monitors.energy_initial, 1e-15);
    }
}

#[test]
fn the_same_bits_twice_and_whatever_is_recorded() {
    let run = |frame_every, contacts| {
        let mut s = simulation(&rack(), options(H));
        let recording = carom_core::Recording {
            frame_every,
            contacts,
        };
        let limit = std::time::Duration::from_secs(600);
        assert!(s.advance(400, recording, limit).is_none());
        bits(&s)
    };
    let first = run(1, true);
    for (frame_every, contacts) in [(1, true), (0, false), (7, true), (1, false)] {
        assert_eq!(run(frame_every, contacts), first);
    }
    // In pieces too.
    let mut s = simulation(&rack(), options(H));
    for steps in [1, 2, 97, 300] {
        assert!(advance(&mut s, steps).is_none());
        s.take_block();
    }
    assert_eq!(bits(&s), first);
}

/// A tolerance below rounding: every problem that is left to Newton fails, at every halving.
fn hopeless() -> Options {
    Options {
        tolerance: 1e-300,
        pile_tolerance: 1e-300,
        tolerance_floor: 1e-300,
        gauss_seidel_sweeps: 0,
        ..options(H)
    }
}

#[test]
fn a_step_that_fails_leaves_the_state_as_it_was() {
    let mut s = simulation(&rack(), hopeless());
    let mut last = bits(&s);
    let outcome = loop {
        let before = bits(&s);
        match advance(&mut s, 1) {
            None => last = bits(&s),
            Some(outcome) => {
                assert_eq!(bits(&s), before);
                break outcome;
            }
        }
        assert!(s.state.step < 100, "the hopeless never failed");
    };
    assert_eq!(bits(&s), last);
    let (step, time, level) = (
        outcome.step,
        outcome.time,
        outcome.level().expect("a level"),
    );
    let contacts = outcome.unsolved.expect("not converged").contacts;
    assert_eq!(step, s.state.step + 1);
    close(time, step as f64 * H, 0.0);
    assert!(contacts > 0 && [Level::Position, Level::Velocity].contains(&level));
    let failed = s.failed.as_ref().expect("the problem is kept");
    assert_eq!(failed.bodies.len() as u32, contacts);
    // Frames and steps are those of the steps that were made.
    let block = s.take_block();
    assert_eq!(block.steps.len() as u64, s.state.step);
    assert_eq!(block.frame_step.last().copied().unwrap_or(0), s.state.step);
    // It fails again the same way: nothing of the attempt is left in the scratch memory either.
    let again = advance(&mut s, 1).expect("it fails again");
    assert_eq!(again.kind(), "not_converged");
    assert_eq!(bits(&s), last);
    assert!(s.take_block().steps.is_empty());
}

#[test]
fn a_step_that_is_accepted_unconverged_is_counted() {
    let warn = Options {
        on_nonconvergence: OnNonconvergence::Warn,
        max_halvings: 1,
        ..hopeless()
    };
    let mut s = simulation(&rack(), warn);
    assert!(advance(&mut s, 30).is_none());
    assert_eq!(s.state.step, 30);
    assert!(s.monitors.unconverged > 0 && s.monitors.halvings > 0);
    // What is accepted is as good as what the default tolerance gives.
    let mut normal = simulation(
        &rack(),
        Options {
            max_halvings: 1,
            ..options(H)
        },
    );
    assert!(advance(&mut normal, 30).is_none());
    assert_eq!(normal.monitors.unconverged + normal.monitors.halvings, 0);
    assert!(s.monitors.penetration_relative < 1e-9);
}

#[test]
fn speeds_that_overflow_end_the_run_with_a_name() {
    let mut input = on_floor([0.2, 0.5, 0.0, 0.0, 0.0]);
    input.position[0][2] = 1.0;
    input.velocity[0] = [1e200, 0.0, 0.0];
    let mut s = simulation(&input, options(H));
    let before = bits(&s);
    let outcome = advance(&mut s, 5).expect("it overflows");
    assert_eq!((outcome.step, &outcome.bodies[..]), (1, &[0, 0][..]));
    assert_eq!(outcome.level(), Some(Level::Smooth));
    assert_eq!(bits(&s), before);
}

#[test]
fn a_pair_without_a_law_may_come_near_but_not_touch() {
    let mut input = balls(&[[0.0; 3], [2.1 * R, 0.0, 0.0]], &[]);
    input.velocity[0] = [1.0, 0.0, 0.0];
    let mut s = simulation(&input, options(H));
    let outcome = advance(&mut s, 100);
    // The gap of 0.1 r closes at 1 m/s in 3.125 ms.
    let outcome = outcome.expect("there is no law");
    assert_eq!(
        (outcome.step, outcome.failure),
        (4, Failure::MissingLaw(0, 1))
    );
    assert_eq!(s.state.step, 3);
}

#[test]
fn a_problem_solved_without_restitution_is_no_failure() {
    // Walls as rough as these can hold the ball in their corner, and no velocity is as Newton's law asks in all three.
    let axes = DVec3::AXES.map(|n| ([0.0; 3], n.to_array()));
    let mut input = carom_core::ModelInput {
        laws: vec![(0, 1, [1.0, 0.8, 0.0, 0.0, 0.0])],
        ..balls(&[[R + 5e-4; 3]], &axes)
    };
    input.velocity[0] = [-1.0; 3];
    let o = Options {
        max_halvings: 0,
        ..options(1e-3)
    };
    let mut s = simulation(&input, o);
    let mut given_up = 0;
    for _ in 0..20 {
        assert!(advance(&mut s, 1).is_none());
        let block = s.take_block();
        assert_eq!(block.steps[0].unconverged, 0);
        // What was given up leaves no residual behind.
        assert!(block.steps[0].residual_velocity < 1e-9);
        given_up += u32::from(block.steps[0].restitution_scale == 0.0);
        assert!(s.keeper().failed.is_none());
    }
    assert!(given_up > 0);
}
