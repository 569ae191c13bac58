//! Path following on the convex problem beside Coulomb's law.
//!
//! Without the slip shift the problem of the parent module is that of least kinetic energy over all forces in the cones. Where some of
//! them leave no velocity at all, it finds such ones, and since nothing slips then, they solve Coulomb's law too (Acary, Cadoux, Lemarechal
//! and Malick, ZAMM 91, 155, 2011). That law may have other
//! solutions, which move; sweeps and Newton find those where they come upon them first.
//!
//! Where something slips, the solution differs from Coulomb's in one thing: sliders move apart with mu times their slip.

use super::{norm, InteriorPoint, SHARE, SHIFT};
use crate::problem::Problem;

/// Iterations (1) at most; some tens are usual.
const MAX_ITERATIONS: u32 = 60;
/// Complementarity over the square of the velocities (1) at which nothing holds (the eigenvalues of a scaled W are some tens at
/// most). Larger, what could be held is let go; 0, each answer "no" takes all iterations.
const DECIDED: f64 = 1e-3;
/// What the equations may then miss over the velocities (1).
const EQUATIONS: f64 = 1e-3;
/// What the equations of a companion may miss over the loads, and its mean complementarity over the largest force (1). Larger: contacts
/// that part keep forces. Smaller: below rounding.
const SOLVED: f64 = 1e-11;
/// The same where rounding keeps the path from it (1). Larger: the rung fails less often, and leaves more.
const SOLVED_AT_WORST: f64 = 1e-6;
/// Scaled forces (1) that are no longer those of the loads: larger ones wedge, and hold anything.
const RUNAWAY: f64 = 1e6;

impl InteriorPoint {
    /// Looks for forces inside of all cones with `|W r + q| <= tolerance |q|`, or as little as there can be up to `enough`; the problem
    /// is a scaled one ([`crate::problem::Scaled`]).
    pub fn hold(&mut self, problem: &Problem, tolerance: f64, enough: f64) -> Option<Vec<f64>> {
        self.begin_convex(problem);
        let (left, best) = self.follow(problem, tolerance);
        (left <= enough && norm(&best) <= RUNAWAY).then_some(best)
    }

    /// The forces that minimise `1/2 r.W r + q.r` over all cones; W of a scaled problem must be definite. Nothing: rounding kept the path from it.
    pub fn companion(&mut self, problem: &Problem) -> Option<Vec<f64>> {
        self.begin_convex(problem);
        let loads = norm(&problem.q);
        let (mut least, mut best) = (f64::INFINITY, Vec::new());
        for _ in 0..MAX_ITERATIONS {
            let gap = self.gap();
            self.residuals(problem);
            let largest = self.y.iter().fold(1.0f64, |most, y| most.max(y.abs()));
            let left = (norm(&self.dual_residual) / loads).max(gap / largest);
            if left < least {
                (least, best) = (left, self.y.clone());
            }
            if least <= SOLVED || !self.improve(problem, gap) {
                break;
            }
        }
        (least <= SOLVED_AT_WORST).then_some(best)
    }

    fn begin_convex(&mut self, problem: &Problem) {
        self.convex = true;
        self.begin(problem);
        self.convex = false;
    }

    /// The least velocity found, over that of the loads, and its forces.
    fn follow(&mut self, problem: &Problem, tolerance: f64) -> (f64, Vec<f64>) {
        let loads = norm(&problem.q);
        let (mut least, mut best) = (f64::INFINITY, self.y.clone());
        for _ in 0..MAX_ITERATIONS {
            let gap = self.gap();
            self.residuals(problem);
            let moving = norm(&self.u);
            if moving < least * loads {
                least = moving / loads;
                best.copy_from_slice(&self.y);
            }
            let all = gap * self.cones.len() as f64;
            let decided =
                all < DECIDED * moving * moving && norm(&self.dual_residual) < EQUATIONS * moving;
            if least <= tolerance || decided || !self.improve(problem, gap) {
                break;
            }
        }
        (least, best)
    }

    /// One step with predictor and corrector. False: there is none.
    fn improve(&mut self, problem: &Problem, gap: f64) -> bool {
        if !self.factor(problem, SHIFT) || !self.solve(0.0, false) {
            return false;
        }
        let after = self.gap_after(self.longest().min(1.0));
        let centering = (after / gap).powi(3).clamp(0.0, 1.0);
        if !self.solve(centering * gap, true) {
            return false;
        }
        self.take((SHARE * self.longest()).min(1.0));
        true
    }
}
