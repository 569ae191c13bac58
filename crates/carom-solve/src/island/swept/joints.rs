//! The joints of an island that is swept, all of them at once: after each sweep over contacts they measure nothing, whatever the tolerance of those is.

use crate::cone::Block;
use crate::direct::{DirectError, Entries, SparseLlt};
use crate::rows::{RowContact, RowSystem, NODE_DOF, WORLD};
use crate::spheres::State;
use std::collections::{BTreeMap, BTreeSet};

/// What is added to the diagonal of joints (1, a share of it): those that repeat one another stay solvable. Less is lost in the rounding of the factors;
/// more, and what others contradict takes sweeps.
const SHIFT: f64 = 1e-12;

/// A row of a joint, over its nodes among the states.
struct JointRow {
    at: usize,
    nodes: [usize; 2],
    jac: [[f64; NODE_DOF]; 2],
    weight: f64,
    lambda: f64,
    last: f64,
}

#[derive(Default)]
pub(super) struct Joints {
    rows: Vec<JointRow>,
    entries: Entries,
    llt: SparseLlt,
    free: Vec<f64>,
    measured: Vec<f64>,
    change: Vec<f64>,
}

impl Joints {
    /// The rows of a system as they are now, with multipliers.
    pub fn open(&mut self, system: &RowSystem, lambda: &[f64]) -> Result<(), DirectError> {
        self.rows.clear();
        let joints: Vec<&RowContact> = system.contacts.iter().filter(|c| c.bilateral).collect();
        let mut first = Vec::with_capacity(joints.len());
        for c in &joints {
            first.push(self.rows.len() as u32);
            self.rows.extend(c.rows().map(|at| JointRow {
                at,
                nodes: [c.node_a, c.node_b].map(|node| node.wrapping_add(1) as usize),
                jac: system.jac[at],
                weight: system.diag[at],
                lambda: lambda[at],
                last: lambda[at],
            }));
        }
        if self.rows.is_empty() {
            return Ok(());
        }
        // Joints of each node so far.
        let mut at_node = BTreeMap::<u32, Vec<usize>>::new();
        self.entries.list.clear();
        for (k, c) in joints.iter().enumerate() {
            let mut others = BTreeSet::new();
            for node in [c.node_a, c.node_b]
                .into_iter()
                .filter(|&node| node != WORLD)
            {
                let here = at_node.entry(node).or_default();
                here.push(k);
                others.extend(here.iter().copied());
            }
            for other in others {
                let mut block = Block::default();
                system.delassus_block(c, joints[other], &mut block);
                for (row, values) in block.iter().enumerate().take(c.dim as usize) {
                    for (col, &value) in values.iter().enumerate().take(joints[other].dim as usize)
                    {
                        let same = other == k && row == col;
                        let value = if same { (1.0 + SHIFT) * value } else { value };
                        let place = (first[k] + row as u32, first[other] + col as u32);
                        self.entries.list.push((place.0, place.1, value));
                    }
                }
            }
        }
        let n = self.rows.len();
        let (col_ptr, row_idx, values) = self.entries.compressed(n);
        self.llt.refactor(n, col_ptr, row_idx, values)
    }

    /// Measures without multipliers, of all rows of the system.
    pub fn measure(&mut self, free: &[f64]) {
        self.free.clear();
        self.free.extend(self.rows.iter().map(|row| free[row.at]));
    }

    /// Solves them where the nodes are, from multipliers that go `beta` on. Adds what changed and what there is, in the square over the masses.
    pub fn solve(
        &mut self,
        states: &mut [State],
        beta: f64,
        sums: &mut [f64; 2],
    ) -> Result<(), DirectError> {
        if self.rows.is_empty() {
            return Ok(());
        }
        self.measured.clear();
        for (row, free) in self.rows.iter().zip(&self.free) {
            let of = |side: usize| along(&row.jac[side], &states[row.nodes[side]]);
            self.measured.push(-(free + of(0) + of(1)));
        }
        self.change.resize(self.rows.len(), 0.0);
        self.llt.solve(&self.measured, &mut self.change)?;
        for (row, change) in self.rows.iter_mut().zip(&self.change) {
            let on = beta * (row.lambda - row.last);
            row.last = row.lambda;
            row.lambda += on + change;
            sums[0] += row.weight * change * change;
            sums[1] += row.weight * row.lambda * row.lambda;
            for (node, jac) in row.nodes.into_iter().zip(&row.jac) {
                let state = &mut states[node];
                for k in 0..3 {
                    state.linear[k] += state.linear[3] * change * jac[k];
                    state.surface[k] += state.surface[3] * change * jac[3 + k];
                }
            }
        }
        Ok(())
    }

    /// The multipliers.
    pub fn write(&self, lambda: &mut [f64]) {
        for row in &self.rows {
            lambda[row.at] = row.lambda;
        }
    }
}

fn along(jac: &[f64; NODE_DOF], state: &State) -> f64 {
    let halves = jac[..3].iter().zip(&state.linear[..3]);
    let turned = jac[3..].iter().zip(&state.surface[..3]);
    halves.chain(turned).map(|(j, u)| j * u).sum()
}
