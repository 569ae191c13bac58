//! Loads, and the first impact problem, once more where the impulses so far give energy ([`crate::impact::gains_energy`]).

use crate::impact::bisect::GAIN_TOLERANCE;
use crate::impact::memory::ImpactScratch;
use crate::impact::{gains_energy, ContactWork};
use crate::model::Model;
use carom_solve::rows::NODE_DOF;
use carom_solve::Status;

impl ImpactScratch {
    pub fn is_pressed(&self, slot: usize) -> bool {
        self.impulse[self.full.contacts[slot].row as usize] > 0.0
    }

    /// Whether all impulses so far have given a group of contacts energy. Joints and loads that depend on the motion do work of their own:
    /// islands with such are not looked at.
    pub fn gains_energy(&self, model: &Model) -> bool {
        if !(model.options.energy_safeguard && self.joints.is_empty() && self.loads.is_empty()) {
            return false;
        }
        // Nearly always: no contact alone.
        if self.work.iter().all(|work| work.iter().sum::<f64>() <= 0.0) {
            return false;
        }
        let mut kinetic: Vec<f64> = self
            .v_check
            .chunks_exact(NODE_DOF)
            .zip(self.full.inv_mass.iter().zip(&self.full.inv_inertia))
            .map(|(v, (im, ii))| {
                0.5 * ((v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / im
                    + (v[3] * v[3] + v[4] * v[4] + v[5] * v[5]) / ii)
            })
            .collect();
        let mut contacts = Vec::new();
        for (slot, work) in self.work.iter().enumerate() {
            if !self.is_pressed(slot) {
                continue;
            }
            let c = &self.full.contacts[slot];
            contacts.push(ContactWork {
                a: c.node_a,
                b: c.node_b,
                work: work.iter().sum(),
            });
            let rows = c.row as usize..(c.row + c.translational) as usize;
            let wall = self.driven[1].get(rows).unwrap_or_default();
            let square: f64 = wall.iter().map(|v| v * v).sum();
            kinetic[c.node_a as usize] += 0.5 / self.full.inv_mass[c.node_a as usize] * square;
        }
        gains_energy(&contacts, &kinetic, GAIN_TOLERANCE)
    }

    /// Forgets all impulses of the step, and the rows of `problem`.
    pub fn forget_all(&mut self, problem: u32) {
        self.impulse.fill(0.0);
        self.work.fill([0.0; 4]);
        self.status.fill(Status::Gap);
        self.update_jump();
        self.table.forget_problem(problem);
    }
}
