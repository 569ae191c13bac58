//! How a pile takes an island in, and what its problems start from.

use super::chunks;
use super::closed_contact::Frame;
use super::velocities::Velocities;
use super::warm::Cursor;
use crate::contact::Contact;
use crate::pile::limits::{is_huge, is_large, threads};
use crate::pile::memory::Pile;
use crate::stepper::Span;
use crate::workspace::On;
use carom_solve::spheres::Body;
use carom_solve::{team, RowSystem};
use glam::DVec3;

/// Fewest contacts of an island whose impacts need so many layers that the impulses of the positions tell more of them than nothing does. Too
/// few: small piles start from wedges, and a tower of 28 balls gained energy. Too many: hit piles take up to twice the sweeps.
const WAVE_CONTACTS: usize = 2_500;

fn has_waves(contacts: usize) -> bool {
    contacts >= WAVE_CONTACTS
}

impl Pile {
    /// Nodes for the spheres of an island, in order of first use; `node_of` is valid for these spheres afterwards.
    pub(super) fn begin(&mut self, on: &mut On) {
        let (model, members) = (on.task.model, on.island.contacts);
        let (contacts, position) = (&*on.scratch.contacts, on.scratch.position);
        let node_of = &mut on.scratch.solve.node_of;
        let threads = threads(model, members.len());
        self.sweeps.threads = threads;
        self.huge = is_huge(contacts);
        // Of the round before this one.
        self.forget_solution();
        self.problem_nodes.take_all();
        chunks::refill(threads, &mut self.ends, members.len(), |k| {
            let c = &contacts[members[k] as usize];
            [c.a, c.b]
        });
        self.spheres.clear();
        for &body in self.ends.iter().flatten() {
            let i = body as usize;
            if i < model.bodies() && self.spheres.get(node_of[i] as usize) != Some(&body) {
                node_of[i] = self.spheres.len() as u32;
                self.spheres.push(body);
            }
        }
        let guide = |(node, &body): (u32, &u32)| {
            let wall = model.free_wall(body as usize)?;
            Some((node, wall.normal.to_array()))
        };
        self.guided.clear();
        if !model.free_walls.is_empty() {
            self.guided
                .extend((0..).zip(&self.spheres).filter_map(guide));
        }
        let spheres = &self.spheres;
        chunks::refill(threads, &mut self.bodies, spheres.len(), |k| {
            let i = spheres[k] as usize;
            Body {
                inv_mass: model.inv_mass[i],
                inv_inertia: model.inv_inertia[i],
                radius: model.radius[i],
            }
        });
        chunks::refill(threads, &mut self.places, spheres.len(), |k| {
            position[spheres[k] as usize].to_array()
        });
    }

    /// The loads of the step on the chosen contacts: from those of the last one.
    pub(super) fn start_loads(&mut self, on: &On) {
        let (state, contacts) = (on.task.state, &*on.scratch.contacts);
        let ratio = on.task.span.h / state.warm_step;
        let (closed, chosen) = (&self.velocity.closed, &self.velocity.chosen);
        let begin = |cursor: &mut Cursor, slot: u32| {
            let c = &contacts[closed[slot as usize].contact as usize];
            let warm = cursor.find((c.a, c.b));
            warm.map_or([DVec3::ZERO; 2], |w| [ratio * w.impulse, ratio * w.moment])
        };
        let threads = self.sweeps.threads;
        self.start.resize(chosen.len(), [0.0; 3]);
        let part = |first: usize, part: &mut [[f64; 3]]| {
            let mut cursor = Cursor::new(&state.warm);
            for (start, &slot) in part.iter_mut().zip(&chosen[first..]) {
                *start = begin(&mut cursor, slot)[0].to_array();
            }
        };
        team::reduce(
            threads,
            chosen.len(),
            &mut self.start[..],
            part,
            |(), ()| (),
        );
        self.start_moments.clear();
        if !self.velocity.turning.is_empty() {
            let mut cursor = Cursor::new(&state.warm);
            let moments = chosen.iter().map(|&slot| begin(&mut cursor, slot)[1]);
            self.start_moments.extend(moments.map(|m| m.to_array()));
        }
        self.start_free_walls();
    }

