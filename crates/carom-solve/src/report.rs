//! What a solve tells about itself.

use crate::ladder::{self, Attempt};

/// Counts and quality of one solve of one island.
#[derive(Clone, Copy, Debug, Default)]
pub struct SolveReport {
    pub converged: bool,
    /// Newton iterations (linear solves) and looks between sweeps over all rungs; 1 for a closed form.
    pub iterations: u32,
    /// Reductions of the step length over all iterations.
    pub line_search: u32,
    /// `|r| / (sum |r_k| + floor/tol)` of eq. 44 at the end.
    pub residual: f64,
    /// The rung of the ladder that ended the solve.
    pub rung: &'static str,
    /// It is not the first that was tried, or that took path following.
    pub fallback: bool,
}

impl SolveReport {
    /// Adds what a later rung did; its quality counts.
    pub(crate) fn add(&mut self, later: &SolveReport) {
        self.iterations += later.iterations;
        self.line_search += later.line_search;
        self.residual = later.residual;
        self.converged = later.converged;
        self.rung = later.rung;
        self.fallback |= later.fallback;
    }

    /// As one attempt.
    pub fn attempt(&self) -> Attempt {
        Attempt {
            rung: self.rung,
            iterations: self.iterations,
            residual: self.residual,
            converged: self.converged,
        }
    }

    /// A closed-form solution: exact, one evaluation.
    pub const CLOSED_FORM: Self = SolveReport {
        converged: true,
        iterations: 1,
        line_search: 0,
        residual: 0.0,
        rung: ladder::CLOSED_FORM,
        fallback: false,
    };
}
