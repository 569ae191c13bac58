//! Impact problems after the first (rule 26): strictly closing contacts alone, which fall apart into little islands.
//!
//! A problem looks only at the contacts of spheres that the problem before has moved, so that a cascade costs what it moves. It is
//! the same sequence as in small islands: all closing contacts of a problem at the same time, then the next problem.

use super::group::{Group, Law};
use super::velocity::{self, Memory as Velocity};
use super::{keep, Pile};
use crate::contact::Contact;
use crate::impact::{bisect_scale, BISECTIONS, GAIN_TOLERANCE};
use crate::model::Model;
use crate::report::{Level, StepReport};
use carom_solve::rows::WORLD;
use carom_solve::spheres::{Body, Goal};
use glam::DVec3;

/// What tells whether a contact closes: a line of memory, since a cascade looks far more often than it solves.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Edge {
    a: u32,
    b: u32,
    normal: DVec3,
    /// Velocity of a moving wall.
    wall: DVec3,
}

/// (Linear, angular) velocity of a node: now, and what Newton's law takes as `V_minus` (eq. 27).
#[derive(Clone, Copy)]
struct Node {
    now: [DVec3; 2],
    minus: [DVec3; 2],
}

/// Memory of a cascade.
#[derive(Default)]
pub(super) struct Memory {
    edges: Vec<Edge>,
    nodes: Vec<Node>,
    /// Relative velocities of the contacts of a little island: now, and `V_minus`.
    before: Vec<[DVec3; 2]>,
    /// Members at each node, node after node, and where each node's begin.
    at_node: Vec<u32>,
    starts: Vec<u32>,
    /// Round in which a member, a node, was last taken up.
    seen: Vec<u32>,
    touched: Vec<u32>,
    moved: Vec<u32>,
    next_moved: Vec<u32>,
    /// Union-find over the nodes of a round, and the local number of a node.
    parent: Vec<u32>,
    local: Vec<u32>,
    order: Vec<(u32, u32)>,
    group: Group,
}

impl Memory {
    fn open(&mut self, velocity: &Velocity) {
        let nodes = velocity.check.len();
        self.edges.clear();
        self.edges.extend(velocity.members.iter().map(|m| Edge {
            a: m.a,
            b: m.b,
            normal: m.normal,
            wall: velocity.wall(m, 1),
        }));
        self.nodes.clear();
        self.nodes.extend((0..nodes).map(|i| {
            let [check, jump] = [&velocity.check[i], &velocity.jump[i]];
            let [old, offset] = [&velocity.old[i], &velocity.offset[i]];
            Node {
                now: [0, 1].map(|k| check[k] + jump[k]),
                minus: [0, 1].map(|k| old[k] - offset[k] + jump[k]),
            }
        }));
        self.list(&velocity.members, nodes);
    }

    /// Normal velocity of a contact.
    #[inline]
    fn normal_speed(&self, slot: u32) -> f64 {
        let edge = &self.edges[slot as usize];
        let at = |node: u32| self.nodes[node as usize].now[0];
        let mut d = at(edge.a) - edge.wall;
        if edge.b != WORLD {
            d -= at(edge.b);
        }
        d.dot(edge.normal)
    }

    fn list(&mut self, velocity: &[velocity::Member], nodes: usize) {
        self.starts.clear();
        self.starts.resize(nodes + 1, 0);
        let ends = |m: &velocity::Member| [m.a, m.b].into_iter().filter(|&n| n != WORLD);
        for m in velocity {
            ends(m).for_each(|n| self.starts[n as usize + 1] += 1);
        }
        for node in 0..nodes {
            self.starts[node + 1] += self.starts[node];
        }
        self.at_node.clear();
        self.at_node.resize(self.starts[nodes] as usize, 0);
        for (slot, m) in velocity.iter().enumerate() {
            for n in ends(m) {
                let place = &mut self.starts[n as usize];
                self.at_node[*place as usize] = slot as u32;
                *place += 1;
            }
        }
        for node in (1..=nodes).rev() {
            self.starts[node] = self.starts[node - 1];
        }
        self.starts[0] = 0;
        for v in [&mut self.parent, &mut self.local, &mut self.touched] {
            v.clear();
            v.resize(nodes, 0);
        }
        self.seen.clear();
        self.seen.resize(velocity.len(), 0);
    }

