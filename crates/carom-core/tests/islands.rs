//! Islands side by side on several threads: every record has the same bits, whatever their number.

mod common;

use carom_core::force::spring::Spring;
use carom_core::joint::{Joint, JointRow, RowKind, GROUND};
use carom_core::options::{Impact, Method, OnNonconvergence};
use carom_core::problem::Steps;
use carom_core::{ModelInput, Options, Simulation};
use carom_laws::Scalar;
use common::{advance, balls, bits, simulation, G, R};
use glam::DVec3;
use std::sync::Arc;

/// Piles from 11 contacts on, two threads for those of 20; whatever can be shared is.
fn options(threads: u32) -> Options {
    Options {
        step: 1e-3,
        threads,
        shared_contacts_per_thread: 1,
        contacts_per_thread: 10,
        pile_contacts: 10,
        ..Options::default()
    }
}

/// A point `arm` of sphere `a` held at the same point of `b`.
fn pin(a: u32, b: u32, arm_a: DVec3, arm_b: DVec3) -> Joint {
    let point = |direction| JointRow {
        kind: RowKind::Point,
        direction,
        arm_a,
        arm_b,
        law: Scalar::zero(),
    };
    Joint {
        a,
        b,
        rows: DVec3::AXES.into_iter().map(point).collect(),
        translational: 3,
        length: R,
    }
}

/// In turn, on a floor and too far from one another to meet: a rolling ball, a column of eight that falls apart, three in a row of
/// which the first hits the second, two that swing into each other on joints, two on a spring, and a heap of 27 that is a pile.
fn scene() -> ModelInput {
    let mut x: Vec<[f64; 3]> = Vec::new();
    let (mut v, mut joints, mut springs) = (Vec::new(), Vec::new(), Vec::new());
    for group in 0..36 {
        let corner = DVec3::new((group % 6) as f64, (group / 6) as f64, 0.0) * 16.0 * R;
        let first = x.len();
        let mut put = |d: [f64; 3]| x.push((corner + R * DVec3::from(d)).to_array());
        let wobble = 0.01 * (1 + group % 5) as f64;
        match group % 6 {
            0 => put([0.0, 0.0, 1.0]),
            1 => (0..8).for_each(|k| {
                let (i, j, l) = ((k % 2) as f64, (k / 2 % 2) as f64, (k / 4) as f64);
                put([2.02 * i + wobble * l, 2.02 * j, 1.01 + 2.02 * l]);
            }),
            2 => (0..3).for_each(|k| put([2.005 * f64::from(k), wobble * f64::from(k), 1.0])),
            3 => (0..2).for_each(|k| put([2.01 * f64::from(k), wobble, 6.0])),
            4 => (0..2).for_each(|k| put([2.5 * f64::from(k), wobble, 1.0])),
            _ => (0..27).for_each(|k| {
                let (i, j, l) = ((k % 3) as f64, (k / 3 % 3) as f64, (k / 9) as f64);
                put([2.002 * i + wobble * l, 2.002 * j, 1.001 + 2.002 * l]);
            }),
        }
        v.resize(x.len(), [0.0; 3]);
        let a = first as u32;
        match group % 6 {
            0 | 2 => v[first] = [1.0 + wobble, 0.1, 0.0],
            1 => v[first + 7] = [0.3, -0.2, -1.0],
            3 => {
                for (k, speed) in [(0, 1.0), (1, -0.5)] {
                    let (body, up) = (first + k, 2.0 * R * DVec3::Z);
                    v[body] = [speed, 0.0, 0.0];
                    let point = up + DVec3::from(x[body]);
                    joints.push(pin(a + k as u32, GROUND, up, point));
                }
            }
            4 => {
                v[first] = [0.8, 0.2, 0.0];
                springs.push(Spring {
                    a,
                    b: a + 1,
                    arm_a: DVec3::ZERO,
                    arm_b: DVec3::ZERO,
                    stiffness: 50.0,
                    damping: 0.05,
                    rest_length: 2.2 * R,
                });
            }
            _ => v[first + 26] = [0.5, 0.4, -2.0],
        }
    }
    let mut input = balls(&x, &[([0.0; 3], [0.0, 0.0, 1.0])]);
    input.gravity = [0.0, 0.0, -G];
    input.velocity = v;
    input.laws = vec![
        (0, 0, [0.2, 0.7, 0.0, 0.0, 0.0]),
        (0, 1, [0.3, 0.4, 0.0, 0.0, 0.0]),
    ];
    input.joints = joints;
    input.loads = springs.into_iter().map(|s| Arc::new(s) as _).collect();
    input
}

/// Everything that a run of some steps leaves behind, number by number in full.
struct Left {
    state: Vec<u64>,
    records: String,
    problems: String,
    end: Simulation,
}

