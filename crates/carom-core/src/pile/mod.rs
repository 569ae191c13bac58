//! Islands of many contacts: both levels by sweeps over spheres without matrices, started from the impulses of the last step.
//!
//! The law is that of the small islands (`level`, `impact`); decision record 016 says what differs: one frame per contact, at the
//! normal of the end of the step, so that [`carom_solve::spheres`] applies; a tolerance of piles; impact problems after the first
//! are solved where something closes and nowhere else (`cascade`). What does not converge here goes to the solvers of the small
//! islands, and is counted.

mod cascade;
mod every;
mod first;
mod keep;
mod member;
mod part;
mod position;
mod record;
mod rest;
mod roll;
mod shares;
mod solve;
mod start;
mod velocity;
mod warm;

pub use position::{overlap, solve_positions};
pub use velocity::solve_velocities;

use crate::contact::Contact;
use crate::islands::{Island, Islands};
use crate::model::Model;
use crate::options::{Impact, Options, Solver};
use crate::problem::Keeper;
use carom_solve::rows::WORLD;
use carom_solve::spheres::{self, Body, Place, Progress, SpheresError, Sweeps};
use glam::DVec3;

/// Sweeps and contact updates that one solve may take: what is more of both.
const SWEEPS: usize = 4_000;
const LEAST_UPDATES: usize = 2_000_000;
/// From this many spheres on neighbours in space are made neighbours in memory.
const SORTED: usize = 2_000;
/// Sweeps from which on the bound of the worst contact widens (`spheres::Goal::patience`; counted as a fallback), or after which a
/// position problem is given up for smaller parts of the step.
const PATIENCE: usize = 1_000;
/// Islands of more contacts than this have no other solver: a step that fails is halved.
const ALONE: usize = 500;
/// Tolerance of piles from which on every island without dense matrix is swept.
const COARSE: f64 = 1e-5;
/// Tolerance that scenes of piles are advised to set.
const USUAL: f64 = 1e-4;
/// Contacts of a large island.
const LARGE: usize = 10_000;
/// Of overlaps that are measured twice.
const ROUNDING: f64 = 1e-6;
/// Contacts of a pile from which on its worst one may be worse.
const TYPICAL: f64 = 2_500.0;
/// Share of the closing tolerance that solvers may leave.
const LEFT: f64 = 0.5;

/// The levels keep to their own impulses of the last step as long as those of one are at most so many times those of the other, `nu` over h/2
/// against the impulse of the loads. Where spheres are wedged a level alone may hold them by friction, for ever if it starts from there.
const APART: f64 = 3.0;

/// A solve starts from nothing where one contact of the last step held so many times what all loads of the island together ask for: spheres that
/// friction wedges may hold one another with any force, and a tolerance that is relative to that tells nothing of the loads.
const RUNAWAY: f64 = 10.0;

/// Contacts from which on memory is given back as soon as its phase is over: getting it again is cheap beside the sweeps of so many.
const HUGE: usize = 1_000_000;

/// Whether memory is given back in a step with these candidates.
pub fn is_huge(contacts: &[Contact]) -> bool {
    contacts.len() >= HUGE
}

/// Restitution terms of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Law {
    /// e_N = e_T = 0.
    Plastic,
    /// Newton's law on the velocities of t_n: the first impact problem.
    First,
    /// Newton's law on what earlier problems of the step have left (eq. 27).
    Later,
}

/// Memory of the pile solver.
pub struct Pile {
    sweeps: Sweeps,
    bodies: Vec<Body>,
    places: Vec<Place>,
    /// Position level: tangential increments of the contacts over the smooth step; none where memory is short.
    slides: Vec<[f64; 3]>,
    contacts: Vec<spheres::Contact>,
    /// Rolling and spinning friction of the contacts; empty where nothing rolls.
    rolls: Vec<spheres::Roll>,
    /// Spheres of the nodes.
    spheres: Vec<u32>,
    /// Impulses that a solve starts from.
    start: Vec<[f64; 3]>,
    /// Moments, where something rolls.
    start_moments: Vec<[f64; 3]>,
    /// What a solve gave: impulses on the bodies A, and corrections of all nodes.
    impulses: Vec<[f64; 3]>,
    corrections: Vec<[f64; 6]>,
    velocity: member::Memory,
    part: part::Part,
    /// Bodies of the contacts.
    ends: Vec<[u32; 2]>,
    /// That of the step, while an island is solved.
    keeper: Keeper,
    /// Take what did not converge, and count it.
    accept: bool,
    /// Give memory back as soon as it was used ([`is_huge`]).
    huge: bool,
}

