//! What a solve tells about itself.

/// Which rung of the chain (rule R1) ended a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rung {
    /// Newton from the given start.
    #[default]
    First,
    /// Newton again with half the penalty.
    HalfPenalty,
    /// Newton again with twice the penalty.
    DoublePenalty,
    /// Newton after Gauss-Seidel sweeps.
    AfterSweeps,
    /// The linearised problem by the solvers of large islands: path following, or what comes after it.
    Path,
}

/// Counts and quality of one solve of one island.
#[derive(Clone, Copy, Debug, Default)]
pub struct SolveReport {
    pub converged: bool,
    /// Newton iterations (linear solves) over all rungs; 1 for a closed form.
    pub iterations: u32,
    /// Reductions of the step length over all iterations.
    pub line_search: u32,
    /// `|r| / (sum |r_k| + floor/tol)` of eq. 44 at the end.
    pub residual: f64,
    /// The rung that ended the solve.
    pub rung: Rung,
}

impl SolveReport {
    /// Adds what one rung did; quality and rung are those of the latest.
    pub(crate) fn add(&mut self, later: &SolveReport, rung: Rung) {
        self.iterations += later.iterations;
        self.line_search += later.line_search;
        self.residual = later.residual;
        self.converged = later.converged;
        self.rung = rung;
    }

    /// A closed-form solution: exact, one evaluation.
    pub const CLOSED_FORM: Self = SolveReport {
        converged: true,
        iterations: 1,
        line_search: 0,
        residual: 0.0,
        rung: Rung::First,
    };
}
