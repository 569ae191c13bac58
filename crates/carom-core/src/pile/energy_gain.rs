//! Work of the contacts of a pile ([`crate::impact::energy`]).

use super::chunks;
use super::closed_contact::{change, ClosedContact, FIXED};
use super::roll;
use super::velocities::Velocities;
use crate::impact::energy::{mix, scales, Admit, ContactWork};
use crate::impact::law::{returned, Law};
use crate::model::Model;
use crate::pile::limits::tolerance;
use crate::pile::memory::Pile;
use crate::rows::halves;
use crate::workspace::On;
use carom_solve::rows::WORLD;
use glam::DVec3;

/// A solution of the problem at hand.
pub(super) struct SphereSolution {
    impulses: Vec<[f64; 3]>,
    moments: Vec<[f64; 3]>,
    corrections: Vec<[f64; 6]>,
}

impl Velocities {
    /// Kinetic energy of each node at `v_check` and the jump that `after` gives, with that of walls as fast as they move, J.
    fn kinetic(&self, pile: &Pile, after: impl Fn(usize) -> [DVec3; 2]) -> Vec<f64> {
        let mut kinetic: Vec<f64> = (self.check.iter().zip(&pile.bodies).enumerate())
            .map(|(node, ([v, w], body))| {
                let [jump_v, jump_w] = after(node);
                let [v, w] = [*v + jump_v, *w + jump_w].map(DVec3::length_squared);
                0.5 * (v / body.inv_mass + w / body.inv_inertia)
            })
            .collect();
        for m in self.closed.iter().filter(|m| m.driven != FIXED) {
            let wall = self.wall(m, 1).length_squared();
            kinetic[m.a as usize] += 0.5 * wall / pile.bodies[m.a as usize].inv_mass;
        }
        kinetic
    }
}

impl Pile {
    /// Whether all impulses so far have given a group of contacts energy.
    pub(super) fn gains_energy(&self, model: &Model) -> bool {
        let memory = &self.velocity;
        if !model.options.energy_safeguard {
            return false;
        }
        let works = memory.closed.iter().enumerate().map(|(slot, m)| {
            let turning = memory.turning.get(slot);
            let turning = turning.map_or(0.0, |t| t.work[0] + t.work[1]);
            ContactWork {
                is_pressed: m.impulse != DVec3::ZERO,
                terms: [m.work[0] + m.work[1] + turning, 0.0, 0.0],
                explained: m.explained,
                ..ContactWork::between(m.a, m.b)
            }
        });
        let works: Vec<ContactWork> = works.collect();
        scales(&works, Admit::Tolerance(tolerance(model)), || {
            memory.kinetic(self, |_| [DVec3::ZERO; 2])
        })
        .is_some()
    }

    /// Forgets all impulses and impacts of the step; what the loads alone gave stays known.
    pub(super) fn forget_all(&mut self, problem: u32) {
        let memory = &mut self.velocity;
        for m in &mut memory.closed {
            (m.impulse, m.hit, m.work) = (DVec3::ZERO, DVec3::ZERO, [0.0; 2]);
            (m.problem, m.normal_before, m.scale, m.explained) = (0, 0.0, 1.0, 0.0);
            m.dropped = true;
        }
        for t in &mut memory.turning {
            (t.moment, t.hit, t.work) = (DVec3::ZERO, DVec3::ZERO, [0.0; 2]);
        }
        memory.jump.fill([DVec3::ZERO; 2]);
        memory.terms = 0.0;
        memory.table.forget_problem(problem);
    }

    /// Notes the work that the residual of the solution at hand explains at each chosen contact.
    pub(super) fn explain(&mut self, on: &On) {
        let (model, contacts) = (on.task.model, &*on.scratch.contacts);
        let (memory, u, moments) = (&self.velocity, &self.corrections, &self.moments);
        let (law, frame) = (self.law, self.frame);
        let impulses = &self.impulses;
        chunks::refill(
            self.sweeps.threads,
            &mut self.explained,
            impulses.len(),
            |k| {
                let slot = memory.chosen[k];
                let m = &memory.closed[slot as usize];
                let (m, z) = memory.state(model, contacts, m, law, frame);
                let (r, z) = (DVec3::from(impulses[k]), z + change(&m, u));
                let turned = moments.get(k).map_or(0.0, |&moment| {
                    DVec3::from(moment).dot(memory.state_turn(slot, &m) + roll::change(&m, u))
                });
                let least = if law == Law::Expansion {
                    m.expansion.1
                } else {
                    0.0
                };
                let normal = [r.dot(m.normal), z.dot(m.normal)];
                let beyond = [normal[0] - least, normal[1]];
                let mut work = ContactWork::default();
                work.explain(beyond, r.dot(z) - normal[0] * normal[1] + turned);
                work.explained
            },
        );
    }

