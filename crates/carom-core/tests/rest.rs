//! What rests and can be held stays, what cannot be held does not, and nothing is glued.

mod common;

use carom_core::options::Impact;
use carom_core::wall::WallMotion;
use carom_core::{ModelInput, Options, Simulation};
use common::{advance, balls, bits, simulation, G, R};
use glam::DVec3;

const H: f64 = 1e-3;

/// Layers, triangular, and the least friction that can hold it: a linear program outside of Carom (`validation/pyramids`).
const PYRAMIDS: [(usize, bool, f64); 4] = [
    (2, false, 0.4142),
    (3, false, 0.524),
    (4, false, 0.5946),
    (3, true, 0.4460),
];

/// A pyramid of touching spheres on a floor, one friction everywhere.
fn pyramid(layers: usize, triangular: bool, friction: f64) -> ModelInput {
    let mut at = Vec::new();
    for layer in 0..layers {
        let side = layers - layer;
        for i in 0..side {
            for j in 0..if triangular { side - i } else { side } {
                let [i, j, k] = [i, j, layer].map(|n| n as f64);
                at.push(if triangular {
                    let across = 3f64.sqrt() * j + k / 3f64.sqrt();
                    let up = 1.0 + 2.0 * k * (2f64 / 3.0).sqrt();
                    [R * (2.0 * i + j + k), R * across, R * up]
                } else {
                    let up = 1.0 + k * 2f64.sqrt();
                    [R * (2.0 * i + k), R * (2.0 * j + k), R * up]
                });
            }
        }
    }
    let law = [friction, 0.3, 0.0, 0.0, 0.0];
    ModelInput {
        gravity: [0.0, 0.0, -G],
        laws: vec![(0, 0, law), (0, 1, law)],
        ..balls(&at, &[([0.0; 3], [0.0, 0.0, 1.0])])
    }
}

fn options() -> Options {
    Options {
        step: H,
        ..Options::default()
    }
}

/// Largest way of a ball over the radius, against what moves by `by`.
fn way(s: &Simulation, input: &ModelInput, by: DVec3) -> f64 {
    let ways = s.state.position.iter().zip(&input.position);
    ways.map(|(x, start)| (*x - by - DVec3::from(*start)).length() / R)
        .fold(0.0, f64::max)
}

fn run(input: &ModelInput, options: Options, steps: u64) -> (Simulation, f64) {
    let mut s = simulation(input, options);
    assert!(advance(&mut s, steps).is_none());
    let way = way(&s, input, DVec3::ZERO);
    (s, way)
}

#[test]
fn a_pyramid_stays_where_friction_can_hold_it_and_falls_where_not() {
    for (layers, triangular, least) in PYRAMIDS {
        for times in [1.01, 1.3, 2.0] {
            let input = pyramid(layers, triangular, times * least);
            let (s, way) = run(&input, options(), 200);
            // Positions follow what the solver leaves of the velocities.
            assert!(
                way < 200.0 * 1e-10,
                "{layers} {triangular} {times}: {way:e}"
            );
            assert_eq!(s.monitors.unconverged, 0);
        }
        let (_, way) = run(&pyramid(layers, triangular, 0.99 * least), options(), 300);
        assert!(way > 1e-3, "{layers} {triangular}: {way:e}");
    }
}

/// By the one-shot law, in shorter steps, by a coarse tolerance, with rolling friction (above 100 contacts and below).
#[test]
fn it_stays_whatever_the_options() {
    for (layers, triangular, least) in [(3, true, 0.4460), (4, false, 0.5946)] {
        let input = pyramid(layers, triangular, 1.2 * least);
        for change in [
            |o: &mut Options| o.impact = Impact::OneShot,
            |o: &mut Options| o.step = 0.1 * H,
            |o: &mut Options| o.pile_tolerance = 1e-4,
        ] {
            let mut o = options();
            change(&mut o);
            let (_, way) = run(&input, o, 60);
            assert!(way < 1e-8, "{layers}: {way:e}");
        }
        let mut rolling = pyramid(layers, triangular, 1.2 * least);
        for law in &mut rolling.laws {
            (law.2[3], law.2[4]) = (0.01 * R, 0.01 * R);
        }
        let (_, way) = run(&rolling, options(), 60);
        assert!(way < 1e-8, "{layers} rolling: {way:e}");
    }
}

