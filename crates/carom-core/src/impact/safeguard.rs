//! The energy safeguard (rule R4): Newton's law with friction and unequal restitution can gain energy in multiple impacts.

use super::law::Law;
use crate::impact::bisect::{bisect_scale, BISECTIONS, BISECTIONS_JOINTS, GAIN_TOLERANCE};
use crate::impact::memory::ImpactScratch;
use crate::model::Model;
use crate::report::StepReport;
use crate::workspace::IslandScratch;
use carom_solve::rows::NODE_DOF;

impl ImpactScratch {
    /// Rule R4: scales restitution in islands of contacts with impulse whose work is positive.
    pub(super) fn safeguard(
        &mut self,
        model: &Model,
        scratch: &mut IslandScratch,
        law: Law,
        problem: u32,
        report: &mut StepReport,
    ) -> bool {
        // A contact that wakes between two groups joins them: look again, at most once per member.
        for _ in 0..self.chosen.len() {
            self.group_by_impulse();
            let groups = self.group.clone();
            let mut done: Vec<u32> = Vec::new();
            for position in 0..self.chosen.len() {
                let group = groups[position];
                if group == u32::MAX || done.contains(&group) {
                    continue;
                }
                // Joints of the group stand behind its contacts.
                let inside: Vec<usize> =
                    (0..groups.len()).filter(|&p| groups[p] == group).collect();
                if !self.gains(model, &inside) {
                    continue;
                }
                done.push(group);
                let base: Vec<f64> = inside
                    .iter()
                    .filter_map(|&p| self.scale.get(p).copied())
                    .collect();
                let mut solve = |this: &mut Self, s: f64, report: &mut StepReport| {
                    for (&p, start) in inside.iter().zip(&base) {
                        this.scale[p] = s * start;
                    }
                    this.build(model, scratch.contacts, law);
                    this.solve_built(model, scratch, problem, None, report)
                };
                // A trial is no part of the step: its counts are its own, and one that fails is not admissible.
                let count = if self.joints.is_empty() {
                    BISECTIONS
                } else {
                    BISECTIONS_JOINTS
                };
                let scale = bisect_scale(count, |s| {
                    let mut own = StepReport::default();
                    let solved = solve(self, s, &mut own) && own.unconverged == 0;
                    solved && !self.gains(model, &inside)
                });
                let residual = report.residual_velocity;
                if !solve(self, scale, report) && !self.is_fine_enough(model, report) {
                    // It is solved with a gain of energy alone: no restitution at all, then, and less friction.
                    self.scale.fill(0.0);
                    self.build(model, scratch.contacts, law);
                    let failed = std::mem::replace(&mut report.residual_velocity, residual);
                    if !self.solve_with_less_friction(model, scratch, problem, report) {
                        report.residual_velocity = failed;
                        return false;
                    }
                    report.restitution_scale = 0.0;
                    return true;
                }
            }
            if done.is_empty() {
                break;
            }
            let least = self.scale.iter().copied().fold(1.0, f64::min);
            report.restitution_scale = report.restitution_scale.min(least);
        }
        true
    }

    /// Marks contacts with impulse by connected group (through spheres), others `u32::MAX`.
    fn group_by_impulse(&mut self) {
        let contacts = &self.sub.contacts;
        let mut node_group: Vec<u32> = (0..self.sub.nodes() as u32).collect();
        let loaded =
            |c: &carom_solve::rows::RowContact| c.bilateral || self.lambda[c.row as usize] > 0.0;
        // Small islands: repeat the sweep until nothing changes.
        loop {
            let mut changed = false;
            for c in contacts
                .iter()
                .filter(|c| loaded(c) && c.node_b != carom_solve::rows::WORLD)
            {
                let (a, b) = (node_group[c.node_a as usize], node_group[c.node_b as usize]);
                if a != b {
                    let low = a.min(b);
                    node_group[c.node_a as usize] = low;
                    node_group[c.node_b as usize] = low;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        self.group.clear();
        self.group.extend(contacts.iter().map(|c| {
            if loaded(c) {
                node_group[c.node_a as usize]
            } else {
                u32::MAX
            }
        }));
    }

    /// What its moving wall adds to the measures of a row group of the problem.
    fn wall_measures(&self, position: usize) -> Option<&[f64]> {
        let c = &self.full.contacts[*self.chosen.get(position)?];
        self.driven[1].get(c.row as usize..(c.row + c.dim) as usize)
    }

    /// Whether the work of the given contacts and joints of the problem exceeds the tolerance of rule R4. Rows that
    /// prescribe a motion do work legitimately.
    fn gains(&self, model: &Model, inside: &[usize]) -> bool {
        let (mut work, mut of_walls) = (0.0, 0.0);
        let mut nodes: Vec<u32> = Vec::new();
        for &position in inside {
            let c = &self.sub.contacts[position];
            let joint = position.checked_sub(self.chosen.len());
            let wall = self.wall_measures(position);
            if let Some(wall) = wall {
                // What a moving wall gives is its own work; its speed belongs to the scale.
                let square = wall.iter().take(c.translational as usize).map(|v| v * v);
                of_walls += 0.5 / self.sub.inv_mass[c.node_a as usize] * square.sum::<f64>();
            }
            for row in c.row as usize..(c.row + c.dim) as usize {
                let prescribes = joint.is_some_and(|k| {
                    let joint = &model.joints[self.joints[k] as usize];
                    joint.prescribes(row - c.row as usize)
                });
                if prescribes {
                    continue;
                }
                let before = self.sub.row_velocity(c, row, &self.velocity)
                    + wall.map_or(0.0, |w| w[row - c.row as usize]);
                let after = before + self.sub.row_velocity(c, row, &self.u);
                work += 0.5 * self.lambda[row] * (before + after);
            }
            for node in [c.node_a, c.node_b] {
                if node != carom_solve::rows::WORLD && !nodes.contains(&node) {
                    nodes.push(node);
                }
            }
        }
        let kinetic: f64 = nodes
            .iter()
            .map(|&node| {
                let v = &self.velocity[NODE_DOF * node as usize..][..NODE_DOF];
                let (im, ii) = (
                    self.sub.inv_mass[node as usize],
                    self.sub.inv_inertia[node as usize],
                );
                0.5 * ((v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / im
                    + (v[3] * v[3] + v[4] * v[4] + v[5] * v[5]) / ii)
            })
            .sum();
        work > GAIN_TOLERANCE * (kinetic + of_walls)
    }
}
