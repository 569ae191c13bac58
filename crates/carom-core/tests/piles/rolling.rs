//! Rolling and spinning friction in piles.

use super::*;
use crate::common::bits;
use crate::common::{balls, simulation, G, MASS, R};
use carom_core::ModelInput;
use scenes::{cluster, drop, momenta};
use threads::large;

/// Bounds in metres.
const RHO: f64 = 0.05 * R;
const DELTA: f64 = 0.02 * R;

/// The scene with these moments in all laws.
pub fn rough(mut input: ModelInput, rho: f64, delta: f64) -> ModelInput {
    for law in &mut input.laws {
        (law.2[3], law.2[4]) = (rho, delta);
    }
    input
}

/// A row of balls side by side that touch one another without friction, on a plane with friction: one island, in which each ball
/// moves across the row as it would alone. Gravity is tilted by `slope` towards y.
fn row(slope: f64, velocity: f64, spin: f64) -> Simulation {
    let count = 12;
    let places: Vec<[f64; 3]> = (0..count)
        .map(|i| [2.0 * R * f64::from(i), 0.0, R])
        .collect();
    let mut input = balls(&places, &[([0.0; 3], [0.0, 0.0, 1.0])]);
    input.gravity = [0.0, G * slope.sin(), -G * slope.cos()];
    input.laws = vec![(0, 0, [0.0; 5]), (0, 1, [0.5, 0.0, 0.0, RHO, DELTA])];
    for i in 0..count as usize {
        input.velocity[i] = [0.0, velocity, 0.0];
        input.angular_velocity[i] = [-velocity / R, 0.0, spin];
    }
    simulation(&input, options(1e-3, 1e-9))
}

/// Largest deviation from `y`, `v` and `w_z`, all balls.
fn off(s: &Simulation, [y, v, w]: [f64; 3]) -> f64 {
    let state = &s.state;
    (0..state.position.len())
        .map(|i| {
            let (x, u, spin) = (
                state.position[i],
                state.velocity[i],
                state.angular_velocity[i],
            );
            (x.y - y)
                .abs()
                .max((u.y - v).abs())
                .max(R * (spin.z - w).abs())
        })
        .fold(0.0, f64::max)
}

/// With rho the line of the load is ahead of the centre: `v' = -(5/7) g rho/r` for a solid ball that rolls, `w' = -delta g m/I` for one
/// that spins, exact in the discrete motion too; then rest.
#[test]
fn balls_in_a_pile_roll_and_spin_to_rest_as_they_do_alone() {
    let (v0, w0) = (0.3, 4.0);
    let mut s = row(0.0, v0, w0);
    let (slow, turn) = (5.0 / 7.0 * G * RHO / R, 2.5 * G * DELTA / (R * R));
    let steps = 200;
    let reports = go_on(&mut s, steps);
    // One pile; where nothing changes the impulses of the last step, or of the other level, are the solution and no sweep is due.
    assert!(reports.iter().all(|r| r.largest_island == 23));
    assert!(reports
        .iter()
        .any(|r| r.sweeps_velocity > 0 || r.sweeps_position > 0));
    let t = steps as f64 * 1e-3;
    let spin = (w0 - turn * t).max(0.0);
    assert!(v0 > slow * t && w0 > turn * t, "both still move");
    let way = v0 * t - 0.5 * slow * t * t;
    let far = off(&s, [way, v0 - slow * t, spin]);
    assert!(far < 1e-7, "{far:e}");
    // Rest: 0.3 m/s are gone after 0.86 s.
    go_on(&mut s, 800);
    let end = s.state.position[0].y;
    close(end, v0 * v0 / (2.0 * slow), 1e-3 * v0);
    let far = off(&s, [end, 0.0, 0.0]);
    assert!(far < 1e-8, "{far:e}");
}

/// A slope of half the rolling friction holds them, of twice as much does not: `v' = (5/7) g (sin - rho/r cos)`.
#[test]
fn balls_in_a_pile_stay_on_a_slope_or_roll_down() {
    for share in [0.5, 2.0] {
        let slope = (share * RHO / R).atan();
        let mut s = row(slope, 0.0, 0.0);
        go_on(&mut s, 200);
        let down = 5.0 / 7.0 * G * (slope.sin() - RHO / R * slope.cos()).max(0.0);
        let far = off(&s, [0.5 * down * 0.04, 0.2 * down, 0.0]);
        assert!(far < 1e-7, "{share}: {far:e}");
    }
}

/// As `agree.rs` has it without moments: the frame of the end of a step makes differences of first order in h. Now and then a contact
/// that opens a step later makes more of them, so what four drops differ by is added up.
#[test]
fn rolling_piles_and_exact_solvers_agree() {
    let mut sums = [[0.0; 3]; 2];
    for seed in [20, 21, 24, 25] {
        let run = |h: f64, pile_contacts: u32| {
            let input = rough(drop(80, 4, [0.4, 0.0], seed), RHO, DELTA);
            let o = Options {
                pile_contacts,
                ..options(h, 1e-9)
            };
            let mut s = simulation(&input, o);
            let reports = converge(&mut s, (0.08 / h).round() as u64);
            let swept = reports.iter().filter(|r| r.sweeps_velocity > 0).count();
            (s, swept)
        };
        let [coarse, fine] = [1e-3, 2.5e-4].map(|h| {
            let ((a, swept), (b, none)) = (run(h, 10), run(h, 100_000));
            assert!(swept > 3 && none == 0, "{swept} {none}");
            let mut most = [0.0f64; 3];
            for i in 0..80 {
                let (p, q) = (&a.state, &b.state);
                most[0] = most[0].max((p.position[i] - q.position[i]).length());
                most[1] = most[1].max((p.velocity[i] - q.velocity[i]).length());
                let turn = p.angular_velocity[i] - q.angular_velocity[i];
                most[2] = most[2].max(R * turn.length());
            }
            most
        });
        assert!(coarse[0] < 1e-4 * R && coarse[1] < 1e-3, "{coarse:?}");
        assert!(coarse[2] < 2e-3, "{coarse:?}");
        for k in 1..3 {
            sums[0][k] += coarse[k];
            sums[1][k] += fine[k];
        }
    }
    // 4 at first order.
    for k in 1..3 {
        assert!(sums[0][k] > 2.5 * sums[1][k], "{sums:?}");
    }
}

