//! What can be recomputed: allocated once, reused in every step.

use crate::contact::Contact;
use crate::impact::ImpactScratch;
use crate::islands::{Island, Islands};
use crate::level::coupling::Trial;
use crate::level::smooth::SmoothScratch;
use crate::model::Model;
use crate::penalty::Workspace;
use crate::pile::{is_huge, Pile};
use crate::problem::Keeper;
use crate::report::Level;
use crate::share::Sharing;
use crate::state::Warm;
use crate::stepper::generalized_alpha::Prediction;
use crate::wall::Walls;
use carom_geom::NeighbourList;
use carom_solve::{Newton, RowSystem};
use glam::DVec3;

/// Residual history of one solve, kept for the plot of quadratic convergence.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Relative residuals of eq. 44 at each iterate, all rungs in order.
    pub values: Vec<f64>,
    pub problem: u32,
    pub contacts: u32,
}

impl History {
    pub(crate) fn clear(&mut self) {
        self.values.clear();
        (self.problem, self.contacts) = (0, 0);
    }
}

/// One contact's share in one impact problem.
#[derive(Clone, Copy, Debug)]
pub struct ImpactRecord {
    pub problem: u32,
    pub a: u32,
    pub b: u32,
    pub status: u8,
    pub normal: DVec3,
    /// World vectors on body A, N s and N m s.
    pub impulse: DVec3,
    pub moment: DVec3,
    /// Normal relative velocity before and after the problem, m/s.
    pub approach: f64,
    pub separation: f64,
    pub restitution_scale: f64,
}

/// Scratch memory of a step.
pub struct Scratch {
    /// Per sphere: translation and rotation predictions.
    pub linear: Vec<Prediction>,
    pub angular: Vec<Prediction>,
    /// Corrections of position U and velocity W, and corrected positions.
    pub shift: Vec<[DVec3; 2]>,
    pub jump: Vec<[DVec3; 2]>,
    pub position: Vec<DVec3>,
    pub need: Vec<f64>,
    /// Smallest radius, m.
    pub smallest: f64,
    pub neighbours: NeighbourList,
    /// Where walls are in this step.
    pub walls: Walls,
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
    /// Histories of the longest solve of each level in this step: smooth, position, velocity.
    pub history: [History; 3],
    pub keeper: Keeper,
    pub pile: Pile,
    /// Memory of method `penalty`.
    pub penalty: Workspace,
    /// What a load said that failed.
    pub load_error: Option<crate::force::LoadError>,
    /// Impulse at the joint and moment on sphere A of every joint in the step: both levels, N s and N m s.
    pub joint_reaction: Vec<[DVec3; 2]>,
    /// Impulse on every wall in the step and its moment about the wall's place, N s and N m s; empty unless recorded.
    pub wall_impulse: Vec<[DVec3; 2]>,
    /// Power at t_n of loads without potential, W.
    pub power: f64,
}

/// What the solve of an island reads and writes: parts of the step's scratch, or memory of a thread (`share`).
pub struct IslandScratch<'a> {
    /// Read only: predictions, positions of the level, and the corrections U once they are known.
    pub linear: &'a [Prediction],
    pub angular: &'a [Prediction],
    pub position: &'a [DVec3],
    pub shift: &'a [[DVec3; 2]],
    pub walls: &'a Walls,
    /// Results.
    pub contacts: &'a mut [Contact],
    pub corrections: Corrections<'a>,
    pub joint_reaction: &'a mut [[DVec3; 2]],
    pub warm: &'a mut Vec<Warm>,
    pub impacts: &'a mut Vec<ImpactRecord>,
    pub history: &'a mut [History; 3],
    pub keeper: &'a mut Keeper,
    /// Buffers.
    pub solve: &'a mut SolveScratch,
    pub trial: &'a mut Trial,
    pub impact: &'a mut ImpactScratch,
    pub pile: &'a mut Pile,
}

