//! The matrix of the nodes: `Mt = M - sum phi_N K - db/du`, dense.

use super::iterate::Iterate;
use crate::direct::dense::{chol_factor, chol_solve, lu_factor, lu_solve};
use crate::rows::{RowContact, RowSystem, NODE_DOF};

/// Factor of `Mt = M - sum phi_N K - db/du`.
#[derive(Default)]
pub(super) struct Mass {
    pub(super) kind: MassKind,
    pub(super) matrix: Vec<f64>,
    pub(super) pivots: Vec<u32>,
    pub(super) scratch: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum MassKind {
    /// `M` itself.
    #[default]
    Diagonal,
    /// Curved contacts: Cholesky of the translational block (3 per node).
    Curved,
    /// Loads that depend on the motion: LU over all degrees of freedom.
    Loaded,
}

/// Whether the turning of a contact's normal matters.
pub(super) fn is_curved(c: &RowContact, at: &Iterate) -> bool {
    c.curvature != 0.0 && at.phi[c.row as usize] > 0.0
}

/// Entries of `-phi_N K` of a contact, with `per_node` degrees of freedom per node.
pub(super) fn curvature(
    c: &RowContact,
    at: &Iterate,
    per_node: usize,
    add: impl FnMut(usize, usize, f64),
) {
    c.turning(at.phi[c.row as usize] * c.curvature, per_node, add);
}

impl Mass {
    /// Factors `Mt` where it differs from `M`. Where it cannot be factored `M` is taken: a quasi-Newton step.
    pub(super) fn factor(&mut self, system: &RowSystem, at: &Iterate) {
        let curved = system.contacts.iter().any(|c| is_curved(c, at));
        // Entries per node: translation only, unless loads turn spheres too.
        let (per_node, kind) = if system.has_load() {
            (NODE_DOF, MassKind::Loaded)
        } else if curved {
            (3, MassKind::Curved)
        } else {
            return;
        };
        let n = per_node * system.nodes();
        self.matrix.clear();
        self.matrix.resize(n * n, 0.0);
        if kind == MassKind::Loaded {
            for &(row, col, value) in &system.load_tangent {
                self.matrix[row as usize * n + col as usize] += value;
            }
        }
        for node in 0..system.nodes() {
            for k in 0..per_node {
                self.matrix[(per_node * node + k) * (n + 1)] += 1.0 / system.inverse(node, k);
            }
        }
        for c in system.contacts.iter().filter(|c| is_curved(c, at)) {
            curvature(c, at, per_node, |row, col, value| {
                self.matrix[row * n + col] += value;
            });
        }
        // Not positive definite: penetration of the order of a radius.
        let factored = if kind == MassKind::Curved {
            chol_factor(&mut self.matrix, n).is_ok()
        } else {
            self.pivots.resize(n, 0);
            lu_factor(&mut self.matrix, n, &mut self.pivots).is_ok()
        };
        self.kind = if factored { kind } else { MassKind::Diagonal };
    }

    /// `x = Mt^-1 f` in place.
    pub(super) fn apply_inverse(&mut self, system: &RowSystem, f: &mut [f64]) {
        let nodes = system.nodes();
        match self.kind {
            MassKind::Loaded => lu_solve(&self.matrix, NODE_DOF * nodes, &self.pivots, f),
            MassKind::Curved => {
                self.scratch.clear();
                for node in 0..nodes {
                    self.scratch
                        .extend_from_slice(&f[NODE_DOF * node..NODE_DOF * node + 3]);
                }
                chol_solve(&self.matrix, 3 * nodes, &mut self.scratch);
                for node in 0..nodes {
                    for k in 0..3 {
                        f[NODE_DOF * node + k] = self.scratch[3 * node + k];
                        f[NODE_DOF * node + 3 + k] *= system.inv_inertia[node];
                    }
                }
            }
            MassKind::Diagonal => {
                for node in 0..nodes {
                    for k in 0..NODE_DOF {
                        f[NODE_DOF * node + k] *= system.inverse(node, k);
                    }
                }
            }
        }
    }
}
