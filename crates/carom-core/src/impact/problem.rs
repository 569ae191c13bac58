//! One impact problem: chosen contacts of an island, fixed impulses of earlier problems, Newton's law (eqs. 16, 24). `solve` states and
//! solves it, `totals` adds what it gave.

mod energy;
mod rest;
mod solve;
mod totals;

pub use energy::RowSolution;

use crate::contact::Contact;
use crate::impact::memory::ImpactScratch;
use crate::level::speeds::{opening, Speeds};
use crate::level::{Demand, Task};
use crate::model::Model;
use crate::rows::{flat, Rows};
use crate::workspace::On;
use carom_solve::rows::{RowContact, NODE_DOF, WORLD};
use carom_solve::Status;

impl ImpactScratch {
    /// First row of the joints in `full`.
    pub(super) fn first_joint_row(&self) -> usize {
        let joints = self.full.contacts.get(self.members.len());
        joints.map_or(self.full.rows(), |c| c.row as usize)
    }

    /// Collects the island: rows with the normal of n+1, and its motion.
    pub fn begin(&mut self, on: &mut On) {
        let (scratch, Task { model, state, .. }) = (&mut *on.scratch, *on.task);
        let (contacts, solve) = (&*scratch.contacts, &mut *scratch.solve);
        let (walls, members) = (scratch.walls, on.island.contacts);
        solve.begin(model, contacts, on.island);
        std::mem::swap(&mut self.full, &mut solve.system);
        self.members.clear();
        self.members.extend_from_slice(members);
        self.driven.iter_mut().for_each(Vec::clear);
        self.driven_middle.clear();
        self.wall_speeds = Speeds::default();
        self.wall_loads.clear();
        self.wall_openings.clear();
        self.middle.clear();
        self.opening.clear();
        let once = model.options.loads_once();
        let mut rows: Rows = Default::default();
        for &m in members {
            let c = &contacts[m as usize];
            let dim = scratch.clumps.rows(model, c, c.n1, &mut rows);
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
            let mut middle = Rows::default();
            if once {
                scratch.clumps.middle_rows(model, c, &mut middle);
                self.middle.extend_from_slice(&middle[..dim]);
                self.opening.push(opening(model, state, walls, c));
            }
            if walls.any_moves() {
                let i = c.a as usize;
                let twists = walls.twists(model, c, state, scratch.position[i]);
                let (mut measures, mut along_middle) = ([[0.0; 6]; 2], [0.0; 6]);
                if let Some([old, new]) = twists {
                    old.measures(&rows, dim, &mut measures[0]);
                    new.measures(&rows, dim, &mut measures[1]);
                    let centre = [state.position[i], scratch.position[i]];
                    if let Some(there) = walls.twist_half_way(model, c, centre) {
                        there.measures(&middle, dim, &mut along_middle);
                    }
                    self.wall_speeds.add_wall(&old, &new);
                }
                self.wall_loads
                    .push((measures[1][0] - measures[0][0]).abs());
                let start = walls.start_twist(model, c, state.position[i]);
                let opens = start.map_or(0.0, |start| -c.n0.dot(start.shape));
                self.wall_openings.push(opens);
                for (all, of_contact) in self.driven.iter_mut().zip(&measures) {
                    all.extend_from_slice(&of_contact[..dim]);
                }
                self.driven_middle.extend_from_slice(&along_middle[..dim]);
            }
        }
        self.span = on.task.span;
        self.begin_coupling(on);
        self.begin_motion(on);
        self.forget_problems();
        self.accept_unconverged = on.task.demand == Demand::Accepted;
    }

    /// Velocities per node, speeds and the closing tolerance.
    fn begin_motion(&mut self, on: &On) {
        let (scratch, Task { model, state, .. }) = (&*on.scratch, *on.task);
        let (linear, angular, clumps) = (scratch.linear, scratch.angular, scratch.clumps);
        self.v_check.clear();
        self.v_old.clear();
        self.speeds = self.wall_speeds;
        for &body in &scratch.solve.bodies {
            let i = body as usize;
            let motion = [linear[i].velocity, angular[i].velocity];
            self.v_check
                .extend(flat(clumps.to_node(model, body, motion)));
            let motion = [state.velocity[i], clumps.spin_before(model, state, body)];
            self.v_old.extend(flat(clumps.to_node(model, body, motion)));
            self.speeds.add(model, state, linear[i].velocity, i);
        }
        self.set_closing(model);
    }

    /// Closing tolerances, by the loads on the bodies of each contact.
    pub(super) fn set_closing(&mut self, model: &Model) {
        let load = |node: u32| -> f64 {
            if node == WORLD {
                return 0.0;
            }
            let at = NODE_DOF * node as usize;
            let (new, old) = (&self.v_check[at..at + 3], &self.v_old[at..at + 3]);
            let change = new.iter().zip(old).map(|(new, old)| (new - old).powi(2));
            change.sum::<f64>().sqrt()
        };
        let mut closing = std::mem::take(&mut self.closing);
        closing.clear();
        closing.extend((0..self.members.len()).map(|slot| {
            let c = &self.full.contacts[slot];
            let of_wall = self.wall_loads.get(slot).copied().unwrap_or(0.0);
            let load = load(c.node_a).max(load(c.node_b)).max(of_wall);
            self.speeds
                .closing_tolerance(&model.options, self.span, self.members.len(), load)
        }));
        self.closing = closing;
    }

