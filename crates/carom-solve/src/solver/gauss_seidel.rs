//! Block Gauss-Seidel: contact after contact, each solved exactly with the others held.

use super::{solve_contact, ConeSolver, Judge};
use crate::cone::MAX_ROWS;
use crate::problem::Problem;

/// Sweeps of a run that is not bounded otherwise.
const MAX_SWEEPS: u32 = 100_000;
/// Sweeps between looks at the residual: a look costs about one sweep.
const LOOK_EVERY: u32 = 10;

/// See the module.
#[derive(Default)]
pub struct GaussSeidel {
    y: Vec<f64>,
}

impl ConeSolver for GaussSeidel {
    fn name(&self) -> &'static str {
        "gauss-seidel"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        self.y.clone_from(&judge.best);
        let problem = &judge.scaled.problem;
        let mut y = std::mem::take(&mut self.y);
        let max = max_iterations.min(MAX_SWEEPS);
        let mut done = 0;
        while done < max {
            sweep(problem, &mut y, done % 2 == 1);
            done += 1;
            if done % LOOK_EVERY == 0 || done == max || done < 4 {
                let err = judge.see(&y);
                if judge.stop() || !err.is_finite() {
                    break;
                }
            }
        }
        self.y = y;
        done
    }
}

/// One sweep, forwards or backwards.
pub fn sweep(problem: &Problem, y: &mut [f64], backwards: bool) {
    let count = problem.groups.len();
    for position in 0..count {
        let i = if backwards {
            count - 1 - position
        } else {
            position
        };
        relax(problem, y, i);
    }
}

/// Solves contact `i`.
#[inline]
pub fn relax(problem: &Problem, y: &mut [f64], i: usize) {
    let group = &problem.groups[i];
    let (rows, dim) = (group.rows(), group.dim);
    let mut b = [0.0; MAX_ROWS];
    b[..dim].copy_from_slice(&problem.q[rows.clone()]);
    problem.w.add_row_product(i, y, &mut b[..dim]);
    let block = problem.w.block(i, problem.w.diagonal[i]);
    let mut r = [0.0; MAX_ROWS];
    r[..dim].copy_from_slice(&y[rows.clone()]);
    for (b, row) in b.iter_mut().zip(block.chunks_exact(dim)) {
        for (w, r) in row.iter().zip(&r) {
            *b -= w * r;
        }
    }
    solve_contact(group, block, &b[..dim], &mut r[..dim]);
    y[rows].copy_from_slice(&r[..dim]);
}
