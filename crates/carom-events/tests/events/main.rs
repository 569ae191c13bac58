//! Method `events`: closed forms, invariants, and the limit of the steps of `nsga`.

mod closed_forms;
#[path = "../../../carom-core/tests/common/mod.rs"]
mod common;
mod handover;
mod invariants;
mod limits;
mod walls;

use carom_core::options::Method;
use carom_core::{ModelInput, Options, Outcome, Recording, Simulation};
use common::compile;
use glam::DVec3;
use std::time::Duration;

fn options(step: f64) -> Options {
    Options {
        step,
        method: Method::Events,
        ..Options::default()
    }
}

fn begin(input: &ModelInput, o: Options) -> Simulation {
    let (model, initial) = compile(input, o).expect("the scene is valid");
    match model.options.method {
        Method::Events => carom_events::simulation(model, initial).expect("it can be done"),
        _ => Simulation::new(model, initial),
    }
}

fn advance(s: &mut Simulation, steps: u64) -> Option<Outcome> {
    let recording = Recording {
        frame_every: 1,
        contacts: true,
    };
    s.advance(steps, recording, Duration::from_secs(600))
}

/// A run in so many reports.
fn run(input: &ModelInput, until: f64, reports: u64) -> Simulation {
    let mut s = begin(input, options(until / reports as f64));
    let outcome = advance(&mut s, reports);
    assert!(outcome.is_none(), "{outcome:?}");
    s
}

fn near(a: DVec3, b: DVec3, bound: f64) {
    assert!(
        (a - b).length() <= bound,
        "{a} and {b} differ by {:e}",
        (a - b).length()
    );
}