    fn root(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            let up = self.parent[self.parent[node as usize] as usize];
            self.parent[node as usize] = up;
            node = up;
        }
        node
    }
}

impl Pile {
    /// Problems 2, 3, ... until nothing closes: the number of the last one, and whether nothing closes (otherwise the bound of the
    /// sequence was reached, or a little island could not be solved: a fallback).
    pub(super) fn cascade(
        &mut self,
        model: &Model,
        contacts: &[Contact],
        report: &mut StepReport,
    ) -> (u32, bool) {
        let mut memory = std::mem::take(&mut self.velocity.cascade);
        let outcome = self.run_cascade(&mut memory, model, contacts, report);
        self.velocity.cascade = memory;
        outcome
    }

    fn run_cascade(
        &mut self,
        memory: &mut Memory,
        model: &Model,
        contacts: &[Contact],
        report: &mut StepReport,
    ) -> (u32, bool) {
        let velocity = &self.velocity;
        let tol = velocity.tol;
        let mut chosen: Vec<u32> = (0..velocity.members.len() as u32)
            .filter(|&slot| velocity.normal_speed(&velocity.members[slot as usize]) < -tol)
            .collect();
        if chosen.is_empty() {
            return (1, true);
        }
        memory.open(velocity);
        for problem in 2..=model.options.max_problems {
            let before = self
                .keeper
                .wants(1)
                .then(|| self.velocity.state_of(model, &chosen));
            let pushed = problem_of(
                memory,
                &mut self.velocity,
                &self.bodies,
                model,
                &chosen,
                problem,
                report,
            );
            if let Some(before) = before {
                self.keep_round(model, contacts, problem, &chosen, before);
            }
            // What is not solved here, and what goes nowhere, ends the sequence.
            report.fallbacks += u32::from(pushed.is_none());
            if pushed != Some(true) {
                return (problem, false);
            }
            // Contacts of moved spheres, each once, in the order of the slots.
            chosen.clear();
            for &node in &memory.moved {
                let range = memory.starts[node as usize] as usize
                    ..memory.starts[node as usize + 1] as usize;
                for &slot in &memory.at_node[range] {
                    if memory.seen[slot as usize] != problem {
                        memory.seen[slot as usize] = problem;
                        if memory.normal_speed(slot) < -tol {
                            chosen.push(slot);
                        }
                    }
                }
            }
            if chosen.is_empty() {
                return (problem, true);
            }
            chosen.sort_unstable();
        }
        (model.options.max_problems, false)
    }
}

/// Velocities, jumps and impulses before a problem of the cascade, and the measures of its contacts.
struct Before {
    motion: Vec<[DVec3; 2]>,
    jump: Vec<[DVec3; 2]>,
    impulse: Vec<DVec3>,
    slip: Vec<DVec3>,
    /// Relative angular velocities and moments, where something rolls.
    turn: Vec<[DVec3; 2]>,
}

impl Velocity {
    #[cold]
    fn state_of(&self, model: &Model, chosen: &[u32]) -> Before {
        let members = || chosen.iter().map(|&slot| &self.members[slot as usize]);
        Before {
            motion: self.velocities(),
            jump: self.jump.clone(),
            impulse: members().map(|m| m.impulse).collect(),
            slip: members()
                .map(|m| self.measures(model, m, Law::Later, 1.0))
                .collect(),
            turn: chosen
                .iter()
                .filter_map(|&slot| self.turning_now(slot))
                .collect(),
        }
    }
}

