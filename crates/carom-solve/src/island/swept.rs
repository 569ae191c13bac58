//! Large islands by sweeps over their rows, contacts of bodies that are no spheres among them: the momentum of [`crate::spheres`], and some contacts that
//! share no node at a time. A sweep costs as much as there are rows, and no factorisation fills up, whatever the bodies are.
//!
//! A sweep takes the normal row of a contact to where it closes, `max(0, r - z/w)`, then each of its discs to `P(r - z/w)` with the largest eigenvalue `w`
//! of the disc's block of `W`, which is never too long a step. All joints of the island are one block, solved exactly at the end of a sweep.

mod joints;
mod kernel;

use crate::cone::Block;
use crate::direct::DirectError;
use crate::rows::{RowContact, RowSystem, NODE_DOF};
use crate::spheres::lanes::EMPTY;
use crate::spheres::{Instructions, Packing, State, UngroupedContact, GROWTH, RAMP};
use joints::Joints;
use kernel::{DiscRows, Group, Row, Sweep};

/// Workspace.
#[derive(Default)]
pub(super) struct RowSweeps {
    packing: Packing,
    groups: Vec<Group>,
    /// Discs of the groups, one group after the other: `each` of every one, as many as a contact has at most.
    discs: Vec<DiscRows>,
    each: usize,
    joints: Joints,
    /// Velocities of the world, then of the nodes; and after the sweep before the last one.
    states: Vec<State>,
    last: Vec<State>,
    /// Sweeps since the momentum was dropped, and what the last one changed.
    age: u32,
    changed: f64,
}

impl RowSweeps {
    /// Another problem: cuts its contacts into groups. [`RowSweeps::restart`] and [`RowSweeps::open`] follow.
    pub fn begin(&mut self, system: &RowSystem) {
        let node = |node: u32| node.wrapping_add(1);
        let links: Vec<UngroupedContact> = (0..)
            .zip(&system.contacts)
            .filter(|(_, c)| !c.bilateral)
            .map(|(id, c)| UngroupedContact {
                a: node(c.node_a),
                b: node(c.node_b),
                id,
            })
            .collect();
        self.packing.pack(&links, system.nodes() + 1, 0);
        self.states.clear();
        self.states.resize(system.nodes() + 1, State::default());
        for (node, state) in self.states[1..].iter_mut().enumerate() {
            state.linear[3] = system.inv_mass[node];
            state.surface[3] = system.inv_inertia[node];
        }
        let discs = system.contacts.iter().map(|c| c.bounds.discs().count());
        self.each = discs.max().unwrap_or(0);
        self.groups.clear();
        for links in &self.packing.groups {
            let mut group = Group {
                ids: links.map(|link| link.id),
                nodes: [links.map(|link| link.a), links.map(|link| link.b)],
                ..Group::default()
            };
            for (side, nodes) in group.nodes.into_iter().enumerate() {
                let of = nodes.map(|node| &self.states[node as usize]);
                group.inverse[2 * side] = of.map(|state| state.linear[3]);
                group.inverse[2 * side + 1] = of.map(|state| state.surface[3]);
            }
            self.groups.push(group);
        }
    }

    /// Drops the momentum.
    pub fn restart(&mut self) {
        self.age = 0;
    }

    /// The problem linearised where the measures are `z` at the corrections `u` of `lambda`; loads stay as they are there.
    pub fn open(
        &mut self,
        system: &RowSystem,
        z: &[f64],
        lambda: &[f64],
        u: &[f64],
    ) -> Result<(), DirectError> {
        self.discs.clear();
        self.discs
            .resize(self.each * self.groups.len(), DiscRows::default());
        for (k, group) in self.groups.iter_mut().enumerate() {
            let discs = &mut self.discs[self.each * k..][..self.each];
            for (lane, &id) in group.ids.iter().enumerate().filter(|(_, &id)| id != EMPTY) {
                let c = &system.contacts[id as usize];
                let mut block = Block::default();
                system.delassus_block(c, c, &mut block);
                let fill = |row: usize, out: &mut Row| {
                    let at = c.row as usize + row;
                    for (half, columns) in out.jac.iter_mut().enumerate() {
                        for (k, column) in columns.iter_mut().enumerate() {
                            column[lane] = system.jac[at][half / 2][3 * (half % 2) + k];
                        }
                    }
                    (out.lambda[lane], out.last[lane]) = (lambda[at], lambda[at]);
                    out.weight[lane] = system.diag[at];
                };
                fill(0, &mut group.normal);
                group.least[lane] = c.least;
                group.step[lane] = 1.0 / normal_weight(c, &block);
                for (disc, out) in c.bounds.discs().zip(discs.iter_mut()) {
                    let rows = disc.start..disc.start + disc.dim;
                    rows.clone()
                        .zip(&mut out.rows)
                        .for_each(|(row, out)| fill(row, out));
                    out.step[lane] = 1.0 / largest(&block, rows.start, rows.end - 1);
                    out.bound[lane] = disc.bound;
                }
            }
        }
        self.joints.open(system, lambda)?;
        self.measure(system, z, u);
        let mut own = vec![0.0; u.len()];
        let mut force = vec![0.0; u.len()];
        system.impulses(lambda, &mut force);
        system.apply_inverse_mass(&force, &mut own);
        for (state, own) in self.states[1..].iter_mut().zip(own.chunks(NODE_DOF)) {
            state.linear[..3].copy_from_slice(&own[..3]);
            state.surface[..3].copy_from_slice(&own[3..]);
        }
        Ok(())
    }