impl Pile {
    pub fn new() -> Pile {
        Pile {
            sweeps: Sweeps::empty(),
            bodies: Vec::new(),
            places: Vec::new(),
            slides: Vec::new(),
            contacts: Vec::new(),
            rolls: Vec::new(),
            spheres: Vec::new(),
            start: Vec::new(),
            start_moments: Vec::new(),
            impulses: Vec::new(),
            corrections: Vec::new(),
            velocity: member::Memory::default(),
            part: part::Part::default(),
            ends: Vec::new(),
            keeper: Keeper::default(),
            accept: false,
            huge: false,
        }
    }

    /// Nodes for the spheres of an island, in order of first use; `node_of` is valid for these spheres afterwards.
    fn begin(
        &mut self,
        model: &Model,
        contacts: &[Contact],
        members: &[u32],
        node_of: &mut [u32],
        position: &[DVec3],
    ) {
        let threads = threads(model, members.len());
        self.sweeps.threads = threads;
        self.huge = is_huge(contacts);
        // Of the round before this one.
        self.forget_solution();
        self.part.take_all();
        shares::refill(threads, &mut self.ends, members.len(), |k| {
            let c = &contacts[members[k] as usize];
            [c.a, c.b]
        });
        self.spheres.clear();
        for &body in self.ends.iter().flatten() {
            let i = body as usize;
            if i < model.spheres() && self.spheres.get(node_of[i] as usize) != Some(&body) {
                node_of[i] = self.spheres.len() as u32;
                self.spheres.push(body);
            }
        }
        let spheres = &self.spheres;
        shares::refill(threads, &mut self.bodies, spheres.len(), |k| {
            let i = spheres[k] as usize;
            Body {
                inv_mass: model.inv_mass[i],
                inv_inertia: model.inv_inertia[i],
                radius: model.radius[i],
            }
        });
        shares::refill(threads, &mut self.places, spheres.len(), |k| {
            position[spheres[k] as usize].to_array()
        });
    }

    /// Makes the problem at hand the one of the sweeps, started from `start`.
    fn load_sweeps(&mut self) -> Result<(), SpheresError> {
        let (bodies, places) = self.part.of(&self.bodies, &self.places);
        let places = (places.len() >= SORTED).then_some(places);
        self.sweeps
            .renew_from(bodies, &self.contacts, places, &self.start)?;
        if self.huge {
            (self.start, self.ends) = (Vec::new(), Vec::new());
        }
        if self.rolls.is_empty() {
            return Ok(());
        }
        let (rolls, moments) = (&self.rolls, &self.start_moments);
        self.sweeps
            .set_rolls(bodies, &self.contacts, rolls, moments)
    }

    /// Takes impulses and corrections from the sweeps.
    fn take_solution(&mut self) {
        let Self {
            sweeps,
            impulses,
            corrections,
            part,
            bodies,
            ..
        } = self;
        sweeps.impulses_into(impulses);
        part.spread(sweeps, corrections, bodies.len());
    }

    /// Gives the memory of a huge problem's statement back: the sweeps have it.
    fn forget_contacts(&mut self) {
        if self.huge {
            self.contacts = Vec::new();
            self.rolls = Vec::new();
            self.start_moments = Vec::new();
        }
    }

    /// Gives the memory of a huge problem's solution back.
    fn forget_solution(&mut self) {
        if self.huge {
            let threads = self.sweeps.threads;
            self.sweeps = Sweeps::empty();
            self.sweeps.threads = threads;
            (self.impulses, self.corrections) = (Vec::new(), Vec::new());
        }
    }

