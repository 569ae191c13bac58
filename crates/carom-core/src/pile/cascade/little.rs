//! The little islands of a problem, each solved alone. They share no sphere, so batches of them may be solved at the same time:
//! what they find enters the front afterwards.

use super::front::{Front, Node};
use super::group::Group;
use super::near::{Island, Near};
use super::parts::Parts;
use crate::impact::bisect::{bisect_scale, BISECTIONS, GAIN_TOLERANCE};
use crate::model::Model;
use crate::pile::limits::GAIN_SHARE;
use crate::pile::member::{self, Given};
use crate::pile::roll;
use crate::pile::velocities::Velocities;
use carom_solve::spheres::{Body, Goal};
use glam::DVec3;
use std::ops::Range;

/// What all islands of a problem are solved with.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub model: &'a Model,
    pub velocity: &'a Velocities,
    pub bodies: &'a [Body],
    pub front: &'a Front,
    pub parts: &'a Parts,
}

/// Consecutive islands, and what they gave, in the order of their contacts and spheres.
#[derive(Default)]
pub(super) struct Batch {
    near: Near,
    group: Group,
    /// Relative velocities of the contacts of an island: now, and `V_minus`.
    before: Vec<[DVec3; 2]>,
    /// Relative angular velocities, where something rolls.
    turn: Vec<DVec3>,
    pub given: Vec<Given>,
    /// Moments and their work, where something rolls.
    pub turned: Vec<(DVec3, [f64; 2])>,
    /// Changes of linear and surface velocity.
    pub moved: Vec<[DVec3; 2]>,
    pub residual: f64,
    /// Islands that were not solved: they gave nothing.
    pub failed: u32,
    pub pushed: bool,
}

impl Batch {
    pub fn solve(&mut self, view: &View, islands: Range<usize>) {
        self.given.clear();
        self.turned.clear();
        self.moved.clear();
        self.residual = 0.0;
        (self.failed, self.pushed) = (0, false);
        let mut islands = islands;
        while !islands.is_empty() {
            let end = self.near.take(view.front, view.parts, islands.clone());
            for k in islands.start..end {
                let ([c, n], [c_end, n_end]) = (view.parts.starts[k], view.parts.starts[k + 1]);
                let island = Island {
                    contacts: c as usize..c_end as usize,
                    nodes: n as usize..n_end as usize,
                };
                if self.solve_island(view, &island).is_none() {
                    self.failed += 1;
                    self.give_nothing(view, &island);
                }
            }
            islands.start = end;
        }
    }

    fn give_nothing(&mut self, view: &View, island: &Island) {
        let (contacts, nodes) = (island.contacts.len(), island.nodes.len());
        let nothing = Given {
            impulse: DVec3::ZERO,
            work: [0.0; 2],
            speed: [0.0; 2],
            scale: 1.0,
        };
        self.given.resize(self.given.len() + contacts, nothing);
        if !view.velocity.turning.is_empty() {
            let moments = self.turned.len() + contacts;
            self.turned.resize(moments, (DVec3::ZERO, [0.0; 2]));
        }
        self.moved
            .resize(self.moved.len() + nodes, [DVec3::ZERO; 2]);
    }

