//! Space that repeats itself: contacts by nearest images, the same motion wherever the border is.

mod common;

use carom_core::options::Method;
use carom_core::wall::{WallMotion, WallRotation};
use carom_core::{ModelError, ModelInput, Options, Simulation};
use carom_geom::{Cylinder, DVec3, Shape};
use common::{advance, balls, compile, simulation, MASS, R};

fn options() -> Options {
    Options {
        step: 1e-3,
        ..Options::default()
    }
}

fn total(s: &Simulation) -> DVec3 {
    s.state.velocity.iter().map(|v| MASS * *v).sum()
}

/// Repeatable numbers in [0, 1).
fn random(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// A gas of `side^3` balls in a box that repeats along all axes, 4 radii a ball wide.
fn gas(side: usize, law: [f64; 5]) -> ModelInput {
    let seed = &mut 17;
    let pitch = 4.0 * R;
    let at: Vec<[f64; 3]> = (0..side.pow(3))
        .map(|i| {
            [i % side, i / side % side, i / side / side]
                .map(|k| pitch * (k as f64 + 0.4 * random(seed)))
        })
        .collect();
    let mut input = ModelInput {
        laws: vec![(0, 0, law)],
        periodic: [pitch * side as f64; 3],
        periodic_origin: [0.3, -0.1, 0.0],
        ..balls(&at, &[])
    };
    for (v, w) in input.velocity.iter_mut().zip(&mut input.angular_velocity) {
        *v = std::array::from_fn(|_| 2.0 * random(seed) - 1.0);
        *w = std::array::from_fn(|_| 20.0 * (2.0 * random(seed) - 1.0));
    }
    input
}

#[test]
fn a_collision_across_the_border_is_a_collision() {
    for method in [Method::Nsga, Method::MoreauJean, Method::Penalty] {
        let run = |shift: [f64; 3], periodic: [f64; 3]| {
            let place = |x: [f64; 3], boxes: f64| {
                std::array::from_fn(|k| x[k] + shift[k] + boxes * periodic[k])
            };
            let at = [
                place([-1.5 * R, 0.0, 0.0], 0.0),
                place([1.5 * R, 0.5 * R, 0.0], 3.0),
            ];
            let mut input = ModelInput {
                laws: vec![(0, 0, [0.3, 0.8, 0.0, 0.0, 0.0])],
                periodic,
                ..balls(&at, &[])
            };
            input.velocity = vec![[2.0, 0.0, 0.0], [-1.0, 0.0, 0.25]];
            let options = Options {
                method,
                ..options()
            };
            let mut s = simulation(&input, options);
            assert!(advance(&mut s, 40).is_none());
            assert_eq!(s.monitors.halvings, 0);
            s
        };
        let free = run([0.0; 3], [0.0; 3]);
        assert!(
            (free.state.velocity[0].x - 2.0).abs() > 0.5,
            "they met: {method:?}"
        );
        // Across borders, far away from the box, and images that are three boxes apart.
        for (shift, length) in [
            ([0.0; 3], [8.0 * R; 3]),
            ([R, 8.0 * R, -R], [8.0 * R, 16.0 * R, 0.0]),
            ([40.0 * R, 0.0, 0.0], [8.0 * R, 0.0, 8.0 * R]),
        ] {
            let s = run(shift, length);
            let kept = total(&s) - MASS * DVec3::new(1.0, 0.0, 0.25);
            assert!(kept.length() < 1e-15, "{method:?} {kept}");
            for i in 0..2 {
                let (v, w) = (s.state.velocity[i], s.state.angular_velocity[i]);
                let off = (v - free.state.velocity[i]).length();
                // Contact forces are stiff: they multiply the rounding of coordinates by K/m over the contact time.
                let rounding = if method == Method::Penalty {
                    1e-10
                } else {
                    1e-12
                };
                assert!(off < rounding, "{method:?} {shift:?} {off:e}");
                assert!((w - free.state.angular_velocity[i]).length() < 1e-9);
                let boxes = if i == 0 { 0.0 } else { 3.0 };
                let x = s.state.position[i] - DVec3::from(shift) - boxes * DVec3::from(length);
                assert!((x - free.state.position[i]).length() < rounding);
            }
        }
    }
}

#[test]
fn a_gas_keeps_momentum_and_energy_and_does_not_know_where_the_border_is() {
    let elastic = gas(3, [0.0, 1.0, 0.0, 0.0, 0.0]);
    let mut s = simulation(&elastic, options());
    let (before, energy) = (total(&s), s.monitors.energy_initial);
    assert!(advance(&mut s, 500).is_none());
    assert!(s.recorder.block.impacts.len() > 20);
    assert!((total(&s) - before).length() < 1e-13);
    assert!((s.monitors.energy_final - energy).abs() < 1e-12 * energy);
    // Positions go on beyond the border.
    let length = elastic.periodic[0];
    assert!(s
        .state
        .position
        .iter()
        .any(|x| x.max_element() > length || x.min_element() < 0.0));
    // With friction, from other places along all axes: chaos lets rounding grow, over this time to 1e-9.
    let rough = gas(3, [0.3, 0.7, 0.0, 0.0, 0.0]);
    let mut moved = rough.clone();
    let shift = [0.37, -1.13, 5.0];
    for x in &mut moved.position {
        *x = std::array::from_fn(|k| x[k] + shift[k]);
    }
    let runs = [&rough, &moved].map(|input| {
        let mut s = simulation(input, options());
        assert!(advance(&mut s, 300).is_none());
        s
    });
    assert!(runs[0].recorder.block.impacts.len() > 20);
    for i in 0..27 {
        let [a, b] = [0, 1].map(|k| &runs[k].state);
        assert!((a.velocity[i] - b.velocity[i]).length() < 1e-9);
        assert!((a.position[i] + DVec3::from(shift) - b.position[i]).length() < 1e-9);
    }
}

#[test]
fn a_gas_that_falls_is_a_gas_at_rest() {
    // Weight along a periodic axis: everything falls alike, for ever, and the potential goes with the unwrapped height.
    let rough = gas(3, [0.2, 0.8, 0.0, 0.0, 0.0]);
    let mut falling = rough.clone();
    falling.gravity = [0.0, 0.0, -8.0];
    let runs = [&rough, &falling].map(|input| {
        let mut s = simulation(input, options());
        assert!(advance(&mut s, 200).is_none());
        s
    });
    let fall = DVec3::new(0.0, 0.0, -8.0 * 0.5 * 0.04);
    for i in 0..27 {
        let [a, b] = [0, 1].map(|k| &runs[k].state);
        assert!((a.position[i] + fall - b.position[i]).length() < 1e-9);
    }
    let [a, b] = [&runs[0].monitors, &runs[1].monitors];
    let loss = |m: &carom_core::Monitors| m.energy_initial - m.energy_final;
    assert!(loss(a) > 0.0 && (loss(a) - loss(b)).abs() < 1e-9);
}

#[test]
fn a_row_slides_down_a_periodic_slope() {
    // Two balls of a row that is endless along x, on a rough plane under slanted gravity, roll as one alone does.
    let slope = |periodic: f64| {
        let mut input = ModelInput {
            gravity: [3.0, 0.0, -9.0],
            laws: vec![
                (0, 0, [0.2, 0.5, 0.0, 0.0, 0.0]),
                (0, 1, [0.5, 0.0, 0.0, 0.0, 0.0]),
            ],
            periodic: [periodic, 0.0, 0.0],
            ..balls(
                &[[0.0, 0.0, R], [3.0 * R, 0.0, R]],
                &[([0.0; 3], [0.0, 0.0, 1.0])],
            )
        };
        input.velocity = vec![[1.0, 0.0, 0.0]; 2];
        input.angular_velocity = vec![[0.0, 1.0 / R, 0.0]; 2];
        let mut s = simulation(&input, options());
        assert!(advance(&mut s, 1000).is_none());
        s
    };
    let (boxed, free) = (slope(6.0 * R), slope(0.0));
    assert_eq!(common::bits(&boxed), common::bits(&free));
    // Rolling: 5/7 of the acceleration.
    let exact = 1.0 + 0.5 * 3.0 * 5.0 / 7.0;
    assert!((boxed.state.position[0].x - exact).abs() < 1e-6);
}

fn refusal(input: &ModelInput) -> String {
    match compile(input, options()) {
        Err(error @ ModelError::Entry { .. }) => error.to_string(),
        other => panic!("{:?}", other.map(|_| ())),
    }
}

#[test]
fn what_cannot_repeat_is_refused() {
    let mut input = balls(&[[0.0, 0.0, R]], &[([0.0; 3], [0.0, 0.0, 1.0])]);
    input.periodic = [3.9 * R, 0.0, 0.0];
    assert!(refusal(&input).contains("four of the largest radii"));
    input.periodic = [-1.0, 0.0, 0.0];
    assert!(refusal(&input).contains("periodic"));
    input.periodic = [1.0, 1.0, 0.0];
    assert!(compile(&input, options()).is_ok());
    input.periodic = [1.0, 1.0, 1.0];
    assert!(
        refusal(&input).contains("shape of wall 0"),
        "{}",
        refusal(&input)
    );
    // A drum that is endless along the axis, turning about it, and not about another.
    let drum = |axis: DVec3, half: f64| {
        Shape::Cylinder(Cylinder {
            centre: DVec3::ZERO,
            axis,
            radius: 1.0,
            half,
            inside: true,
        })
    };
    let mut input = balls(&[[0.0; 3]], &[]);
    input.periodic = [0.0, 1.0, 0.0];
    for (axis, half, fits) in [
        (DVec3::Y, f64::INFINITY, true),
        (DVec3::X, f64::INFINITY, false),
        (DVec3::Y, 2.0, false),
    ] {
        input.walls = vec![(drum(axis, half), 1)];
        assert_eq!(compile(&input, options()).is_ok(), fits);
    }
    input.walls = vec![(drum(DVec3::Y, f64::INFINITY), 1)];
    for (axis, fits) in [(DVec3::Y, true), (DVec3::Z, false)] {
        let rotation = WallRotation {
            axis,
            point: DVec3::ZERO,
            angle: carom_laws::Scalar::zero(),
        };
        input.wall_motion = vec![(
            0,
            WallMotion {
                rotation: Some(rotation),
                ..WallMotion::default()
            },
        )];
        assert_eq!(compile(&input, options()).is_ok(), fits);
    }
}
