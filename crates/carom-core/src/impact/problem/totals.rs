//! What impact problems gave: totals of the island, the table of impacts, the results of the step.

use crate::contact::Contact;
use crate::impact::law::Law;
use crate::impact::memory::ImpactScratch;
use crate::impact::table::ImpactRow;
use crate::rows::halves;
use crate::workspace::On;
use carom_solve::rows::NODE_DOF;
use carom_solve::Status;

impl ImpactScratch {
    /// Adds the new impulses and their work to the totals.
    pub(in crate::impact) fn commit(&mut self, contacts: &[Contact]) {
        for (position, &slot) in self.chosen.iter().enumerate() {
            let (c, s) = (self.full.contacts[slot], self.sub.contacts[position]);
            for r in 0..c.dim as usize {
                let (row, sub_row) = (c.row as usize + r, s.row as usize + r);
                let value = self.lambda[sub_row];
                let along = self.acts_along(row);
                let before = if self.along_middle {
                    c.along(along, &self.velocity) + self.wall_along_middle(row)
                } else {
                    self.relative::<1>(&c, row, &self.velocity)
                };
                let after = before + c.along(along, &self.u);
                let given = if self.along_middle {
                    &mut self.load
                } else {
                    &mut self.impulse
                };
                given[row] += value;
                let kind = contacts[self.members[slot] as usize].row_kind(r);
                self.work[slot][kind] += 0.5 * value * (before + after);
            }
            self.work_explained[slot] += self.explained[position];
            if self.lambda[s.row as usize] > 0.0 {
                let xi_slip = self.is_slipping(position);
                self.status[slot] = if xi_slip { Status::Slip } else { Status::Stick };
            }
        }
        let joints = self.full.contacts[self.members.len()..].iter();
        for (c, s) in joints.zip(&self.sub.contacts[self.chosen.len()..]) {
            let given = if self.along_middle {
                &mut self.load
            } else {
                &mut self.impulse
            };
            for r in 0..c.dim as usize {
                given[c.row as usize + r] += self.lambda[s.row as usize + r];
            }
        }
        for (sum, b) in self.load_impulse.iter_mut().zip(&self.sub.load) {
            *sum += b;
        }
        self.update_jump();
    }

    /// All that a contact was given, packed.
    pub(in crate::impact) fn packed(&self, slot: usize) -> [f64; 6] {
        let c = &self.full.contacts[slot];
        let rows = c.rows();
        let mut packed = [0.0; 6];
        packed[..c.dim as usize].copy_from_slice(&self.impulse[rows.clone()]);
        for (sum, load) in packed
            .iter_mut()
            .zip(self.load.get(rows).unwrap_or_default())
        {
            *sum += load;
        }
        packed
    }

    /// What the loads gave a contact, packed.
    pub(in crate::impact) fn packed_load(&self, slot: usize) -> [f64; 6] {
        let c = &self.full.contacts[slot];
        let rows = c.rows();
        let mut packed = [0.0; 6];
        if let Some(load) = self.load.get(rows) {
            packed[..c.dim as usize].copy_from_slice(load);
        }
        packed
    }

    /// Takes the loads of the chosen contacts as they are.
    pub(in crate::impact) fn take_loads(&mut self, on: &On, loads: &[f64]) {
        (self.law, self.along_middle) = (Law::Plastic, true);
        self.set_velocities(Law::Plastic);
        self.scale.clear();
        self.scale.resize(self.chosen.len(), 1.0);
        self.build(on, Law::Plastic);
        self.lambda.clear();
        self.lambda.extend_from_slice(loads);
        self.sub.impulses(&self.lambda, &mut self.force);
        self.sub.apply_inverse_mass(&self.force, &mut self.u);
        self.explain();
    }

    /// Writes the loads of the island, and the jumps that they make.
    pub(in crate::impact) fn give_loads(&self, on: &mut On) {
        for (slot, &m) in self.members.iter().enumerate() {
            let c = &mut on.scratch.contacts[m as usize];
            c.load = self.packed_load(slot);
        }
        self.give_jumps(on);
    }

    fn give_jumps(&self, on: &mut On) {
        let (model, scratch) = (on.task.model, &mut *on.scratch);
        for (node, &body) in scratch.solve.bodies.iter().enumerate() {
            let at = NODE_DOF * node..NODE_DOF * (node + 1);
            let (j, s) = (&self.jump[at.clone()], &self.settled[at]);
            let ([v, w], [v_s, w_s]) = (halves(j), halves(s));
            let jump = [v + v_s, w + w_s];
            let jump = scratch.clumps.from_node(model, body, jump);
            scratch.corrections.set(body, jump);
        }
    }

    /// Whether no joint, load or moving wall belongs to the island.
    pub(in crate::impact) fn has_contacts_alone(&self) -> bool {
        let moves = self.driven.iter().flatten().any(|&v| v != 0.0);
        self.joints.is_empty() && self.loads.is_empty() && !moves
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

    /// Keeps the problem for the table of impacts.
    pub(in crate::impact) fn record(&mut self, contacts: &[Contact], problem: u32) {
        let mut table = std::mem::take(&mut self.table);
        for (position, &slot) in self.chosen.iter().enumerate() {
            let s = &self.sub.contacts[position];
            let row = s.row as usize;
            if self.lambda[row] <= 0.0 {
                continue;
            }
            let contact = &contacts[self.members[slot] as usize];
            let mut packed = [0.0; 6];
            packed[..s.dim as usize].copy_from_slice(&self.lambda[row..row + s.dim as usize]);
            let world = if self.along_middle {
                let middle = contact.middle();
                middle.to_world(middle.n1, &packed)
            } else {
                contact.to_world(contact.n1, &packed)
            };
            let full = &self.full.contacts[slot];
            let normal_before = self.relative::<1>(full, full.row as usize, &self.velocity);
            table.push(|| ImpactRow {
                slot: slot as u32,
                problem,
                status: self.status[slot],
                given: [world.impulse, world.moment],
                speed: [
                    normal_before,
                    normal_before + self.full.row_velocity(full, full.row as usize, &self.u),
                ],
                scale: self.scale[position],
            });
        }
        self.table = table;
    }

    /// Writes the island's result into the step's scratch.
    pub fn finish(&mut self, on: &mut On) {
        self.give_jumps(on);
        let (model, scratch, report) = (on.task.model, &mut *on.scratch, &mut *on.report);
        report.impact_problems = report.impact_problems.max(self.problems);
        report.restitution_scale = report.restitution_scale.min(self.table.least_scale());
        self.finish_joints(model, scratch);
        let of = |slot: usize| {
            let c = &scratch.contacts[self.members[slot] as usize];
            ([c.a, c.b], c.n1)
        };
        self.table.hand_over(of, scratch.impacts);
        for (slot, &m) in self.members.iter().enumerate() {
            let c = &self.full.contacts[slot];
            let contact = &mut scratch.contacts[m as usize];
            contact.lambda = self.packed(slot);
            contact.load = self.packed_load(slot);
            contact.work = self.work[slot];
            contact.status = self.status[slot];
            let free = self.relative::<1>(c, c.row as usize, &self.v_check);
            report.missed_impacts += u32::from(contact.missed(model, free, self.closing[slot]));
        }
    }
}
