//! Joints and loads in the impact problems of an island (`docs/theory/algorithm.md`, section 7): every problem holds all
//! joint rows, and loads act through the change of `h f` with the velocities of the problem (eq. 4).

use super::law::Law;
use crate::clump::places::Clumps;
use crate::impact::memory::ImpactScratch;
use crate::joint::add_reaction;
use crate::level::coupling::Trial;
use crate::level::Task;
use crate::model::Model;
use crate::rotation;
use crate::rows::{flat, halves, Rows};
use crate::stepper::Span;
use crate::workspace::{IslandScratch, On};
use carom_solve::rows::{Measured, RowSystem, Subproblem, NODE_DOF, WORLD};
use glam::DVec3;

/// Velocity measures, linear in `u`, beside loads that are not.
pub struct CoupledVelocities<'a> {
    pub model: &'a Model,
    pub clumps: &'a Clumps,
    pub loads: &'a [u32],
    pub bodies: &'a [u32],
    pub node_of: &'a [u32],
    /// Placements at q_{n+1}.
    pub trial: &'a mut Trial,
    pub span: Span,
    /// CoupledVelocities at `u = 0`, 6 per node.
    pub before: &'a [f64],
    /// Wrench that the change is counted from, and the part of its impulse that is known already.
    pub base: &'a [f64],
    pub known: &'a [f64],
    /// Rows along which it measures; none: those of the impulses.
    pub measured: &'a [[[f64; NODE_DOF]; 2]],
}

impl Subproblem for CoupledVelocities<'_> {
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]) {
        Measured(self.measured).write(system, u, z);
        let h = self.span.h;
        for (node, &body) in self.bodies.iter().enumerate() {
            let at = |k: usize| self.before[NODE_DOF * node + k] + u[NODE_DOF * node + k];
            let motion = [
                DVec3::new(at(0), at(1), at(2)),
                DVec3::new(at(3), at(4), at(5)),
            ];
            let [velocity, spin] = self.clumps.from_node(self.model, body, motion);
            self.trial.velocity[body as usize] = velocity;
            self.trial.angular_velocity[body as usize] = spin;
        }
        let mut load = std::mem::take(&mut system.load);
        self.trial.wrenches(
            self.model,
            self.clumps,
            self.loads,
            self.bodies,
            self.span.end,
            &mut load,
        );
        for (b, (base, known)) in load.iter_mut().zip(self.base.iter().zip(self.known)) {
            *b = h * (*b - base) - known;
        }
        self.trial.stiffness(
            self.model,
            self.clumps,
            (self.loads, self.node_of),
            self.span.end,
            (0.0, h),
            &mut system.load_tangent,
        );
        system.load = load;
    }
}

impl ImpactScratch {
    /// Joint rows at q_{n+1}, their rates, and the loads at `(q_check, v_check)`.
    pub(super) fn begin_coupling(&mut self, on: &mut On) {
        let (island, Task { model, state, .. }) = (on.island, *on.task);
        self.joints.clear();
        self.joints.extend_from_slice(island.joints);
        self.loads.clear();
        self.loads.extend_from_slice(island.loads);
        self.linked.clear();
        self.rates.iter_mut().for_each(Vec::clear);
        self.load_base.clear();
        if island.is_free() {
            return;
        }
        let scratch = &mut *on.scratch;
        let (linear, angular) = (scratch.linear, scratch.angular);
        let (solve, trial) = (&*scratch.solve, &mut *scratch.trial);
        let orientation = |i: usize, turn: DVec3| rotation::advance(turn, state.orientation[i]);
        for &body in &solve.bodies {
            let i = body as usize;
            trial.position[i] = state.position[i] + linear[i].displacement;
            trial.orientation[i] = orientation(i, angular[i].displacement);
            trial.velocity[i] = linear[i].velocity;
            trial.angular_velocity[i] = angular[i].velocity;
        }
        let end = self.span.end;
        if !self.loads.is_empty() {
            let ends = self.loads.iter().map(|&l| model.loads[l as usize].bodies());
            let pairs = ends.filter_map(|[a, b]| Some([a?, b?]));
            let node = |body: u32| solve.node_of[body as usize];
            self.linked.extend(pairs.map(|pair| pair.map(node)));
            self.load_base.resize(NODE_DOF * solve.bodies.len(), 0.0);
            let base = &mut self.load_base;
            trial.wrenches(model, scratch.clumps, &self.loads, &solve.bodies, end, base);
        }
        for &body in &solve.bodies {
            let i = body as usize;
            trial.position[i] = scratch.position[i];
            let turn = angular[i].displacement + scratch.shift[i][1];
            trial.orientation[i] = orientation(i, turn);
        }
        let mut rows = Rows::default();
        for &index in &self.joints {
            let joint = &model.joints[index as usize];
            let dim = joint.gradient_at(&trial.poses(joint), &mut rows);
            (scratch.clumps).scale_rows(model, [joint.a, joint.b], &mut rows[..dim]);
            let node = |body: u32| solve.node_of.get(body as usize).copied().unwrap_or(WORLD);
            for (all, time) in self.rates.iter_mut().zip([self.span.start, end]) {
                let mut rates = [0.0; 6];
                joint.rates(time, &mut rates);
                all.extend_from_slice(&rates[..dim]);
            }
            let nodes = (node(joint.a), node(joint.b));
            let zeros = [0.0; 6];
            self.full.push_joint(
                nodes,
                joint.translational,
                joint.length,
                &rows[..dim],
                &zeros[..dim],
            );
            if model.options.loads_once() {
                self.middle.extend_from_slice(&rows[..dim]);
            }
        }
    }

