//! The hybrid: climbs [`AUTO`].

use super::{Admm, ConeSolver, GaussSeidel, InteriorPoint, Judge, SemiSmoothNewton};
use crate::direct::SparseLlt;
use crate::ladder::{
    Method, When, AUTO, GAIN, MAX_FILL, POLISH, SMALL_ROWS, UNSYMMETRIC, WARM, WORTHWHILE,
};
use crate::problem::Problem;

/// Rows (1) up to which the size of the factors is not asked for: a full matrix has fewer numbers than [`MAX_FILL`]. Only time
/// hangs on it.
const SURELY_SPARSE: usize = 3000;

/// See the module. Keeps what its methods keep: symbolic factorisations of a pattern that stands.
#[derive(Default)]
pub struct Auto {
    /// Contact updates that sweeps may cost in all; nothing is tried after them. None: only time and iterations count.
    pub sweep_budget: Option<u64>,
    swept: u64,
    sweeps: GaussSeidel,
    newton: SemiSmoothNewton,
    interior: InteriorPoint,
    admm: Admm,
}

impl ConeSolver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    /// The stages count for themselves; `max_iterations` is that of the settings.
    fn run(&mut self, judge: &mut Judge<'_>, _: u32) -> u32 {
        self.swept = 0;
        let mut gaining = true;
        let held = judge.source.is_held();
        for rung in &AUTO {
            if judge.stop() {
                break;
            }
            if !self.fits(rung.when, judge, gaining) {
                continue;
            }
            if held && !matches!(rung.way, Method::Newton { .. } | Method::Split) {
                // Sweeps and paths know no least impulse.
                if rung.when == When::Full {
                    break;
                }
                continue;
            }
            let (name, budget) = (rung.name, rung.budget);
            let why = format!("{}, err {:.1e}", rung.why, judge.best_err);
            match rung.way {
                Method::Newton { patience } => {
                    self.newton.patience = patience;
                    judge.stage(name, &mut self.newton, budget, why);
                }
                Method::Sweeps { relaxation, lots } => {
                    self.sweeps.relaxation = relaxation;
                    for _ in 0..lots {
                        let before = judge.best_err;
                        if !self.sweep(judge, name, budget, why.clone()) {
                            return 0;
                        }
                        let worth = judge.best_err <= WORTHWHILE * before;
                        if judge.stop() || !worth || !judge.best_err.is_finite() {
                            break;
                        }
                    }
                }
                Method::Round {
                    relaxation,
                    patience,
                } => {
                    self.sweeps.relaxation = relaxation;
                    let before = judge.best_err;
                    if !self.sweep(judge, name, budget, why) {
                        return 0;
                    }
                    gaining &= judge.best_err <= GAIN * before;
                    if !judge.stop() && (gaining || rung.when != When::Gaining) {
                        self.newton.patience = patience;
                        let why = format!("Newton's quadratic end, err {:.1e}", judge.best_err);
                        judge.stage("polish", &mut self.newton, POLISH, why);
                    }
                }
                Method::Path => {
                    judge.stage(name, &mut self.interior, budget, why);
                }
                Method::Split => {
                    judge.stage(name, &mut self.admm, budget, why);
                }
            }
            if rung.when == When::Full {
                break;
            }
        }
        0
    }
}

impl Auto {
    fn fits(&self, when: When, judge: &Judge, gaining: bool) -> bool {
        let problem = &judge.scaled.problem;
        let bounded = self.sweep_budget.is_some();
        match when {
            When::Always => true,
            When::SmallOrWarm => problem.rows() <= SMALL_ROWS || judge.best_err < WARM,
            When::Full => fill(problem).is_some_and(|fill| fill > MAX_FILL),
            When::Gaining => gaining,
            When::Symmetric => {
                (!bounded || problem.is_held()) && problem.w.asymmetry() <= UNSYMMETRIC
            }
            When::Unbounded => !bounded,
        }
    }

    /// Sweeps within their budget; false where nothing is left of it.
    fn sweep(
        &mut self,
        judge: &mut Judge<'_>,
        name: &'static str,
        count: u32,
        why: String,
    ) -> bool {
        let contacts = judge.source.groups.len().max(1) as u64;
        let mut allowed = u64::from(count);
        if let Some(budget) = self.sweep_budget {
            allowed = allowed.min(budget.saturating_sub(self.swept) / contacts);
        }
        self.swept += allowed * contacts;
        if allowed > 0 {
            judge.stage(name, &mut self.sweeps, allowed as u32, why);
        }
        allowed > 0
    }
}

/// Numbers in the Cholesky factors of W; 0 where they are surely few, nothing where there is no memory for them.
pub(crate) fn fill(problem: &Problem) -> Option<usize> {
    if problem.rows() <= SURELY_SPARSE {
        return Some(0);
    }
    let (col_ptr, row_idx, ..) = super::admm::lower_half(problem);
    let mut plan = SparseLlt::new();
    plan.analyse(problem.rows(), &col_ptr, &row_idx).ok()?;
    plan.fill()
}