    /// Starts from nothing where what it would start from has run away ([`RUNAWAY`]); `load`: what loads give each sphere, in the unit of the
    /// impulses.
    fn start_sound(&mut self, load: impl Fn(usize) -> f64 + Sync) {
        let (threads, start) = (self.sweeps.threads, &self.start);
        let largest = shares::map(threads, start.len(), |range| {
            let squares = start[range]
                .iter()
                .map(|r| DVec3::from(*r).length_squared());
            squares.fold(0.0, f64::max)
        });
        let largest = largest.into_iter().fold(0.0, f64::max).sqrt();
        let spheres = &self.spheres;
        let loads = shares::sum(threads, spheres.len(), |k| load(spheres[k] as usize));
        if largest > RUNAWAY * loads {
            self.start.fill([0.0; 3]);
            self.start_moments.fill([0.0; 3]);
        }
    }

    fn mean(&self, f: impl Fn(usize) -> f64 + Sync) -> f64 {
        let (threads, spheres) = (self.sweeps.threads, &self.spheres);
        let sum = shares::sum(threads, spheres.len(), |k| f(spheres[k] as usize));
        sum / spheres.len() as f64
    }
}

impl Default for Pile {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether an impulse of one level is beyond what the other level's stands for ([`APART`]).
fn is_beyond(of_one: DVec3, of_other: DVec3) -> bool {
    of_one.length_squared() > APART * APART * of_other.length_squared()
}

/// Whether an island is solved here.
pub fn fits(model: &Model, island: Island) -> bool {
    let o = &model.options;
    // Sweeps converge linearly: the coarser the tolerance, the smaller the islands in which they are the faster ones.
    let least = if o.pile_tolerance >= COARSE {
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
fn is_large(contacts: usize) -> bool {
    contacts >= LARGE
}

/// Whether something overlaps deeper than it may after a round of [`crate::level::Demand::Rough`].
pub fn is_left_rough(model: &Model, contacts: &[Contact], islands: &Islands) -> bool {
    let o = &model.options;
    let tolerance = o.tolerance.max(o.pile_tolerance);
    let mut all = (0..islands.len()).map(|k| islands.island(k));
    all.any(|island| {
        if !is_large(island.contacts.len()) || !fits(model, island) {
            return false;
        }
        let (members, count) = (island.contacts, island.contacts.len());
        let parts = shares::map(threads(model, count), count, |range| {
            let (mut smallest, mut deepest) = (f64::INFINITY, 0.0f64);
            for c in members[range].iter().map(|&m| &contacts[m as usize]) {
                let radius = |body: u32| model.radius.get(body as usize).copied();
                let radii = [c.a, c.b].map(|body| radius(body).unwrap_or(f64::INFINITY));
                smallest = smallest.min(radii[0]).min(radii[1]);
                deepest = deepest.max(-c.gap);
            }
            (smallest, deepest)
        });
        let smallest = parts.iter().fold(f64::INFINITY, |x, p| x.min(p.0));
        let deepest = parts.iter().fold(0.0f64, |x, p| x.max(p.1));
        deepest > (1.0 + ROUNDING) * overlap(tolerance, count) * smallest
    })
}

/// What the worst of so many contacts may be left with over what the worst of a small pile may: at the same residual the worst of
/// very many is worse.
fn worst(contacts: usize) -> f64 {
    (contacts as f64 / TYPICAL).powf(0.75).clamp(1.0, 5.0)
}

/// Closing tolerance of so many contacts over that of a small pile: a solution that is coarser than [`USUAL`] leaves closing speeds by which
/// impacts would go round and round, and to make the worst of very many contacts as small takes twice the sweeps.
fn coarser(o: &Options, contacts: usize) -> f64 {
    worst(contacts).min((o.pile_tolerance / USUAL).max(1.0))
}

/// Sweeps that one solve of `contacts` contacts may take.
fn budget(contacts: usize) -> usize {
    (LEAST_UPDATES / contacts.max(1)).clamp(SWEEPS, 16 * SWEEPS)
}

/// Whether the solvers of the small islands may try what failed here: beyond some hundred contacts they take minutes.
pub fn may_fall_back(island: Island) -> bool {
    island.contacts.len() <= ALONE
}

/// The node of a body; the world for walls.
fn node(model: &Model, node_of: &[u32], body: u32) -> u32 {
    if (body as usize) < model.spheres() {
        node_of[body as usize]
    } else {
        WORLD
    }
}

/// What sweeps tell, as the other solvers report it.
fn told(progress: &Progress, rounds: u32) -> carom_solve::SolveReport {
    carom_solve::SolveReport {
        converged: progress.converged,
        iterations: rounds,
        residual: progress.residual,
        ..Default::default()
    }
}
