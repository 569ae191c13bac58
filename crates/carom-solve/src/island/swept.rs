//! Rounds of sweeps over the rows of an island, each with a short run of Newton's method after it.

use super::{Island, Newton};
use crate::report::SolveReport;
use crate::rows::Subproblem;

/// Contact updates that the sweeps of one solve may cost, some tenths of a second; see [`super::hybrid`] for wrong values.
const SWEEP_BUDGET: u32 = 400_000;
/// Doublings (1) of the sweeps of a round.
const MAX_DOUBLINGS: u32 = 9;
/// Sweeps go on while they bring something: where the residual of what they leave has not fallen to this share (1) of its least
/// in so many rounds, thus in some sixteen times the sweeps, nothing better comes of them. Rows of joints, and gaps, that
/// contradict one another leave it where it is, or let it run away.
const STALE_SHARE: f64 = 0.5;
/// These rounds (1). Few, jams give up that would have come loose; many, time in a step that is halved anyway.
const STALE_ROUNDS: u32 = 4;

impl Newton {
    /// Gauss-Seidel sweeps, twice as many in each round, and a short Newton polish after each. Where Newton alternates between
    /// statuses of redundant contacts, sweeps find a consistent set in the end.
    pub(super) fn sweep_and_polish<P: Subproblem>(
        &mut self,
        on: &mut Island<P>,
        [rounds, polish]: [u32; 2],
        x: &mut [f64],
    ) -> SolveReport {
        let mut total = SolveReport::default();
        let mut swept = self.start.clone();
        let sweeps = on.options.sweeps;
        let mut budget = (SWEEP_BUDGET / on.system.contacts.len().max(1) as u32).max(sweeps);
        let (mut least, mut stale) = (f64::INFINITY, 0);
        for round in 0..rounds {
            let count = (sweeps << round.min(MAX_DOUBLINGS)).min(budget);
            if count == 0 {
                break;
            }
            budget -= count;
            let mut left = count;
            while left > 0 {
                let some = left.min(sweeps);
                self.sweep(on, some, &mut swept);
                left -= some;
            }
            x.copy_from_slice(&swept);
            let report = self.iterate(on, 1.0, polish, x);
            total.add(&report);
            if report.converged {
                break;
            }
            if self.began < STALE_SHARE * least {
                (least, stale) = (self.began, 0);
                continue;
            }
            stale += 1;
            if stale == STALE_ROUNDS {
                break;
            }
        }
        total
    }

    /// Sweeps over the problem linearised at `x`, momentum balanced before and after: normals may have turned, and loads changed.
    fn sweep<P: Subproblem>(&mut self, on: &mut Island<P>, count: u32, x: &mut [f64]) {
        let (system, z) = (&mut *on.system, &mut self.at.z);
        let (lambda, u) = x.split_at_mut(system.rows());
        on.problem.evaluate(system, u, z);
        system.momentum(lambda, &mut self.force);
        system.apply_inverse_mass(&self.force, u);
        on.problem.evaluate(system, u, z);
        self.hybrid.sweep(system, z, count, lambda);
        system.momentum(lambda, &mut self.force);
        system.apply_inverse_mass(&self.force, u);
    }
}
