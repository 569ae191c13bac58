//! One impact problem: chosen contacts of an island, fixed impulses of earlier problems, Newton's law (eqs. 16, 24).

use super::coupled::Velocities;
use crate::contact::{Contact, Rows};
use crate::islands::Island;
use crate::level::coupling::Trial;
use crate::level::position::along;
use crate::level::velocity::Speeds;
use crate::level::{newton_options, worst_group};
use crate::model::Model;
use crate::problem::Solve;
use crate::report::{Level, StepReport};
use crate::scratch::{ImpactRecord, IslandScratch, SolveScratch};
use crate::state::State;
use crate::stepper::Span;
use carom_solve::rows::{Linear, RowContact, RowSystem, Subproblem, NODE_DOF};
use carom_solve::{SolveReport, Status};

/// Speed over r/h below which the multipliers of joints at rest are rounding.
const AT_REST: f64 = 1e-3;

/// Restitution terms of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// e_N = e_T = 0.
    Plastic,
    /// Newton's law on `v_minus`, normal of n+1, clipped.
    Newton,
    /// As printed: normal of n, not clipped, e_T always.
    Printed,
}

/// An island at velocity level, in local nodes and rows.
#[derive(Default)]
pub struct ImpactScratch {
    /// All closed contacts of the island, then its joints.
    pub full: RowSystem,
    pub members: Vec<u32>,
    pub joints: Vec<u32>,
    pub loads: Vec<u32>,
    /// t_n and t_{n+1}.
    pub span: Span,
    /// `c'(t_{n+1})` of the joint rows, in the order of `full`.
    pub(super) rates: Vec<f64>,
    /// Jump of stage J; wrench of the loads it is counted from, and impulse of their change since (6 per node).
    pub(super) settled: Vec<f64>,
    pub(super) settled_joint: Vec<f64>,
    pub(super) load_base: Vec<f64>,
    pub(super) load_impulse: Vec<f64>,
    /// Smooth and old velocities, total jump, jump of the fixed impulses, jump of stage 0, `V_minus` (6 per node).
    pub v_check: Vec<f64>,
    pub v_old: Vec<f64>,
    pub jump: Vec<f64>,
    pub fixed: Vec<f64>,
    pub v_minus: Vec<f64>,
    /// Accumulated impulses per row of `full`.
    pub impulse: Vec<f64>,
    /// What moving walls add to the measures of contact rows at t_n and t_{n+1}; empty: none moves.
    pub(super) driven: [Vec<f64>; 2],
    /// Slots (into `members`) of the contacts of the problem at hand.
    pub chosen: Vec<usize>,
    pub tol: f64,
    pub speeds: Speeds,
    /// Of the walls of its contacts.
    pub(super) wall_speeds: Speeds,
    pub problems: u32,
    work: Vec<[f64; 4]>,
    status: Vec<Status>,
    pub(super) sub: RowSystem,
    pub(super) lambda: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) scale: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    force: Vec<f64>,
    pub(super) group: Vec<u32>,
    /// Rows of stage 0, kept until the step turns out to have an impact in this island.
    resting: Vec<ImpactRecord>,
    accept_unconverged: bool,
    /// What the last solve told.
    last: SolveReport,
}

impl ImpactScratch {
    /// First row of the joints in `full`.
    pub(super) fn first_joint_row(&self) -> usize {
        let joints = self.full.contacts.get(self.members.len());
        joints.map_or(self.full.rows(), |c| c.row as usize)
    }

