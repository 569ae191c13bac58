//! What the impact problems of a pile gave: results of its contacts, warm starts, the table of impacts.

use super::velocities::Velocities;
use super::{chunks, record};
use crate::contact::Contact;
use crate::model::Model;
use crate::outcome::ImpactRecord;
use crate::pile::memory::Pile;
use crate::pile::turning::Turning;
use crate::state::Warm;
use crate::workspace::On;
use carom_solve::team;
use glam::DVec3;

/// Chunks of contacts whose results are on their way. Memory alone: more, and what is found of millions of contacts is held twice.
const CHUNKS_AT_A_TIME: usize = 64;

impl Pile {
    /// Writes the loads of the island, and the jumps that they make.
    pub(super) fn close_loads(&self, on: &mut On, resting: &[bool]) {
        let (memory, scratch) = (&self.velocity, &mut *on.scratch);
        for (&body, jump) in self.spheres.iter().zip(&memory.jump) {
            scratch.corrections.set(body, *jump);
        }
        for (slot, (&index, &resting)) in on.island.contacts.iter().zip(resting).enumerate() {
            let (m, c) = (&memory.closed[slot], &mut scratch.contacts[index as usize]);
            let moment = memory.turning.get(slot).map_or(DVec3::ZERO, |t| t.load);
            let middle = c.middle();
            c.load = record::packed(&middle, middle.n1, m.load, moment);
            c.resting = resting;
            if m.load != DVec3::ZERO {
                scratch.warm.push(Warm {
                    key: (c.a, c.b),
                    impulse: m.load,
                    moment,
                });
            }
        }
    }

    /// Writes the island's result into the step's scratch.
    pub(super) fn close(&mut self, on: &mut On) {
        let (memory, model) = (&self.velocity, on.task.model);
        let (scratch, report) = (&mut *on.scratch, &mut *on.report);
        for (&body, jump) in self.spheres.iter().zip(&memory.jump) {
            scratch.corrections.set(body, *jump);
        }
        let mut pieces = chunks::cut(on.island.contacts, scratch.contacts);
        // Some at a time: what is found of millions of contacts is not held twice.
        while !pieces.is_empty() {
            let some = pieces.drain(..pieces.len().min(CHUNKS_AT_A_TIME)).collect();
            let found = team::map(self.sweeps.threads, some, |mut share| {
                let mut found = Found::default();
                for (slot, &index) in (share.first..).zip(share.list) {
                    found.take(model, memory, slot, share.item(index));
                }
                found
            });
            for mut found in found {
                scratch.warm.append(&mut found.warm);
                scratch.impacts.append(&mut found.impacts);
                report.restitution_scale = report.restitution_scale.min(found.restitution_scale);
                report.missed_impacts += found.missed;
            }
        }
        report.restitution_scale = report.restitution_scale.min(memory.table.least_scale());
        let of = |slot: usize| {
            let m = &memory.closed[slot];
            let c = &scratch.contacts[m.contact as usize];
            ([c.a, c.b], m.normal)
        };
        memory.table.hand_over(of, scratch.impacts);
    }
}

/// What is found at the contacts of a share.
struct Found {
    warm: Vec<Warm>,
    impacts: Vec<ImpactRecord>,
    missed: u32,
    /// The least of the contacts that closed: scaled restitution of a contact that only loads press scales nothing.
    restitution_scale: f64,
}

impl Default for Found {
    fn default() -> Self {
        Found {
            warm: Vec::new(),
            impacts: Vec::new(),
            missed: 0,
            restitution_scale: 1.0,
        }
    }
}

impl Found {
    /// Writes the result of a contact, and lists what it gives the next step and the table of impacts.
    fn take(&mut self, model: &Model, memory: &Velocities, slot: usize, c: &mut Contact) {
        let m = &memory.closed[slot];
        // Of a contact without moments.
        let nothing = Turning::default();
        let turning = memory.turning.get(slot).unwrap_or(&nothing);
        let free = memory.free(m).dot(m.normal);
        // As if all of them were of one frame.
        let status = |c: &Contact, rows: &[f64; 6]| m.status(c.to_world(m.normal, rows).impulse);
        if model.options.loads_once() {
            let middle = c.middle();
            let solved = record::packed(&middle, middle.n1, m.load, turning.load);
            let remains = !m.dropped;
            c.load = if remains { solved } else { [0.0; 6] };
            let kept = |load: DVec3| if remains { load } else { DVec3::ZERO };
            let (hit, turned) = (
                m.impulse - kept(m.load),
                turning.moment - kept(turning.load),
            );
            c.lambda = record::packed(c, m.normal, hit, turned);
            for (sum, load) in c.lambda.iter_mut().zip(c.load) {
                *sum += load;
            }
            c.status = status(c, &c.lambda);
            if !memory.table.wanted && memory.table.has_impact() && m.load != DVec3::ZERO {
                // Positions follow it, whether an impact takes it back or not.
                let by_loads = Velocities::relative(m, &memory.offset).dot(m.normal);
                self.impacts.push(ImpactRecord {
                    problem: 0,
                    a: c.a,
                    b: c.b,
                    status: status(c, &solved) as u8,
                    normal: m.normal,
                    impulse: m.load,
                    moment: turning.load,
                    normal_before: free,
                    separation: free + by_loads,
                    restitution_scale: 1.0,
                    course: None,
                });
            }
        } else {
            record::set_frame(c, m.normal);
            c.lambda = record::packed(c, m.normal, m.impulse, turning.moment);
            c.status = m.status(m.impulse);
            if m.load != DVec3::ZERO {
                self.warm.push(Warm {
                    key: (c.a, c.b),
                    impulse: m.load,
                    moment: turning.load,
                });
            }
        }
        c.work = [m.work[0], m.work[1], turning.work[0], turning.work[1]];
        self.missed += u32::from(c.missed(model, free, m.closing));
        if m.problem == 0 {
            return;
        }
        self.restitution_scale = self.restitution_scale.min(m.scale);
        if memory.table.wanted {
            return;
        }
        self.impacts.push(ImpactRecord {
            problem: m.problem,
            a: c.a,
            b: c.b,
            status: c.status as u8,
            normal: m.normal,
            impulse: m.hit,
            moment: turning.hit,
            normal_before: m.normal_before,
            separation: memory.normal_speed(m),
            restitution_scale: m.scale,
            course: None,
        });
    }
}
