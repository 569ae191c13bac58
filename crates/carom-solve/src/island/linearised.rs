//! Islands as a sequence of linear cone problems, each solved by `hybrid`. At the velocity level one is enough; at the position level what
//! is left of the gaps and the turning of the normals shrinks with every one. Loads that depend on the motion are those of the round before.

use super::{Island, Newton};
use crate::report::SolveReport;
use crate::rows::Subproblem;

/// Tolerance of a linear problem over that of the island (1). With 1 the island just misses its tolerance, and another linear
/// problem is needed; small, sweeps that nobody needs.
const LINEAR_SHARE: f64 = 0.1;
/// Factor (1) on the tolerance and the roundings where a solved linear problem left the island unsolved.
const TIGHTER: f64 = 1e-2;
/// Relative residual (1) below which no linear problem is asked for: rounding. Smaller, islands end unconverged after solves
/// that could not do better.
const LEAST_TOLERANCE: f64 = 1e-12;
/// Roundings of a coordinate (1) that the gaps of a linear problem may keep: fewer than [`super::GAP_ROUNDINGS`], which judges
/// the island.
const LINEAR_ROUNDINGS: f64 = 4.0;
/// Share (1) of the last residual below which a linear problem was worth another one. Near 1, rounds without progress; near 0,
/// good ones are thrown away.
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
            let closed = self.gaps_closed(on.system, options, 0.0);
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