    /// Collects the island: rows with the normal of n+1, velocities per node, speeds and the closing tolerance.
    pub fn begin(
        &mut self,
        model: &Model,
        state: &State,
        scratch: &mut IslandScratch,
        island: Island,
        span: Span,
        accept_unconverged: bool,
    ) {
        let IslandScratch {
            contacts,
            solve,
            walls,
            position,
            ..
        } = scratch;
        let members = island.contacts;
        solve.begin(model, contacts, island);
        std::mem::swap(&mut self.full, &mut solve.system);
        self.members.clear();
        self.members.extend_from_slice(members);
        self.driven.iter_mut().for_each(Vec::clear);
        self.wall_speeds = Speeds::default();
        let mut rows: Rows = Default::default();
        for &m in members {
            let c = &contacts[m as usize];
            let dim = c.rows(model, c.n1, &mut rows);
            let (a, b) = (solve.node(model, c.a), solve.node(model, c.b));
            let bounds = c.bounds;
            self.full.push_contact(
                a,
                b,
                bounds,
                c.length,
                c.n1.to_array(),
                &rows[..dim],
                &[0.0; 6][..dim],
            );
            if walls.any_moves() {
                let i = c.a as usize;
                let old = walls.start_twist(model, c, state.position[i]);
                let new = walls.end_twist(model, c, position[i]);
                let mut measures = [[0.0; 6]; 2];
                if let (Some(old), Some(new)) = (old, new) {
                    old.measures(&rows, dim, &mut measures[0]);
                    new.measures(&rows, dim, &mut measures[1]);
                    self.wall_speeds.add_wall(&old, &new);
                }
                for (all, of_contact) in self.driven.iter_mut().zip(&measures) {
                    all.extend_from_slice(&of_contact[..dim]);
                }
            }
        }
        self.span = span;
        self.begin_coupling(model, state, scratch, island);
        let IslandScratch {
            solve,
            linear,
            angular,
            ..
        } = scratch;
        self.v_check.clear();
        self.v_old.clear();
        self.speeds = self.wall_speeds;
        for &body in &solve.bodies {
            let i = body as usize;
            let (lin, ang) = (linear[i].velocity, angular[i].velocity);
            self.v_check
                .extend([lin.x, lin.y, lin.z, ang.x, ang.y, ang.z]);
            let (lin, ang) = (state.velocity[i], state.angular_velocity[i]);
            self.v_old
                .extend([lin.x, lin.y, lin.z, ang.x, ang.y, ang.z]);
            self.speeds.add(model, state, linear[i].velocity, i);
        }
        self.tol = self.speeds.closing_tolerance(&model.options, members.len());
        let dofs = self.v_check.len();
        for v in [
            &mut self.jump,
            &mut self.fixed,
            &mut self.settled,
            &mut self.load_impulse,
        ] {
            v.clear();
            v.resize(dofs, 0.0);
        }
        self.v_minus.clone_from(&self.v_old);
        for v in [&mut self.velocity, &mut self.force, &mut self.u] {
            v.clear();
            v.resize(dofs, 0.0);
        }
        self.impulse.clear();
        self.impulse.resize(self.full.rows(), 0.0);
        self.work.clear();
        self.work.resize(members.len(), [0.0; 4]);
        self.status.clear();
        self.status.resize(members.len(), Status::Gap);
        self.problems = 0;
        self.resting.clear();
        self.accept_unconverged = accept_unconverged;
    }

    /// Measure of a row of `full` at the velocities `v` of t_n (0) or t_{n+1} (1): against the wall, where that moves.
    #[inline]
    fn relative<const END: usize>(&self, c: &RowContact, row: usize, v: &[f64]) -> f64 {
        let wall = self.driven[END].get(row).copied().unwrap_or(0.0);
        self.full.row_velocity(c, row, v) + wall
    }

    /// Normal relative velocity of a contact at `v_check + jump`.
    #[inline]
    pub fn normal_velocity(&self, slot: usize, jump: &[f64]) -> f64 {
        let c = &self.full.contacts[slot];
        let row = c.row as usize;
        self.relative::<1>(c, row, &self.v_check) + self.full.row_velocity(c, row, jump)
    }

    /// Normal relative velocity of a contact at `v_n`.
    #[inline]
    pub fn old_normal_velocity(&self, slot: usize) -> f64 {
        let c = &self.full.contacts[slot];
        self.relative::<0>(c, c.row as usize, &self.v_old)
    }

    /// Chooses every contact that closes by more than the tolerance at `v_check + jump`.
    pub fn choose_closing(&mut self) {
        self.chosen.clear();
        for slot in 0..self.members.len() {
            if self.normal_velocity(slot, &self.jump) < -self.tol {
                self.chosen.push(slot);
            }
        }
    }

