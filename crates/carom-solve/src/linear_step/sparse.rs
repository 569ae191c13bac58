//! Column-compressed matrices over the rows of contacts that share a node.

use crate::direct::SparseLu;
use crate::rows::{RowSystem, WORLD};

/// Sparse assembly: contacts per node, the CSC arrays and the factorisation that is reused while the pattern stands.
#[derive(Default)]
pub(super) struct SparseParts {
    pub(super) node_start: Vec<usize>,
    pub(super) node_contacts: Vec<usize>,
    pub(super) position: Vec<usize>,
    pub(super) neighbours: Vec<usize>,
    pub(super) col_ptr: Vec<usize>,
    pub(super) row_idx: Vec<usize>,
    pub(super) values: Vec<f64>,
    pub(super) lu: SparseLu,
}

impl SparseParts {
    /// Column-compressed form of the entries; equal places are summed.
    pub(super) fn compress(&mut self, n: usize, entries: &mut [(u32, u32, f64)]) {
        entries.sort_by_key(|&(row, col, _)| (u64::from(col) << 32) | u64::from(row));
        self.col_ptr.clear();
        self.col_ptr.resize(n + 1, 0);
        self.row_idx.clear();
        self.values.clear();
        let mut last = None;
        for &(row, col, value) in entries.iter() {
            if last == Some((row, col)) {
                if let Some(sum) = self.values.last_mut() {
                    *sum += value;
                }
                continue;
            }
            last = Some((row, col));
            self.row_idx.push(row as usize);
            self.values.push(value);
            self.col_ptr[col as usize + 1] += 1;
        }
        for col in 0..n {
            self.col_ptr[col + 1] += self.col_ptr[col];
        }
    }

    /// Lists, per node, the slots of the active contacts on it.
    pub(super) fn index_contacts(&mut self, system: &RowSystem, active: &[(usize, usize)]) {
        self.node_start.clear();
        self.node_start.resize(system.nodes() + 1, 0);
        let ends = |index: usize| {
            let c = &system.contacts[index];
            [c.node_a, c.node_b]
                .into_iter()
                .filter(|&node| node != WORLD)
                .map(|node| node as usize)
        };
        for &(index, _) in active {
            ends(index).for_each(|node| self.node_start[node + 1] += 1);
        }
        for node in 0..system.nodes() {
            self.node_start[node + 1] += self.node_start[node];
        }
        self.position.clear();
        self.position
            .extend_from_slice(&self.node_start[..system.nodes()]);
        self.node_contacts
            .resize(self.node_start[system.nodes()], 0);
        for (slot, &(index, _)) in active.iter().enumerate() {
            for node in ends(index) {
                self.node_contacts[self.position[node]] = slot;
                self.position[node] += 1;
            }
        }
    }

    /// Slots of the contacts that share a node with `c` (itself among them), ascending and once each.
    pub(super) fn collect_neighbours(&mut self, c: &crate::rows::RowContact) {
        self.neighbours.clear();
        for node in [c.node_a, c.node_b] {
            if node != WORLD {
                let range = self.node_start[node as usize]..self.node_start[node as usize + 1];
                self.neighbours
                    .extend_from_slice(&self.node_contacts[range]);
            }
        }
        self.neighbours.sort_unstable();
        self.neighbours.dedup();
    }
}
