//! Loads of a pile, and its first impact problem, once more where the impulses so far give energy ([`crate::impact::gains_energy`]).

use crate::impact::bisect::GAIN_TOLERANCE;
use crate::impact::{gains_energy, ContactWork};
use crate::model::Model;
use crate::pile::limits::GAIN_SHARE;
use crate::pile::memory::Pile;
use glam::DVec3;

impl Pile {
    /// Whether all impulses so far have given a group of contacts energy.
    pub(super) fn gains_energy(&self, model: &Model) -> bool {
        let (o, memory) = (&model.options, &self.velocity);
        if !o.energy_safeguard {
            return false;
        }
        let mut kinetic: Vec<f64> = memory
            .check
            .iter()
            .zip(&self.bodies)
            .map(|([v, w], b)| {
                0.5 * (v.length_squared() / b.inv_mass + w.length_squared() / b.inv_inertia)
            })
            .collect();
        let mut contacts = Vec::new();
        for (slot, m) in memory.closed.iter().enumerate() {
            if m.impulse == DVec3::ZERO {
                continue;
            }
            let turning = memory
                .turning
                .get(slot)
                .map_or(0.0, |t| t.work[0] + t.work[1]);
            contacts.push(ContactWork {
                a: m.a,
                b: m.b,
                work: m.work[0] + m.work[1] + turning,
            });
            let wall = memory.wall(m, 1).length_squared();
            kinetic[m.a as usize] += 0.5 * wall / self.bodies[m.a as usize].inv_mass;
        }
        let share = GAIN_TOLERANCE.max(GAIN_SHARE * o.tolerance.max(o.pile_tolerance));
        gains_energy(&contacts, &kinetic, share)
    }

    /// Forgets all impulses and impacts of the step; what the loads alone gave stays known.
    pub(super) fn forget_all(&mut self, problem: u32) {
        let memory = &mut self.velocity;
        for m in &mut memory.closed {
            (m.impulse, m.hit, m.work) = (DVec3::ZERO, DVec3::ZERO, [0.0; 2]);
            (m.problem, m.approach, m.scale) = (0, 0.0, 1.0);
        }
        for t in &mut memory.turning {
            (t.moment, t.hit, t.work) = (DVec3::ZERO, DVec3::ZERO, [0.0; 2]);
        }
        memory.jump.fill([DVec3::ZERO; 2]);
        memory.terms = 0.0;
        memory.table.forget_problem(problem);
    }
}
