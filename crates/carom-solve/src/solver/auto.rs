//! The hybrid: cheap sweeps first, Newton to finish, and stronger means only where these do not do.

use super::{Admm, ConeSolver, GaussSeidel, InteriorPoint, Judge, SemiSmoothNewton};

/// The rule in words, checkpoint by checkpoint; the code below does what it says.
pub const RULE: &str = "\
Checkpoints of auto; each starts from the best iterate so far, and the first that reaches the tolerance ends the run.
1  start     up to 96 rows (dense): Newton at once, at most 20 iterations.
2  sweeps    60 sweeps of Gauss-Seidel, and 60 more as long as 60 sweeps make err 10 times smaller (at most 1200).
3  polish    Newton, at most 30 iterations; it gives up after 5 that do not halve err.
4  rounds    240 sweeps and a polish, 960 sweeps and a polish; skipped on as soon as sweeps do not halve err.
5  path      interior point, from scratch: at most 200 iterations, given up after 40 without a better err; then a polish
             that gives up after 12 such iterations.
6  rounds    500 sweeps and a polish, then 1000, 2000, 4000: redundant contacts find a consistent set in the end.
7  split     ADMM, at most 5000 iterations, and a polish; left out where W is unsymmetric by more than 1e-6.
8  last      sweeps until the time is up, at most 100 000. The best iterate is returned with its err, solved or not.";

/// Rows up to which Newton goes first.
const SMALL_ROWS: usize = 96;
const SMALL_ITERATIONS: u32 = 20;
const SWEEPS: u32 = 60;
const MAX_LOTS: u32 = 20;
/// Sweeps go on while a lot of them makes err smaller by this factor.
const WORTHWHILE: f64 = 0.1;
const POLISH: u32 = 30;
const QUICK: u32 = 5;
const PATIENT: u32 = 12;
/// Rounds before the path, the gain in sweeps that they need, and rounds after it.
const EARLY: [u32; 2] = [240, 960];
const GAIN: f64 = 0.5;
const LATE: [u32; 4] = [500, 1000, 2000, 4000];
const PATH: u32 = 200;
const SPLIT: u32 = 5000;
const UNSYMMETRIC: f64 = 1e-6;
const LAST: u32 = 100_000;

/// See the module. Keeps what its methods keep: symbolic factorisations of a pattern that stands.
#[derive(Default)]
pub struct Auto {
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
        if rows <= SMALL_ROWS {
            let why = format!("{rows} rows: a dense factorisation costs no more than some sweeps");
            self.newton.patience = PATIENT;
            if judge.stage("start", &mut self.newton, SMALL_ITERATIONS, why) {
                return;
            }
        }
        if self.sweep_while_worthwhile(judge) || self.polish(judge, QUICK) {
            return;
        }
        for sweeps in EARLY {
            let before = judge.best_err;
            let why = format!("Newton stalled at {before:.1e}: another start for it");
            if judge.stage("rounds", &mut self.sweeps, sweeps, why) || judge.late() {
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
        for sweeps in LATE {
            let why = format!("stalled at {:.1e}: another start for Newton", judge.best_err);
            if judge.late()
                || judge.stage("rounds", &mut self.sweeps, sweeps, why)
                || self.polish(judge, PATIENT)
            {
                return;
            }
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
            judge.stage("last", &mut self.sweeps, LAST, why);
        }
    }

    fn sweep_while_worthwhile(&mut self, judge: &mut Judge<'_>) -> bool {
        let mut why = String::from("sweeps are cheap and find most of the active set");
        for _ in 0..MAX_LOTS {
            let before = judge.best_err;
            if judge.stage("sweeps", &mut self.sweeps, SWEEPS, why) {
                return true;
            }
            if judge.late() || judge.best_err > WORTHWHILE * before {
                return false;
            }
            why = format!("they made err {:.0} times smaller", before / judge.best_err);
        }
        false
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
