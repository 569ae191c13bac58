//! What can be recomputed: allocated once, reused in every step.

use crate::clump::places::Clumps;
use crate::contact::{Contact, ContactKey};
use crate::flow::Exchange;
use crate::force::LoadError;
use crate::impact::ImpactScratch;
use crate::islands::Islands;
use crate::level::coupling::Trial;
use crate::level::smooth_newton::SmoothScratch;
use crate::model::Model;
use crate::outcome::{History, ImpactRecord, Level};
use crate::parallel::Sharing;
use crate::pile::limits::is_huge;
use crate::pile::memory::Pile;
use crate::problem::Keeper;
use crate::state::Warm;
use crate::stepper::generalized_alpha::Prediction;
use crate::transition::Transition;
use crate::wall::places::Walls;
use crate::workspace::{Corrections, IslandScratch, SolveScratch};
use carom_geom::NeighbourList;
use glam::DVec3;

/// Scratch memory of a step.
#[derive(Default)]
pub struct Scratch {
    /// Per sphere: translation and rotation predictions.
    pub linear: Vec<Prediction>,
    pub angular: Vec<Prediction>,
    /// Corrections of position U and velocity W, and corrected positions.
    pub shift: Vec<[DVec3; 2]>,
    pub jump: Vec<[DVec3; 2]>,
    pub position: Vec<DVec3>,
    /// Where loads are solved once: the jumps of velocity that they make, then the ways and turns that follow from these. Empty elsewhere.
    pub load_shift: Vec<[DVec3; 2]>,
    /// Ways and turns by cohesion, which join them: loads answer it where the smooth motion alone ends. Empty where nothing is cohesive, too.
    pub(crate) pulled: Vec<[DVec3; 2]>,
    pub need: Vec<f64>,
    /// Smallest radius, m.
    pub smallest: f64,
    pub neighbours: NeighbourList,
    /// Where walls are in this step.
    pub walls: Walls,
    /// How clumps stand at the positions of the level at hand.
    pub clumps: Clumps,
    /// Candidate contacts, sorted by (a, b).
    pub contacts: Vec<Contact>,
    /// Pairs that overlap at the end of a step of `moreau`.
    pub overlaps: Vec<Contact>,
    pub islands: Islands,
    pub sharing: Sharing,
    pub solve: SolveScratch,
    pub smooth: SmoothScratch,
    /// Where loads and joints are evaluated.
    pub trial: Trial,
    pub impact: ImpactScratch,
    /// Warm-start impulses found in this step.
    pub warm: Vec<Warm>,
    pub impacts: Vec<ImpactRecord>,
    /// Time of each, s; empty where impacts have the time of their step.
    pub impact_times: Vec<f64>,
    /// Of methods with events.
    pub transitions: Vec<Transition>,
    /// Balls that left within the step, of methods that know when.
    pub left: Exchange,
    /// Histories of the longest solve of each level in this step: smooth, position, velocity.
    pub history: [History; 3],
    pub keeper: Keeper,
    pub pile: Pile,
    /// What a load said that failed.
    pub load_error: Option<LoadError>,
    /// Impulse at the joint and moment on sphere A of every joint in the step: both levels, N s and N m s.
    pub joint_reaction: Vec<[DVec3; 2]>,
    /// Impulse on every wall in the step and its moment about the wall's place, N s and N m s; empty unless recorded.
    pub wall_impulse: Vec<[DVec3; 2]>,
    /// Potential energy of cohesion at the end of the step, J.
    pub(crate) attraction: f64,
    /// That of each contact, of methods in which they have one, J.
    pub elastic: Vec<(ContactKey, f64)>,
    /// What walls, and images of a box that deforms, pulled balls with: contacts as at t_n, and impulses on the balls.
    pub(crate) driven_pulls: Vec<(Contact, DVec3)>,
    /// Power at t_n of loads without potential, W.
    pub power: f64,
}

impl Scratch {
    /// Way of a body in its smooth motion and by cohesion, m.
    #[inline]
    pub(crate) fn way(&self, i: usize) -> DVec3 {
        let smooth = self.linear[i].displacement;
        self.pulled.get(i).map_or(smooth, |by| smooth + by[0])
    }

    pub fn new(model: &Model) -> Scratch {
        let n = model.bodies();
        let mut neighbours = NeighbourList::new();
        neighbours.set_periodic(model.periodic);
        neighbours.set_threads(model.options.threads as usize);
        neighbours.set_meshes(model.mesh_spans());
        neighbours.set_between(model.clumps.len());
        let stands = model.free_walls.is_empty() && model.walls.iter().all(|w| w.motion.is_none());
        neighbours.set_fixed_walls(stands);
        Scratch {
            linear: vec![Prediction::default(); n],
            angular: vec![Prediction::default(); n],
            shift: vec![[DVec3::ZERO; 2]; n],
            jump: vec![[DVec3::ZERO; 2]; n],
            position: vec![DVec3::ZERO; n],
            load_shift: match model.options.loads_once() {
                true => vec![[DVec3::ZERO; 2]; n],
                false => Vec::new(),
            },
            pulled: match model.options.loads_once() && model.cohesive_reach() > 0.0 {
                true => vec![[DVec3::ZERO; 2]; n],
                false => Vec::new(),
            },
            need: vec![0.0; n],
            smallest: model.radius.iter().copied().fold(f64::INFINITY, f64::min),
            neighbours,
            walls: Walls::new(model),
            clumps: Clumps::new(model),
            islands: Islands::new(model.options.threads as usize),
            smooth: SmoothScratch::new(model),
            trial: Trial::new(model),
            solve: SolveScratch::new(model),
            pile: Pile::new(),
            joint_reaction: vec![[DVec3::ZERO; 2]; model.joints.len()],
            attraction: 0.0,
            wall_impulse: vec![[DVec3::ZERO; 2]; model.recorded_walls()],
            ..Scratch::default()
        }
    }

    /// Gives back what a level was solved with, if it is much.
    pub fn end_level(&mut self) {
        if is_huge(&self.contacts) {
            self.pile = Pile::new();
            self.sharing = Sharing::default();
        }
    }

    /// Forgets what the last step found.
    pub fn begin_step(&mut self) {
        if is_huge(&self.contacts) {
            (self.warm, self.impacts) = (Vec::new(), Vec::new());
        }
        self.impacts.clear();
        self.impact_times.clear();
        self.transitions.clear();
        self.left = Exchange::default();
        self.warm.clear();
        for history in &mut self.history {
            history.clear();
        }
        self.keeper.failed = None;
    }

    /// The islands of a level, and what they are solved with in the step itself.
    pub fn of_level(&mut self, level: Level) -> (&Islands, IslandScratch<'_>) {
        let (shift, corrections): (&[_], _) = match level {
            Level::Position => (&self.load_shift, &mut self.shift),
            Level::Loads => (&self.shift, &mut self.load_shift),
            _ => (&self.shift, &mut self.jump),
        };
        let scratch = IslandScratch {
            linear: &self.linear,
            angular: &self.angular,
            position: &self.position,
            shift,
            walls: &self.walls,
            clumps: &self.clumps,
            contacts: &mut self.contacts,
            corrections: Corrections::Placed(corrections),
            joint_reaction: &mut self.joint_reaction,
            warm: &mut self.warm,
            impacts: &mut self.impacts,
            history: &mut self.history,
            keeper: &mut self.keeper,
            solve: &mut self.solve,
            trial: &mut self.trial,
            impact: &mut self.impact,
            pile: &mut self.pile,
        };
        (&self.islands, scratch)
    }
}
