//! Islands as a sequence of linear cone problems, each solved by `hybrid`. At the velocity level one is enough; at the position level what
//! is left of the gaps and the turning of the normals shrinks with every one.

use super::{Island, Newton};
use crate::report::SolveReport;
use crate::rows::Subproblem;

/// Tolerance of a linear problem relative to that of the island, and how far it may be tightened.
const LINEAR_SHARE: f64 = 0.1;
const TIGHTER: f64 = 1e-2;
const LEAST_TOLERANCE: f64 = 1e-12;
/// Roundings of a coordinate that the gaps of a linear problem may keep.
const LINEAR_ROUNDINGS: f64 = 4.0;
/// Share of the residual below which a linear problem was worth it.
const GAIN: f64 = 0.5;
impl Newton {
    pub(super) fn linearise<P: Subproblem>(
        &mut self,
        on: &mut Island<P>,
        most: u32,
        x: &mut [f64],
    ) -> SolveReport {
        let (options, large) = (on.options, on.is_large());
        let mut total = SolveReport::default();
        self.set_penalty(on.system, options.penalty_scale);
        let mut tolerance = LINEAR_SHARE * options.tolerance;
        let mut rounding = LINEAR_ROUNDINGS * options.rounding;
        let (mut before, mut exact) = (f64::INFINITY, true);
        for _ in 0..most {
            let terms = self.evaluate(on, x);
            total.residual = on.relative(&terms);
            self.history.push(total.residual);
            if !terms.residual.is_finite() {
                break;
            }
            // Gaps of large islands are a target here, no condition: in a tight one they may contradict one another by rounding.
            let solved = total.residual < options.tolerance;
            let closed = self.gaps_closed(on.system, options);
            if solved && (!exact || closed) {
                total.converged = large || closed;
                break;
            }
            if total.residual > GAIN * before {
                // The linear problem was solved as well as it can be, or will be: another one would be the same.
                if !exact || tolerance < LEAST_TOLERANCE {
                    total.converged = solved && (large || closed);
                    break;
                }
                tolerance *= TIGHTER;
                rounding *= TIGHTER;
            }
            before = total.residual;
            let report = self
                .hybrid
                .solve(on.system, &self.at.z, [tolerance, rounding], x);
            exact = report.converged;
            total.iterations += report.iterations;
            total.fallback |= report.fallback;
        }
        total
    }
}
