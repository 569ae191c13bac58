//! Work of an island's contacts and joints ([`crate::impact::energy`]).

use crate::contact::Contact;
use crate::impact::energy::{mix, scales, Admit, ContactWork};
use crate::impact::law::returned;
use crate::impact::memory::ImpactScratch;
use crate::model::Model;
use carom_solve::rows::{RowContact, NODE_DOF, WORLD};
use carom_solve::Status;

/// A solution of the problem at hand: multipliers, corrections of the velocities, impulses of the loads that answer them.
pub struct RowSolution {
    pub(super) lambda: Vec<f64>,
    u: Vec<f64>,
    load: Vec<f64>,
}

impl ImpactScratch {
    pub fn is_pressed(&self, slot: usize) -> bool {
        let row = self.full.contacts[slot].row as usize;
        self.impulse[row] > 0.0 || self.load.get(row).is_some_and(|&load| load > 0.0)
    }

    /// What its moving wall adds to the measures of a contact at t_{n+1}.
    fn wall_measures(&self, c: &RowContact) -> &[f64] {
        let rows = c.rows();
        self.driven[1].get(rows).unwrap_or_default()
    }

    /// Kinetic energy of each node at `v_check + jump`, with that of walls as fast as they move, J.
    fn kinetic(&self, jump: &[f64]) -> Vec<f64> {
        let full = &self.full;
        let mut kinetic: Vec<f64> = (self.v_check.chunks_exact(NODE_DOF))
            .zip(jump.chunks_exact(NODE_DOF))
            .zip(full.inv_mass.iter().zip(&full.inv_inertia))
            .map(|((v, j), (im, ii))| {
                let square = |k: usize| (v[k] + j[k]).powi(2);
                let (linear, angular) = ((0..3).map(square), (3..6).map(square));
                0.5 * (linear.sum::<f64>() / im + angular.sum::<f64>() / ii)
            })
            .collect();
        for c in &full.contacts[..self.members.len()] {
            let wall = self.wall_measures(c).iter().take(c.translational as usize);
            let node = c.node_a as usize;
            kinetic[node] += 0.5 / full.inv_mass[node] * wall.map(|v| v * v).sum::<f64>();
        }
        kinetic
    }

    /// Whether all impulses so far have given a group of contacts energy. Joints and loads that depend on the motion do work of their own:
    /// islands with such are not looked at.
    pub fn gains_energy(&self, model: &Model) -> bool {
        if !(model.options.energy_safeguard && self.joints.is_empty() && self.loads.is_empty()) {
            return false;
        }
        let works = (0..self.members.len()).map(|slot| {
            let c = &self.full.contacts[slot];
            ContactWork {
                is_pressed: self.is_pressed(slot),
                terms: [self.work[slot].iter().sum(), 0.0, 0.0],
                explained: self.work_explained[slot],
                ..ContactWork::between(c.node_a, c.node_b)
            }
        });
        let works: Vec<ContactWork> = works.collect();
        scales(&works, Admit::Tolerance(model.options.tolerance), || {
            self.kinetic(&vec![0.0; self.jump.len()])
        })
        .is_some()
    }

    /// Forgets all impulses of the step, and the rows of `problem`.
    pub fn forget_all(&mut self, problem: u32) {
        self.impulse.fill(0.0);
        self.load.fill(0.0);
        self.work.fill([0.0; 4]);
        self.work_explained.fill(0.0);
        self.status.fill(Status::Gap);
        self.update_jump();
        self.table.forget_problem(problem);
    }

    /// Notes the work that the residual of the solution at hand explains at each contact.
    pub(in crate::impact) fn explain(&mut self) {
        self.explained.clear();
        for c in &self.sub.contacts[..self.chosen.len()] {
            let row = c.row as usize;
            let measured = if self.along_middle {
                &self.measured
            } else {
                &self.sub.jac
            };
            let z = |r: usize| self.sub.z0[r] + c.along(&measured[r], &self.u);
            let across = (row + 1..row + c.dim as usize).map(|r| self.lambda[r] * z(r));
            let mut work = ContactWork::default();
            work.explain([self.lambda[row] - c.least, z(row)], across.sum());
            self.explained.push(work.explained);
        }
    }

    /// Jump of the velocities from which the problem at hand is judged, and whether it solves contacts of the loads anew.
    fn judged_from(&self) -> (&[f64], bool) {
        if self.law.is_first() {
            (&self.offset, true)
        } else {
            (&self.fixed, false)
        }
    }

    /// By how much the velocities with the correction `u` differ from those of the jump `from`.
    fn change(&self, from: &[f64], u: &[f64]) -> Vec<f64> {
        let rest = self.fixed.iter().zip(from).zip(u);
        rest.map(|((fixed, from), u)| fixed - from + u).collect()
    }