    /// Rows of the joints, and room for the loads, behind the contacts of a problem. What joints prescribe is that of t_n (0) or t_{n+1} (1).
    pub(super) fn add_joints(&self, sub: &mut RowSystem, end: usize) {
        let first = self.first_joint_row();
        for c in &self.full.contacts[self.members.len()..] {
            let rows = c.rows();
            let row = sub.jac.len() as u32;
            sub.jac.extend_from_slice(&self.acting()[rows.clone()]);
            sub.diag.extend_from_slice(&self.full.diag[rows.clone()]);
            sub.z0.extend(rows.map(|r| {
                self.full.row_velocity(c, r, &self.velocity) - self.rates[end][r - first]
            }));
            sub.contacts
                .push(carom_solve::rows::RowContact { row, ..*c });
        }
        if !self.loads.is_empty() {
            sub.open_load();
        }
    }

    /// Stage J: joints and the change of loads alone, from `v_check`; what follows starts from its result.
    pub(super) fn settle(&mut self, on: &mut On) -> bool {
        let Task { model, state, .. } = *on.task;
        self.chosen.clear();
        self.scale.clear();
        self.velocity.clone_from(&self.v_check);
        self.along_middle = false;
        self.build(on, Law::Plastic);
        if !self.solve_built(on, 0, None) {
            return false;
        }
        let scratch = &mut *on.scratch;
        self.balance();
        let first = self.first_joint_row();
        self.impulse[first..].copy_from_slice(&self.lambda);
        self.settled.clone_from(&self.u);
        for (v, u) in self.v_check.iter_mut().zip(&self.u) {
            *v += u;
        }
        self.speeds = self.wall_speeds;
        for (node, &body) in scratch.solve.bodies.iter().enumerate() {
            let settled = halves(&self.v_check[NODE_DOF * node..]);
            let [velocity, spin] = scratch.clumps.from_node(model, body, settled);
            self.speeds.add(model, state, velocity, body as usize);
            scratch.trial.velocity[body as usize] = velocity;
            scratch.trial.angular_velocity[body as usize] = spin;
        }
        self.set_closing(model);
        // From here on loads count from the settled motion, and joints from zero.
        self.settled_joint = self.impulse[first..].to_vec();
        self.impulse[first..].fill(0.0);
        if !self.loads.is_empty() {
            let (loads, bodies) = (&self.loads, &scratch.solve.bodies);
            let (clumps, end) = (scratch.clumps, self.span.end);
            let base = &mut self.load_base;
            (scratch.trial).wrenches(model, clumps, loads, bodies, end, base);
        }
        true
    }

    /// Adds the joints' impulses at the velocity level to their totals of the step.
    pub(super) fn finish_joints(&self, model: &Model, scratch: &mut IslandScratch) {
        let first = self.first_joint_row();
        let mut row = 0;
        for &index in &self.joints {
            let (index, joint) = (index as usize, &model.joints[index as usize]);
            for r in 0..joint.rows.len() {
                let lambda = self.settled_joint[row] + self.impulse[first + row];
                let total = &mut scratch.joint_reaction[index];
                let own = |row: &[[f64; NODE_DOF]; 2]| {
                    let of_body = scratch.clumps.to_node(model, joint.a, halves(&row[0]));
                    [flat(of_body), row[1]]
                };
                add_reaction(joint, r, &own(&self.full.jac[first + row]), lambda, total);
                if let Some(&load) = self.load.get(first + row) {
                    add_reaction(joint, r, &own(&self.middle[first + row]), load, total);
                }
                row += 1;
            }
        }
    }
}
