//! Islands as a sequence of linear cone problems, each solved by `hybrid`. At the velocity level one is enough; at the position level what
//! is left of the gaps and the turning of the normals shrinks with every one. Loads that depend on the motion are those of the round before. Large
//! islands are swept (`swept`), and linearised again as they are.

use super::{Island, Newton};
use crate::cone::{self, Status, MAX_ROWS};
use crate::report::SolveReport;
use crate::rows::{RowContact, Subproblem};
use crate::spheres::momentum;

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
/// Sweeps (1) between two looks at most, each of which states the problem anew. Many: normals have turned long before. Few: momentum is lost with
/// each statement, and positions of heaps do not converge (measured with 16).
const BETWEEN: u32 = 64;
/// The same at least, where the residual is met and the worst contact is not. Speed alone: a look costs as much as some sweeps.
const LEAST_BETWEEN: u32 = 8;
/// Change in a sweep over the multipliers (1), in parts of the tolerance, from which on a look is worth while. Speed alone.
const LIKELY: f64 = 0.5;
/// Sweeps (1) in which the residual has to come down to [`GAIN`] times what it was. Small, other ways solve what sweeps would have; large, what
/// they cannot solve costs as many.
const PATIENCE: u32 = 400;
/// Overlap over the radius that swept positions may keep, in parts of the tolerance: as in piles. Larger: the norm of all hides the worst contact.
const OVERLAP: f64 = 0.9;
/// What loads may give back of a change of velocities (1, [`crate::rows::RowSystem::load_feedback`]). At 1 the loads of the look before diverge.
const MOST_FEEDBACK: f64 = 0.5;

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
            let closed = self.are_closed(on.system, options, 0.0);
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

    /// Sweeps, and linearises anew at each look. Nothing: loads follow the motion too closely to be those of the look before.
    pub(super) fn sweep<P: Subproblem>(
        &mut self,
        on: &mut Island<P>,
        most: u32,
        x: &mut [f64],
    ) -> Option<SolveReport> {
        let mut sweeps = std::mem::take(&mut self.row_sweeps);
        let mut total = SolveReport::default();
        self.set_penalty(on.system, on.options.penalty_scale);
        let (mut done, mut since, mut before) = (0, 0, f64::INFINITY);
        // Normals of positions turn, and momentum would lead astray. Measures of velocities change by loads alone, and along normals half-way.
        let turns = on.options.gap_tolerance.is_finite();
        sweeps.begin(on.system);
        loop {
            let terms = self.evaluate(on, x);
            if done == 0 && on.system.load_feedback() > MOST_FEEDBACK {
                self.row_sweeps = sweeps;
                return None;
            }
            total.residual = on.relative(&terms);
            self.history.push(total.residual);
            total.converged = total.residual < on.options.tolerance && self.nearly_closed(on);
            if total.converged || !terms.residual.is_finite() || done >= most {
                break;
            }
            if total.residual <= GAIN * before {
                (since, before) = (0, total.residual);
            } else if since >= PATIENCE {
                break;
            }
            let (lambda, u) = x.split_at_mut(on.system.rows());
            if done == 0 || turns {
                sweeps.restart();
                sweeps.open(on.system, &self.at.z, lambda, u);
            } else {
                sweeps.measure(on.system, &self.at.z, u);
            }
            let enough = LIKELY * on.options.tolerance;
            let cap = momentum(done as usize);
            // What a sweep changes tells of the residual, and not of the worst contact.
            let least = if total.residual < on.options.tolerance {
                LEAST_BETWEEN
            } else {
                1
            };
            let calm = (1..=BETWEEN).find(|&k| sweeps.once(cap) <= enough * enough && k >= least);
            let count = calm.unwrap_or(BETWEEN);
            sweeps.write(&on.system.contacts, lambda);
            on.system.correction(lambda, u);
            total.iterations += 1;
            done += count;
            since += count;
        }
        self.row_sweeps = sweeps;
        let (lambda, u) = x.split_at_mut(on.system.rows());
        if done == 0 {
            lambda.copy_from_slice(&self.at.phi);
            on.system.correction(lambda, u);
            return Some(total);
        }
        // Sweeps leave multipliers in their cones: these are the solution, and not what a step further would make of them.
        self.at.phi.copy_from_slice(lambda);
        for (c, status) in on.system.contacts.iter().zip(&mut self.at.statuses) {
            let own = &lambda[c.rows()];
            if own[0] <= 0.0 {
                *status = Status::Gap;
            } else if *status == Status::Gap {
                let mut same = [0.0; MAX_ROWS];
                *status = cone::project(&c.bounds, own, &mut same[..own.len()]);
            }
        }
        Some(total)
    }

    /// Whether no contact overlaps by more than a pile may, where gaps are asked for, or closes faster than it may.
    fn nearly_closed<P>(&self, on: &Island<P>) -> bool {
        let most = OVERLAP * on.options.tolerance;
        let closed = |c: &RowContact| self.at.z[c.row as usize] >= -most * c.length;
        self.none_closes(on.system, on.options)
            && (on.options.gap_tolerance.is_infinite() || on.system.contacts.iter().all(closed))
    }
}
