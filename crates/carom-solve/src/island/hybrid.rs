//! One linear cone problem of an island in blocks, solved by [`Auto`] or split.

use crate::problem::Problem;
use crate::report::SolveReport;
use crate::rows::RowSystem;
use crate::solver::{self, Auto, Settings};

/// Contact updates that the sweeps of one linear problem may cost, some tenths of a second; bounds the time of a step in a jam.
/// Small, more fallbacks and halved steps; large, a step that never converges takes long before it is halved.
const SWEEP_BUDGET: u64 = 4_000_000;
/// Sweeps of one linear problem at most, in small islands, for the same reason.
const MAX_SWEEPS: u64 = 6_000;

/// Workspace.
#[derive(Default)]
pub(super) struct Hybrid {
    auto: Auto,
    problem: Problem,
    q: Vec<f64>,
}

impl Hybrid {
    /// Solves the problem linearised at `x`, where the measures are `z`. `rounding` is the error of one measure: what it explains of `err` is
    /// solved too.
    pub fn solve(
        &mut self,
        system: &RowSystem,
        z: &[f64],
        [tolerance, rounding]: [f64; 2],
        x: &mut [f64],
    ) -> SolveReport {
        let (lambda, u) = x.split_at_mut(system.rows());
        self.state(system, z, u);
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
        let outcome = solver::solve(&self.problem, &mut self.auto, settings, lambda);
        system.correction(lambda, u);
        let factorised = ["newton", "interior-point"];
        let stages = outcome.stages.iter();
        let counted = stages.clone().filter(|s| factorised.contains(&s.solver));
        SolveReport {
            converged: outcome.converged,
            iterations: counted.map(|s| s.iterations).sum(),
            fallback: stages.clone().any(|s| s.solver == "interior-point"),
            ..SolveReport::default()
        }
    }

    /// Leaves what alternating directions find of the same problem.
    pub fn split(&mut self, system: &RowSystem, z: &[f64], tolerance: f64, x: &mut [f64]) {
        let (lambda, u) = x.split_at_mut(system.rows());
        self.state(system, z, u);
        solver::split(&self.problem, tolerance, lambda);
        system.correction(lambda, u);
    }

    /// The problem with the measures `z` at the correction `u` of the multipliers.
    fn state(&mut self, system: &RowSystem, z: &[f64], u: &[f64]) {
        self.q = system.free(z, u);
        self.problem.fill_rows(system, &self.q);
    }
}
