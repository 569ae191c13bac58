//! Forces that hold one another: a ball in a corner of three rough walls may be pressed by each of them as hard as one likes. Whatever
//! a step starts from, they give no energy.

mod common;

use carom_core::{ModelInput, Options, Simulation};
use common::{advance, balls, simulation, G, MASS, R};
use glam::DVec3;

const H: f64 = 1e-3;
/// Above 1/sqrt(2) friction holds a ball in the corner against any force of the walls.
const FRICTION: f64 = 0.9;

/// A ball in a corner, pulled off its wall 1 and onto the others, and one that hits it within the step.
fn corner() -> ModelInput {
    let law = [FRICTION, 0.3, 0.0, 0.0, 0.0];
    let away = 2.0 * R / 3f64.sqrt();
    let planes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|n| ([0.0; 3], n));
    let mut input = ModelInput {
        gravity: [-G, 0.1 * G, -0.8 * G],
        laws: vec![(0, 0, law), (0, 1, law)],
        ..balls(&[[R; 3], [R + away + 1e-4; 3]], &planes)
    };
    input.velocity[1] = [-0.5; 3];
    input
}

/// The same started from walls that press with `times` the weight each.
fn pressed(mut s: Simulation, times: f64) -> Simulation {
    let sum = DVec3::ONE;
    assert_eq!(s.state.warm.len(), 3);
    for w in &mut s.state.warm {
        let n = DVec3::AXES[w.key.1 as usize - 2];
        w.impulse = times * MASS * G * H * (1.5 * n - 0.5 * sum);
    }
    s
}

fn options(piles: bool) -> Options {
    Options {
        step: H,
        pile_contacts: if piles { 0 } else { 500 },
        pile_tolerance: if piles { 1e-4 } else { 1e-8 },
        ..Options::default()
    }
}

fn kinetic(s: &Simulation) -> f64 {
    let of = |(v, w): (&DVec3, &DVec3)| {
        0.5 * MASS * (v.length_squared() + 0.4 * R * R * w.length_squared())
    };
    let state = &s.state;
    state
        .velocity
        .iter()
        .zip(&state.angular_velocity)
        .map(of)
        .sum()
}

#[test]
fn a_hit_ball_is_not_thrown_out_of_its_corner() {
    let input = corner();
    for piles in [false, true] {
        let mut before = simulation(&input, options(piles));
        // One step at rest, before the other one comes.
        before.state.velocity[1] = DVec3::ZERO;
        assert!(advance(&mut before, 1).is_none());
        before.state.velocity[1] = DVec3::splat(-0.5);
        let energy = kinetic(&before);
        let mut fallbacks = Vec::new();
        for times in [1.0, 1e3, 1e5] {
            let mut s = simulation(&input, options(piles));
            s.state = before.state.clone();
            let mut s = pressed(s, times);
            assert!(advance(&mut s, 1).is_none());
            let after = kinetic(&s);
            assert!(after < energy, "{piles} {times:e}: {energy:e} to {after:e}");
            assert_eq!(s.monitors.unconverged, 0);
            fallbacks.push(s.monitors.fallbacks);
        }
        println!("{piles} {fallbacks:?}");
    }
}