impl Pile {
    /// Keeps a problem of the cascade: all its little islands as one. (Restitution that the safeguard scaled is stated unscaled.)
    #[cold]
    fn keep_round(
        &mut self,
        model: &Model,
        contacts: &[Contact],
        index: u32,
        chosen: &[u32],
        before: Before,
    ) {
        let velocity = &self.velocity;
        let stated: Vec<keep::Stated> = chosen
            .iter()
            .zip(before.slip.iter().zip(&before.impulse))
            .enumerate()
            .map(|(k, (&slot, (&slip, &impulse)))| {
                let m = &velocity.members[slot as usize];
                let turning = before
                    .turn
                    .get(k)
                    .map_or([DVec3::ZERO; 2], |[turn, moment]| {
                        [*turn, velocity.turning[slot as usize].moment - *moment]
                    });
                keep::Stated::of(m, slip, m.impulse - impulse, turning)
            })
            .collect();
        let correction: Vec<[f64; 6]> = velocity
            .jump
            .iter()
            .zip(&before.jump)
            .map(|([v, w], [v0, w0])| {
                let (v, w) = (*v - *v0, *w - *w0);
                [v.x, v.y, v.z, w.x, w.y, w.z]
            })
            .collect();
        let at = keep::Place {
            model,
            contacts,
            spheres: &self.spheres,
            bodies: &self.bodies,
            level: Level::Velocity,
            index,
            report: keep::report_of(1, 0.0, true),
        };
        keep::keep(&mut self.keeper, &at, &stated, &correction, &before.motion);
    }
}