/// Moments balance, and take energy: a free cluster that is hit keeps its momenta, and rule R4 holds.
#[test]
fn free_piles_that_roll_keep_their_momentum_and_gain_no_energy() {
    for restitution in [0.0, 0.3, 0.9] {
        let v = [2.7, 0.9, -0.3];
        let smooth = cluster(0.3, restitution, [-6.5 * R, 0.1 * R, 0.3 * R], v);
        let mut input = rough(smooth, 4.0 * RHO, 4.0 * DELTA);
        *input.angular_velocity.last_mut().expect("balls") = [20.0, -30.0, 10.0];
        let h = 2.5e-5;
        let o = Options {
            max_problems: 50,
            ..options(h, 1e-8)
        };
        let mut s = simulation(&input, o);
        let (p0, l0, t0) = momenta(&s);
        let reports = go_on(&mut s, 2400);
        assert!(reports.iter().any(|r| r.sweeps_velocity > 0));
        let (p, l, t) = momenta(&s);
        close((p - p0).length(), 0.0, 1e-14 * p0.length());
        close((l - l0).length(), 0.0, 2.0 * t0 * h);
        assert!(s.monitors.energy_max_rise <= 1e-10 * t0);
        assert!(t < 0.95 * t0, "{t} {t0}");
        let block = s.take_block();
        let work = |k: usize| block.contacts.iter().map(|c| c.work[k]).sum::<f64>();
        // What contacts took is what is gone, and rolling and spinning took their share.
        close((0..4).map(work).sum::<f64>(), t - t0, 1e-6 * t0);
        assert!(
            work(2) < -1e-4 * t0 && work(3) < -1e-6 * t0,
            "{} {}",
            work(2),
            work(3)
        );
        for impact in block.impacts.iter().map(|i| &i.impact) {
            let normal = impact.impulse.dot(impact.normal);
            let along = impact.moment.dot(impact.normal);
            let across = impact.moment.reject_from_normalized(impact.normal).length();
            assert!(across <= 4.0 * RHO * normal * (1.0 + 1e-6), "{impact:?}");
            assert!(
                along.abs() <= 4.0 * DELTA * normal * (1.0 + 1e-6),
                "{impact:?}"
            );
        }
    }
}

/// 300 grains with rolling friction settle to rest, with moments in their cones.
#[test]
fn grains_that_roll_settle() {
    let input = rough(drop(300, 6, [0.5, 0.3], 3), 2.0 * RHO, 2.0 * DELTA);
    let mut s = simulation(
        &input,
        Options {
            pile_contacts: 100,
            ..options(1e-3, 1e-4)
        },
    );
    let fall = 300.0 * MASS * G * R;
    // The last grains roll over one another now and then: at rest after some seconds.
    let at_rest = |s: &mut Simulation| {
        s.take_block();
        let reports = converge(s, 100);
        let last = reports.last().expect("steps");
        let fallbacks: u32 = reports.iter().map(|r| r.fallbacks).sum();
        assert!(fallbacks < 15, "{fallbacks} in 100 steps");
        last.largest_island > 500 && last.energy_kinetic < 1e-8 * fall
    };
    assert!((0..40).any(|_| at_rest(&mut s)));
    assert!(s.monitors.energy_max_rise < 1e-4 * s.monitors.energy_scale);
}

#[test]
fn threads_change_no_bit_of_rolling_piles() {
    let run = |threads| {
        let o = Options {
            threads,
            contacts_per_thread: 2_048,
            ..options(1e-3, 1e-3)
        };
        let mut s = simulation(&rough(large(), RHO, DELTA), o);
        let reports = go_on(&mut s, 2);
        assert!(reports.iter().all(|r| r.largest_island >= 8 * 2_048));
        bits(&s)
    };
    let one = run(1);
    for threads in [3, 8] {
        assert!(one == run(threads), "{threads} threads");
    }
}

#[test]
fn a_restored_rolling_pile_goes_on_with_the_same_bits() {
    let input = rough(drop(80, 4, [0.4, 0.3], 5), RHO, DELTA);
    let o = options(5e-4, 1e-7);
    let mut whole = simulation(&input, o.clone());
    converge(&mut whole, 400);
    let state = whole.state.clone();
    converge(&mut whole, 50);
    let end = bits(&whole);
    let resume = |forget: &dyn Fn(&mut carom_core::state::Warm)| {
        let mut s = simulation(&input, o.clone());
        s.state = state.clone();
        s.state.warm.iter_mut().for_each(forget);
        converge(&mut s, 50);
        bits(&s)
    };
    assert!(end == resume(&|_| ()));
    // Moments are started from: without them the bits differ.
    assert!(end != resume(&|w| w.moment = glam::DVec3::ZERO));
}