    /// Contacts of a free wall none of which has an impulse from before share its load evenly: of many solutions the sweeps would take one that
    /// follows from the numbers of the balls.
    fn start_free_walls(&mut self) {
        let memory = &self.velocity;
        for &(node, along) in &self.guided {
            let [check, old] = [&memory.check, &memory.old].map(|v| v[node as usize][0]);
            let mass = 1.0 / self.bodies[node as usize].inv_mass;
            let load = mass * (check - old).dot(DVec3::from(along));
            let of_wall = |&(_, &slot): &(usize, &u32)| memory.closed[slot as usize].b == node;
            let touched = memory.chosen.iter().enumerate().filter(of_wall);
            let places: Vec<usize> = touched.map(|(k, _)| k).collect();
            let begins = places.iter().all(|&k| self.start[k] == [0.0; 3]);
            if begins && load > 0.0 {
                let share = load / places.len().max(1) as f64;
                for k in places {
                    self.start[k] = along.map(|x| share * x);
                }
            }
        }
    }

    /// Positions along normals alone: from what the loads have moved them by, or from those that this step has found where pairs have joined. Whether
    /// the pile is large and has been solved before in this step.
    pub(super) fn start_normals(
        &mut self,
        contacts: &[Contact],
        members: &[u32],
        of_loads: &[f64],
    ) -> bool {
        let threads = self.sweeps.threads;
        let contact = |k: usize| &contacts[members[k] as usize];
        let again = chunks::any(threads, members.len(), |k| contact(k).nu[0] > 0.0);
        chunks::refill(threads, &mut self.start, members.len(), |k| {
            let c = contact(k);
            let size = if again { c.nu[0] } else { of_loads[k] };
            (size * c.n1).to_array()
        });
        self.start_moments.clear();
        again && is_large(members.len())
    }

    /// The loads of this step, which are known from before positions were solved.
    pub(super) fn start_known_loads(&mut self, contacts: &[Contact]) {
        let (memory, bodies) = (&mut self.velocity, &self.bodies);
        self.start.clear();
        self.start_moments.clear();
        memory.known.clear();
        memory.known.resize(bodies.len(), [DVec3::ZERO; 2]);
        for &slot in &memory.chosen {
            let m = &memory.closed[slot as usize];
            let c = contacts[m.contact as usize].middle();
            let load = c.to_world(c.n1, &c.load);
            let along = Frame::Middle.state(contacts, m);
            Velocities::push(bodies, &along, load.impulse, &mut memory.known);
            for (node, sign) in [(m.a, 1.0), (m.b, -1.0)] {
                if let Some(known) = memory.known.get_mut(node as usize) {
                    known[1] += sign * bodies[node as usize].inv_inertia * load.moment;
                }
            }
            self.start.push(load.impulse.to_array());
            if !memory.turning.is_empty() {
                self.start_moments.push(load.moment.to_array());
            }
        }
    }

    /// The first impact problem: from what the loads gave.
    pub(super) fn start_first(&mut self) {
        let memory = &self.velocity;
        self.start.clear();
        self.start_moments.clear();
        for &slot in &memory.chosen {
            self.start
                .push(memory.closed[slot as usize].load.to_array());
            let moments = memory.turning.get(slot as usize);
            self.start_moments
                .extend(moments.map(|t| t.load.to_array()));
        }
    }

    /// From multipliers of the chosen contacts as rows, in the frames of these.
    pub(super) fn start_from_rows(&mut self, rows: &RowSystem, framed: &[Contact], lambda: &[f64]) {
        self.start.clear();
        self.start_moments.clear();
        for (row, c) in rows.contacts.iter().zip(framed) {
            let mut packed = [0.0; 6];
            packed[..row.dim as usize].copy_from_slice(&lambda[row.rows()]);
            let world = c.to_world(c.n1, &packed);
            self.start.push(world.impulse.to_array());
            if !self.velocity.turning.is_empty() {
                self.start_moments.push(world.moment.to_array());
            }
        }
    }

    /// The chosen contacts from nothing.
    pub(super) fn start_nothing(&mut self) {
        for start in [&mut self.start, &mut self.start_moments] {
            start.clear();
            start.resize(self.velocity.chosen.len(), [0.0; 3]);
        }
    }

    /// All closed contacts of a sequence that was cut short: from what is missing to the impulses that the positions of this step took. (Spheres
    /// that meet go the way of a step, `nu = h lambda`; under loads alone they go half of it, `nu/h` is less than what has been given, and
    /// nothing is missing.) The sweeps put it into the cones; moments start from nothing.
    pub(super) fn start_last(&mut self, contacts: &[Contact], span: Span) {
        self.start_nothing();
        let (threads, closed) = (self.sweeps.threads, &self.velocity.closed);
        if !has_waves(closed.len()) {
            return;
        }
        chunks::each(threads, &mut self.start, |slot, start| {
            let m = &closed[slot];
            let c = &contacts[m.contact as usize];
            let missing = c.nu[0] / span.h * c.n1 - m.impulse;
            if missing.dot(m.normal) > 0.0 {
                *start = missing.to_array();
            }
        });
    }
}