#[test]
fn a_held_pyramid_is_the_same_on_two_threads_and_in_parts() {
    for (layers, triangular, least) in PYRAMIDS {
        let input = pyramid(layers, triangular, 1.2 * least);
        let (whole, _) = run(&input, options(), 40);
        let two = Options {
            threads: 2,
            contacts_per_thread: 10,
            ..options()
        };
        assert_eq!(bits(&whole), bits(&run(&input, two, 40).0), "{layers}");
        let (mut first, _) = run(&input, options(), 17);
        // What a checkpoint keeps is the state alone.
        let mut rest = simulation(&input, options());
        rest.state = first.state.clone();
        assert!(advance(&mut rest, 23).is_none() && advance(&mut first, 23).is_none());
        assert_eq!(bits(&whole), bits(&rest), "{layers}");
        assert_eq!(bits(&whole), bits(&first), "{layers}");
    }
}

/// What is nearly at rest comes to rest: solvers leave such speeds.
#[test]
fn a_trace_of_motion_does_not_bring_it_down() {
    for (layers, triangular, least) in [(3, true, 0.4460), (4, false, 0.5946)] {
        for tolerance in [1e-7, 1e-5, 1e-4] {
            for speed in [1e-8, 3e-7, 3e-6] {
                let mut input = pyramid(layers, triangular, 1.5 * least);
                for (k, v) in input.velocity.iter_mut().enumerate() {
                    let k = k as f64;
                    *v = [speed * k.sin(), speed * k.cos(), 0.0];
                }
                let o = Options {
                    pile_tolerance: tolerance,
                    ..options()
                };
                let (_, way) = run(&input, o, 200);
                println!("{layers} {tolerance:e} {speed:e}: {way:e}");
                // Of the norms of eq. 44, some times the weight, in each step.
                let left = 200.0 * tolerance * 4.0 * G * H * H / R;
                assert!(
                    way < 1e-5 + left,
                    "{layers} {tolerance:e} {speed:e}: {way:e}"
                );
            }
        }
    }
}

/// Rest is rest against the floor: on a belt that moves with it.
#[test]
fn a_belt_takes_it_along() {
    let speed = DVec3::new(0.5, 0.25, 0.0);
    for (layers, triangular, least) in [(3, true, 0.4460), (4, false, 0.5946)] {
        let mut input = pyramid(layers, triangular, 1.2 * least);
        input.velocity.fill(speed.to_array());
        input.wall_motion = vec![(
            0,
            WallMotion {
                surface_velocity: speed,
                ..WallMotion::default()
            },
        )];
        let mut s = simulation(&input, options());
        assert!(advance(&mut s, 100).is_none());
        let way = way(&s, &input, 100.0 * H * speed);
        assert!(way < 1e-8, "{layers}: {way:e}");
        // And it falls where the belt starts under it.
        input.velocity.fill([0.0; 3]);
        let (s, _) = run(&input, options(), 10);
        let fastest = s.state.velocity.iter().map(|v| v.length());
        assert!(fastest.fold(0.0, f64::max) > 1e-3, "{layers}");
    }
}

/// A pyramid that rests falls when it is hit or tilted, and a row of balls rolls from rest down a slope as one ball does.
#[test]
fn nothing_is_glued() {
    for (layers, triangular, least) in [(3, true, 0.4460), (4, false, 0.5946)] {
        let input = pyramid(layers, triangular, 1.2 * least);
        let mut s = simulation(&input, options());
        assert!(advance(&mut s, 20).is_none());
        s.state.velocity[0] = DVec3::new(-0.5, -0.5, 0.0);
        assert!(advance(&mut s, 200).is_none());
        assert!(way(&s, &input, DVec3::ZERO) > 0.5);
        let mut tilted = pyramid(layers, triangular, 1.2 * least);
        tilted.gravity = [4.0, 0.0, -9.0];
        let (_, way) = run(&tilted, options(), 300);
        assert!(way > 0.1, "{way:e}");
    }
    let (angle, steps) = (0.2f64, 100u32);
    let at: Vec<[f64; 3]> = (0..4).map(|k| [0.0, 2.0 * R * f64::from(k), R]).collect();
    let mut input = balls(&at, &[([0.0; 3], [0.0, 0.0, 1.0])]);
    input.gravity = [G * angle.sin(), 0.0, -G * angle.cos()];
    input.laws = vec![
        (0, 0, [0.9, 0.3, 0.0, 0.0, 0.0]),
        (0, 1, [0.9, 0.3, 0.0, 0.0, 0.0]),
    ];
    let (s, _) = run(&input, options(), u64::from(steps));
    let speed = f64::from(steps) * H * 5.0 / 7.0 * G * angle.sin();
    for v in &s.state.velocity {
        assert!((v.x - speed).abs() < 1e-6 * speed, "{} {speed}", v.x);
    }
}