    /// The same rows with other measures `z` at the corrections `u`.
    pub fn measure(&mut self, system: &RowSystem, z: &[f64], u: &[f64]) {
        let free = system.free(z, u);
        self.joints.measure(&free);
        for (k, group) in self.groups.iter_mut().enumerate() {
            let discs = &mut self.discs[self.each * k..][..self.each];
            for (lane, &id) in group.ids.iter().enumerate().filter(|(_, &id)| id != EMPTY) {
                let c = &system.contacts[id as usize];
                let own = &free[c.rows()];
                group.normal.free[lane] = own[0];
                for (disc, out) in c.bounds.discs().zip(discs.iter_mut()) {
                    let rows = own[disc.start..].iter().zip(&mut out.rows).take(disc.dim);
                    rows.for_each(|(own, row)| row.free[lane] = *own);
                }
            }
        }
    }

    /// One sweep: first a step on the way that the last ones came, at most `cap` times theirs. What it changed over what there is, in the square.
    pub fn once(&mut self, cap: f64) -> f64 {
        let k = f64::from(self.age.saturating_sub(1));
        let beta = (k / (k + RAMP)).min(cap);
        if self.age == 0 {
            // Of another problem.
            self.last.clone_from(&self.states);
        }
        for (state, last) in self.states.iter_mut().zip(&mut self.last) {
            let now = *state;
            for k in 0..3 {
                state.linear[k] += beta * (now.linear[k] - last.linear[k]);
                state.surface[k] += beta * (now.surface[k] - last.surface[k]);
            }
            *last = now;
        }
        let mut sums = Instructions::default().run(Sweep {
            groups: &mut self.groups,
            discs: &mut self.discs,
            each: self.each,
            states: &mut self.states,
            beta,
        });
        // What they leave open where they are not solved is seen at the next look.
        let _ = self.joints.solve(&mut self.states, beta, &mut sums);
        let [changed, size] = sums;
        self.age = match self.age {
            0 => 1,
            _ if changed > GROWTH * self.changed => 1,
            age => age + 1,
        };
        self.changed = changed;
        if size > 0.0 {
            changed / size
        } else {
            0.0
        }
    }

    /// Joints alone, once: their multipliers.
    pub fn hold(&mut self, lambda: &mut [f64]) -> Result<(), DirectError> {
        self.joints.solve(&mut self.states, 0.0, &mut [0.0; 2])?;
        self.joints.write(lambda);
        Ok(())
    }

    /// The multipliers.
    pub fn write(&self, contacts: &[RowContact], lambda: &mut [f64]) {
        self.joints.write(lambda);
        for (k, group) in self.groups.iter().enumerate() {
            let discs = &self.discs[self.each * k..][..self.each];
            for (lane, &id) in group.ids.iter().enumerate().filter(|(_, &id)| id != EMPTY) {
                let c = &contacts[id as usize];
                let own = &mut lambda[c.rows()];
                own[0] = group.normal.lambda[lane];
                for (disc, from) in c.bounds.discs().zip(discs) {
                    let rows = own[disc.start..].iter_mut().zip(&from.rows).take(disc.dim);
                    rows.for_each(|(own, row)| *own = row.lambda[lane]);
                }
            }
        }
    }
}

/// `w` of the normal row: what the multiplier changes of the measure by itself, and by what follows it in the discs. Where friction is above 1 the first
/// part is as much larger: a longer step changes discs by more than itself.
fn normal_weight(c: &RowContact, block: &Block) -> f64 {
    let followed = c.bounds.discs().map(|disc| {
        let row = &block[0][disc.start..disc.start + disc.dim];
        disc.bound * row.iter().map(|w| w * w).sum::<f64>().sqrt()
    });
    block[0][0] * c.bounds.sliding.max(1.0) + followed.sum::<f64>()
}

/// The larger eigenvalue of rows `i` and `j` of a block, which may be one.
fn largest(block: &Block, i: usize, j: usize) -> f64 {
    let (a, b) = (block[i][i], block[j][j]);
    if i == j {
        return a;
    }
    0.5 * (a + b) + (0.5 * (a - b)).hypot(block[i][j])
}
