//! Islands as a sequence of linear cone problems, each solved by `hybrid`. At the velocity level one is enough; at the position level what
//! is left of the gaps and the turning of the normals shrinks with every one. Loads that depend on the motion are those of the round before. Large
//! islands are swept (`swept`), and linearised again as they are.

use super::swept::RowSweeps;
use super::{Island, Newton, GAP_ROUNDINGS};
use crate::cone::{self, Status, MAX_ROWS};
use crate::ladder::SWEEPS;
use crate::report::SolveReport;
use crate::rows::{RowContact, RowSystem, Subproblem};
use crate::spheres::momentum_cap;

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
/// Tolerance of alternating directions over that of the round before (1). At 1, rounds in which the worst contact alone misses repeat one another;
/// small, iterations that nobody needs.
const NEXT_ROUND: f64 = 0.5;
/// Sweeps (1) between two looks at most, each of which states positions anew. Many: normals have turned long before. Few: momentum is lost with
/// each statement, and positions of heaps do not converge (measured with 16).
const BETWEEN: u32 = 64;
/// The same at least, where the residual is met and the worst contact is not. Speed alone: a look costs as much as some sweeps.
const LEAST_BETWEEN: u32 = 8;
/// Change in a sweep over the multipliers (1), in parts of the tolerance, from which on a look is worth while. Speed alone.
const LIKELY: f64 = 0.5;
/// Sweeps (1) in which the residual, and what the worst contact misses, has to come down to [`GAIN`] times what it was. Small, other ways solve what
/// sweeps would have; large, what they cannot solve costs as many.
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
        let (mut before, mut exact, mut finer) = (f64::INFINITY, true, false);
        for _ in 0..most {
            let terms = self.evaluate(on, x);
            total.residual = on.relative(&terms);
            self.history.push(total.residual);
            if !terms.residual.is_finite() {
                break;
            }
            // Gaps of large islands are a target here, no condition: in a tight one they may contradict one another by rounding. So is what closes,
            // for one finer problem.
            let solved = total.residual < options.tolerance && !terms.ran_away();
            let closed = self.gaps_closed(on.system, options, 0.0);
            let rests = finer || self.none_closes(on.system, options);
            if solved && (!exact || (closed && rests)) {
                total.converged = large || closed;
                break;
            }
            if total.residual > GAIN * before {
                // The linear problem was solved as well as it can be, or will be: another one would be the same.
                if !exact || tolerance < LEAST_TOLERANCE {
                    total.converged = solved && (large || closed);
                    break;
                }
                finer = true;
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

    /// Alternating directions on the problem linearised where it is, then sweeps, in turn; more finely each time, where the worst contact is what
    /// misses. Nothing where sweeps say so.
    pub(super) fn split<P: Subproblem>(
        &mut self,
        on: &mut Island<P>,
        rounds: u32,
        x: &mut [f64],
    ) -> Option<SolveReport> {
        let mut total = SolveReport::default();
        let mut tolerance = on.options.tolerance;
        for _ in 0..rounds {
            self.evaluate(on, x);
            self.hybrid.split(on.system, &self.at.z, tolerance, x);
            let swept = self.sweep(on, SWEEPS, x)?;
            total.add(&swept);
            if total.converged || !total.residual.is_finite() {
                break;
            }
            tolerance *= NEXT_ROUND;
        }
        Some(total)
    }

    /// Sweeps, and linearises anew at each look. Nothing: loads follow the motion too closely to be those of the look before.
    pub(super) fn sweep<P: Subproblem>(
        &mut self,
        on: &mut Island<P>,
        most: u32,
        x: &mut [f64],
    ) -> Option<SolveReport> {
        let mut sweeps = std::mem::take(&mut self.row_sweeps);
        let found = self.sweep_with(&mut sweeps, on, most, x);
        self.row_sweeps = sweeps;
        found
    }

    fn sweep_with<P: Subproblem>(
        &mut self,
        sweeps: &mut RowSweeps,
        on: &mut Island<P>,
        most: u32,
        x: &mut [f64],
    ) -> Option<SolveReport> {
        let mut total = SolveReport::default();
        self.set_penalty(on.system, on.options.penalty_scale);
        let (mut done, mut since, mut before) = (0, 0, f64::INFINITY);
        // Normals of positions turn, and momentum would lead astray. Measures of velocities change with loads, and where they have rows of their own.
        let turns = on.options.gap_tolerance.is_finite();
        loop {
            let terms = self.evaluate(on, x);
            if done == 0 && on.system.load_feedback() > MOST_FEEDBACK {
                return None;
            }
            total.residual = on.relative(&terms);
            self.history.push(total.residual);
            let missed = (total.residual / on.options.tolerance).max(self.missed(on));
            total.converged = total.residual < on.options.tolerance && missed < 1.0;
            if total.converged || !terms.residual.is_finite() || done >= most {
                break;
            }
            if missed <= GAIN * before {
                (since, before) = (0, missed);
            } else if since >= PATIENCE {
                break;
            }
            let (lambda, u) = x.split_at_mut(on.system.rows());
            if done == 0 {
                sweeps.begin(on.system);
            }
            if done == 0 || turns {
                sweeps.restart();
                sweeps.open(on.system, &self.at.z, lambda, u).ok()?;
            } else {
                sweeps.measure(on.system, &self.at.z, u);
            }
            let enough = LIKELY * on.options.tolerance;
            let cap = momentum_cap(done as usize);
            // What a sweep changes tells of the residual, and not of the worst contact.
            let least = match total.residual < on.options.tolerance {
                true if turns => BETWEEN,
                true => LEAST_BETWEEN,
                false => 1,
            };
            let calm = (1..=BETWEEN).find(|&k| sweeps.once(cap) <= enough * enough && k >= least);
            let count = calm.unwrap_or(BETWEEN);
            sweeps.write(&on.system.contacts, lambda);
            on.system.correction(lambda, u);
            total.iterations += 1;
            done += count;
            since += count;
        }
        let (lambda, u) = x.split_at_mut(on.system.rows());
        if done == 0 {
            lambda.copy_from_slice(&self.at.phi);
            if on.system.contacts.iter().any(|c| c.bilateral) {
                // Contacts that come into their cones move what joints hold.
                sweeps.begin(on.system);
                sweeps.open(on.system, &self.at.z, lambda, u).ok()?;
                sweeps.hold(lambda).ok()?;
                self.at.phi.copy_from_slice(lambda);
            }
            on.system.correction(lambda, u);
            return Some(total);
        }
        self.take_swept(on.system, lambda);
        Some(total)
    }

    /// Sweeps leave multipliers in their cones: these are the solution, and not what a step further would make of them.
    fn take_swept(&mut self, system: &RowSystem, lambda: &[f64]) {
        self.at.phi.copy_from_slice(lambda);
        let contacts = system.contacts.iter().zip(&mut self.at.statuses);
        for (c, status) in contacts.filter(|(c, _)| !c.bilateral) {
            let own = &lambda[c.rows()];
            if own[0] <= 0.0 {
                *status = Status::Gap;
            } else if *status == Status::Gap {
                let mut same = [0.0; MAX_ROWS];
                *status = cone::project(&c.bounds, own, &mut same[..own.len()]);
            }
        }
    }

    /// What the worst contact overlaps by, and the worst joint is open by, over what they may, where gaps are asked for; else what they close or open by (1).
    fn missed<P>(&self, on: &Island<P>) -> f64 {
        let options = on.options;
        let turns = options.gap_tolerance.is_finite();
        let of = |c: &RowContact| {
            if c.bilateral {
                let rows = c.row as usize..(c.row + c.translational) as usize;
                let open = self.at.z[rows]
                    .iter()
                    .fold(0.0, |most: f64, z| most.max(z.abs()));
                let tolerance = options.gap_tolerance * c.length + GAP_ROUNDINGS * options.rounding;
                return open / if turns { tolerance } else { options.closing };
            }
            let overlap = OVERLAP * options.tolerance * c.length;
            -self.at.z[c.row as usize] / if turns { overlap } else { options.closing }
        };
        on.system.contacts.iter().map(of).fold(0.0, f64::max)
    }
}