    /// The solution at hand.
    pub(super) fn solution(&self) -> SphereSolution {
        SphereSolution {
            impulses: self.impulses.clone(),
            moments: self.moments.clone(),
            corrections: self.corrections.clone(),
        }
    }

    /// Jump of the velocities from which the problem at hand is judged, and whether it solves contacts of the loads anew.
    fn judged_from(&self) -> (&[[DVec3; 2]], bool) {
        match self.law {
            law if law.is_first() => (&self.velocity.offset, true),
            _ => (&self.velocity.jump, false),
        }
    }

    /// See [`crate::impact::sequence::ImpactIsland::limits`].
    pub(super) fn limits(
        &self,
        model: &Model,
        with: Option<&SphereSolution>,
        admit: Admit,
    ) -> Option<Vec<f64>> {
        let memory = &self.velocity;
        let (impulses, moments, corrections) = match with {
            Some(with) => (&with.impulses, &with.moments, &with.corrections),
            None => (&self.impulses, &self.moments, &self.corrections),
        };
        let (from, anew) = self.judged_from();
        let since = |m: &ClosedContact| {
            let of = |jump| Velocities::relative(m, jump);
            of(&memory.jump) - of(from)
        };
        // Of what it has now the problem solves nothing anew: that of the loads was dropped, or is of the compression.
        let had = |load: DVec3, now: DVec3| if anew { load - now } else { DVec3::ZERO };
        let works = memory.chosen.iter().enumerate().map(|(k, &slot)| {
            let m = &memory.closed[slot as usize];
            let mut work = ContactWork {
                explained: self.explained[k],
                returned: returned(&model.laws[m.law as usize], &model.options),
                ..ContactWork::between(m.a, m.b)
            };
            let solved = [self.impulses[k], impulses[k]].map(DVec3::from);
            let loaded = anew && (m.load != DVec3::ZERO || m.impulse != DVec3::ZERO);
            work.is_pressed = loaded || solved.iter().any(|r| *r != DVec3::ZERO);
            let since = since(m);
            let before = memory.now(m) - since;
            let changes = [&self.corrections, corrections].map(|u| since + change(m, u));
            let given = solved.map(|r| r - had(m.load, m.impulse));
            work.add_vectors(before, given, changes);
            let by = |node: u32| match node {
                WORLD => 0.0,
                node => {
                    let [to, from] =
                        [corrections, &self.corrections].map(|u| halves(&u[node as usize])[0]);
                    m.normal.dot(to - from)
                }
            };
            work.normal = [m.normal.dot(before + changes[0]), by(m.a), -by(m.b)];
            if let Some(turning) = memory.turning.get(slot as usize) {
                let since = roll::relative(m, &memory.jump) - roll::relative(m, from);
                let before = memory.turn(slot) - since;
                let changes = [&self.corrections, corrections];
                let changes = changes.map(|u| since + roll::change(m, u));
                let had = had(turning.load, turning.moment);
                let given = [&self.moments, moments].map(|of| DVec3::from(of[k]) - had);
                work.add_vectors(before, given, changes);
            }
            work
        });
        let works: Vec<ContactWork> = works.collect();
        scales(&works, admit, || memory.kinetic(self, |node| from[node]))
    }

    /// Goes from the solution at hand towards `with` as far as these scales of the nodes say.
    pub(super) fn mix(&mut self, with: SphereSolution, scales: Option<Vec<f64>>) {
        let Some(scales) = scales else {
            (self.impulses, self.moments, self.corrections) =
                (with.impulses, with.moments, with.corrections);
            return;
        };
        let of = |&slot: &u32| scales[self.velocity.closed[slot as usize].a as usize];
        let of_chosen: Vec<f64> = self.velocity.chosen.iter().map(of).collect();
        for (k, &s) in of_chosen.iter().enumerate() {
            mix(&mut self.impulses[k], &with.impulses[k], s);
            if let Some(moment) = self.moments.get_mut(k) {
                mix(moment, &with.moments[k], s);
            }
        }
        for ((u, to), &s) in (self.corrections.iter_mut().zip(&with.corrections)).zip(&scales) {
            mix(u, to, s);
        }
        self.scales = scales;
    }
}
