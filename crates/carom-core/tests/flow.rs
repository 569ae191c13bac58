//! Balls that come and go: when, where, what they carry, and that nothing else notices.

mod common;

use carom_core::clump::body::ClumpInput;
use carom_core::flow::{Inflow, Outlet, Region};
use carom_core::options::Method;
use carom_core::{ModelError, ModelInput, Options, Simulation};
use common::{advance, balls, bits, compile, simulation, MASS, R};
use glam::DVec3;

const METHODS: [Method; 3] = [Method::Nsga, Method::MoreauJean, Method::Penalty];

fn options(method: Method) -> Options {
    Options {
        step: 1e-3,
        method,
        ..Options::default()
    }
}

fn inflow(first: u32, count: u32) -> Inflow {
    let low = DVec3::new(-0.2, -0.2, 0.5);
    Inflow {
        first,
        count,
        region: Region::Box {
            low,
            high: -low.with_z(-0.5),
        },
        rate: 0.0,
        start: 0.0,
        velocity: DVec3::new(0.0, 0.0, -2.0),
        spread: 0.1,
        turned: false,
        seed: 7,
    }
}

/// `count` balls that rain on a floor with a hole of 0.1 m through which they leave: everything below z = -0.1 m.
fn rain(count: usize) -> ModelInput {
    let law = [0.4, 0.3, 0.0, 0.0, 0.0];
    let mut input = balls(
        &vec![[0.0, 0.0, 0.5]; count + 1],
        &[([0.0, -0.4, 0.0], [0.0, 1.0, 0.0])],
    );
    input.position[0] = [0.5, 0.0, 2.0];
    input.gravity = [0.0, 0.0, -9.8];
    input.laws = vec![(0, 0, law), (0, 1, law)];
    input.inflow = vec![inflow(1, count as u32)];
    input.outlet = vec![Outlet {
        low: DVec3::new(-9.0, -9.0, -9.0),
        high: DVec3::new(9.0, 9.0, -0.1),
        inside: true,
    }];
    input
}

fn count(s: &Simulation) -> usize {
    s.state.present.iter().filter(|p| **p).count()
}

