//! The clusters of a problem, each solved alone. They share no sphere, so batches of them may be solved at the same time:
//! what they find enters the graph afterwards.

use super::cluster_copies::{ClusterCopies, ClusterRange};
use super::cluster_solver::ClusterSolver;
use super::clusters::Clusters;
use super::contact_graph::{ContactGraph, Node};
use crate::impact::energy::{scales, Admit, ContactWork};
use crate::model::Model;
use crate::pile::closed_contact::{self, ProblemImpulse};
use crate::pile::limits::{finer, tolerance};
use crate::pile::roll;
use crate::pile::velocities::Velocities;
use carom_solve::spheres::{Body, Goal};
use glam::DVec3;
use std::ops::Range;

/// What all clusters of a problem are solved with.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub model: &'a Model,
    pub velocity: &'a Velocities,
    pub bodies: &'a [Body],
    pub graph: &'a ContactGraph,
    pub clusters: &'a Clusters,
}

/// Consecutive clusters, and what they gave, in the order of their contacts and spheres.
#[derive(Default)]
pub(super) struct Batch {
    copies: ClusterCopies,
    solver: ClusterSolver,
    /// Relative velocities of the contacts of a cluster: now, and `V_minus`.
    before: Vec<[DVec3; 2]>,
    /// Relative angular velocities, where something rolls.
    turn: Vec<DVec3>,
    pub given: Vec<ProblemImpulse>,
    /// Moments and their work, where something rolls.
    pub turned: Vec<(DVec3, [f64; 2])>,
    /// Changes of linear and surface velocity.
    pub moved: Vec<[DVec3; 2]>,
    pub residual: f64,
    /// Clusters that were not solved: they gave nothing.
    pub failed: u32,
    pub pushed: bool,
}

impl Batch {
    pub fn solve(&mut self, view: &View, range: Range<usize>) {
        self.given.clear();
        self.turned.clear();
        self.moved.clear();
        self.residual = 0.0;
        (self.failed, self.pushed) = (0, false);
        let mut range = range;
        while !range.is_empty() {
            let end = self.copies.take(view.graph, view.clusters, range.clone());
            for k in range.start..end {
                let ([c, n], [c_end, n_end]) =
                    (view.clusters.starts[k], view.clusters.starts[k + 1]);
                let cluster = ClusterRange {
                    contacts: c as usize..c_end as usize,
                    nodes: n as usize..n_end as usize,
                };
                if self.solve_cluster(view, &cluster).is_none() {
                    self.failed += 1;
                    self.give_nothing(view, &cluster);
                }
            }
            range.start = end;
        }
    }

