//! Large islands: linearise, solve the linear cone problem by [`Auto`], move, and look again.

use crate::problem::Problem;
use crate::report::SolveReport;
use crate::rows::{RowSystem, NODE_DOF};
use crate::solver::{Auto, Settings};

/// Contact updates, and sweeps, that one linear problem may cost: some tenths of a second.
const SWEEP_BUDGET: u64 = 4_000_000;
const MAX_SWEEPS: u64 = 6_000;

/// Workspace.
#[derive(Default)]
pub(crate) struct Hybrid {
    auto: Auto,
    problem: Problem,
    q: Vec<f64>,
    force: Vec<f64>,
}

impl Hybrid {
    /// Solves the problem linearised at `u`, where the measures are `z`; `lambda` is start and result, `u = M^-1 G^T lambda`.
    /// The residual of the report is the `err` of the linear problem. `rounding` is the error of one measure: what it explains
    /// of `err` is solved too.
    pub fn solve(
        &mut self,
        system: &RowSystem,
        z: &[f64],
        [tolerance, rounding]: [f64; 2],
        lambda: &mut [f64],
        u: &mut [f64],
    ) -> SolveReport {
        self.q.clear();
        self.q.extend_from_slice(z);
        for c in &system.contacts {
            for row in c.row as usize..(c.row + c.dim) as usize {
                self.q[row] -= system.row_velocity(c, row, u);
            }
        }
        self.problem.fill_rows(system, &self.q);
        let contacts = system.contacts.len() as u64;
        self.auto.sweep_budget = Some(SWEEP_BUDGET.min(MAX_SWEEPS * contacts));
        let size = self.q.iter().map(|q| q * q).sum::<f64>().sqrt();
        let explained = if size > 0.0 {
            rounding * (contacts as f64).sqrt() / size
        } else {
            0.0
        };
        let settings = Settings {
            tolerance: tolerance.max(explained),
            ..Settings::default()
        };
        let outcome = crate::solver::solve(&self.problem, &mut self.auto, settings, lambda);
        self.force.clear();
        self.force.resize(NODE_DOF * system.nodes(), 0.0);
        system.impulses(lambda, &mut self.force);
        system.apply_inverse_mass(&self.force, u);
        let factorised = ["newton", "interior-point"];
        let stages = || outcome.stages.iter();
        SolveReport {
            converged: outcome.converged,
            iterations: stages()
                .filter(|s| factorised.contains(&s.solver))
                .map(|s| s.iterations)
                .sum(),
            residual: outcome.err,
            fallback: stages().any(|s| s.solver == "interior-point"),
            ..SolveReport::default()
        }
    }
}