#[test]
fn balls_enter_at_their_rate_and_all_that_falls_leaves() {
    for method in METHODS {
        let mut input = rain(30);
        input.inflow[0].rate = 100.0;
        input.inflow[0].start = 0.0105;
        let mut s = simulation(&input, options(method));
        assert_eq!(count(&s), 1);
        let mut entered = Vec::new();
        for step in 1..=1000 {
            assert!(advance(&mut s, 1).is_none());
            let m = &s.monitors;
            assert_eq!(count(&s) as u64, 1 + m.entered - m.removed);
            if m.entered as usize > entered.len() {
                entered.resize(m.entered as usize, step);
            }
            // Nothing rises but by what enters: energy less the exchange and the losses.
            let sum = m.energy_initial + m.energy_in - m.energy_out + m.energy_work;
            assert!(
                m.energy_final <= sum + 1e-9 * m.energy_scale,
                "{method:?} {step}"
            );
        }
        // The k-th at the first grid point at or after start + k/rate, to within a wait for room.
        assert_eq!(entered.len(), 30);
        for (k, &step) in entered.iter().enumerate() {
            let due = 11 + 10 * k as i64;
            assert!((0..3).contains(&(step - due)), "{k}: {step} {due}");
        }
        assert_eq!(s.monitors.removed, 31, "{method:?}");
        assert_eq!(count(&s), 0);
        assert_eq!(s.monitors.energy_rises, 0);
        assert!(s.monitors.energy_final == 0.0);
        let block = s.take_block();
        assert_eq!(block.events.len(), 61);
        assert_eq!(block.present.len(), 1000 * 31);
        let there = block.position.chunks(3).map(|x| !x[0].is_nan());
        assert!(
            there.eq(block.present.iter().copied()),
            "absent balls have no place"
        );
        assert!(block.velocity.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn the_balance_closes_to_rounding_where_nothing_touches() {
    let mut input = rain(30);
    input.inflow[0].rate = 10.0;
    input.inflow[0].region = Region::Disc {
        centre: DVec3::new(0.0, 0.0, 0.4),
        normal: DVec3::Z,
        radius: 0.1,
    };
    let mut s = simulation(&input, options(Method::Nsga));
    assert!(advance(&mut s, 2500).is_none());
    let m = &s.monitors;
    assert!(m.entered > 20 && m.removed > 15);
    let off = m.energy_final - m.energy_initial - m.energy_in + m.energy_out;
    assert!(
        off.abs() < 1e-11 * m.energy_in.abs().max(m.energy_scale),
        "{off:e}"
    );
    // On the disc, at the speed given to within the spread.
    for e in s.recorder.block.events.iter().filter(|e| e.entered) {
        let frame = (e.step as usize).saturating_sub(1) * 31 + e.body as usize;
        if e.step > 0 {
            let at = |v: &[f64]| DVec3::from_slice(&v[3 * frame..]);
            let x = at(&s.recorder.block.position);
            assert!((x.z - 0.4).abs() < 1e-15 && x.truncate().length() <= 0.1);
            let off = at(&s.recorder.block.velocity) - DVec3::new(0.0, 0.0, -2.0);
            assert!(off.abs().max_element() <= 0.1 && off.length() > 0.0);
        }
    }
}

#[test]
fn as_fast_as_there_is_room_and_never_into_one_another() {
    let mut input = rain(400);
    input.gravity = [0.0; 3];
    input.periodic = [0.0, 0.0, 0.0];
    let s = simulation(&input, options(Method::Nsga));
    // A layer of 0.4 m by 0.4 m at one height, shut off by the wall at y = -0.4 m: far from all 400, and many.
    let inside: Vec<usize> = (0..401).filter(|&i| s.state.present[i]).collect();
    assert!(inside.len() > 20 && inside.len() < 60, "{}", inside.len());
    for (k, &i) in inside.iter().enumerate() {
        for &j in &inside[..k] {
            let gap = s.state.position[i].distance(s.state.position[j]) - 2.0 * R;
            assert!(gap >= 0.0, "{i} {j} {gap}");
        }
    }
    // The same in a periodic box: room is looked for across its border.
    input.periodic = [0.4, 0.0, 0.0];
    let low = DVec3::new(-0.2, -0.3, 0.5);
    input.inflow[0].region = Region::Box {
        low,
        high: DVec3::new(0.2, 0.3, 0.6),
    };
    let s = simulation(&input, options(Method::Nsga));
    assert!(count(&s) > 50);
    for i in 1..401 {
        for j in (1..i).filter(|&j| s.state.present[i] && s.state.present[j]) {
            let d = s
                .model
                .periodic
                .nearest(s.state.position[i] - s.state.position[j]);
            assert!(d.length() >= 2.0 * R);
        }
    }
}

#[test]
fn a_run_taken_up_again_has_the_same_bits() {
    for method in METHODS {
        let input = rain(60);
        let run = |steps| {
            let mut s = simulation(&input, options(method));
            assert!(advance(&mut s, steps).is_none());
            s
        };
        let whole = run(400);
        assert!(whole.monitors.entered > 10 && whole.monitors.removed > 3);
        let half = run(150);
        let mut taken = simulation(&input, options(method));
        taken.state = half.state.clone();
        taken.monitors = half.monitors.clone();
        assert!(advance(&mut taken, 250).is_none());
        assert_eq!(bits(&taken), bits(&whole));
        assert_eq!(taken.state.present, whole.state.present);
        assert_eq!(taken.state.entered, whole.state.entered);
        assert_eq!(taken.monitors, whole.monitors);
    }
}

#[test]
fn who_is_absent_is_not_noticed() {
    // A ball at rest on the floor, with absent ones all over the place, and without.
    for method in METHODS {
        let law = [0.4, 0.3, 0.0, 0.0, 0.0];
        let alone = |extra: usize| {
            let mut at = vec![[0.1, 0.0, 3.0 * R], [0.1, 0.5 * R, 6.0 * R]];
            at.extend(vec![[0.1, 0.0, 3.0 * R]; extra]);
            let mut input = balls(&at, &[([0.0; 3], [0.0, 0.0, 1.0])]);
            input.gravity = [0.0, 0.0, -9.8];
            input.laws = vec![(0, 0, law), (0, 1, law)];
            if extra > 0 {
                input.inflow = vec![Inflow {
                    start: 1e3,
                    ..inflow(2, extra as u32)
                }];
            }
            let mut s = simulation(&input, options(method));
            assert!(advance(&mut s, 500).is_none());
            s
        };
        let (free, crowded) = (alone(0), alone(50));
        for i in 0..2 {
            assert_eq!(free.state.position[i], crowded.state.position[i]);
            assert_eq!(free.state.velocity[i], crowded.state.velocity[i]);
        }
        assert_eq!(free.monitors.energy_final, crowded.monitors.energy_final);
        assert_eq!(free.monitors.contacts, crowded.monitors.contacts);
        assert!((crowded.state.velocity[7]) == DVec3::ZERO);
    }
}

#[test]
fn the_ball_above_one_that_is_taken_falls() {
    for method in METHODS {
        let mut input = balls(
            &[[0.0, 0.0, R], [0.0, 0.0, 3.0 * R]],
            &[([0.0; 3], [0.0, 0.0, 1.0])],
        );
        let law = [0.0; 5];
        input.gravity = [0.0, 0.0, -9.8];
        input.laws = vec![(0, 0, law), (0, 1, law)];
        // An outlet makes it a model whose balls come and go.
        input.outlet = vec![Outlet {
            low: DVec3::splat(8.0),
            high: DVec3::splat(9.0),
            inside: true,
        }];
        let mut s = simulation(&input, options(method));
        assert!(advance(&mut s, 50).is_none());
        let x = s.state.position[1].z;
        assert!((x - 3.0 * R).abs() < 1e-4, "{method:?}: it rests");
        s.state.present[0] = false;
        s.state.touches.clear();
        let v = s.state.velocity[1].z;
        assert!(advance(&mut s, 20).is_none());
        let fallen = s.state.position[1].z - x - 0.02 * v;
        assert!(
            (fallen + 0.5 * 9.8 * 4e-4).abs() < 2e-5,
            "{method:?}: {fallen}"
        );
        assert!((s.state.velocity[1].z - v + 9.8 * 0.02).abs() < 0.01);
        assert!(s.recorder.block.steps[50..].iter().all(|r| r.contacts == 0));
    }
}

/// Which balls at `x` are left in a world of period 0.3 m along x with an outlet between two places along it.
fn left(x: &[f64], origin: f64, [low, high]: [f64; 2], inside: bool) -> Vec<f64> {
    let at: Vec<_> = (x.iter().enumerate())
        .map(|(k, &x)| [x, 10.0 * R * k as f64, 0.0])
        .collect();
    let mut input = balls(&at, &[]);
    input.periodic = [0.3, 0.0, 0.0];
    input.periodic_origin = [origin, 0.0, 0.0];
    input.outlet = vec![Outlet {
        low: DVec3::new(low, -9.0, -9.0),
        high: DVec3::new(high, 9.0, 9.0),
        inside,
    }];
    input.radius.fill(0.01);
    let s = simulation(&input, options(Method::Nsga));
    let there = x.iter().zip(&s.state.present).filter(|(_, &p)| p);
    there.map(|(&x, _)| x).collect()
}

#[test]
fn a_periodic_outlet_takes_every_image() {
    for origin in [0.0, -0.15, 7.0] {
        let x = [0.27, 0.32, 0.02, -0.02, 0.2, 0.1, 6.32, 6.2];
        let (out, kept) = ([0.27, 0.32, 0.02, -0.02, 6.32], [0.2, 0.1, 6.2]);
        assert_eq!(left(&x, origin, [0.25, 0.35], true), kept);
        assert_eq!(left(&x, origin, [0.25, 0.35], false), out);
        // Wherever the box is written.
        assert_eq!(left(&x, origin, [-29.75, -29.65], true), kept);
        assert_eq!(left(&[0.25], origin, [0.20, 0.28], true), [0.0; 0]);
        assert_eq!(
            left(&[-0.05, 0.25, 0.15], origin, [-0.1, 0.1], false),
            [-0.05, 0.25]
        );
        // As long as the period or longer.
        for box_ in [[0.25, 0.55], [-9.0, 9.0], [-1e30, 1e30]] {
            assert_eq!(left(&x, origin, box_, true), [0.0; 0]);
            assert_eq!(left(&x, origin, box_, false), x);
        }
    }
}

#[test]
fn room_is_looked_for_at_any_place_where_balls_may_be() {
    // Farther from the origin than an integer counts cells, too, and many images away in a periodic box.
    for far in [0.0, 1e3, 1e9, 1e15, 1e18, 1e30, 9e74] {
        for sign in [1.0, -1.0] {
            for periodic in [[0.0; 3], [0.4, 0.0, 0.0], [0.4, 0.4, 1e300]] {
                let mut input = rain(40);
                (input.plane_point, input.plane_normal) = (Vec::new(), Vec::new());
                (input.plane_material, input.outlet) = (Vec::new(), Vec::new());
                input.gravity = [0.0; 3];
                input.periodic = periodic;
                input.periodic_origin = [1e60, 0.0, -1e60];
                let low = DVec3::splat(sign * far);
                input.inflow[0].region = Region::Box {
                    low,
                    high: low + DVec3::splat(0.3),
                };
                let s = simulation(&input, options(Method::Nsga));
                let there: Vec<usize> = (1..41).filter(|&i| s.state.present[i]).collect();
                let most = if far > 1e16 { 1 } else { 40 };
                assert!((1..=most).contains(&there.len()), "{far}: {there:?}");
                assert!(far > 1e8 || there.len() > 10, "{far}: {there:?}");
                for (k, &i) in there.iter().enumerate() {
                    for &j in &there[..k] {
                        let (x, y) = (s.state.position[i], s.state.position[j]);
                        let met = s.model.periodic.sphere_sphere(x, R, y, R);
                        assert!(met.gap >= 0.0, "{far} {periodic:?}: {x} {y}");
                    }
                }
            }
        }
    }
}

fn refusal(change: impl FnOnce(&mut ModelInput)) -> String {
    let mut input = rain(5);
    change(&mut input);
    match compile(&input, Options::default()) {
        Err(error @ ModelError::Entry { .. }) => error.to_string(),
        other => panic!("{:?}", other.map(|_| ())),
    }
}

#[test]
fn unusable_flows_are_refused() {
    assert!(refusal(|i| i.inflow[0].count = 6).contains("there are 6 spheres"));
    assert!(refusal(|i| i.inflow.push(inflow(3, 1))).contains("another inflow"));
    assert!(refusal(|i| i.inflow[0].turned = true).contains("balls are round"));
    assert!(refusal(|i| i.inflow[0].rate = -1.0).contains("rate"));
    assert!(refusal(|i| i.inflow[0].spread = f64::NAN).contains("spread"));
    assert!(refusal(|i| i.outlet[0].high.x = -10.0).contains("corner"));
    assert!(refusal(|i| {
        i.inflow[0].region = Region::Box {
            low: DVec3::ZERO,
            high: DVec3::new(1.0, -1.0, 0.0),
        }
    })
    .contains("region"));
    // Where no ball may be at the start, none enters: the square of such a place is no number.
    let far = DVec3::new(0.3, -5.5e303, 0.0);
    for region in [
        Region::Disc {
            centre: far,
            normal: DVec3::Z,
            radius: 0.06,
        },
        Region::Disc {
            centre: DVec3::ZERO,
            normal: DVec3::Z,
            radius: 1e80,
        },
        Region::Box {
            low: far,
            high: DVec3::ONE,
        },
        Region::Box {
            low: DVec3::ZERO,
            high: DVec3::INFINITY,
        },
    ] {
        let told = refusal(|i| i.inflow[0].region = region);
        assert!(
            told.contains("region") && told.contains("not above 1e75 m"),
            "{told}"
        );
    }
}

/// A rod that turns as it falls to the outlet below z = -0.1 m, and a ball far above.
fn falling_rod() -> ModelInput {
    let at = [[0.0, -R, 0.0], [0.0, R, 0.0], [0.5, 0.0, 2.0]];
    let mut input = balls(&at, &[]);
    input.gravity = [0.0, 0.0, -9.8];
    input.outlet = rain(1).outlet;
    let (across, along) = (2.8 * MASS * R * R, 0.8 * MASS * R * R);
    input.clumps = vec![ClumpInput {
        balls: 0..2,
        mass: 2.0 * MASS,
        inertia: [across, along, across],
        position: [0.0; 3],
        orientation: [1.0, 0.0, 0.0, 0.0],
        velocity: [0.0; 3],
        angular_velocity: [8.0, 0.0, 0.0],
    }];
    input
}

#[test]
fn a_clump_leaves_as_a_whole_and_stands_still_from_then_on() {
    let mut s = simulation(&falling_rod(), options(Method::Nsga));
    // The first step after which its centre is below -0.1 m: sqrt(2 * 0.1/9.8) = 142.9 ms.
    assert!(advance(&mut s, 142).is_none());
    assert_eq!(s.state.present, [true; 4]);
    assert!(s.state.position[0].z < -0.1 || s.state.position[1].z < -0.1);
    assert!(advance(&mut s, 1).is_none());
    assert_eq!(s.state.present, [false, false, true, false]);
    let (m, fallen) = (2.0 * MASS, 9.8 * 0.143);
    let spin = 0.5 * 2.8 * MASS * R * R * 64.0;
    let motion = 0.5 * m * fallen * fallen + spin;
    let lost = motion - m * 9.8 * 0.5 * 9.8 * 0.143 * 0.143;
    assert!((s.monitors.energy_out - lost).abs() < 1e-12 * motion);
    assert_eq!(s.monitors.removed, 2);
    let (position, orientation) = (s.state.position.clone(), s.state.orientation.clone());
    assert!(advance(&mut s, 50).is_none());
    for i in [0, 1, 3] {
        assert_eq!(s.state.position[i], position[i]);
        assert_eq!(s.state.orientation[i], orientation[i]);
        assert_eq!(s.state.velocity[i], DVec3::ZERO);
    }
    assert_eq!(s.monitors.energy_rises, 0);
}

#[test]
fn a_state_has_a_clump_with_all_its_balls_or_none_of_it() {
    let input = falling_rod();
    let model = compile(&input, options(Method::Nsga)).unwrap().0;
    let mut state = simulation(&input, options(Method::Nsga)).state;
    assert!(state.check(&model).is_ok());
    state.present[1] = false;
    let told = state.check(&model).unwrap_err().to_string();
    assert!(told.contains("parts of a clump"), "{told}");
    (state.present[0], state.present[3]) = (false, false);
    assert!(state.check(&model).is_ok());
}

#[test]
fn balls_enter_around_a_clump_and_none_of_its_own() {
    // A rod lies in the region, and stays there.
    let mut at = vec![[0.0, -R, 0.5], [0.0, R, 0.5], [0.5, 0.0, 2.0]];
    at.extend([[0.0, 0.0, 0.5]; 40]);
    let mut input = balls(&at, &[]);
    input.laws = vec![(0, 0, [0.4, 0.3, 0.0, 0.0, 0.0])];
    input.clumps = falling_rod().clumps;
    input.clumps[0].position[2] = 0.5;
    input.clumps[0].angular_velocity = [0.0; 3];
    input.inflow = vec![Inflow {
        velocity: DVec3::ZERO,
        spread: 0.0,
        ..inflow(3, 40)
    }];
    let mut s = simulation(&input, options(Method::Nsga));
    assert!(s.monitors.entered > 10);
    let least = |s: &Simulation, i: usize| {
        let to = |ball: usize| (s.state.position[i] - s.state.position[ball]).length();
        to(0).min(to(1))
    };
    for i in (3..43).filter(|&i| s.state.present[i]) {
        assert!(least(&s, i) >= 2.0 * R);
    }
    assert!(advance(&mut s, 20).is_none());
    input.inflow[0].first = 1;
    let told = compile(&input, options(Method::Nsga)).unwrap_err();
    assert!(told.to_string().contains("balls of a clump"), "{told}");
}

#[test]
fn clumps_enter_turned_at_random_where_all_their_balls_have_room() {
    // Rods in a box hardly wider than one is long: some turns do not fit.
    let walls = [
        ([-0.13, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ([0.13, 0.0, 0.0], [-1.0, 0.0, 0.0]),
    ];
    let count = 25;
    let mut at = vec![[0.5, 0.0, 9.0]];
    at.extend([[0.0, -R, 0.5], [0.0, R, 0.5]].repeat(count));
    let mut input = balls(&at, &walls);
    input.laws = vec![
        (0, 0, [0.4, 0.3, 0.0, 0.0, 0.0]),
        (0, 1, [0.4, 0.3, 0.0, 0.0, 0.0]),
    ];
    let rod = falling_rod().clumps[0].clone();
    let rods = (0..count).map(|k| ClumpInput {
        balls: 1 + 2 * k..3 + 2 * k,
        position: [0.0, 0.0, 0.5],
        angular_velocity: [0.0; 3],
        ..rod.clone()
    });
    input.clumps = rods.collect();
    let first = at.len() as u32;
    let low = DVec3::new(-0.13 + R, -0.3, 0.4);
    input.inflow = vec![Inflow {
        region: Region::Box {
            low,
            high: -low.with_z(-0.6),
        },
        turned: true,
        start: 1e-3,
        ..inflow(first, count as u32)
    }];
    let mut s = simulation(&input, options(Method::Nsga));
    assert_eq!(s.state.present.iter().filter(|p| **p).count(), 1);
    assert!(advance(&mut s, 1).is_none());
    assert_eq!(s.monitors.entered, 2 * u64::from(s.state.entered[0]));
    assert!(s.state.entered[0] > 10);
    let (mut directions, mut energy) = (DVec3::ZERO, 0.0);
    for k in (0..count).filter(|k| s.state.present[first as usize + k]) {
        let i = first as usize + k;
        let [a, b] = [1 + 2 * k, 2 + 2 * k];
        assert!(s.state.present[a] && s.state.present[b]);
        let (x, y) = (s.state.position[a], s.state.position[b]);
        let along = (y - x) / (2.0 * R);
        assert!((along.length() - 1.0).abs() < 1e-12);
        assert!((0.5 * (x + y) - s.state.position[i]).length() < 1e-12);
        // The rod lies along its second axis, and its balls have turned with it.
        assert!((s.state.orientation[i] * DVec3::Y - along).length() < 1e-12);
        assert!((s.state.orientation[a] * DVec3::Y - along).length() < 1e-12);
        assert!(x.x.abs().max(y.x.abs()) <= 0.13 - R + 1e-12);
        let v = s.state.velocity[i];
        assert_eq!([s.state.velocity[a], s.state.velocity[b]], [v; 2]);
        energy += 0.5 * 2.0 * MASS * v.length_squared();
        directions += along * along;
        for j in (0..2 * count)
            .map(|j| 1 + j)
            .filter(|&j| j != a && j != b && s.state.present[j])
        {
            let gap = |x: DVec3| (x - s.state.position[j]).length() - 2.0 * R;
            assert!(gap(x).min(gap(y)) >= 0.0);
        }
    }
    assert!((s.monitors.energy_in - energy).abs() < 1e-12 * energy);
    let share = directions / f64::from(s.state.entered[0]);
    assert!(share.min_element() > 0.1, "{share}");
}
