//! Contact problems of a run kept as data: those of chosen steps, the hardest, and the one that could not be solved.
//!
//! A problem is stated at the solution found, where its measures are linear: rows `G` and `q = z(u) - G u`, so that the
//! multipliers of the step solve `u = M^-1 (G^T r + b), z = G u + q` to the tolerance of the step. Every contact has all six
//! rows (N, T1, T2, R1, R2, S); one that the step did not need has the bound 0. Nothing is computed unless it was asked for.

use crate::clump::places::Clumps;
use crate::contact::Contact;
use crate::model::Model;
use crate::outcome::Level;
use crate::rows::Rows;
use carom_solve::ladder::Attempt;
use carom_solve::rows::{RowContact, RowSystem, NODE_DOF};
use carom_solve::{Bounds, SolveReport};

/// Rows of a kept contact.
pub const CONTACT_ROWS: usize = 6;

/// A contact problem as it stood in a step: rows over nodes, row groups of contacts before those of joints.
#[derive(Clone, Debug)]
pub struct KeptProblem {
    pub level: Level,
    pub step: u64,
    /// Time at the end of the step, s.
    pub time: f64,
    /// 0: the whole step; else the number of the attempt at a shorter one within it.
    pub part: u32,
    /// Number of the island in its level.
    pub island: u32,
    /// Number of the impact problem, 0 for stage 0 and at position level.
    pub index: u32,
    pub iterations: u32,
    /// Relative residual of eq. 44.
    pub residual: f64,
    pub converged: bool,
    /// How it was tried to solve it, rung by rung.
    pub attempts: Vec<Attempt>,
    /// Per node: the sphere or free wall (as known outside), its mass and its moment of inertia.
    pub spheres: Vec<u32>,
    pub mass: Vec<f64>,
    pub inertia: Vec<f64>,
    /// Bodies of every contact, then of every joint (the ground counts as the joined sphere itself).
    pub bodies: Vec<(u32, u32)>,
    /// mu, rho, delta of every contact.
    pub bounds: Vec<[f64; 3]>,
    pub joints: u32,
    /// Per row: nodes A and B (`WORLD`: none), gradient over both, `q`, multiplier.
    pub nodes: Vec<[u32; 2]>,
    pub gradient: Vec<[[f64; NODE_DOF]; 2]>,
    pub free: Vec<f64>,
    pub multiplier: Vec<f64>,
    /// Per node, 6 each: motion before the correction (velocity, or displacement in the step), and the correction `u`.
    pub motion: Vec<f64>,
    pub correction: Vec<f64>,
    /// Loads that depend on the motion at `u`, 6 per node, and `-db/du`; empty: none.
    pub load: Vec<f64>,
    pub load_tangent: Vec<(u32, u32, f64)>,
    /// Contact or joint with the largest residual row.
    pub worst: u32,
}

/// A solve, as its place in the step knows it. `system` and `measures` are those at `correction`.
pub struct Solve<'a> {
    pub model: &'a Model,
    pub contacts: &'a [Contact],
    pub clumps: &'a Clumps,
    /// The contacts of the problem, in the order of `system`.
    pub members: &'a [u32],
    pub spheres: &'a [u32],
    pub system: &'a RowSystem,
    pub measures: &'a [f64],
    pub multiplier: &'a [f64],
    pub correction: &'a [f64],
    /// 6 per node.
    pub motion: &'a [f64],
    pub level: Level,
    pub index: u32,
    pub report: SolveReport,
    /// What the solver tried; empty: the report says all.
    pub attempts: &'a [Attempt],
    /// Contact or joint with the largest residual row.
    pub worst: usize,
}

