//! When an island is a pile, and how far its solvers go: sizes, budgets, tolerances.

use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::options::{Impact, Options, Solver};
use carom_solve::rows::WORLD;
use carom_solve::spheres::Progress;
use glam::DVec3;

/// Sweeps and contact updates that one solve may take: what is more of both.
pub(super) const SWEEPS: usize = 4_000;

pub(super) const LEAST_UPDATES: usize = 2_000_000;

/// Sweeps from which on the bound of the worst contact widens (`spheres::Goal::patience`; counted as a fallback), or after which a
/// position problem is given up for smaller parts of the step.
pub(super) const PATIENCE: usize = 1_000;

/// Islands of more contacts than this have no other solver: a step that fails is halved.
pub(super) const NEWTON_CONTACTS: usize = 500;

/// Tolerance of piles from which on every island without dense matrix is swept.
pub(super) const COARSE_TOLERANCE: f64 = 1e-5;

/// Tolerance that scenes of piles are advised to set.
pub(super) const USUAL_TOLERANCE: f64 = 1e-4;

/// Contacts of a large island.
pub(super) const LARGE_ISLAND: usize = 10_000;

/// Contacts of a pile from which on its worst one may be worse.
pub(super) const WORST_CONTACT_FROM: f64 = 2_500.0;

/// Share of the closing tolerance that solvers may leave.
pub(super) const CLOSING_LEFT: f64 = 0.5;

/// The levels keep to their own impulses of the last step as long as those of one are at most so many times those of the other, `nu` over h/2
/// against the impulse of the loads. Where spheres are wedged a level alone may hold them by friction, for ever if it starts from there.
pub(super) const LEVELS_APART: f64 = 3.0;

/// Contacts from which on memory is given back as soon as its phase is over: getting it again is cheap beside the sweeps of so many.
pub(super) const HUGE_ISLAND: usize = 1_000_000;

/// Whether memory is given back in a step with these candidates.
pub fn is_huge(contacts: &[Contact]) -> bool {
    contacts.len() >= HUGE_ISLAND
}

/// Whether an impulse of one level is beyond what the other level's stands for ([`LEVELS_APART`]).
pub(super) fn is_beyond(of_one: DVec3, of_other: DVec3) -> bool {
    of_one.length_squared() > LEVELS_APART * LEVELS_APART * of_other.length_squared()
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
        && o.solver == Solver::Auto
        && o.impact != Impact::SequencePaper
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

/// Closing tolerance of so many contacts over that of a small pile: a solution that is coarser than [`USUAL_TOLERANCE`] leaves closing speeds by which
/// impacts would go round and round, and to make the worst of very many contacts as small takes twice the sweeps.
pub(super) fn coarser(o: &Options, contacts: usize) -> f64 {
    worst(contacts).min((o.pile_tolerance / USUAL_TOLERANCE).max(1.0))
}

/// Sweeps that one solve of `contacts` contacts may take.
pub(super) fn budget(contacts: usize) -> usize {
    (LEAST_UPDATES / contacts.max(1)).clamp(SWEEPS, 16 * SWEEPS)
}

/// Whether the solvers of the small islands may try what failed here: beyond some hundred contacts they take minutes.
pub fn may_fall_back(island: Island) -> bool {
    island.contacts.len() <= NEWTON_CONTACTS
}

/// The node of a body; the world for walls.
pub(super) fn node(model: &Model, node_of: &[u32], body: u32) -> u32 {
    if (body as usize) < model.spheres() {
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
        ..Default::default()
    }
}

/// An impact problem gains energy if its work exceeds this share of the solver's tolerance, of the kinetic energy: an inexact
/// solution does a little work.
pub(super) const GAIN_SHARE: f64 = 1e-2;