impl Left {
    fn must_equal(&self, other: &Left, name: &str) {
        assert!(self.state == other.state, "{name}: state");
        for (a, b) in [
            (&self.records, &other.records),
            (&self.problems, &other.problems),
        ] {
            if a == b {
                continue;
            }
            let same = a.bytes().zip(b.bytes()).take_while(|(x, y)| x == y).count();
            let around = |s: &str| s[same.saturating_sub(300)..s.len().min(same + 100)].to_owned();
            panic!("{name}:\n{}\n{}", around(a), around(b));
        }
    }
}

fn run(input: &ModelInput, steps: u64, o: Options) -> Left {
    let mut s = simulation(input, o);
    let keeper = s.keeper();
    keeper.hardest = 4;
    keeper.steps = vec![Steps {
        first: 3,
        last: steps,
        stride: 5,
    }];
    let outcome = advance(&mut s, steps);
    let mut block = s.take_block();
    // Numbers print as the shortest that are read back to the same bits.
    let records = format!("{outcome:?} {block:?} {:?} {:?}", s.failed, s.monitors);
    let keeper = s.keeper();
    let problems = format!("{:?} {:?}", keeper.take(), keeper.take_hardest());
    s.recorder.block = std::mem::take(&mut block);
    Left {
        state: bits(&s),
        records,
        problems,
        end: s,
    }
}

/// Runs on 1, 2, 3 and 8 threads must leave the same; the first of them.
fn same(name: &str, input: &ModelInput, steps: u64, change: impl Fn(&mut Options)) -> Simulation {
    let with = |threads| {
        let mut o = options(threads);
        change(&mut o);
        run(input, steps, o)
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        let many = with(threads);
        one.must_equal(&many, &format!("{name}, {threads} threads"));
    }
    one.end
}

#[test]
fn records_are_the_same_for_any_number_of_threads() {
    let s = same("nsga", &scene(), 60, |_| {});
    let block = &s.recorder.block;
    assert!(block.steps.iter().all(|r| r.islands >= 20));
    assert!(block.steps.iter().any(|r| r.largest_island >= 15));
    assert!(block.steps.iter().any(|r| r.sweeps_velocity > 0));
    assert!(block.impacts.len() > 300, "{} impacts", block.impacts.len());
    assert!(block.residuals.len() > 60 && block.joints.iter().any(|x| *x != 0.0));
    assert_eq!(s.monitors.halvings, 0);
}

#[test]
fn other_schemes_and_laws_too() {
    same("moreau", &scene(), 30, |o| {
        o.method = Method::MoreauJean;
        o.position_projection = true;
    });
    same("as printed", &scene(), 30, |o| {
        o.impact = Impact::SequencePaper
    });
    same("one-shot", &scene(), 30, |o| o.impact = Impact::OneShot);
    same("poisson", &scene(), 30, |o| o.impact = Impact::Poisson);
}

/// Tolerances below rounding, so that some solves fail: in steps of which smaller parts are made, in one that ends the run, and in
/// such that are accepted. Without joints: these fail before contacts, in the smooth motion.
#[test]
fn steps_that_fail_fail_in_the_same_way() {
    let fail = |input: &ModelInput, policy, tolerance: f64, max_halvings: u32, pile: f64| {
        same(&format!("{policy:?} {tolerance:e}"), input, 10, |o| {
            o.tolerance = tolerance;
            o.pile_tolerance = pile;
            o.tolerance_floor = 1e-300;
            o.gauss_seidel_sweeps = 0;
            o.max_halvings = max_halvings;
            o.on_nonconvergence = policy;
        })
    };
    let mut free = scene();
    free.joints.clear();
    free.loads.clear();
    let s = fail(&free, OnNonconvergence::Stop, 1e-18, 2, 1e-17);
    let (made, kept) = (s.state.step, s.failed.is_some());
    assert!(made < 10 && kept, "{made} {kept}");
    // Near rounding some of these fail whole and are solved in halves, others are not.
    let halvings = [3e-17, 4e-17, 5e-17].map(|tolerance| {
        let s = fail(&free, OnNonconvergence::Stop, tolerance, 6, 1e-7);
        s.monitors.halvings
    });
    assert!(halvings.iter().any(|&n| n > 0), "{halvings:?}");
    let s = fail(&free, OnNonconvergence::Warn, 1e-18, 1, 1e-7);
    let (halvings, unconverged) = (s.monitors.halvings, s.monitors.unconverged);
    assert!(
        s.state.step == 10 && halvings > 0 && unconverged > 10,
        "{halvings} {unconverged}"
    );
}

/// Where the work is too little for a thread nothing is shared; that changes no bit either.
#[test]
fn it_does_not_matter_from_which_work_on_islands_are_shared() {
    let input = scene();
    let with = |shared_contacts_per_thread| {
        let o = Options {
            shared_contacts_per_thread,
            ..options(3)
        };
        run(&input, 20, o)
    };
    let always = with(1);
    for least in [40, 100_000] {
        always.must_equal(&with(least), &format!("from {least} contacts on"));
    }
}
