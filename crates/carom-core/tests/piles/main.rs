//! Islands of many contacts against laws of physics, against the exact solvers and against themselves.

mod agree;
#[path = "../common/mod.rs"]
mod common;
mod conserve;
mod every;
mod hit;
mod loads;
mod rolling;
mod scenes;
mod threads;

use carom_core::{Options, Simulation, StepReport};
use common::advance;

/// Piles from 11 contacts on.
pub fn options(step: f64, tolerance: f64) -> Options {
    Options {
        step,
        pile_contacts: 10,
        tolerance: tolerance.min(1e-8),
        pile_tolerance: tolerance,
        ..Options::default()
    }
}

/// Goes on; every step must have converged without a halving. Reports of all steps since the last block was taken.
pub fn converge(s: &mut Simulation, steps: u64) -> Vec<StepReport> {
    let outcome = advance(s, steps);
    assert!(outcome.is_none(), "{outcome:?}");
    let reports = s.recorder.block.steps.clone();
    for r in &reports {
        assert_eq!(r.unconverged + r.halvings, 0, "{r:?}");
    }
    reports
}

/// The same by the first solver of every island: neither leniency nor the solvers of small islands behind that of piles.
pub fn go_on(s: &mut Simulation, steps: u64) -> Vec<StepReport> {
    let reports = converge(s, steps);
    for r in &reports {
        assert_eq!(r.fallbacks, 0, "{r:?}");
    }
    reports
}

pub fn close(a: f64, b: f64, bound: f64) {
    assert!(
        (a - b).abs() <= bound,
        "{a:e} and {b:e} differ by {:e}",
        a - b
    );
}
