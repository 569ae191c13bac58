//! The little islands of a problem, each solved alone. They share no sphere, so batches of them may be solved at the same time:
//! what they find enters the front afterwards.

use super::front::{Front, Given};
use super::group::Group;
use super::parts::Parts;
use crate::impact::{bisect_scale, BISECTIONS, GAIN_TOLERANCE};
use crate::model::Model;
use crate::pile::member::{self, Memory as Velocity};
use crate::pile::roll;
use crate::pile::solve::GAIN_SHARE;
use carom_solve::spheres::{Body, Goal};
use glam::DVec3;
use std::ops::Range;

/// What all islands of a problem are solved with.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub model: &'a Model,
    pub velocity: &'a Velocity,
    pub bodies: &'a [Body],
    pub front: &'a Front,
    pub parts: &'a Parts,
}

/// Consecutive islands, and what they gave, in the order of their contacts and spheres.
#[derive(Default)]
pub(super) struct Batch {
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
    pub restitution_scale: f64,
    /// Islands that were not solved: they gave nothing.
    pub failed: u32,
    pub pushed: bool,
}

impl Batch {
    pub fn solve(&mut self, view: &View, islands: Range<usize>) {
        self.given.clear();
        self.turned.clear();
        self.moved.clear();
        (self.residual, self.restitution_scale) = (0.0, 1.0);
        (self.failed, self.pushed) = (0, false);
        for island in islands {
            let ([c, n], [c_end, n_end]) =
                (view.parts.starts[island], view.parts.starts[island + 1]);
            let (contacts, nodes) = (c as usize..c_end as usize, n as usize..n_end as usize);
            let solved = self.solve_island(view, contacts.clone(), nodes.clone());
            if solved.is_none() {
                self.failed += 1;
                self.give_nothing(view, contacts.len(), nodes.len());
            }
        }
    }

    fn give_nothing(&mut self, view: &View, contacts: usize, nodes: usize) {
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

    fn solve_island(
        &mut self,
        view: &View,
        contacts: Range<usize>,
        nodes: Range<usize>,
    ) -> Option<()> {
        let View {
            model,
            velocity,
            front,
            ..
        } = *view;
        let o = &model.options;
        let goal = Goal {
            tolerance: o.tolerance.max(o.pile_tolerance),
            floor: velocity.floor,
            // Its share of what the whole pile is judged by.
            scale: velocity.terms * (contacts.len() as f64 / velocity.members.len() as f64).sqrt(),
            closing: velocity.left(o),
            penalty_scale: o.penalty_scale,
            patience: usize::MAX,
            most: 0,
            had: 0,
        };
        let slots = &view.parts.slots[contacts.clone()];
        self.state(view, contacts, &view.parts.nodes[nodes.clone()]);
        let (residual, solved) = self.group.solve(&goal);
        if !solved {
            return None;
        }
        let kinetic: f64 = view.parts.nodes[nodes]
            .iter()
            .map(|&node| front.nodes[node as usize].kinetic())
            .sum();
        let most = GAIN_TOLERANCE.max(GAIN_SHARE * goal.tolerance) * kinetic;
        let mut scale = 1.0;
        if o.energy_safeguard && self.work(view, slots) > most {
            scale = bisect_scale(BISECTIONS, |s| {
                self.restitute(view, slots, s);
                self.group.solve(&goal).1 && self.work(view, slots) <= most
            });
            self.restitute(view, slots, scale);
            if !self.group.solve(&goal).1 {
                return None;
            }
        }
        self.residual = self.residual.max(residual);
        self.restitution_scale = self.restitution_scale.min(scale);
        self.give(view, slots, scale);
        Some(())
    }

    /// States an island as a group.
    fn state(&mut self, view: &View, contacts: Range<usize>, nodes: &[u32]) {
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
        for &node in nodes {
            self.group.push_node(&front.nodes[node as usize]);
            if rolls {
                self.group.push_body(bodies[node as usize]);
            }
        }
        let all = view.parts.slots[contacts.clone()].iter();
        for (&slot, &sides) in all.zip(&view.parts.sides[contacts]) {
            let edge = &front.edges[slot as usize];
            let [now, minus] = front.relative(velocity, edge);
            self.before.push([now, minus]);
            let slip = velocity.newton(view.model, edge.normal, edge.restitution, 1.0, now, minus);
            self.group.push_contact(edge, sides, slip);
            if rolls {
                let turn = front.turn(velocity, bodies, slot);
                self.turn.push(turn);
                self.group.push_roll(&velocity.turning[slot as usize], turn);
            }
        }
    }

    /// Scales restitution; impulses stay as a start.
    fn restitute(&mut self, view: &View, slots: &[u32], scale: f64) {
        for (k, (&slot, &[now, minus])) in slots.iter().zip(&self.before).enumerate() {
            let edge = &view.front.edges[slot as usize];
            let law = edge.restitution;
            let slip = (view.velocity).newton(view.model, edge.normal, law, scale, now, minus);
            self.group.set_slip(k, slip);
        }
    }

    /// Work of the solution at hand.
    fn work(&self, view: &View, slots: &[u32]) -> f64 {
        let mut done = 0.0;
        for (k, &slot) in slots.iter().enumerate() {
            let [n, t] = self.work_of(view, k, slot);
            done += n + t;
            if self.group.rolls() {
                let [r, s] = self.turning_work_of(view, k, slot);
                done += r + s;
            }
        }
        done
    }

    fn work_of(&self, view: &View, k: usize, slot: u32) -> [f64; 2] {
        let [before, _] = self.before[k];
        let after = before + self.group.change(k);
        let normal = view.front.edges[slot as usize].normal;
        member::work(normal, self.group.impulse(k), before, after)
    }

    fn turning_work_of(&self, view: &View, k: usize, slot: u32) -> [f64; 2] {
        let (normal, before) = (view.front.edges[slot as usize].normal, self.turn[k]);
        let after = before + self.group.turn_change(k);
        roll::work(normal, self.group.moment(k), before, after)
    }

    /// Lists what the solution at hand gives.
    fn give(&mut self, view: &View, slots: &[u32], scale: f64) {
        for (k, &slot) in slots.iter().enumerate() {
            let impulse = self.group.impulse(k);
            let [before, _] = self.before[k];
            let after = before + self.group.change(k);
            let normal = view.front.edges[slot as usize].normal;
            self.pushed |= impulse != DVec3::ZERO;
            self.given.push(Given {
                impulse,
                work: self.work_of(view, k, slot),
                speed: [before.dot(normal), after.dot(normal)],
                scale,
            });
            if self.group.rolls() {
                let done = self.turning_work_of(view, k, slot);
                self.turned.push((self.group.moment(k), done));
            }
        }
        let moved = self.group.corrections().iter();
        self.moved.extend(moved.map(|u| [u.linear, u.surface]));
    }
}