    /// Recomputes the jump from all impulses: momentum balance to rounding, whatever path led here.
    fn update_jump(&mut self) {
        self.full.impulses(&self.impulse, &mut self.force);
        for (f, b) in self.force.iter_mut().zip(&self.load_impulse) {
            *f += b;
        }
        self.full.apply_inverse_mass(&self.force, &mut self.jump);
    }

    /// Forgets the impulses of the chosen contacts, and those of joints and loads that answered them (stage 1 solves them
    /// anew); the kept ones' work is restated.
    pub fn drop_chosen(&mut self, contacts: &[Contact]) {
        for &slot in &self.chosen {
            let c = &self.full.contacts[slot];
            self.impulse[c.row as usize..(c.row + c.dim) as usize].fill(0.0);
        }
        let joint_rows = self.first_joint_row();
        self.impulse[joint_rows..].fill(0.0);
        self.load_impulse.fill(0.0);
        self.update_jump();
        for slot in 0..self.members.len() {
            let c = self.full.contacts[slot];
            self.work[slot] = [0.0; 4];
            for r in 0..c.dim as usize {
                let row = c.row as usize + r;
                let before = self.relative::<1>(&c, row, &self.v_check);
                let after = before + self.full.row_velocity(&c, row, &self.jump);
                let kind = contacts[self.members[slot] as usize].row_kind(r);
                self.work[slot][kind] += 0.5 * self.impulse[row] * (before + after);
            }
        }
    }

    /// Solves the chosen contacts by `law` with all present impulses fixed, adds the new ones. With `index` the
    /// problem is an impact (safeguarded and recorded); without it is stage 0. `warm` starts from given impulses.
    pub fn solve_chosen(
        &mut self,
        model: &Model,
        scratch: &mut IslandScratch,
        law: Law,
        index: Option<u32>,
        warm: Option<&[f64]>,
        report: &mut StepReport,
    ) -> bool {
        self.problems += 1;
        self.fixed.clone_from(&self.jump);
        for (v, (c, j)) in self
            .velocity
            .iter_mut()
            .zip(self.v_check.iter().zip(&self.fixed))
        {
            *v = c + j;
        }
        self.scale.clear();
        self.scale.resize(self.chosen.len(), 1.0);
        self.build(model, scratch.contacts, law);
        let problem = index.unwrap_or(0);
        let scaled = index.is_some() && law == Law::Newton && model.options.energy_safeguard;
        // Contacts that can jam (a ball in a corner with mu > 1/sqrt 2) may have no velocities that Newton's law asks for. Smaller
        // parts of the step may take them one by one; where there are none, restitution goes: without it the measures are
        // those of a motion, and the problem has a solution.
        let without = scaled && self.span.smallest;
        let accept = self.accept_unconverged;
        self.accept_unconverged = accept && !without;
        let failed_before = scratch.keeper.failed.take();
        let residual_before = report.residual_velocity;
        let mut solved = self.solve_built(model, scratch, problem, warm, report);
        self.accept_unconverged = accept;
        if !solved && without {
            // What is given up is no part of the step.
            report.residual_velocity = residual_before;
            self.scale.fill(0.0);
            self.build(model, scratch.contacts, law);
            solved = self.solve_built(model, scratch, problem, warm, report);
            report.restitution_scale = 0.0;
            report.fallbacks += 1;
        }
        if !solved {
            return false;
        }
        // What was given up cannot be scaled further.
        if scaled && self.scale.iter().any(|&s| s > 0.0) {
            let fine = self.safeguard(model, scratch, law, index.unwrap_or(0), report);
            if !fine {
                return false;
            }
        }
        if self.last.converged {
            // What was tried on the way, with more restitution, is no failure.
            scratch.keeper.failed = failed_before;
        }
        if scratch.keeper.wants(self.last.iterations) {
            self.keep(model, scratch, index.unwrap_or(0));
        }
        self.commit(scratch.contacts);
        self.record(scratch, index);
        true
    }

    /// Whether the last problem gave no impulse at all: the next ones would be the same.
    pub fn stands_still(&self) -> bool {
        let contacts = self.sub.contacts.iter().filter(|c| !c.bilateral);
        contacts
            .flat_map(|c| &self.lambda[c.row as usize..(c.row + c.dim) as usize])
            .all(|&l| l == 0.0)
    }

