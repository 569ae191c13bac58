//! Method `penalty`: closed forms of one collision, published values of several, friction, order in the substep, bits.

mod collisions;
#[path = "../../../carom-core/tests/common/mod.rs"]
mod common;
mod damping;
mod elastic;
mod friction;
mod running;

use carom_core::options::Method;
use carom_core::{ModelInput, Options, Simulation};
use common::{advance, balls, compile, simulation, R};

fn options(step: f64) -> Options {
    Options {
        step,
        method: Method::Penalty,
        ..Options::default()
    }
}

/// Why a scene is refused.
fn refusal(input: &ModelInput, o: Options) -> Option<String> {
    let made =
        compile(input, o).and_then(|(model, initial)| carom_penalty::simulation(model, initial));
    made.err().map(|e| e.to_string())
}

fn close(a: f64, b: f64, bound: f64) {
    assert!(
        (a - b).abs() <= bound,
        "{a:e} and {b:e} differ by {:e}",
        a - b
    );
}

/// Ball 0 comes along x at `speed` to others at rest, from a gap that is no multiple of anything.
fn line(count: usize, e: f64, speed: f64) -> ModelInput {
    let mut position: Vec<[f64; 3]> = (0..count).map(|i| [2.0 * R * i as f64, 0.0, 0.0]).collect();
    position[0][0] -= 0.01234;
    let mut input = ModelInput {
        laws: vec![(0, 0, [0.0, e, 0.0, 0.0, 0.0])],
        ..balls(&position, &[])
    };
    input.velocity[0][0] = speed;
    input
}

fn run(input: &ModelInput, o: Options, until: f64) -> Simulation {
    let steps = (until / o.step).round() as u64;
    let mut s = simulation(input, o);
    assert!(advance(&mut s, steps).is_none());
    s
}

fn energies(s: &mut Simulation) -> Vec<f64> {
    let block = s.take_block();
    let total = |r: &carom_core::StepReport| r.energy_kinetic + r.energy_potential;
    block.steps.iter().map(total).collect()
}
