//! Poisson's law (Glocker and Pfeiffer, Nonlinear Dyn. 7, 471, 1995): compression to the end, then expansion.
//!
//! ```text
//! P_c   all contacts from V^- = v_n without restitution: the impulses of compression
//! 1     all contacts without restitution, on top of the loads: from the velocities that these have left
//! 2     P_N >= e_N P_c,N,  gamma_N >= 0,  (P_N - e_N P_c,N) gamma_N = 0,  friction by Coulomb's law within mu P_N,
//!       on gamma_T - e_T D_TT P_c,T
//! ```
//!
//! Nothing closes after it. Without loads P_c is problem 1; with them it keeps a resting ball from rebounding. Where the expansion adds
//! energy, counted from the loads on, less of it is given (rule R4). Loads stay: to solve them anew takes the friction back that they had, and
//! where that was more than the impact costs it is a gain.

use crate::impact::law::Law;
use crate::impact::sequence::{loads, solve_problem, ImpactIsland, Start};

/// Loads, compression, expansion.
#[must_use]
pub fn compress_and_expand(island: &mut impl ImpactIsland) -> bool {
    if loads(island).is_none() {
        return false;
    }
    if !island.flags(|slot| island.closes(slot)).contains(&true) {
        return true;
    }
    island.choose(|_| true);
    let Some(expands) = island.compress() else {
        return false;
    };
    solve_problem(island, Law::Plastic, 1, Start::Nothing)
        && (!expands || solve_problem(island, Law::Expansion, 2, Start::Nothing))
}