    /// Rows of the chosen contacts with their free measures `z0`.
    pub(super) fn build(&mut self, model: &Model, contacts: &[Contact], law: Law) {
        let mut sub = std::mem::take(&mut self.sub);
        sub.clear();
        sub.inv_mass.extend_from_slice(&self.full.inv_mass);
        sub.inv_inertia.extend_from_slice(&self.full.inv_inertia);
        sub.node_length.extend_from_slice(&self.full.node_length);
        for (position, &slot) in self.chosen.iter().enumerate() {
            let c = self.full.contacts[slot];
            let contact = &contacts[self.members[slot] as usize];
            let row = sub.jac.len();
            let rows = c.row as usize..(c.row + c.dim) as usize;
            sub.jac.extend_from_slice(&self.full.jac[rows.clone()]);
            sub.diag.extend_from_slice(&self.full.diag[rows.clone()]);
            sub.z0.extend(
                rows.clone()
                    .map(|r| self.relative::<1>(&c, r, &self.velocity)),
            );
            sub.contacts.push(RowContact {
                row: row as u32,
                ..c
            });
            if law == Law::Plastic {
                continue;
            }
            let material = contact.law(model);
            let scale = self.scale[position];
            let old = self.relative::<0>(&c, c.row as usize, &self.v_minus);
            let (e_n, approach, tangential) = if law == Law::Printed {
                (
                    material.restitution,
                    self.printed_approach(&c, contact),
                    true,
                )
            } else {
                let slow = -old < model.options.restitution_threshold;
                (
                    if slow { 0.0 } else { material.restitution },
                    old.min(0.0),
                    old < -self.tol,
                )
            };
            sub.z0[row] += scale * e_n * approach;
            if tangential && contact.bounds.sliding > 0.0 {
                for r in 1..3 {
                    let slip = self.relative::<0>(&c, c.row as usize + r, &self.v_minus);
                    sub.z0[row + r] += scale * material.tangential_restitution * slip;
                }
            }
        }
        self.add_joints(&mut sub);
        self.sub = sub;
    }

    /// `G_N(n) V_minus`: the normal of t_n, as eqs. 16, 24 and 43 print it.
    fn printed_approach(&self, c: &RowContact, contact: &Contact) -> f64 {
        let n = contact.n0;
        let row = [n.x, n.y, n.z, 0.0, 0.0, 0.0];
        let part = |node: u32| {
            let v = &self.v_minus[NODE_DOF * node as usize..];
            along(&row, glam::DVec3::new(v[0], v[1], v[2]), glam::DVec3::ZERO)
        };
        let mut sum = part(c.node_a);
        if c.node_b != carom_solve::rows::WORLD {
            sum -= part(c.node_b);
        }
        sum + self.driven[0].get(c.row as usize).copied().unwrap_or(0.0)
    }

