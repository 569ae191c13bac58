//! The hybrid: cheap sweeps first, Newton to finish, and stronger means only where these do not do.

use super::{Admm, ConeSolver, GaussSeidel, InteriorPoint, Judge, SemiSmoothNewton};

/// The rule, in words; what is shown is this text, what is done stands below.
pub const RULE: &str = "todo";

/// See the module.
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

    fn run(&mut self, judge: &mut Judge<'_>, _: u32) -> u32 {
        if judge.stop() {
            return 0;
        }
        let _ = judge.stage("sweeps", &mut self.sweeps, 60, "start".into())
            || judge.stage("polish", &mut self.newton, 30, "polish".into())
            || judge.stage("interior", &mut self.interior, 100, "stalled".into())
            || judge.stage("polish", &mut self.newton, 60, "polish".into())
            || judge.stage("admm", &mut self.admm, 5000, "stalled".into())
            || judge.stage("polish", &mut self.newton, 60, "polish".into())
            || judge.stage("sweeps", &mut self.sweeps, 20000, "last".into());
        0
    }
}