    /// See [`crate::impact::sequence::ImpactIsland::limits`].
    pub(in crate::impact) fn limits(
        &self,
        (model, contacts): (&Model, &[Contact]),
        with: Option<&RowSolution>,
        admit: Admit,
    ) -> Option<Vec<f64>> {
        let (lambda, u) = with.map_or((&self.lambda, &self.u), |with| (&with.lambda, &with.u));
        let (from, anew) = self.judged_from();
        let velocity: Vec<f64> = self.v_check.iter().zip(from).map(|(v, j)| v + j).collect();
        let changes = [&self.u, u].map(|u| self.change(from, u));
        let joints = self.members.len()..self.full.contacts.len();
        let slots = self.chosen.iter().copied().chain(joints);
        // What a load between two nodes gives one it takes from the other: they have one scale.
        let linked = self.linked.iter().map(|&[a, b]| ContactWork {
            is_pressed: true,
            ..ContactWork::between(a, b)
        });
        let works: Vec<ContactWork> = (slots.zip(&self.sub.contacts).enumerate())
            .map(|(position, (slot, c))| {
                let full = &self.full.contacts[slot];
                let row = |r: usize| full.row as usize + r;
                // Of the loads, what is solved anew: an impact may leave them as they are.
                let kept = |row: usize| self.load.get(row).copied().unwrap_or(0.0);
                let loads = |row: usize| self.offset_impulse[row] - kept(row);
                let had = |r: usize| match anew {
                    true => loads(row(r)) - self.impulse[row(r)],
                    false => 0.0,
                };
                let pressed = |lambda: &[f64]| lambda[c.row as usize] > 0.0;
                let had_any = had(0) > 0.0 || (anew && self.impulse[row(0)] > 0.0);
                let any = pressed(&self.lambda) || pressed(lambda) || had_any;
                let of_residual = self.explained.get(position).copied().unwrap_or(0.0);
                let of_contact = self
                    .members
                    .get(slot)
                    .map(|&m| contacts[m as usize].law(model));
                let at = |node: u32, side: usize| match node {
                    WORLD => 0.0,
                    node => {
                        let of = NODE_DOF * node as usize;
                        let change = changes[1][of..].iter().zip(&changes[0][of..]);
                        let row = &self.sub.jac[c.row as usize][side];
                        change.zip(row).map(|((to, from), g)| g * (to - from)).sum()
                    }
                };
                let wall = self.wall_measures(full);
                let normal = |v: &[f64]| self.sub.row_velocity(c, c.row as usize, v);
                let of_wall = wall.first().copied().unwrap_or(0.0);
                let first = normal(&velocity) + of_wall + normal(&changes[0]);
                let mut work = ContactWork {
                    is_pressed: c.bilateral || any,
                    normal: [first, at(c.node_a, 0), at(c.node_b, 1)],
                    explained: of_residual,
                    returned: of_contact.map_or(0.0, |law| returned(law, &model.options)),
                    ..ContactWork::between(c.node_a, c.node_b)
                };
                let joint = slot.checked_sub(self.members.len());
                let joint = joint.map(|k| &model.joints[self.joints[k] as usize]);
                for r in 0..c.dim as usize {
                    // What prescribes a motion does work of its own.
                    if joint.is_some_and(|joint| joint.prescribes(r)) {
                        continue;
                    }
                    let row = c.row as usize + r;
                    let measure = |v: &[f64]| self.sub.row_velocity(c, row, v);
                    let before = measure(&velocity) + wall.get(r).copied().unwrap_or(0.0);
                    let solved = [&self.lambda, lambda].map(|l| l[row]);
                    let change = [0, 1].map(|k| measure(&changes[k]));
                    let Some(middle) = self.middle.get(full.row as usize + r) else {
                        work.add(before, solved.map(|l| l - had(r)), change);
                        continue;
                    };
                    // The loads that are solved anew acted along the mean of the normals; impulses of earlier problems (compression) did not.
                    let at = full.row as usize + r;
                    let [earlier, dropped] = match anew {
                        true => [self.impulse[at], loads(at)],
                        false => [0.0; 2],
                    };
                    work.add(before, solved.map(|l| l + earlier), change);
                    let turned = |v: &[f64]| full.along(middle, v) - measure(v);
                    let along = [0, 1].map(|k| change[k] + turned(&changes[k]));
                    let before = full.along(middle, &velocity) + self.wall_along_middle(at);
                    work.add(before, [-dropped; 2], along);
                }
                work
            })
            .chain(linked)
            .collect();
        scales(&works, admit, || self.kinetic(from))
    }

    /// The solution at hand.
    pub(in crate::impact) fn solution(&self) -> RowSolution {
        RowSolution {
            lambda: self.lambda.clone(),
            u: self.u.clone(),
            load: self.sub.load.clone(),
        }
    }

    /// Corrections of the velocities as the impulses have them: what a solver leaves of the balance of momentum would be energy.
    pub(in crate::impact) fn balance(&mut self) {
        self.sub.impulses(&self.lambda, &mut self.force);
        for (f, b) in self.force.iter_mut().zip(&self.sub.load) {
            *f += b;
        }
        self.sub.apply_inverse_mass(&self.force, &mut self.u);
    }

    /// Takes a solution back.
    pub(in crate::impact) fn restore(&mut self, solution: RowSolution) {
        (self.lambda, self.u, self.sub.load) = (solution.lambda, solution.u, solution.load);
    }

    /// Goes from the solution at hand towards `with` as far as `scales` of the nodes say.
    pub(in crate::impact) fn mix(&mut self, with: &RowSolution, scales: &[f64]) {
        for (position, c) in self.sub.contacts.iter().enumerate() {
            let (rows, s) = (c.rows(), scales[c.node_a as usize]);
            mix(&mut self.lambda[rows.clone()], &with.lambda[rows], s);
            if let Some(scale) = self.scale.get_mut(position) {
                *scale = s;
            }
        }
        for (node, &s) in scales.iter().enumerate() {
            let at = NODE_DOF * node..NODE_DOF * (node + 1);
            mix(&mut self.u[at.clone()], &with.u[at.clone()], s);
            if let Some(load) = self.sub.load.get_mut(at.clone()) {
                mix(load, &with.load[at], s);
            }
        }
    }
}