    fn solve_island(&mut self, view: &View, island: &Island) -> Option<()> {
        let View {
            model, velocity, ..
        } = *view;
        let o = &model.options;
        let goal = Goal {
            tolerance: o.tolerance.max(o.pile_tolerance),
            floor: velocity.floor,
            // Its share of what the whole pile is judged by.
            scale: velocity.terms
                * (island.contacts.len() as f64 / velocity.members.len() as f64).sqrt(),
            closing: velocity.left(o),
            penalty_scale: o.penalty_scale,
            patience: usize::MAX,
            most: 0,
            had: 0,
            rescale: usize::MAX,
            weighed: false,
            calm: 1.0,
        };
        self.state(view, island);
        let (residual, solved) = self.group.solve(&goal);
        if !solved {
            return None;
        }
        let from = [self.given.len(), self.turned.len()];
        let mut scale = 1.0;
        let done = self.list(island);
        // Most lose energy, and need no measure of it.
        if o.energy_safeguard && done > 0.0 {
            let kinetic: f64 = self.near.nodes(island).iter().map(Node::kinetic).sum();
            let most = GAIN_TOLERANCE.max(GAIN_SHARE * goal.tolerance) * kinetic;
            if done > most {
                scale = bisect_scale(BISECTIONS, |s| {
                    self.again(view, island, s, &goal, from)
                        .is_some_and(|done| done <= most)
                });
                self.again(view, island, scale, &goal, from)?;
            }
        }
        for given in &mut self.given[from[0]..] {
            given.scale = scale;
            self.pushed |= given.impulse != DVec3::ZERO;
        }
        let moved = self.group.corrections().iter();
        self.moved.extend(moved.map(|u| [u.linear, u.surface]));
        self.residual = self.residual.max(residual);
        Some(())
    }

    /// States an island as a group.
    fn state(&mut self, view: &View, island: &Island) {
        let View {
            velocity,
            front,
            bodies,
            ..
        } = *view;
        let rolls = !velocity.turning.is_empty();
        self.group.clear();
        self.before.clear();
        self.turn.clear();
        for node in self.near.nodes(island) {
            self.group.push_node(node);
        }
        if rolls {
            for &node in &view.parts.nodes[island.nodes.clone()] {
                self.group.push_body(bodies[node as usize]);
            }
        }
        let slots = &view.parts.slots[island.contacts.clone()];
        let sides = &view.parts.sides[island.contacts.clone()];
        for ((edge, &sides), &slot) in self.near.edges(island).iter().zip(sides).zip(slots) {
            let [now, minus] = self.near.relative(velocity, island, edge, sides);
            self.before.push([now, minus]);
            let slip = velocity.newton(
                &view.model.options,
                edge.normal,
                edge.restitution,
                1.0,
                now,
                minus,
            );
            self.group.push_contact(edge, sides, slip);
            if rolls {
                let turn = front.turn(velocity, bodies, slot);
                self.turn.push(turn);
                self.group.push_roll(&velocity.turning[slot as usize], turn);
            }
        }
    }

    /// Solves again with scaled restitution, from the impulses at hand, and lists what that gives instead of what is listed
    /// `from` there on: its work, if it was solved.
    fn again(
        &mut self,
        view: &View,
        island: &Island,
        scale: f64,
        goal: &Goal,
        from: [usize; 2],
    ) -> Option<f64> {
        self.given.truncate(from[0]);
        self.turned.truncate(from[1]);
        let all = self.near.edges(island).iter().zip(&self.before);
        for (k, (edge, &[now, minus])) in all.enumerate() {
            let law = edge.restitution;
            let slip =
                (view.velocity).newton(&view.model.options, edge.normal, law, scale, now, minus);
            self.group.set_slip(k, slip);
        }
        let (_, solved) = self.group.solve(goal);
        solved.then(|| self.list(island))
    }

    /// Lists what the solution at hand gives; its work.
    fn list(&mut self, island: &Island) -> f64 {
        let mut done = 0.0;
        let all = self.near.edges(island).iter().zip(&self.before);
        for (k, (edge, &[before, _])) in all.enumerate() {
            let normal = edge.normal;
            let impulse = self.group.impulse(k);
            let after = before + self.group.change(k);
            let work = member::work(normal, impulse, before, after);
            done += work[0] + work[1];
            self.given.push(Given {
                impulse,
                work,
                speed: [before.dot(normal), after.dot(normal)],
                scale: 1.0,
            });
            if self.group.rolls() {
                let (moment, before) = (self.group.moment(k), self.turn[k]);
                let after = before + self.group.turn_change(k);
                let work = roll::work(normal, moment, before, after);
                done += work[0] + work[1];
                self.turned.push((moment, work));
            }
        }
        done
    }
}
