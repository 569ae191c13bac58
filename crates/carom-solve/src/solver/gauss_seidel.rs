//! Block Gauss-Seidel: contact after contact, each solved exactly with the others held.

use super::sweep::Sweeps;
use super::{ConeSolver, Judge};

/// Sweeps of a run that is not bounded otherwise.
const MAX_SWEEPS: u32 = 100_000;
/// Sweeps after which the residual is looked at, at first, and then every so many: a look costs one or two sweeps.
const LOOK_AFTER: [u32; 3] = [1, 2, 3];
const LOOK_EVERY: u32 = 10;

/// See the module.
#[derive(Default)]
pub struct GaussSeidel {
    y: Vec<f64>,
    /// The problem of this judge, packed: the next run of the same solve needs it again.
    packed: Option<(u64, Sweeps)>,
}

impl ConeSolver for GaussSeidel {
    fn name(&self) -> &'static str {
        "gauss-seidel"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        let (clock, threads) = (judge.clock(), judge.threads());
        self.y.clone_from(&judge.best);
        let mut sweeps = match self.packed.take() {
            Some((solve, sweeps)) if solve == judge.number() => sweeps,
            _ => Sweeps::new(&judge.scaled.problem, threads),
        };
        sweeps.enter(&self.y);
        let max = max_iterations.min(MAX_SWEEPS);
        let mut done = 0;
        while done < max {
            let first = LOOK_AFTER.into_iter().find(|&look| look > done);
            let look = first
                .unwrap_or((done / LOOK_EVERY + 1) * LOOK_EVERY)
                .min(max);
            sweeps.sweep(look - done, || clock.late());
            done = look;
            sweeps.leave(&mut self.y);
            let err = judge.see(&self.y);
            if judge.stop() || !err.is_finite() {
                break;
            }
        }
        self.packed = Some((judge.number(), sweeps));
        done
    }
}