    /// No problem was solved yet.
    fn forget_problems(&mut self) {
        let (dofs, contacts) = (self.v_check.len(), self.members.len());
        for v in [
            &mut self.jump,
            &mut self.fixed,
            &mut self.offset,
            &mut self.settled,
            &mut self.load_impulse,
            &mut self.velocity,
            &mut self.force,
            &mut self.u,
        ] {
            v.clear();
            v.resize(dofs, 0.0);
        }
        for v in [&mut self.impulse, &mut self.offset_impulse] {
            v.clear();
            v.resize(self.full.rows(), 0.0);
        }
        self.load.clear();
        self.load.resize(self.middle.len(), 0.0);
        self.work.clear();
        self.work.resize(contacts, [0.0; 4]);
        self.work_explained.clear();
        self.work_explained.resize(contacts, 0.0);
        self.status.clear();
        self.status.resize(contacts, Status::Gap);
        (self.problems, self.fineness) = (0, 1.0);
        self.table.begin(true);
    }

    /// Measure of a row of `full` at the velocities `v` of t_n (0) or t_{n+1} (1): against the wall, where that moves.
    #[inline]
    fn relative<const END: usize>(&self, c: &RowContact, row: usize, v: &[f64]) -> f64 {
        let wall = self.driven[END].get(row).copied().unwrap_or(0.0);
        self.full.row_velocity(c, row, v) + wall
    }

    /// What a moving wall adds to a row of `middle` at t_{n+1}.
    #[inline]
    pub(super) fn wall_along_middle(&self, row: usize) -> f64 {
        self.driven_middle.get(row).copied().unwrap_or(0.0)
    }

    /// Normal relative velocity of a contact at `v_check + jump`.
    #[inline]
    pub fn normal_velocity(&self, slot: usize, jump: &[f64]) -> f64 {
        let c = &self.full.contacts[slot];
        let row = c.row as usize;
        self.relative::<1>(c, row, &self.v_check) + self.full.row_velocity(c, row, jump)
    }

    /// Normal relative velocity of a contact at `v_n`; along the normal of then where loads are solved once, for what rolls over a curved
    /// surface does not approach it.
    #[inline]
    pub fn old_normal_velocity(&self, slot: usize) -> f64 {
        let c = &self.full.contacts[slot];
        let of_start = self.opening.get(slot).copied();
        of_start.unwrap_or_else(|| self.relative::<0>(c, c.row as usize, &self.v_old))
    }

    /// The impulse of the problem at hand in a row acts along this.
    #[inline]
    pub(super) fn acts_along(&self, row: usize) -> &[[f64; NODE_DOF]; 2] {
        if self.along_middle {
            &self.middle[row]
        } else {
            &self.full.jac[row]
        }
    }

    /// The fastest that a chosen contact closes at `v_check + jump`, m/s.
    pub fn closing_of_chosen(&self) -> f64 {
        let speeds = self
            .chosen
            .iter()
            .map(|&slot| -self.normal_velocity(slot, &self.jump));
        speeds.fold(0.0, f64::max)
    }

    /// Chooses every contact that closes by more than the tolerance at `v_check + jump`.
    pub fn choose_closing(&mut self) {
        self.chosen.clear();
        for slot in 0..self.members.len() {
            if self.normal_velocity(slot, &self.jump) < -self.closing[slot] {
                self.chosen.push(slot);
            }
        }
    }

    /// Recomputes the jump from all impulses: momentum balance to rounding, whatever path led here.
    fn update_jump(&mut self) {
        self.full.impulses(&self.impulse, &mut self.force);
        if !self.load.is_empty() {
            std::mem::swap(&mut self.full.jac, &mut self.middle);
            for c in &self.full.contacts {
                self.full.add_impulse(c, &self.load, &mut self.force);
            }
            std::mem::swap(&mut self.full.jac, &mut self.middle);
        }
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
            let rows = c.row as usize..(c.row + c.dim) as usize;
            self.impulse[rows.clone()].fill(0.0);
            if let Some(load) = self.load.get_mut(rows) {
                load.fill(0.0);
            }
        }
        let joint_rows = self.first_joint_row();
        self.impulse[joint_rows..].fill(0.0);
        if let Some(load) = self.load.get_mut(joint_rows..) {
            load.fill(0.0);
        }
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
                let Some(load) = self.load.get(row) else {
                    continue;
                };
                let mean = |v: &[f64]| c.along(&self.middle[row], v);
                let of_load =
                    self.wall_along_middle(row) + mean(&self.v_check) + 0.5 * mean(&self.jump);
                self.work[slot][kind] += load * of_load;
            }
        }
    }
}
