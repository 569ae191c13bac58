//! Problems without a solution: the chain of fallbacks ends where it brings nothing any more. Absurd scenes with joints once
//! took 5 s a step, nearly all of it in sweeps that went round in circles or went on with what was no number.

mod common;

use carom_solve::rows::{RowSystem, Subproblem, WORLD};
use common::{sharp, solve};

/// A body held by rows `z_k(x)`, with their slopes, along the first axis; counts how often it is asked.
struct Held<F> {
    measures: F,
    asked: u32,
}

impl<F: Fn(f64) -> Vec<(f64, f64)>> Subproblem for Held<F> {
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]) {
        self.asked += 1;
        for (row, (value, slope)) in (self.measures)(u[0]).into_iter().enumerate() {
            z[row] = value;
            system.jac[row][0][0] = slope;
        }
    }
}

/// Evaluations that a problem takes.
fn asked(measures: impl Fn(f64) -> Vec<(f64, f64)>) -> u32 {
    let mut system = RowSystem::default();
    let node = system.push_node(1.0, 0.4, 1.0);
    for (value, _) in measures(0.0) {
        let mut row = [[0.0; 6]; 2];
        row[0][0] = 1.0;
        system.push_joint((node, WORLD), 1, 1.0, &[row], &[value]);
    }
    let mut problem = Held { measures, asked: 0 };
    let solved = solve(&mut system, &mut problem, &sharp());
    assert!(!solved.report.converged, "{:?}", solved.report);
    println!("{} evaluations, {:?}", problem.asked, solved.report);
    problem.asked
}

#[test]
fn rows_that_contradict_one_another_are_given_up_soon() {
    // x = 1 and x = -1: sweeps leave the same residual for ever.
    assert!(asked(|x| vec![(x - 1.0, 1.0), (x + 1.0, 1.0)]) < 10_000);
}

#[test]
fn what_runs_away_is_given_up_too() {
    // No root; sweeps with the slope of the start run away to what is no number.
    assert!(asked(|x| vec![(1.0 + 100.0 * x * x, 200.0 * x)]) < 10_000);
}
