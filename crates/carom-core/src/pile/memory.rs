//! Memory of the pile solver, and its way to the sweeps and back.

use super::cascade::memory::CascadeMemory;
use super::closed_contact::Frame;
use super::velocities::Velocities;
use super::{chunks, problem_nodes};
use crate::impact::law::Law;
use carom_solve::spheres::{self, Body, Place, SpheresError, Sweeps};
use glam::DVec3;
use std::ops::Range;

/// Fewest spheres of a problem that are sorted along a curve in space. Speed alone: unsorted, a large pile waits for memory in every sweep.
const SORTED_SPHERES: usize = 2_000;

/// A solve starts from nothing where one contact of the last step held so many times (1) what all loads of the island together ask for: spheres that
/// friction wedges may hold one another with any force, and a tolerance that is relative to that tells nothing of the loads. Too large: a ball
/// in a corner was thrown out by 556 weights that it had been squeezed with (decision 015). Too small: jams start anew, at four times the time.
const RUNAWAY_RATIO: f64 = 10.0;

/// Memory of the pile solver.
#[derive(Default)]
pub struct Pile {
    pub(super) sweeps: Sweeps,
    pub(super) bodies: Vec<Body>,
    pub(super) places: Vec<Place>,
    /// Position level: what the loads have moved the nodes by along normals, m.
    pub(super) taken: Vec<DVec3>,
    pub(super) contacts: Vec<spheres::Contact>,
    /// Rolling and spinning friction of the contacts; empty where nothing rolls.
    pub(super) rolls: Vec<spheres::Roll>,
    /// Bodies of the nodes, and which of them are free walls, with their normals.
    pub(super) spheres: Vec<u32>,
    pub(super) guided: Vec<(u32, [f64; 3])>,
    /// Impulses that a solve starts from.
    pub(super) start: Vec<[f64; 3]>,
    /// Moments, where something rolls.
    pub(super) start_moments: Vec<[f64; 3]>,
    /// What a solve gave: impulses on the bodies A, moments where something rolls (velocity level), and corrections of all nodes.
    pub(super) impulses: Vec<[f64; 3]>,
    pub(super) moments: Vec<[f64; 3]>,
    pub(super) corrections: Vec<[f64; 6]>,
    /// Work that the residual explains at each chosen contact, J.
    pub(super) explained: Vec<f64>,
    /// What is left of restitution at the contacts of each node; empty: all.
    pub(super) scales: Vec<f64>,
    /// The law of the velocity problem at hand, and the frame of its impulses.
    pub(super) law: Law,
    pub(super) frame: Frame,
    pub(super) velocity: Velocities,
    pub(super) cascade: CascadeMemory,
    pub(super) problem_nodes: problem_nodes::ProblemNodes,
    /// Bodies of the contacts.
    pub(super) ends: Vec<[u32; 2]>,
    /// Take what did not converge, and count it.
    pub(super) accept: bool,
    /// What sweeps do not solve is solved by its convex companion.
    pub(super) companion: bool,
    /// Give memory back as soon as it was used ([`super::limits::is_huge`]).
    pub(super) huge: bool,
}

impl Pile {
    pub fn new() -> Pile {
        Pile {
            sweeps: Sweeps::empty(),
            ..Pile::default()
        }
    }

    /// Makes the problem at hand the one of the sweeps, started from `start`.
    pub(super) fn load_sweeps(&mut self) -> Result<(), SpheresError> {
        self.drop_missing_rows();
        let (bodies, places) = self.problem_nodes.of(&self.bodies, &self.places);
        let places = (places.len() >= SORTED_SPHERES).then_some(places);
        let guided = self.guided.iter().copied();
        self.sweeps.guided.clear();
        (self.sweeps.guided).extend(self.problem_nodes.numbered(guided));
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

    /// Takes from the start what acts along rows that a contact has not: normals have turned since, a start that is good enough is not swept, and
    /// nothing records what no row has.
    fn drop_missing_rows(&mut self) {
        let (threads, contacts, rolls) = (self.sweeps.threads, &self.contacts, &self.rolls);
        let along = |k: usize, x: [f64; 3]| {
            let (x, n) = (DVec3::from(x), DVec3::from(contacts[k].normal));
            let along = x.dot(n) * n;
            [along, x - along]
        };
        chunks::each(threads, &mut self.start, |k, start| {
            if contacts[k].friction == 0.0 {
                *start = along(k, *start)[0].to_array();
            }
        });
        if rolls.is_empty() {
            return;
        }
        chunks::each(threads, &mut self.start_moments, |k, moment| {
            let ([spinning, rolling], roll) = (along(k, *moment), &rolls[k]);
            let kept = |radius: f64, part: DVec3| if radius > 0.0 { part } else { DVec3::ZERO };
            *moment = (kept(roll.spinning, spinning) + kept(roll.rolling, rolling)).to_array();
        });
    }

    /// Takes impulses and corrections from the sweeps.
    pub(super) fn take_solution(&mut self) {
        let Self {
            sweeps,
            impulses,
            moments,
            corrections,
            velocity,
            problem_nodes: part,
            bodies,
            ..
        } = self;
        sweeps.impulses_into(impulses);
        if velocity.turning.is_empty() {
            moments.clear();
        } else {
            sweeps.moments_into(moments);
        }
        part.spread(sweeps, corrections, bodies.len());
    }

    /// Gives the memory of a huge problem's statement back: the sweeps have it.
    pub(super) fn forget_contacts(&mut self) {
        if self.huge {
            self.contacts = Vec::new();
            self.rolls = Vec::new();
            self.start_moments = Vec::new();
        }
    }

    /// Gives the memory of a huge problem's solution back.
    pub(super) fn forget_solution(&mut self) {
        if self.huge {
            let threads = self.sweeps.threads;
            self.sweeps = Sweeps::empty();
            self.sweeps.threads = threads;
            (self.impulses, self.corrections) = (Vec::new(), Vec::new());
        }
    }

    /// Starts from nothing where what it would start from has run away ([`RUNAWAY_RATIO`]); `load`: what loads give each sphere, in the unit of the
    /// impulses.
    pub(super) fn start_sound(&mut self, load: impl Fn(usize) -> f64 + Sync) {
        let (threads, start) = (self.sweeps.threads, &self.start);
        let longest = |range: Range<usize>| {
            let squares = start[range]
                .iter()
                .map(|r| DVec3::from(*r).length_squared());
            squares.fold(0.0, f64::max)
        };
        let largest = chunks::reduce(threads, start.len(), longest, f64::max).sqrt();
        let spheres = &self.spheres;
        let loads = chunks::sum(threads, spheres.len(), |k| load(spheres[k] as usize));
        if largest > RUNAWAY_RATIO * loads {
            self.start.fill([0.0; 3]);
            self.start_moments.fill([0.0; 3]);
        }
    }

    pub(super) fn mean(&self, f: impl Fn(usize) -> f64 + Sync) -> f64 {
        let (threads, spheres) = (self.sweeps.threads, &self.spheres);
        let sum = chunks::sum(threads, spheres.len(), |k| f(spheres[k] as usize));
        sum / spheres.len() as f64
    }
}