/// Where the corrections of a level go: U or W of each sphere.
pub enum Corrections<'a> {
    Placed(&'a mut [[DVec3; 2]]),
    Listed(&'a mut Vec<(u32, [DVec3; 2])>),
}

/// Buffers of one island's solve.
#[derive(Default)]
pub struct SolveScratch {
    pub newton: Newton,
    pub system: RowSystem,
    /// Local node of each sphere (valid only for the island at hand) and the reverse.
    pub node_of: Vec<u32>,
    pub bodies: Vec<u32>,
    pub lambda: Vec<f64>,
    pub u: Vec<f64>,
}

impl Scratch {
    pub fn new(model: &Model) -> Scratch {
        let n = model.spheres();
        let mut neighbours = NeighbourList::new();
        neighbours.set_periodic(model.periodic);
        neighbours.set_threads(model.options.threads as usize);
        Scratch {
            linear: vec![Prediction::default(); n],
            angular: vec![Prediction::default(); n],
            shift: vec![[DVec3::ZERO; 2]; n],
            jump: vec![[DVec3::ZERO; 2]; n],
            position: vec![DVec3::ZERO; n],
            need: vec![0.0; n],
            smallest: model.radius.iter().copied().fold(f64::INFINITY, f64::min),
            neighbours,
            walls: Walls::new(model),
            contacts: Vec::new(),
            overlaps: Vec::new(),
            islands: Islands::new(model.options.threads as usize),
            sharing: Sharing::default(),
            impact: ImpactScratch::default(),
            smooth: SmoothScratch::new(model),
            trial: Trial::new(model),
            solve: SolveScratch::new(model),
            warm: Vec::new(),
            impacts: Vec::new(),
            history: Default::default(),
            keeper: Keeper::default(),
            pile: Pile::new(),
            penalty: Workspace::new(model),
            load_error: None,
            joint_reaction: vec![[DVec3::ZERO; 2]; model.joints.len()],
            wall_impulse: vec![[DVec3::ZERO; 2]; model.recorded_walls()],
            power: 0.0,
        }
    }
}

impl Scratch {
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
        self.warm.clear();
        for history in &mut self.history {
            history.clear();
        }
        self.keeper.failed = None;
    }

    /// The islands of a level, and what they are solved with in the step itself.
    pub fn of_level(&mut self, level: Level) -> (&Islands, IslandScratch<'_>) {
        let (shift, corrections): (&[_], _) = match level {
            Level::Position => (&[], &mut self.shift),
            _ => (&self.shift, &mut self.jump),
        };
        let scratch = IslandScratch {
            linear: &self.linear,
            angular: &self.angular,
            position: &self.position,
            shift,
            walls: &self.walls,
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

impl Corrections<'_> {
    #[inline]
    pub fn set(&mut self, body: u32, correction: [DVec3; 2]) {
        match self {
            Corrections::Placed(all) => all[body as usize] = correction,
            Corrections::Listed(list) => list.push((body, correction)),
        }
    }

    /// How many are listed.
    pub fn listed(&self) -> usize {
        match self {
            Corrections::Placed(_) => 0,
            Corrections::Listed(list) => list.len(),
        }
    }
}

impl SolveScratch {
    pub fn new(model: &Model) -> SolveScratch {
        SolveScratch {
            node_of: vec![u32::MAX; model.spheres()],
            ..SolveScratch::default()
        }
    }

    /// Starts an island: nodes for the spheres of its contacts, joints and loads, in order of first use.
    pub fn begin(&mut self, model: &Model, contacts: &[Contact], island: Island) {
        self.system.clear();
        self.bodies.clear();
        for &index in island.contacts {
            let c = &contacts[index as usize];
            self.add_node(model, c.a);
            if (c.b as usize) < model.spheres() {
                self.add_node(model, c.b);
            }
        }
        if island.is_free() {
            return;
        }
        for &index in island.joints {
            let link = &model.links[index as usize];
            self.add_node(model, link.a);
            self.add_node(model, link.b);
        }
        for &index in island.loads {
            for body in model.loads[index as usize].bodies().into_iter().flatten() {
                self.add_node(model, body);
            }
        }
    }

    fn add_node(&mut self, model: &Model, body: u32) {
        let i = body as usize;
        if !self.bodies.contains_recent(body, &self.node_of) {
            let (m, inertia) = (model.mass[i], model.inertia[i]);
            self.node_of[i] = self.system.push_node(m, inertia, model.radius[i]);
            self.bodies.push(body);
        }
    }

    /// Local node of a body; the world for walls.
    #[inline]
    pub fn node(&self, model: &Model, body: u32) -> u32 {
        if (body as usize) < model.spheres() {
            self.node_of[body as usize]
        } else {
            carom_solve::rows::WORLD
        }
    }
}

/// Membership in O(1): a stale entry of `node_of` points at another body or past the end.
trait Recent {
    fn contains_recent(&self, body: u32, node_of: &[u32]) -> bool;
}

impl Recent for Vec<u32> {
    #[inline]
    fn contains_recent(&self, body: u32, node_of: &[u32]) -> bool {
        self.get(node_of[body as usize] as usize) == Some(&body)
    }
}