/// One problem: little islands of the chosen contacts, each solved alone. Leaves the nodes that moved. False: no impulse at all.
fn problem_of(
    memory: &mut Memory,
    velocity: &mut Velocity,
    bodies: &[Body],
    model: &Model,
    chosen: &[u32],
    problem: u32,
    report: &mut StepReport,
) -> Option<bool> {
    for &slot in chosen {
        let m = &velocity.members[slot as usize];
        for node in [m.a, m.b].into_iter().filter(|&n| n != WORLD) {
            memory.parent[node as usize] = node;
        }
    }
    for &slot in chosen {
        let m = &velocity.members[slot as usize];
        if m.b != WORLD {
            let (a, b) = (memory.root(m.a), memory.root(m.b));
            memory.parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut order = std::mem::take(&mut memory.order);
    order.clear();
    for &slot in chosen {
        let root = memory.root(velocity.members[slot as usize].a);
        order.push((root, slot));
    }
    order.sort_unstable();
    memory.next_moved.clear();
    let mut pushed = false;
    for little in order.chunk_by(|x, y| x.0 == y.0) {
        pushed |= solve_little(memory, velocity, bodies, model, little, problem, report)?;
    }
    memory.order = order;
    std::mem::swap(&mut memory.moved, &mut memory.next_moved);
    Some(pushed)
}

/// Solves one little island and adds its impulses. False: it gave none.
fn solve_little(
    memory: &mut Memory,
    velocity: &mut Velocity,
    bodies: &[Body],
    model: &Model,
    little: &[(u32, u32)],
    problem: u32,
    report: &mut StepReport,
) -> Option<bool> {
    let o = &model.options;
    let goal = Goal {
        tolerance: o.tolerance.max(o.pile_tolerance),
        floor: velocity.floor,
        // Its share of what the whole pile is judged by.
        scale: velocity.terms * (little.len() as f64 / velocity.members.len() as f64).sqrt(),
        closing: velocity.left(o),
        penalty_scale: o.penalty_scale,
        patience: usize::MAX,
        most: 0,
        had: 0,
    };
    let group = &mut memory.group;
    group.clear();
    memory.before.clear();
    let first = memory.next_moved.len();
    for &(_, slot) in little {
        let m = &velocity.members[slot as usize];
        for node in [m.a, m.b].into_iter().filter(|&n| n != WORLD) {
            if memory.touched[node as usize] != problem {
                memory.touched[node as usize] = problem;
                memory.local[node as usize] = group.push_node(bodies[node as usize]);
                memory.next_moved.push(node);
            }
        }
        let local = |node: u32| match node {
            WORLD => WORLD,
            node => memory.local[node as usize],
        };
        let at = |node: u32| &memory.nodes[node as usize];
        let now = m.relative(|node| at(node).now) - velocity.wall(m, 1);
        let minus = m.relative(|node| at(node).minus) - velocity.wall(m, 0);
        memory.before.push([now, minus]);
        let slip = velocity.restituted(model, m, 1.0, now, minus);
        group.push_contact(m, (local(m.a), local(m.b)), slip);
        if let Some(turning) = velocity.turning.get(slot as usize) {
            group.push_roll(turning, velocity.turn(slot));
        }
    }
    let (_, residual, solved) = group.solve(&goal);
    if !solved {
        return None;
    }
    report.residual_velocity = report.residual_velocity.max(residual);
    let mut scale = 1.0;
    let nodes = &memory.next_moved[first..];
    let gains = |group: &Group, velocity: &Velocity| {
        let mut done = 0.0;
        for (k, (&(_, slot), &[before, _])) in little.iter().zip(&memory.before).enumerate() {
            let m = &velocity.members[slot as usize];
            let [n, t] = velocity::work(m, group.impulse(k), before, before + group.change(k));
            done += n + t;
            if group.rolls() {
                let (moment, change) = (group.moment(k), group.turn_change(k));
                let [r, s] = velocity.turning_work(slot, moment, change);
                done += r + s;
            }
        }
        let kinetic: f64 = nodes
            .iter()
            .map(|&node| {
                let body = &bodies[node as usize];
                let [v, w] = memory.nodes[node as usize].now;
                0.5 * (v.length_squared() / body.inv_mass + w.length_squared() / body.inv_inertia)
            })
            .sum();
        done > GAIN_TOLERANCE.max(super::solve::GAIN_SHARE * goal.tolerance) * kinetic
    };
    if o.energy_safeguard && gains(group, velocity) {
        let at = |group: &mut Group, scale: f64| {
            for (k, (&(_, slot), &[now, minus])) in little.iter().zip(&memory.before).enumerate() {
                let m = &velocity.members[slot as usize];
                group.set_slip(k, velocity.restituted(model, m, scale, now, minus));
            }
            group.solve(&goal).2
        };
        scale = bisect_scale(BISECTIONS, |s| at(group, s) && !gains(group, velocity));
        if !at(group, scale) {
            return None;
        }
        report.restitution_scale = report.restitution_scale.min(scale);
    }
    let mut pushed = false;
    let tol = velocity.tol;
    for (k, (&(_, slot), &[before, _])) in little.iter().zip(&memory.before).enumerate() {
        let m = &mut velocity.members[slot as usize];
        let r = group.impulse(k);
        let after = before + group.change(k);
        let done = velocity::work(m, r, before, after);
        pushed |= r != DVec3::ZERO;
        let speed = [before.dot(m.normal), after.dot(m.normal)];
        let moment = if group.rolls() {
            group.moment(k)
        } else {
            DVec3::ZERO
        };
        let hits = m.add(problem, r, speed[0], done, scale, tol);
        velocity
            .every
            .push(slot, problem, [r, moment], speed, scale);
        if group.rolls() {
            let change = group.turn_change(k);
            let done = velocity.turning_work(slot, moment, change);
            velocity.turning[slot as usize].add(moment, done, hits);
        }
    }
    for (local, &node) in nodes.iter().enumerate() {
        let [v, w] = group.correction(local as u32);
        let at = &mut memory.nodes[node as usize];
        for velocities in [
            &mut velocity.jump[node as usize],
            &mut at.now,
            &mut at.minus,
        ] {
            velocities[0] += v;
            velocities[1] += w;
        }
    }
    Some(pushed)
}
