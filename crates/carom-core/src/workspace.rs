//! What the solve of an island reads and writes: parts of the step's memory, or memory of a thread.

use crate::clump::places::Clumps;
use crate::contact::Contact;
use crate::impact::ImpactScratch;
use crate::islands::Island;
use crate::level::coupling::Trial;
use crate::level::Task;
use crate::model::Model;
use crate::outcome::{History, ImpactRecord};
use crate::pile::memory::Pile;
use crate::problem::Keeper;
use crate::report::StepReport;
use crate::state::Warm;
use crate::stepper::generalized_alpha::Prediction;
use crate::wall::places::Walls;
use carom_solve::{Newton, RowSystem};
use glam::DVec3;

/// What the solve of an island reads and writes: parts of the step's scratch, or memory of a thread (`share`).
pub struct IslandScratch<'a> {
    /// Read only: predictions, positions of the level, and the corrections U once they are known.
    pub linear: &'a [Prediction],
    pub angular: &'a [Prediction],
    pub position: &'a [DVec3],
    pub shift: &'a [[DVec3; 2]],
    pub walls: &'a Walls,
    pub clumps: &'a Clumps,
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

/// How a body has moved in the step before its positions are corrected: smoothly, and by loads that are solved once (`by_loads`).
pub fn moved(
    linear: &[Prediction],
    angular: &[Prediction],
    by_loads: &[[DVec3; 2]],
    body: usize,
) -> [DVec3; 2] {
    let [way, turn] = by_loads.get(body).copied().unwrap_or_default();
    [
        linear[body].displacement + way,
        angular[body].displacement + turn,
    ]
}

impl IslandScratch<'_> {
    /// At the position level.
    pub fn moved(&self, body: usize) -> [DVec3; 2] {
        moved(self.linear, self.angular, self.shift, body)
    }
}

/// An island on its way through a level: what is asked, what it is solved with, and what the step reports.
pub struct On<'r, 's> {
    pub task: &'r Task<'r>,
    pub island: Island<'r>,
    pub scratch: &'r mut IslandScratch<'s>,
    pub report: &'r mut StepReport,
}

impl On<'_, '_> {
    /// What the step reports so far, with the residual history of the velocity level.
    pub fn snapshot(&self) -> (StepReport, History) {
        (*self.report, self.scratch.history[2].clone())
    }

    /// Goes back to a snapshot: what was solved since is no part of the step.
    pub fn restore(&mut self, snapshot: (StepReport, History)) {
        (*self.report, self.scratch.history[2]) = snapshot;
    }
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
    /// Local node of each body with a state of motion (valid only for the island at hand) and the reverse.
    pub node_of: Vec<u32>,
    pub bodies: Vec<u32>,
    pub lambda: Vec<f64>,
    pub u: Vec<f64>,
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
            node_of: vec![u32::MAX; model.bodies()],
            ..SolveScratch::default()
        }
    }

    /// Starts an island: nodes for the spheres of its contacts, joints and loads, in order of first use.
    pub fn begin(&mut self, model: &Model, contacts: &[Contact], island: Island) {
        self.system.clear();
        self.bodies.clear();
        for &index in island.contacts {
            let c = &contacts[index as usize];
            for mover in [c.a, c.b].into_iter().filter_map(|b| model.mover(b)) {
                self.add_node(model, mover);
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

    /// Local node of a body, of its clump if it has one; the world for walls.
    #[inline]
    pub fn node(&self, model: &Model, body: u32) -> u32 {
        let mover = model.mover(body);
        mover.map_or(carom_solve::rows::WORLD, |i| self.node_of[i as usize])
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
