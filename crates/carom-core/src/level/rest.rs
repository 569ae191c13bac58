//! What rests and can be held stays: of the solutions of Coulomb's law the one at rest, where the solvers come upon another one first.
//!
//! Where contacts are redundant and friction is large, the same loads may have a solution that rests and others that move (a pyramid of
//! spheres; `docs/theory/algorithm.md` section 6). A solver finds the one that its path leads to. Of these a body that is at rest takes
//! the one that leaves it there: it is looked for where a solution moves, or none was found, and nothing moved before.

use crate::contact::Contact;
use crate::level::tolerance;
use crate::options::{Options, Solver};
use crate::state::{State, Warm};

/// Share (1) of what the loads alone would move something by in a step up to which it stays at rest. Too large: what slides is held; at 1e-2 two
/// pyramids of `validation/pyramids` do not do as friction says. At 1e-9 all still do.
const STAYS_SHARE: f64 = 1e-5;
/// The same over the solver's tolerance (1), where that is coarser: what a coarse solve leaves must not count as motion.
const STAYS_OVER_TOLERANCE: f64 = 10.0;
/// Share (1) of the motion by the loads up to which something was at rest at t_n. At 1e-3 the 3e-6 m/s that sweeps leave brought pyramids
/// down (decision 015): what solvers leave, step by step, must not grow into a motion that is no longer looked at. Too large: what begins to move is stopped.
const WAS_SHARE: f64 = 1e-2;
/// The same over the share up to which it stays at rest (1), for coarse tolerances; too small, and piles swept coarsely fall as above.
const WAS_OVER_STAYS: f64 = 10.0;
/// Most contacts of an island for which rest is looked for (`carom_solve::hold` bounds the factors of matrices besides). Too few: at 0, 16 of
/// 36 pyramids that friction can hold fall (`validation/pyramids`). More: stating the problem of a large island takes the time of its step.
const MOST_CONTACTS: usize = 10_000;

/// Shares of what the loads alone would move something by: up to the first it stays at rest, up to the second it was so.
#[derive(Clone, Copy)]
pub(crate) struct RestBounds {
    pub stays: f64,
    pub was: f64,
}

/// Nothing where rest is not looked for.
pub(crate) fn rest_bounds(o: &Options, contacts: usize) -> Option<RestBounds> {
    // Whoever asks for a solver, or for the law as printed, gets what that gives.
    let plain = o.solver == Solver::Auto && !o.is_printed();
    let stays = STAYS_SHARE.max(STAYS_OVER_TOLERANCE * tolerance(o, contacts));
    (plain && contacts > 1 && contacts <= MOST_CONTACTS).then(|| RestBounds {
        stays,
        was: WAS_SHARE.max(WAS_OVER_STAYS * stays),
    })
}

/// Measures of a contact as lengths, or speeds: the largest. `z` begins with the normal and sliding rows, if there are such.
pub(crate) fn largest(sliding: bool, length: f64, z: &[f64]) -> f64 {
    let head = if sliding { 3 } else { 1 };
    let size = |(row, z): (usize, &f64)| {
        if row < head {
            z.abs()
        } else {
            length * z.abs()
        }
    };
    z.iter().enumerate().map(size).fold(0.0, f64::max)
}

/// What a contact carried in the last step.
pub(crate) fn of_last_step<'s>(state: &'s State, c: &Contact) -> Option<&'s Warm> {
    let found = state.warm.binary_search_by_key(&(c.a, c.b), |w| w.key);
    found.ok().map(|at| &state.warm[at])
}