impl Solve<'_> {
    fn state(&self) -> KeptProblem {
        let system = self.system;
        let rows = CONTACT_ROWS * system.contacts.len();
        let mut kept = KeptProblem {
            level: self.level,
            step: 0,
            time: 0.0,
            part: 0,
            island: 0,
            index: self.index,
            iterations: self.report.iterations,
            residual: self.report.residual,
            converged: self.report.converged,
            attempts: match self.attempts {
                [] => vec![self.report.attempt()],
                several => several.to_vec(),
            },
            spheres: self
                .spheres
                .iter()
                .map(|&i| self.model.outside(i))
                .collect(),
            mass: system.inv_mass.iter().map(|im| 1.0 / im).collect(),
            inertia: system.inv_inertia.iter().map(|ii| 1.0 / ii).collect(),
            bodies: Vec::with_capacity(system.contacts.len()),
            bounds: Vec::with_capacity(self.members.len()),
            joints: (system.contacts.len() - self.members.len()) as u32,
            nodes: Vec::with_capacity(rows),
            gradient: Vec::with_capacity(rows),
            free: Vec::with_capacity(rows),
            multiplier: Vec::with_capacity(rows),
            motion: self.motion.to_vec(),
            correction: self.correction.to_vec(),
            load: system.load.clone(),
            load_tangent: system.load_tangent.clone(),
            worst: self.worst as u32,
        };
        for (slot, &m) in self.members.iter().enumerate() {
            self.push_contact(
                &mut kept,
                &system.contacts[slot],
                &self.contacts[m as usize],
            );
        }
        for group in &system.contacts[self.members.len()..] {
            let sphere = |node: u32| self.spheres.get(node as usize).copied();
            let a = sphere(group.node_a).unwrap_or(0);
            kept.bodies.push((a, sphere(group.node_b).unwrap_or(a)));
            for row in group.rows() {
                self.push_row(&mut kept, [group.node_a, group.node_b], row);
            }
        }
        kept
    }

    /// All six rows of a contact.
    fn push_contact(&self, kept: &mut KeptProblem, group: &RowContact, c: &Contact) {
        let bounds = match group.dim {
            // Positions that are corrected along normals alone.
            1 => Bounds::default(),
            _ => c.bounds,
        };
        let [mu, rho, delta] = [bounds.sliding, bounds.rolling, bounds.spinning];
        kept.bodies.push((c.a, c.b));
        kept.bounds.push([mu, rho, delta]);
        let all = Contact {
            bounds: Bounds {
                sliding: 1.0,
                rolling: 1.0,
                spinning: 1.0,
            },
            ..*c
        };
        let mut full = Rows::default();
        self.clumps.rows(self.model, &all, c.n0, &mut full);
        let nodes = [group.node_a, group.node_b];
        let mut row = group.row as usize;
        for (gradient, bound) in full.iter().zip([1.0, mu, mu, rho, rho, delta]) {
            if bound > 0.0 {
                self.push_row(kept, nodes, row);
                row += 1;
            } else {
                // No force acts in this row, so what it measures without one is all that there is to say.
                kept.nodes.push(nodes);
                kept.gradient.push(*gradient);
                kept.free.push(along(gradient, nodes, self.motion));
                kept.multiplier.push(0.0);
            }
        }
    }

    /// A row of the system as it stands.
    fn push_row(&self, kept: &mut KeptProblem, nodes: [u32; 2], row: usize) {
        let gradient = self.system.jac[row];
        kept.nodes.push(nodes);
        kept.gradient.push(gradient);
        kept.free
            .push(self.measures[row] - along(&gradient, nodes, self.correction));
        kept.multiplier.push(self.multiplier[row]);
    }
}

/// `G v` of one row, 6 values of `v` per node.
fn along(gradient: &[[f64; NODE_DOF]; 2], nodes: [u32; 2], v: &[f64]) -> f64 {
    let side = |g: &[f64; NODE_DOF], node: u32| {
        let start = NODE_DOF * node as usize;
        let motion = v.get(start..start + NODE_DOF);
        motion.map_or(0.0, |v| g.iter().zip(v).map(|(g, v)| g * v).sum())
    };
    side(&gradient[0], nodes[0]) + side(&gradient[1], nodes[1])
}

/// Steps `first, first + stride, ...` up to and including `last`.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    pub first: u64,
    pub last: u64,
    pub stride: u64,
}

impl Steps {
    fn contains(&self, step: u64) -> bool {
        (self.first..=self.last).contains(&step) && (step - self.first) % self.stride.max(1) == 0
    }
}

/// Decides which problems are kept, and keeps them. Without a choice it costs two comparisons per solve.
#[derive(Default)]
pub struct Keeper {
    /// Steps of which everything is kept.
    pub steps: Vec<Steps>,
    /// How many of the hardest problems of the run are kept besides, by iterations.
    pub hardest: usize,
    /// The problem that could not be solved last.
    pub failed: Option<KeptProblem>,
    /// Where the step stands: island at hand, attempt within the step.
    pub island: u32,
    pub part: u32,
    step: u64,
    time: f64,
    chosen: bool,
    kept: Vec<KeptProblem>,
    /// Sorted by iterations, hardest first, older before newer.
    ranking: Vec<KeptProblem>,
    /// Of a thread: iterations of the last of the step's full ranking, which the hardest must exceed.
    exceed: Option<u32>,
}

