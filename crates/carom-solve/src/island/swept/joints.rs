//! The joints of an island that is swept, all of them at once: after each sweep over contacts they measure nothing, whatever the tolerance of those is.

use crate::direct::{DirectError, Gram, Touched};
use crate::rows::{RowSystem, NODE_DOF, WORLD};
use crate::spheres::State;
use std::collections::BTreeMap;

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
    gram: Gram,
    free: Vec<f64>,
    measured: Vec<f64>,
    change: Vec<f64>,
}

impl Joints {
    /// The rows of a system as they are now, with multipliers.
    pub fn open(&mut self, system: &RowSystem, lambda: &[f64]) -> Result<(), DirectError> {
        self.rows.clear();
        let mut bodies = BTreeMap::<u32, Touched>::new();
        for c in system.contacts.iter().filter(|c| c.bilateral) {
            for at in c.rows() {
                let sides = [c.node_a, c.node_b].into_iter().zip(system.jac[at]);
                for (node, g) in sides.filter(|(node, _)| *node != WORLD) {
                    let body = bodies.entry(node).or_insert_with(|| Touched {
                        inverse: std::array::from_fn(|k| system.inverse(node as usize, k)),
                        rows: Vec::new(),
                    });
                    body.rows.push((self.rows.len(), g));
                }
                self.rows.push(JointRow {
                    at,
                    nodes: [c.node_a, c.node_b].map(|node| node.wrapping_add(1) as usize),
                    jac: system.jac[at],
                    weight: system.diag[at],
                    lambda: lambda[at],
                    last: lambda[at],
                });
            }
        }
        match self.rows.len() {
            0 => Ok(()),
            n => self.gram.factor(n, bodies.values()),
        }
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
        self.gram.solve(&self.measured, &mut self.change)?;
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
