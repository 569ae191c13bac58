//! Islands by their convex companion ([`companion`]), linearised where the normals have turned.

use super::{Island, Newton};
use crate::companion;
use crate::report::SolveReport;
use crate::rows::{RowSystem, Subproblem};

/// What a linear problem may miss of the measures, over their size (1). At velocity level it misses nothing; larger, and positions keep the
/// overlaps that turning normals leave.
const TURNED: f64 = 1e-9;
/// Closing over the largest measure without forces (1) that no tolerance excuses. Larger: a ball in a rough corner, where no velocity is as Newton's
/// law asks, rebounds by sigma. Smaller: what tolerances leave.
const CLOSING: f64 = 1e-3;

/// Largest difference of two lists.
fn apart(one: &[f64], other: &[f64]) -> f64 {
    let pairs = one.iter().zip(other);
    pairs.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

impl Newton {
    /// The companion.
    pub(super) fn companion<P: Subproblem>(
        &mut self,
        on: &mut Island<P>,
        most: u32,
        x: &mut [f64],
    ) -> SolveReport {
        let mut total = SolveReport::default();
        self.set_penalty(on.system, on.options.penalty_scale);
        let rows = on.system.rows();
        let Some(friction) = on.options.beside.companion else {
            return total;
        };
        let (mut closes, mut settled) = (false, true);
        self.evaluate(on, x);
        for _ in 0..most {
            let free = on.system.free(&self.at.z, &x[rows..]);
            let Some(size) = self.solve_companion(on, friction, x) else {
                return total;
            };
            // Of the linear problem.
            let expected = on.system.with_multipliers(&free, &x[rows..]);
            total.iterations += 1;
            let terms = self.evaluate(on, x);
            total.residual = on.relative(&terms);
            self.history.push(total.residual);
            closes = self.closes(on.system, size);
            let mut missed = apart(&expected, &self.at.z);
            if on.system.has_load() {
                // Loads were those of the round before.
                let by_loads = apart(&free, &on.system.free(&self.at.z, &x[rows..]));
                settled = by_loads <= on.options.tolerance * size;
                missed = missed.max(by_loads);
            }
            if missed <= TURNED * size {
                break;
            }
        }
        // What slides moves apart: the multipliers are those found, not what Coulomb's law would make of them.
        let lambda = &x[..rows];
        self.at.phi.copy_from_slice(lambda);
        for (slot, status) in self.at.statuses.iter_mut().enumerate() {
            *status = companion::status(on.system, slot, lambda);
        }
        total.converged = settled && !closes && self.gaps_closed(on.system, on.options, friction);
        total
    }

    /// Whether measures contradict one another: then forces without bound make the relative residual as small as one likes, and contacts close all
    /// the same. `size`: the largest measure without forces.
    fn closes(&self, system: &RowSystem, size: f64) -> bool {
        let mut contacts = system.contacts.iter().filter(|c| !c.bilateral);
        contacts.any(|c| self.at.z[c.row as usize] < -CLOSING * size)
    }

    /// Solves the companion linearised at `x`, where all is evaluated; the largest measure without forces.
    fn solve_companion<P>(&mut self, on: &Island<P>, friction: f64, x: &mut [f64]) -> Option<f64> {
        let (lambda, u) = x.split_at_mut(on.system.rows());
        let free = on.system.free(&self.at.z, u);
        let size = free.iter().fold(0.0f64, |most, q| most.max(q.abs()));
        let solved = companion::solve(on.system, &free, friction, lambda);
        on.system.correction(lambda, u);
        solved.then_some(size)
    }
}
