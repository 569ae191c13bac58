//! The hybrid: cheap sweeps first, Newton to finish, and stronger means only where these do not do.

use super::gauss_seidel::RELAXATION;
use super::{Admm, ConeSolver, GaussSeidel, InteriorPoint, Judge, SemiSmoothNewton};
use crate::direct::SparseLlt;
use crate::problem::Problem;

/// The rule in words, checkpoint by checkpoint; the code below does what it says.
pub const RULE: &str = "\
Checkpoints of auto; each starts from the best iterate so far, and the first that reaches the tolerance ends the run. Best is
judged by the larger of two: err, and err of the problem scaled to diagonals of 1 (the reasons name this one).
1  start     up to 96 rows (dense), or a start with err below 1e-3: Newton at once, at most 20 iterations, 12 that do not halve err.
2  sweeps    60 sweeps of Gauss-Seidel (relaxation 1.3), and 60 more while 60 make err 10 times smaller (at most 1200).
   sweeps    only, up to 100 000, where Cholesky factors of W would hold more than 8e6 numbers: the rest would take too long.
3  polish    Newton, at most 30 iterations; it gives up after 8 that do not halve err.
4  rounds    240 sweeps and a polish, 960 sweeps and a polish; skipped on as soon as sweeps do not halve err.
5  path      interior point, from scratch: at most 200 iterations, given up after 40 that do not make err a tenth smaller; then a polish
             that gives up after 12 such iterations.
6  rounds    1000 sweeps (relaxation 1.5) and a polish, then 2000 (1.3), 5000 (1.5), 10 000 (1.3), 30 000 (1.5).
7  split     ADMM, at most 5000 iterations, and a polish; left out where W is unsymmetric by more than 1e-6.
8  last      sweeps until the time is up, at most 100 000. The best iterate is returned with its err, solved or not.";

/// Rows up to which Newton goes first.
const SMALL_ROWS: usize = 96;
const SMALL_ITERATIONS: u32 = 20;
/// Below this err a start is warm.
const WARM: f64 = 1e-3;
const SWEEPS: u32 = 60;
const MAX_LOTS: u32 = 20;
/// Sweeps go on while a lot of them makes err smaller by this factor.
const WORTHWHILE: f64 = 0.1;
const POLISH: u32 = 30;
const QUICK: u32 = 8;
const PATIENT: u32 = 12;
/// Rounds before the path, the gain in sweeps that they need, and rounds after it.
const EARLY: [u32; 2] = [240, 960];
const GAIN: f64 = 0.5;
const LATE: [(u32, f64); 5] = [
    (1000, STRONG),
    (2000, RELAXATION),
    (5000, STRONG),
    (10_000, RELAXATION),
    (30_000, STRONG),
];
/// Relaxation that is faster on most piles at rest, and too much for some others.
const STRONG: f64 = 1.5;
/// Numbers in Cholesky factors of W up to which factorising methods are tried; problems of so few rows are not asked.
const MAX_FILL: usize = 8_000_000;
const SURELY_SPARSE: usize = 3000;
const PATH: u32 = 200;
const SPLIT: u32 = 5000;
const UNSYMMETRIC: f64 = 1e-6;
const LAST: u32 = 100_000;

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
        if !judge.stop() {
            self.checkpoints(judge);
        }
        0
    }
}

impl Auto {
    fn checkpoints(&mut self, judge: &mut Judge<'_>) {
        let rows = judge.source.rows();
        self.swept = 0;
        if rows <= SMALL_ROWS || judge.best_err < WARM {
            let why = if judge.best_err < WARM {
                format!("the start has err {:.1e}", judge.best_err)
            } else {
                format!("{rows} rows: a dense factorisation costs no more than some sweeps")
            };
            self.newton.patience = PATIENT;
            if judge.stage("start", &mut self.newton, SMALL_ITERATIONS, why) {
                return;
            }
        }
        self.sweeps.relaxation = RELAXATION;
        if self.sweep_while_worthwhile(judge) {
            return;
        }
        if let Some(fill) = too_full(&judge.scaled.problem) {
            let why = format!("Cholesky factors of W would hold {fill:.0e} numbers");
            self.sweep(judge, "sweeps", LAST, why);
            return;
        }
        if self.polish(judge, QUICK) {
            return;
        }
        for sweeps in EARLY {
            let before = judge.best_err;
            let why = format!("Newton stalled at {before:.1e}: another start for it");
            if self.sweep(judge, "rounds", sweeps, why) || judge.late() {
                return;
            }
            if judge.best_err > GAIN * before {
                break;
            }
            if self.polish(judge, QUICK) {
                return;
            }
        }
        let why = format!("sweeps and Newton stalled at {:.1e}", judge.best_err);
        if judge.late()
            || judge.stage("path", &mut self.interior, PATH, why)
            || self.polish(judge, PATIENT)
        {
            return;
        }
        for (sweeps, relaxation) in LATE {
            self.sweeps.relaxation = relaxation;
            let why = format!(
                "stalled at {:.1e}: another start for Newton",
                judge.best_err
            );
            if judge.late()
                || self.sweep(judge, "rounds", sweeps, why)
                || self.polish(judge, PATIENT)
            {
                return;
            }
        }
        if self.sweep_budget.is_some() {
            return;
        }
        if judge.scaled.problem.w.asymmetry() <= UNSYMMETRIC {
            let why = format!("stalled at {:.1e}", judge.best_err);
            if judge.late()
                || judge.stage("split", &mut self.admm, SPLIT, why)
                || self.polish(judge, PATIENT)
            {
                return;
            }
        }
        if !judge.late() {
            let why = format!("stalled at {:.1e}: whatever time is left", judge.best_err);
            self.sweeps.relaxation = RELAXATION;
            judge.stage("last", &mut self.sweeps, LAST, why);
        }
    }

    fn sweep_while_worthwhile(&mut self, judge: &mut Judge<'_>) -> bool {
        let mut why = String::from("sweeps are cheap and find most of the active set");
        for _ in 0..MAX_LOTS {
            let before = judge.best_err;
            if self.sweep(judge, "sweeps", SWEEPS, why) {
                return true;
            }
            if judge.late() || !judge.best_err.is_finite() || judge.best_err > WORTHWHILE * before {
                return false;
            }
            why = format!("they made err {:.0} times smaller", before / judge.best_err);
        }
        false
    }

    /// Sweeps within the budget; true where the run is over.
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
            if allowed == 0 {
                return true;
            }
        }
        self.swept += allowed * contacts;
        judge.stage(name, &mut self.sweeps, allowed as u32, why)
    }

    /// Newton from the best iterate; true where the run is over.
    fn polish(&mut self, judge: &mut Judge<'_>, patience: u32) -> bool {
        if judge.late() {
            return true;
        }
        let why = format!("Newton's quadratic end, from {:.1e}", judge.best_err);
        self.newton.patience = patience;
        judge.stage("polish", &mut self.newton, POLISH, why)
    }
}

/// Size of the Cholesky factors of W where it is above [`MAX_FILL`].
fn too_full(problem: &Problem) -> Option<f64> {
    if problem.rows() <= SURELY_SPARSE {
        return None;
    }
    let (col_ptr, row_idx, ..) = super::admm::lower_half(problem);
    let mut plan = SparseLlt::new();
    plan.analyse(problem.rows(), &col_ptr, &row_idx).ok()?;
    plan.fill()
        .filter(|&fill| fill > MAX_FILL)
        .map(|fill| fill as f64)
}