    fn give_nothing(&mut self, view: &View, cluster: &ClusterRange) {
        let (contacts, nodes) = (cluster.contacts.len(), cluster.nodes.len());
        let nothing = ProblemImpulse {
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

    fn solve_cluster(&mut self, view: &View, cluster: &ClusterRange) -> Option<()> {
        let View {
            model, velocity, ..
        } = *view;
        let o = &model.options;
        let goal = Goal {
            tolerance: tolerance(model),
            floor: velocity.floor,
            // Its share of what the whole pile is judged by.
            scale: velocity.terms
                * (cluster.contacts.len() as f64 / velocity.closed.len() as f64).sqrt(),
            closing: velocity.left(o),
            worst: 1.0,
            penalty_scale: o.penalty_scale,
            patience: usize::MAX,
            most: 0,
            had: 0,
            rescale: usize::MAX,
            weighed: false,
            calm: 1.0,
        };
        self.state(view, cluster);
        let (mut residual, solved) = self.solver.solve(&goal);
        if !solved {
            return None;
        }
        let from = [self.given.len(), self.turned.len()];
        let mut scales = None;
        // Most lose energy, and need no measure of it.
        if self.list(cluster) > 0.0 && o.energy_safeguard {
            let most = Admit::Tolerance(goal.tolerance);
            let gains =
                |this: &Self, admit| (this.limits(view, cluster, &this.solver, admit)).is_some();
            if gains(self, Admit::Rounding) && !gains(self, Admit::Explained) {
                let (finer, solved) = self.solver.solve(&finer(&goal));
                if solved {
                    residual = finer;
                }
            }
            if gains(self, most) {
                let with = self.solver.clone();
                for (k, &[now, _]) in self.before.iter().enumerate() {
                    self.solver.set_slip(k, now);
                }
                self.solver.begin_again();
                let (residual_without, solved) = self.solver.solve(&goal);
                if !solved {
                    return None;
                }
                residual = residual.max(residual_without);
                scales = self.limits(view, cluster, &with, most);
                self.solver.mix(&with, scales.as_deref());
            }
            self.given.truncate(from[0]);
            self.turned.truncate(from[1]);
            self.list(cluster);
        }
        let sides = &view.clusters.sides[cluster.contacts.clone()];
        if let Some(scales) = scales {
            for (given, sides) in self.given[from[0]..].iter_mut().zip(sides) {
                given.scale = scales[sides[0] as usize];
            }
        }
        for given in &self.given[from[0]..] {
            self.pushed |= given.impulse != DVec3::ZERO;
        }
        let moved = self.solver.corrections().iter();
        self.moved.extend(moved.map(|u| [u.linear, u.surface]));
        self.residual = self.residual.max(residual);
        Some(())
    }

    /// States a cluster.
    fn state(&mut self, view: &View, cluster: &ClusterRange) {
        let View {
            velocity,
            graph,
            bodies,
            ..
        } = *view;
        let rolls = !velocity.turning.is_empty();
        self.solver.clear();
        self.before.clear();
        self.turn.clear();
        for node in self.copies.nodes(cluster) {
            self.solver.push_node(node);
        }
        if rolls {
            for &node in &view.clusters.nodes[cluster.nodes.clone()] {
                self.solver.push_body(bodies[node as usize]);
            }
        }
        let slots = &view.clusters.slots[cluster.contacts.clone()];
        let sides = &view.clusters.sides[cluster.contacts.clone()];
        for ((edge, &sides), &slot) in self.copies.edges(cluster).iter().zip(sides).zip(slots) {
            let [now, minus] = self.copies.relative(velocity, cluster, edge, sides);
            self.before.push([now, minus]);
            let slip = velocity.newton(
                view.model,
                (edge.normal, f64::from(edge.closing)),
                edge.law,
                now,
                minus,
            );
            self.solver.push_contact(edge, sides, slip);
            if rolls {
                let turn = graph.turn(velocity, bodies, slot);
                self.turn.push(turn);
                self.solver
                    .push_roll(&velocity.turning[slot as usize], turn);
            }
        }
    }

    /// Restitution scale of each sphere between the solution at hand and one `with` restitution; nothing if none gains energy beyond what is
    /// admitted.
    fn limits(
        &self,
        view: &View,
        cluster: &ClusterRange,
        with: &ClusterSolver,
        admit: Admit,
    ) -> Option<Vec<f64>> {
        let both = [&self.solver, with];
        let sides = &view.clusters.sides[cluster.contacts.clone()];
        let edges = self.copies.edges(cluster);
        let works = sides
            .iter()
            .zip(edges)
            .enumerate()
            .map(|(k, (&[a, b], edge))| {
                let impulses = both.map(|of| of.impulse(k));
                let mut work = ContactWork {
                    is_pressed: impulses.iter().any(|r| *r != DVec3::ZERO),
                    ..ContactWork::between(a, b)
                };
                let (before, changes) = (self.before[k][0], both.map(|of| of.change(k)));
                for axis in 0..3 {
                    let at = |v: DVec3| v[axis];
                    work.add(at(before), impulses.map(at), changes.map(at));
                }
                let (r, z) = (impulses[1], with.measure(k));
                let normal = [r.dot(edge.normal), z.dot(edge.normal)];
                let mut across = r.dot(z) - normal[0] * normal[1];
                if with.rolls() {
                    let (before, changes) = (self.turn[k], both.map(|of| of.turn_change(k)));
                    let moments = both.map(|of| of.moment(k));
                    for axis in 0..3 {
                        let at = |v: DVec3| v[axis];
                        work.add(at(before), moments.map(at), changes.map(at));
                    }
                    across += moments[1].dot(before + changes[1]);
                }
                work.explain(normal, across);
                work
            });
        let works: Vec<ContactWork> = works.collect();
        scales(&works, admit, || {
            let nodes = self.copies.nodes(cluster).iter();
            nodes.map(Node::kinetic).collect()
        })
    }

    /// Lists what the solution at hand gives; its work.
    fn list(&mut self, cluster: &ClusterRange) -> f64 {
        let mut done = 0.0;
        let all = self.copies.edges(cluster).iter().zip(&self.before);
        for (k, (edge, &[before, _])) in all.enumerate() {
            let normal = edge.normal;
            let impulse = self.solver.impulse(k);
            let after = before + self.solver.change(k);
            let work = closed_contact::work(normal, impulse, before, after);
            done += work[0] + work[1];
            self.given.push(ProblemImpulse {
                impulse,
                work,
                speed: [before.dot(normal), after.dot(normal)],
                scale: 1.0,
            });
            if self.solver.rolls() {
                let (moment, before) = (self.solver.moment(k), self.turn[k]);
                let after = before + self.solver.turn_change(k);
                let work = roll::work(normal, moment, before, after);
                done += work[0] + work[1];
                self.turned.push((moment, work));
            }
        }
        done
    }
}