impl Keeper {
    pub(crate) fn begin_step(&mut self, step: u64, time: f64) {
        (self.step, self.time, self.part) = (step, time, 0);
        self.chosen = self.steps.iter().any(|s| s.contains(step));
    }

    /// Whether a problem that took so many iterations is to be kept.
    #[inline]
    pub(crate) fn wants(&self, iterations: u32) -> bool {
        self.chosen || (self.hardest > 0 && self.ranks(iterations))
    }

    fn ranks(&self, iterations: u32) -> bool {
        let least = self.ranking.last().map_or(0, |p| p.iterations);
        (self.ranking.len() < self.hardest || iterations > least)
            && self.exceed.is_none_or(|least| iterations > least)
    }

    /// For a thread that solves some islands of the level at hand.
    pub(crate) fn fork(&self) -> Keeper {
        let full = self.hardest > 0 && self.ranking.len() >= self.hardest;
        let last = self.ranking.last().filter(|_| full);
        Keeper {
            hardest: self.hardest,
            part: self.part,
            step: self.step,
            time: self.time,
            chosen: self.chosen,
            exceed: last.map(|p| p.iterations),
            ..Keeper::default()
        }
    }

    /// Takes what a thread kept of an island, as if it had been solved here; `failed` is the problem in it that could not be
    /// solved. Islands come in their order.
    pub(crate) fn take_over(
        &mut self,
        fork: &mut Keeper,
        island: u32,
        failed: Option<&KeptProblem>,
    ) {
        if let Some(problem) = failed {
            self.failed = Some(problem.clone());
        }
        for problem in fork.ranking.iter().filter(|p| p.island == island) {
            self.rank(problem);
        }
        let count = fork.kept.partition_point(|p| p.island <= island);
        self.kept.extend(fork.kept.drain(..count));
    }

    /// Puts a problem among the hardest, if it is one of them.
    fn rank(&mut self, problem: &KeptProblem) {
        if self.hardest > 0 && self.ranks(problem.iterations) {
            let place = self
                .ranking
                .partition_point(|p| p.iterations >= problem.iterations);
            self.ranking.insert(place, problem.clone());
            self.ranking.truncate(self.hardest);
        }
    }

    /// Keeps a problem, if it is wanted or was not solved. Joints alone are no contact problem: of them only what failed is told.
    #[cold]
    pub(crate) fn keep(&mut self, solve: &Solve) {
        let mut problem = solve.state();
        (problem.step, problem.time) = (self.step, self.time);
        (problem.part, problem.island) = (self.part, self.island);
        if !problem.converged {
            self.failed = Some(problem.clone());
        }
        if solve.members.is_empty() {
            return;
        }
        self.rank(&problem);
        if self.chosen {
            self.kept.push(problem);
        }
    }

    /// Forgets what was solved in vain: the problems of this attempt and level (all levels without one), since pairs were
    /// listed anew or the attempt failed. What could not be solved stays.
    pub(crate) fn discard(&mut self, level: Option<Level>) {
        if self.kept.is_empty() && self.ranking.is_empty() {
            return;
        }
        let (step, part) = (self.step, self.part);
        let stays = |p: &KeptProblem| {
            let here = p.step == step && p.part == part && level.is_none_or(|l| l == p.level);
            !(here && p.converged)
        };
        self.kept.retain(stays);
        self.ranking.retain(stays);
    }

    /// Begins a step that is made once more to keep all of it; gives what `end_again` needs.
    pub(crate) fn begin_again(&mut self, step: u64, time: f64) -> (Vec<KeptProblem>, usize) {
        let before = (
            std::mem::take(&mut self.kept),
            std::mem::take(&mut self.hardest),
        );
        self.begin_step(step, time);
        self.chosen = true;
        before
    }

    /// Ends it: the last of its problems that fits, with the problem itself; what was kept before stays.
    pub(crate) fn end_again(
        &mut self,
        (kept, hardest): (Vec<KeptProblem>, usize),
        fits: impl Fn(&KeptProblem) -> bool,
    ) -> Option<KeptProblem> {
        let mut again = std::mem::replace(&mut self.kept, kept);
        (self.hardest, self.chosen) = (hardest, false);
        let last = again.iter().rposition(fits)?;
        Some(again.swap_remove(last))
    }

    /// Takes the problems of the chosen steps made since the last call.
    pub fn take(&mut self) -> Vec<KeptProblem> {
        std::mem::take(&mut self.kept)
    }

    /// Takes the hardest problems.
    pub fn take_hardest(&mut self) -> Vec<KeptProblem> {
        std::mem::take(&mut self.ranking)
    }
}
