//! Periodic boxes that change their size or shear: contacts across a border that moves, the mean flow, energy.

mod common;

use carom_core::clump::body::ClumpInput;
use carom_core::deformation::law::Deformation;
use carom_core::joint::Joint;
use carom_core::options::Method;
use carom_core::report::StepReport;
use carom_core::{ModelInput, Options, Simulation};
use carom_geom::DVec3;
use carom_laws::Scalar;
use common::{advance, balls, compile, simulation, MASS, R};

/// A law `c + a t + b t^2`.
fn law(c: f64, a: f64, b: f64) -> Option<Scalar> {
    Some(Scalar::Polynomial(vec![c, a, b]))
}

fn shear(rate: f64, flow: usize, gradient: usize) -> Option<Deformation> {
    Some(Deformation {
        stretch: [None, None, None],
        shear: law(0.0, rate, 0.0),
        flow,
        gradient,
    })
}

fn options(step: f64) -> Options {
    Options {
        step,
        ..Options::default()
    }
}

/// Repeatable numbers in [-1, 1).
fn random(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn vector(seed: &mut u64) -> [f64; 3] {
    std::array::from_fn(|_| random(seed))
}

/// `side^3` balls in a box about the origin, `pitch` radii a ball wide, with velocities of up to `speed` against the flow.
fn gas(side: usize, pitch: f64, speed: f64, friction: f64, restitution: f64) -> ModelInput {
    let seed = &mut 23;
    let length = pitch * R * side as f64;
    let at: Vec<[f64; 3]> = (0..side.pow(3))
        .map(|i| {
            let cell = [i % side, i / side % side, i / side / side];
            cell.map(|k| pitch * R * (k as f64 + 0.5) - 0.5 * length)
        })
        .collect();
    let mut input = ModelInput {
        laws: vec![(0, 0, [friction, restitution, 0.0, 0.0, 0.0])],
        periodic: [length; 3],
        periodic_origin: [-0.5 * length; 3],
        ..balls(&at, &[])
    };
    for (v, w) in input.velocity.iter_mut().zip(&mut input.angular_velocity) {
        *v = vector(seed).map(|v| speed * v);
        *w = vector(seed).map(|w| speed / R * w);
    }
    input
}

/// Velocities against the mean flow, and places as shares of the box.
fn against_flow(s: &Simulation) -> Vec<[DVec3; 2]> {
    let (model, t, h) = (&s.model, s.time(), s.model.options.step);
    let law = model.deformation.as_ref().expect("it deforms");
    let now = law.periodic(&model.periodic, t, h);
    let of =
        |(x, v): (&DVec3, &DVec3)| [*v - law.flow_at(&model.periodic, *x, t, h), now.share(*x)];
    s.state
        .position
        .iter()
        .zip(&s.state.velocity)
        .map(of)
        .collect()
}

#[test]
fn a_free_ball_flies_straight_with_the_flow_on_top() {
    let mut input = gas(2, 8.0, 0.0, 0.0, 1.0);
    input.deformation = shear(3.0, 0, 2);
    let mut s = simulation(&input, options(1e-3));
    assert!(advance(&mut s, 500).is_none());
    for (i, x) in input.position.iter().enumerate() {
        let flow = DVec3::new(3.0 * x[2], 0.0, 0.0);
        assert!((s.state.velocity[i] - flow).length() < 1e-14);
        assert!((s.state.position[i] - DVec3::from(*x) - 0.5 * flow).length() < 1e-13);
    }
    // All go with the box: nobody meets anybody, for ever.
    assert!(s.recorder.block.impacts.is_empty());
    assert_eq!(s.monitors.energy_rises, 0);
}

#[test]
fn a_contact_across_a_border_that_shears_is_one_with_a_ball_that_is_as_fast_as_the_image() {
    let length = 8.0 * R;
    for method in [Method::Nsga, Method::MoreauJean] {
        for (flow, gradient, rate) in [(0, 2, 2.0), (1, 0, -5.0), (2, 1, 0.5)] {
            let (mut up, mut along) = (DVec3::ZERO, DVec3::ZERO);
            up[gradient] = 1.0;
            along[flow] = 1.0;
            let aside = DVec3::ONE - up - along;
            let mut input = balls(
                &[
                    (2.2 * R * up).to_array(),
                    (-2.6 * R * up + 0.3 * R * (along + aside)).to_array(),
                ],
                &[],
            );
            input.laws = vec![(0, 0, [0.3, 0.7, 0.0, 0.0, 0.0])];
            input.periodic = [length; 3];
            input.periodic_origin = [-0.5 * length; 3];
            input.deformation = shear(rate, flow, gradient);
            input.velocity = vec![(2.0 * up).to_array(), (-1.0 * up - 0.5 * aside).to_array()];
            input.angular_velocity = vec![[3.0, -8.0, 5.0], [-2.0, 9.0, 4.0]];
            let given = Options {
                method,
                ..options(2e-4)
            };
            let mut sheared = simulation(&input, given.clone());
            let mut free = input.clone();
            (free.deformation, free.periodic) = (None, [0.0; 3]);
            // The second ball at the place of its image, and as fast.
            let flow_at = |x: DVec3| rate * x[gradient] * along;
            let [xa, xb] = [0, 1].map(|i| DVec3::from(input.position[i]));
            let image = xb + length * up;
            let [va, vb] = [0, 1].map(|i| DVec3::from(input.velocity[i]));
            free.position[1] = image.to_array();
            free.velocity = vec![
                (va + flow_at(xa)).to_array(),
                (vb + flow_at(image)).to_array(),
            ];
            let mut free = simulation(&free, given);
            for s in [&mut sheared, &mut free] {
                assert!(advance(s, 400).is_none());
                assert_eq!(s.recorder.block.impacts.len(), 1);
            }
            let t = sheared.time();
            let offset = rate * length * along;
            let [a, b] = [&sheared.state, &free.state];
            for i in 0..2 {
                let (by, at) = match i {
                    0 => (DVec3::ZERO, DVec3::ZERO),
                    _ => (offset, length * up + t * offset),
                };
                let place = format!("{method:?} {flow} {gradient} ball {i}");
                assert!(
                    (a.velocity[i] + by - b.velocity[i]).length() < 1e-12,
                    "{place}"
                );
                let spin = a.angular_velocity[i] - b.angular_velocity[i];
                assert!(spin.length() < 1e-10, "{place}");
                assert!(
                    (a.position[i] + at - b.position[i]).length() < 1e-12,
                    "{place}"
                );
            }
        }
    }
}

#[test]
fn cohesion_and_clumps_reach_across_a_border_that_shears() {
    let length = 8.0 * R;
    let rate = 1.5;
    let at = [
        [0.1 * R, 0.0, 2.2 * R],
        [0.0, 0.2 * R, -3.4 * R],
        [0.0, 2.2 * R, -3.4 * R],
    ];
    for clumped in [false, true] {
        let count = if clumped { 3 } else { 2 };
        let mut input = balls(&at[..count], &[]);
        input.laws = vec![(0, 0, [0.3, 0.2, 0.0, 0.0, 0.0])];
        if clumped {
            input.clumps = vec![ClumpInput {
                balls: 1..3,
                mass: 2.0 * MASS,
                inertia: [2.8 * MASS * R * R, 0.8 * MASS * R * R, 2.8 * MASS * R * R],
                position: [0.0, 1.2 * R, -3.4 * R],
                orientation: [1.0, 0.0, 0.0, 0.0],
                velocity: [0.0; 3],
                angular_velocity: [0.0; 3],
            }];
        } else {
            (input.cohesion, input.rupture_distance) = (vec![0.2], vec![0.6 * R]);
        }
        input.periodic = [length; 3];
        input.periodic_origin = [-0.5 * length; 3];
        input.deformation = shear(rate, 0, 2);
        input.velocity[0] = [0.0, 0.0, 0.3];
        let mut free = input.clone();
        (free.deformation, free.periodic) = (None, [0.0; 3]);
        for x in &mut free.position[1..] {
            x[2] += length;
        }
        for clump in &mut free.clumps {
            clump.position[2] += length;
            clump.velocity[0] = rate * clump.position[2];
        }
        for (v, x) in free.velocity.iter_mut().zip(&free.position) {
            v[0] += rate * x[2];
        }
        let mut runs = [&input, &free].map(|input| simulation(input, options(2e-4)));
        for s in &mut runs {
            assert!(advance(s, 400).is_none());
            assert!(!s.recorder.block.impacts.is_empty());
            let loss = |r: &StepReport| r.energy_kinetic + r.energy_potential;
            let steps = &s.recorder.block.steps;
            let [first, last] = [steps.first(), steps.last()].map(|r| loss(r.expect("steps")));
            let work: f64 = steps[1..].iter().map(|r| r.energy_work).sum();
            assert!(
                last - first - work < 1e-4 * first,
                "{}",
                last - first - work
            );
        }
        let offset = DVec3::new(rate * length, 0.0, 0.0);
        let [a, b] = [&runs[0].state, &runs[1].state];
        for i in 0..count {
            let by = if i == 0 { DVec3::ZERO } else { offset };
            let off = a.velocity[i] + by - b.velocity[i];
            assert!(off.length() < 1e-11, "{clumped} {i} {off}");
            assert!((a.angular_velocity[i] - b.angular_velocity[i]).length() < 1e-9);
        }
    }
}

#[test]
fn energy_of_a_sheared_and_squeezed_gas_is_what_the_box_did() {
    for (stretch, rate) in [([0.0; 3], 4.0), ([-0.4; 3], 0.0), ([0.5, 0.0, -0.3], -3.0)] {
        let mut input = gas(4, 3.0, 1.0, 0.0, 1.0);
        input.deformation = Some(Deformation {
            stretch: stretch.map(|rate| law(1.0, rate, 0.0)),
            ..shear(rate, 0, 1).expect("a shear")
        });
        let mut s = simulation(&input, options(2e-4));
        let before: DVec3 = s.state.velocity.iter().map(|v| MASS * *v).sum();
        assert!(advance(&mut s, 2500).is_none());
        let after: DVec3 = s.state.velocity.iter().map(|v| MASS * *v).sum();
        assert!((after - before).length() < 1e-12);
        assert!(s.recorder.block.impacts.len() > 300);
        let m = &s.monitors;
        let work: f64 = s.recorder.block.steps.iter().map(|r| r.energy_work).sum();
        let change = m.energy_final - m.energy_initial;
        assert!(work.abs() > 0.05 * m.energy_initial);
        assert!(
            (change - work).abs() < 1e-10 * m.energy_initial,
            "{change:e} {work:e}"
        );
    }
}

#[test]
fn nothing_depends_on_where_the_border_is() {
    // Chaos lets rounding grow: so long, and no longer.
    let mut input = gas(3, 3.0, 1.0, 0.4, 0.6);
    input.deformation = shear(6.0, 2, 1);
    let mut moved = input.clone();
    let (length, shift) = (input.periodic[0], 0.31 * R);
    for (i, x) in moved.position.iter_mut().enumerate() {
        // Images of other boxes, and all of it against the border.
        for k in 0..3 {
            x[k] += shift * (k as f64 - 0.4) + length * ((i * (k + 1)) % 3) as f64;
        }
    }
    let runs = [&input, &moved].map(|input| {
        let mut s = simulation(input, options(1e-3));
        assert!(advance(&mut s, 120).is_none());
        s
    });
    assert!(runs[0].recorder.block.impacts.len() > 20);
    assert_eq!(
        runs[0].recorder.block.impacts.len(),
        runs[1].recorder.block.impacts.len()
    );
    let [a, b] = [0, 1].map(|k| against_flow(&runs[k]));
    for (a, b) in a.iter().zip(&b) {
        assert!((a[0] - b[0]).length() < 1e-9, "{} {}", a[0], b[0]);
    }
}

#[test]
fn an_oscillating_shear_carries_everything_along() {
    // Of any smooth law; and of one with kinks, on steps and between them.
    let smooth = Scalar::Polynomial(vec![0.0, 0.0, 10.0, -20.0]);
    let kinks = Scalar::Table(vec![[0.0, 0.0], [0.1, 0.5], [0.2005, -0.25], [0.3, -0.25]]);
    for (law, within) in [(smooth, 1e-11), (kinks, 1e-11)] {
        let mut input = gas(2, 8.0, 0.0, 0.0, 1.0);
        let end = law.value(0.25);
        input.deformation = Some(Deformation {
            shear: Some(law),
            ..shear(0.0, 0, 2).expect("a shear")
        });
        let mut s = simulation(&input, options(1e-3));
        assert!(advance(&mut s, 250).is_none());
        for (i, x) in input.position.iter().enumerate() {
            let x = DVec3::from(*x) + DVec3::new(end * x[2], 0.0, 0.0);
            assert!(
                (s.state.position[i] - x).length() < within * R,
                "{}",
                s.state.position[i] - x
            );
        }
        for [v, _] in against_flow(&s) {
            assert!(v.length() < within, "{v}");
        }
        let m = &s.monitors;
        let work: f64 = s.recorder.block.steps.iter().map(|r| r.energy_work).sum();
        assert!((m.energy_final - m.energy_initial - work).abs() < 1e-9 * work.abs().max(1e-3));
    }
}

#[test]
fn sweeps_and_rows_agree_on_a_dense_flow() {
    let mut input = gas(4, 2.02, 0.05, 0.5, 0.0);
    input.deformation = Some(Deformation {
        stretch: [-0.25; 3].map(|rate| law(1.0, rate, 0.0)),
        ..shear(1.0, 0, 1).expect("a shear")
    });
    let run = |pile_contacts: u32| {
        let given = Options {
            pile_contacts,
            pile_tolerance: 1e-11,
            ..options(2e-4)
        };
        let mut s = simulation(&input, given);
        assert!(advance(&mut s, 150).is_none());
        assert_eq!(s.monitors.unconverged + s.monitors.halvings, 0);
        s
    };
    let [swept, rows] = [2, 100_000].map(run);
    assert!(swept
        .recorder
        .block
        .steps
        .iter()
        .any(|r| r.sweeps_velocity > 0));
    assert!(rows
        .recorder
        .block
        .steps
        .iter()
        .all(|r| r.sweeps_velocity == 0));
    assert!(rows.recorder.block.impacts.len() > 50);
    for (a, b) in against_flow(&swept).iter().zip(against_flow(&rows)) {
        assert!((a[0] - b[0]).length() < 1e-6, "{} {}", a[0], b[0]);
    }
}

#[test]
fn a_floor_along_the_flow_knows_no_images() {
    // Contacts with the floor and across the border take turns in memory.
    let mut input = gas(3, 2.2, 0.3, 0.3, 0.5);
    input.periodic[1] = 0.0;
    let low = -1.1 * R * 3.0;
    input.plane_point = vec![[0.0, low, 0.0], [0.0, -low, 0.0]];
    input.plane_normal = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
    input.plane_material = vec![1, 1];
    input.laws.push((0, 1, [0.3, 0.5, 0.0, 0.0, 0.0]));
    input.deformation = shear(3.0, 0, 2);
    let mut s = simulation(&input, options(5e-4));
    assert!(advance(&mut s, 600).is_none());
    assert!(s.recorder.block.impacts.len() > 100);
    // What the box gives goes into motion, or contacts take it.
    let block = &s.recorder.block;
    let work: f64 = block.steps.iter().map(|r| r.energy_work).sum();
    let taken: f64 = block.contacts.iter().flat_map(|c| c.work).sum();
    let change = s.monitors.energy_final - s.monitors.energy_initial;
    assert!(work > 0.1 * s.monitors.energy_initial && taken < -0.1 * s.monitors.energy_initial);
    let off = change - work - taken;
    assert!(
        off.abs() < 1e-9 * work,
        "{change:e} {work:e} {taken:e} {off:e}"
    );
}

#[test]
fn what_cannot_deform_is_refused() {
    let refused = |change: &dyn Fn(&mut ModelInput), options: Options| {
        let mut input = gas(2, 8.0, 0.0, 0.0, 1.0);
        input.deformation = shear(1.0, 0, 1);
        change(&mut input);
        match compile(&input, options) {
            Ok(_) => "accepted".to_owned(),
            Err(error) => error.to_string(),
        }
    };
    let plain = || options(1e-3);
    assert_eq!(refused(&|_| (), plain()), "accepted");
    let refused_as = |change: &dyn Fn(&mut ModelInput), text: &str| {
        let said = refused(change, plain());
        assert!(said.contains(text), "{said}");
    };
    refused_as(&|input| input.periodic[1] = 0.0, "does not repeat");
    refused_as(
        &|input| input.deformation = shear(1.0, 1, 1),
        "along the gradient",
    );
    refused_as(
        &|input| {
            let stretch = [law(1.1, 0.0, 0.0), None, None];
            let sheared = shear(1.0, 0, 1).expect("a shear");
            input.deformation = Some(Deformation { stretch, ..sheared });
        },
        "none at t = 0",
    );
    refused_as(
        &|input| {
            input.joints = vec![Joint {
                a: 0,
                b: 1,
                rows: Vec::new(),
                translational: 0,
                length: R,
            }]
        },
        "excludes joints",
    );
    for method in [Method::Penalty, Method::Events] {
        let said = refused(&|_| (), Options { method, ..plain() });
        assert!(said.contains("method"), "{said}");
    }
}

#[test]
fn a_box_that_gets_too_short_stops_the_run() {
    let mut input = gas(2, 8.0, 0.0, 0.0, 1.0);
    input.deformation = Some(Deformation {
        stretch: [law(1.0, -1.0, 0.0), None, None],
        ..shear(0.0, 0, 1).expect("a shear")
    });
    let mut s = simulation(&input, options(1e-2));
    let outcome = advance(&mut s, 100).expect("it stops");
    let said = outcome.message.expect("it says why");
    assert!(said.contains("long along x"), "{said}");
}

#[test]
fn a_box_that_closes_on_its_grains_says_so() {
    let mut input = gas(3, 2.05, 0.0, 0.5, 0.0);
    input.deformation = Some(Deformation {
        stretch: [-0.5; 3].map(|rate| law(1.0, rate, 0.0)),
        ..shear(0.0, 0, 1).expect("a shear")
    });
    let mut s = simulation(&input, options(1e-3));
    let outcome = advance(&mut s, 600).expect("it jams");
    let unsolved = outcome.unsolved.expect("a problem without solution");
    assert!(
        unsolved.cures.contains("on which a periodic box closes"),
        "{}",
        unsolved.cures
    );
}
