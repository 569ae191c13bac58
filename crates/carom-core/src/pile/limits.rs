//! When an island is a pile, and how far its solvers go: sizes, budgets, tolerances.

use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::options::Solver;
use carom_solve::ladder::COARSE_TOLERANCE;
use carom_solve::rows::WORLD;
use carom_solve::spheres::{Goal, Progress};

/// Sweeps that one solve may take (up to 16 times as many where [`LEAST_UPDATES`] are more). Too few: tall piles end unconverged, and steps are
/// halved or counted as fallbacks. Too many: a step without solution takes minutes to say so.
pub(super) const SWEEPS: usize = 4_000;

/// Contact updates that one solve may take at least, for small piles, whose sweeps are cheap; wrong values show as for [`SWEEPS`].
pub(super) const LEAST_UPDATES: usize = 8_000_000;

/// Sweeps from which on the bound of the worst contact widens (`spheres::Goal::patience`; counted as a fallback), or after which a
/// position problem is given up for smaller parts of the step. Too few: at 100 falling heaps take five times as long and more.
/// Too many: each jam costs as many sweeps before it is halved.
pub(super) const PATIENCE: usize = 1_000;

/// Most contacts of an island whose positions go to Newton's method where sweeps fail; a step with a larger one is halved. More: one failure takes
/// minutes. Fewer: jams of a few hundred contacts end at the last halving, and the run stops.
pub(super) const NEWTON_CONTACTS: usize = 500;

/// Fewest contacts of a large island, which is solved otherwise where it is hit. Fewer: wedges stay, and a tower of 28 balls gained energy. More:
/// hit piles of tens of thousands of grains take up to twice the sweeps.
pub(super) const LARGE_ISLAND: usize = 10_000;

/// Contacts of a pile from which on its worst one may be worse ([`worst`]). Fewer: overlaps of small piles grow. More: the worst of very many
/// contacts takes twice the sweeps.
pub(super) const WORST_CONTACT_FROM: f64 = 2_500.0;

/// Fewest candidate contacts of a step whose memory is given back as soon as its phase is over: getting it again is cheap beside the sweeps of
/// so many. Fewer: steps wait for the system's memory. More: a scene of millions of balls needs the memory of all phases at once.
pub(super) const HUGE_ISLAND: usize = 1_000_000;

/// Whether memory is given back in a step with these candidates.
pub fn is_huge(contacts: &[Contact]) -> bool {
    contacts.len() >= HUGE_ISLAND
}

/// Whether an island is solved here.
pub fn fits(model: &Model, island: Island) -> bool {
    let o = &model.options;
    // Sweeps converge linearly: the coarser the tolerance, the smaller the islands in which they are the faster ones.
    let least = if o.pile_tolerance >= COARSE_TOLERANCE {
        o.pile_contacts.min(o.dense_contacts)
    } else {
        o.pile_contacts
    };
    island.contacts.len() > least as usize
        && island.is_free()
        && !island.clumps
        && o.solver == Solver::Auto
        && !o.impact.is_printed()
        && !o.is_printed()
}

/// Threads that sweep an island of `contacts` contacts.
pub fn threads(model: &Model, contacts: usize) -> usize {
    let o = &model.options;
    let worth = contacts / o.contacts_per_thread as usize;
    (o.threads as usize).min(worth).max(1)
}

/// Whether an island has so many contacts that its worst ones take most of the work when it is hit. (Small ones do not gain by it, and
/// are the ones in which wedges matter.)
pub(super) fn is_large(contacts: usize) -> bool {
    contacts >= LARGE_ISLAND
}

/// What the worst of so many contacts may be left with over what the worst of a small pile may: at the same residual the worst of
/// very many is worse.
pub(super) fn worst(contacts: usize) -> f64 {
    (contacts as f64 / WORST_CONTACT_FROM)
        .powf(0.75)
        .clamp(1.0, 5.0)
}

/// Sweeps that one solve of `contacts` contacts may take.
pub(super) fn budget(contacts: usize) -> usize {
    (LEAST_UPDATES / contacts.max(1)).clamp(SWEEPS, 16 * SWEEPS)
}

/// Whether the solvers of the small islands may try positions that failed here: beyond some hundred contacts they take minutes.
pub fn may_fall_back(island: Island) -> bool {
    island.contacts.len() <= NEWTON_CONTACTS
}

/// The node of a body; the world for walls.
pub(super) fn node(model: &Model, node_of: &[u32], body: u32) -> u32 {
    if (body as usize) < model.bodies() {
        node_of[body as usize]
    } else {
        WORLD
    }
}

/// What sweeps tell, as the other solvers report it.
pub(super) fn told(progress: &Progress, rounds: u32) -> carom_solve::SolveReport {
    carom_solve::SolveReport {
        converged: progress.converged,
        iterations: rounds,
        residual: progress.residual,
        rung: carom_solve::ladder::SPHERES,
        ..Default::default()
    }
}

/// Tolerance of what is solved as spheres.
pub(super) fn tolerance(model: &Model) -> f64 {
    model.options.tolerance.max(model.options.pile_tolerance)
}

/// How much finer (1) a problem is solved whose residual may give energy. Larger: a hundred elastic balls gain 5e-7 of their energy in a hit.
/// Smaller: sweeps, which converge linearly, take twice the time in dense gases.
const FINER: f64 = 1e-2;

pub(super) fn finer(goal: &Goal) -> Goal {
    Goal {
        tolerance: FINER * goal.tolerance,
        floor: FINER * goal.floor,
        closing: FINER * goal.closing,
        worst: 1.0,
        ..*goal
    }
}