    pub(super) fn solve_built(
        &mut self,
        model: &Model,
        scratch: &mut IslandScratch,
        problem: u32,
        warm: Option<&[f64]>,
        report: &mut StepReport,
    ) -> bool {
        self.lambda.clear();
        self.lambda.resize(self.sub.rows(), 0.0);
        if let Some(start) = warm {
            self.lambda[..start.len()].copy_from_slice(start);
        }
        self.sub.impulses(&self.lambda, &mut self.force);
        self.sub.apply_inverse_mass(&self.force, &mut self.u);
        let nodes = self.sub.nodes() as f64;
        let mass = self.sub.inv_mass.iter().map(|im| 1.0 / im).sum::<f64>() / nodes;
        let mut speed = self.speeds.largest();
        if !self.joints.is_empty() {
            // Joints are solved at rest too, where every speed is 0.
            speed = speed.max(AT_REST * self.sub.node_length[0] / self.span.h);
        }
        let groups = self.sub.contacts.len();
        let mut floor = model.options.tolerance_floor * mass * speed;
        if groups > model.options.dense_contacts as usize {
            // The speed that would open or close the touching tolerance in this step (`position_floor`).
            let length = self.sub.node_length.iter().sum::<f64>() / nodes;
            floor = floor.max(model.options.touching_tolerance * length / self.span.h * mass);
        }
        let mut options = newton_options(&model.options, groups, floor, false);
        // The closing tolerance must stand clear of what the solver leaves (rule R3).
        if self.speeds.speed > 0.0 && !self.chosen.is_empty() {
            options.tolerance = options.tolerance.min(self.tol / (10.0 * self.speeds.speed));
        }
        let [mut lambda, mut u] = [&mut self.lambda, &mut self.u].map(std::mem::take);
        let mut sub = std::mem::take(&mut self.sub);
        let SolveScratch {
            newton,
            bodies,
            node_of,
            ..
        } = &mut scratch.solve;
        let result = if self.loads.is_empty() {
            newton.solve(&mut sub, &mut Linear, &options, &mut lambda, &mut u)
        } else {
            let mut problem = self.velocities(model, bodies, node_of, scratch.trial);
            newton.solve(&mut sub, &mut problem, &options, &mut lambda, &mut u)
        };
        (self.sub, self.lambda, self.u) = (sub, lambda, u);
        report.add_velocity(&result);
        let history = &mut scratch.history[2];
        if newton.history.len() > history.values.len() {
            history.values.clone_from(&newton.history);
            history.problem = problem;
            history.contacts = self.chosen.len() as u32;
        }
        self.last = result;
        if result.converged {
            return true;
        }
        self.keep(model, scratch, problem);
        report.unconverged += u32::from(self.accept_unconverged);
        self.accept_unconverged
    }

    /// Hands the problem at hand, with what was found, to the keeper.
    #[cold]
    fn keep(&mut self, model: &Model, scratch: &mut IslandScratch, index: u32) {
        let members: Vec<u32> = self.chosen.iter().map(|&slot| self.members[slot]).collect();
        let (mut multiplier, mut correction) = (self.lambda.clone(), self.u.clone());
        if !multiplier.iter().chain(&correction).all(|x| x.is_finite()) {
            multiplier.fill(0.0);
            correction.fill(0.0);
        }
        // On a copy: the step goes on from what its last solve left.
        let mut system = self.sub.clone();
        let mut measures = vec![0.0; system.rows()];
        if self.loads.is_empty() {
            system.linear_measures(&correction, &mut measures);
        } else {
            let SolveScratch {
                bodies, node_of, ..
            } = &scratch.solve;
            self.velocities(model, bodies, node_of, scratch.trial)
                .evaluate(&mut system, &correction, &mut measures);
        }
        scratch.keeper.keep(&Solve {
            model,
            contacts: scratch.contacts,
            members: &members,
            spheres: &scratch.solve.bodies,
            system: &system,
            measures: &measures,
            multiplier: &multiplier,
            correction: &correction,
            motion: &self.velocity,
            level: Level::Velocity,
            index,
            report: self.last,
            worst: worst_group(&self.sub, scratch.solve.newton.residual_rows()),
        });
    }

