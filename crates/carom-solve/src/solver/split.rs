//! Some alternating directions before sweeps go on.

use super::{solve, Admm, Settings};
use crate::problem::Problem;

/// Most contacts of a problem that goes to [`split`] where sweeps fail, which has a factorisation for some hundred iterations. More: its memory, and
/// seconds for each failure. Fewer: heaps of rolling grains and of clumps are halved, and may stop the run.
pub const SPLIT_CONTACTS: usize = 2_000;
/// Iterations (1) of it, before sweeps go on from what it finds: it tells which forces hold one another, sweeps end what is left at single
/// contacts. More: what has no solution takes as long to say so. Fewer: steps of grains that roll are halved.
const SPLIT_ITERATIONS: u32 = 1_000;
/// Its tolerance over that of the island (1), which is of another norm. Near 1 the judge of the island may refuse what it finds.
const SPLIT_SHARE: f64 = 0.1;

/// Leaves in `lambda` what some alternating directions find, for sweeps to go on from: where grains roll or lock one another there are so many
/// self-balanced forces that sweeps alone crawl.
pub fn split(problem: &Problem, tolerance: f64, lambda: &mut [f64]) {
    let settings = Settings {
        tolerance: SPLIT_SHARE * tolerance,
        max_iterations: SPLIT_ITERATIONS,
        ..Settings::default()
    };
    solve(problem, &mut Admm::default(), settings, lambda);
}