    /// The problem at hand where loads depend on the velocities.
    fn velocities<'a>(
        &'a self,
        model: &'a Model,
        bodies: &'a [u32],
        node_of: &'a [u32],
        trial: &'a mut Trial,
    ) -> Velocities<'a> {
        Velocities {
            model,
            loads: &self.loads,
            bodies,
            node_of,
            trial,
            span: self.span,
            before: &self.velocity,
            base: &self.load_base,
            known: &self.load_impulse,
        }
    }

    /// Adds the new impulses and their work to the totals.
    fn commit(&mut self, contacts: &[Contact]) {
        for (position, &slot) in self.chosen.iter().enumerate() {
            let (c, s) = (self.full.contacts[slot], self.sub.contacts[position]);
            for r in 0..c.dim as usize {
                let (row, sub_row) = (c.row as usize + r, s.row as usize + r);
                let value = self.lambda[sub_row];
                self.impulse[row] += value;
                let before = self.relative::<1>(&c, row, &self.velocity);
                let after = before + self.full.row_velocity(&c, row, &self.u);
                let kind = contacts[self.members[slot] as usize].row_kind(r);
                self.work[slot][kind] += 0.5 * value * (before + after);
            }
            if self.lambda[s.row as usize] > 0.0 {
                let xi_slip = self.is_slipping(position);
                self.status[slot] = if xi_slip { Status::Slip } else { Status::Stick };
            }
        }
        let joints = self.full.contacts[self.members.len()..].iter();
        for (c, s) in joints.zip(&self.sub.contacts[self.chosen.len()..]) {
            for r in 0..c.dim as usize {
                self.impulse[c.row as usize + r] += self.lambda[s.row as usize + r];
            }
        }
        for (sum, b) in self.load_impulse.iter_mut().zip(&self.sub.load) {
            *sum += b;
        }
        self.update_jump();
    }

    /// Whether the sliding disc of a chosen contact is saturated.
    fn is_slipping(&self, position: usize) -> bool {
        let c = &self.sub.contacts[position];
        if c.bounds.sliding <= 0.0 {
            return true;
        }
        let row = c.row as usize;
        let friction = self.lambda[row + 1].hypot(self.lambda[row + 2]);
        friction >= c.bounds.sliding * self.lambda[row] * (1.0 - 1e-12)
    }

    /// Keeps the problem in the table of impacts. Stage 0, and a first problem in which only loads act (laws without
    /// stage 0 solve rest as an impact), enter it only if an impact follows in this island.
    fn record(&mut self, scratch: &mut IslandScratch, index: Option<u32>) {
        let loads_only = |slot: &usize| self.old_normal_velocity(*slot) >= -self.tol;
        let quiet = index.is_none() || (index == Some(1) && self.chosen.iter().all(loads_only));
        let mut rows = std::mem::take(&mut self.resting);
        for (position, &slot) in self.chosen.iter().enumerate() {
            let s = &self.sub.contacts[position];
            let row = s.row as usize;
            if self.lambda[row] <= 0.0 {
                continue;
            }
            let contact = scratch.contacts[self.members[slot] as usize];
            let mut packed = [0.0; 6];
            packed[..s.dim as usize].copy_from_slice(&self.lambda[row..row + s.dim as usize]);
            let world = contact.to_world(contact.n1, &packed);
            let full = &self.full.contacts[slot];
            let approach = self.relative::<1>(full, full.row as usize, &self.velocity);
            rows.push(ImpactRecord {
                problem: index.unwrap_or(0),
                a: contact.a,
                b: contact.b,
                status: self.status[slot] as u8,
                normal: contact.n1,
                impulse: world.impulse,
                moment: world.moment,
                approach,
                separation: approach + self.sub.row_velocity(s, row, &self.u),
                restitution_scale: self.scale[position],
            });
        }
        if !quiet {
            scratch.impacts.append(&mut rows);
        }
        self.resting = rows;
    }

    /// Writes the island's result into the step's scratch.
    pub fn finish(&mut self, model: &Model, scratch: &mut IslandScratch, report: &mut StepReport) {
        report.impact_problems = report.impact_problems.max(self.problems);
        for (node, &body) in scratch.solve.bodies.iter().enumerate() {
            let at = NODE_DOF * node..NODE_DOF * (node + 1);
            let (j, s) = (&self.jump[at.clone()], &self.settled[at]);
            let jump = [
                glam::DVec3::new(j[0] + s[0], j[1] + s[1], j[2] + s[2]),
                glam::DVec3::new(j[3] + s[3], j[4] + s[4], j[5] + s[5]),
            ];
            scratch.corrections.set(body, jump);
        }
        self.finish_joints(model, scratch);
        for (slot, &m) in self.members.iter().enumerate() {
            let c = &self.full.contacts[slot];
            let contact = &mut scratch.contacts[m as usize];
            contact.lambda = [0.0; 6];
            contact.lambda[..c.dim as usize]
                .copy_from_slice(&self.impulse[c.row as usize..(c.row + c.dim) as usize]);
            contact.work = self.work[slot];
            contact.status = self.status[slot];
            let free = self.relative::<1>(c, c.row as usize, &self.v_check);
            let touching = contact.gap_start <= model.options.touching_tolerance * contact.length;
            // Overlap made by the smooth motion, not by a neighbour's position correction.
            let overlapped = contact.gap_check < 0.0 && contact.nu[0] > 0.0;
            if overlapped && free > self.tol && !touching {
                report.missed_impacts += 1;
            }
        }
    }
}
