//! The linear system of one Newton iteration, reduced to the rows of the active contacts.
//!
//! With `Mt = M - sum phi_N K` (K: derivative of the normal rows, position level only), `W = G Mt^-1 G^T` over active
//! rows and `C` the cone tangent, the increments satisfy
//!
//! `[1 - C + C p W] dl = phi - l - C p G du0`,  `du = du0 + Mt^-1 G^T dl`,  `du0 = Mt^-1 (G^T l - M u)`.
//!
//! Inactive rows (`xi_N < 0`) have `dl = -l` and leave the matrix. A proximal shift on the diagonal keeps redundant
//! contacts factorable; it scales with the residual, so it changes the path and not the limit.

mod iterate;
mod mass;

use crate::cone::{Block, Status, MAX_ROWS};
use crate::direct::dense::{lu_factor, lu_solve};
use crate::direct::{DirectError, Entries};
use crate::rows::{RowSystem, NODE_DOF, WORLD};
pub use iterate::Iterate;
use mass::{curvature, is_curved, Mass, MassKind};

/// Ratio (1) of the pivots below which rows count as dependent. With 0 dependent rows get multipliers of 1/rounding; large,
/// stiff but sound rows are solved with a shift, in more iterations.
const PIVOT_RATIO: f64 = 1e-9;

/// Buffers of the reduced system.
#[derive(Default)]
pub struct LinearStep {
    /// Active contacts, and the first reduced row of each.
    active: Vec<(usize, usize)>,
    matrix: Vec<f64>,
    pivots: Vec<u32>,
    rhs: Vec<f64>,
    solution: Vec<f64>,
    du0: Vec<f64>,
    /// Factor of `Mt`, and `Mt^-1 G^T` per active row.
    mass: Mass,
    compliance: Vec<f64>,
    /// The matrix of large islands.
    sparse: Entries,
}

impl LinearStep {
    /// Solves for `(d_lambda, d_u)`. `shift` is relative to the diagonal of the multiplier block; `near` the solution
    /// a dense system goes without it if its rows are independent.
    #[allow(clippy::too_many_arguments)]
    pub fn solve(
        &mut self,
        system: &RowSystem,
        at: &Iterate,
        shift: f64,
        near: bool,
        dense: bool,
        d_lambda: &mut [f64],
        d_u: &mut [f64],
    ) -> Result<(), DirectError> {
        self.active.clear();
        let mut rows = 0;
        for (index, status) in at.statuses.iter().enumerate() {
            if *status != Status::Gap {
                self.active.push((index, rows));
                rows += system.contacts[index].dim as usize;
            }
        }
        self.mass.kind = MassKind::Diagonal;
        if !dense && system.has_load() {
            return self.solve_loaded(system, at, shift, d_lambda, d_u);
        }
        if dense {
            self.mass.factor(system, at);
        }
        self.free_step(system, at);
        self.assemble_rhs(system, at, rows);
        if dense {
            self.pivots.resize(rows, 0);
            // Near the solution independent rows need no shift, and without it the last iterations are exact ones.
            let tried = if near { 0.0 } else { shift };
            self.assemble_dense(system, at, rows, tried);
            if lu_factor(&mut self.matrix, rows, &mut self.pivots).is_err()
                || (near && self.nearly_singular(rows))
            {
                self.assemble_dense(system, at, rows, shift);
                lu_factor(&mut self.matrix, rows, &mut self.pivots)?;
            }
            self.solution.clear();
            self.solution.extend_from_slice(&self.rhs);
            lu_solve(&self.matrix, rows, &self.pivots, &mut self.solution);
        } else {
            self.assemble_sparse(system, at, shift);
            self.sparse.solve(0, &self.rhs, &mut self.solution)?;
        }
        self.expand(system, at, d_lambda, d_u);
        Ok(())
    }

    /// Large islands with loads: `Mt^-1` would be full, so the increments of the nodes stay in the matrix beside those of
    /// the active rows,
    ///
    /// `[Mt, -G^T; C p G, 1 - C + shift] [du; dl] = [G^T l + b - M u; phi - l]`.
    fn solve_loaded(
        &mut self,
        system: &RowSystem,
        at: &Iterate,
        shift: f64,
        d_lambda: &mut [f64],
        d_u: &mut [f64],
    ) -> Result<(), DirectError> {
        let dofs = NODE_DOF * system.nodes();
        self.free_force(system, at);
        self.rhs.clear();
        self.rhs.extend_from_slice(&self.du0);
        let entries = &mut self.sparse.list;
        entries.clear();
        entries.extend_from_slice(&system.load_tangent);
        mass_entries(system, entries);
        for c in system.contacts.iter().filter(|c| is_curved(c, at)) {
            curvature(c, at, NODE_DOF, |row, col, value| {
                entries.push((row as u32, col as u32, value));
            });
        }
        for &(index, first) in &self.active {
            let c = &system.contacts[index];
            let none = [[0.0; MAX_ROWS]; MAX_ROWS];
            let corner = Self::newton_block(system, at, index, true, &none, shift);
            for r in 0..c.dim as usize {
                let (row, own) = (c.row as usize + r, (dofs + first + r) as u32);
                self.rhs.push(at.phi[row] - at.lambda[row]);
                for (k, &value) in corner[r].iter().enumerate().take(c.dim as usize) {
                    entries.push((own, (dofs + first + k) as u32, value));
                }
                for (side, node) in [(0, c.node_a), (1, c.node_b)] {
                    if node == WORLD {
                        continue;
                    }
                    for j in 0..NODE_DOF {
                        let dof = NODE_DOF as u32 * node + j as u32;
                        entries.push((dof, own, -system.jac[row][side][j]));
                        let value: f64 = (0..c.dim as usize)
                            .map(|k| {
                                let other = c.row as usize + k;
                                let jac = system.jac[other][side][j];
                                at.tangents[index][r][k] * at.penalty[other] * jac
                            })
                            .sum();
                        entries.push((own, dof, value));
                    }
                }
            }
        }
        self.sparse.solve(0, &self.rhs, &mut self.solution)?;
        d_u.copy_from_slice(&self.solution[..dofs]);
        self.expand_multipliers(system, at, dofs, d_lambda);
        Ok(())
    }

    /// `du0 = Mt^-1 (G_act^T l_act + b - M u)`; multipliers of inactive rows count as already gone.
    fn free_step(&mut self, system: &RowSystem, at: &Iterate) {
        self.free_force(system, at);
        self.mass.apply_inverse(system, &mut self.du0);
    }

    /// `G_act^T l_act + b - M u`.
    fn free_force(&mut self, system: &RowSystem, at: &Iterate) {
        self.du0.clear();
        self.du0.resize(NODE_DOF * system.nodes(), 0.0);
        for (node, u) in at.u.chunks_exact(NODE_DOF).enumerate() {
            for k in 0..NODE_DOF {
                self.du0[NODE_DOF * node + k] = -u[k] / system.inverse(node, k);
            }
        }
        for (f, b) in self.du0.iter_mut().zip(&system.load) {
            *f += b;
        }
        for &(index, _) in &self.active {
            system.add_impulse(&system.contacts[index], at.lambda, &mut self.du0);
        }
    }

    /// `rhs = phi - l - C p G du0` on active rows.
    fn assemble_rhs(&mut self, system: &RowSystem, at: &Iterate, rows: usize) {
        self.rhs.clear();
        self.rhs.resize(rows, 0.0);
        for &(index, first) in &self.active {
            let c = &system.contacts[index];
            let dim = c.dim as usize;
            let mut pz = [0.0; MAX_ROWS];
            for (r, value) in pz.iter_mut().enumerate().take(dim) {
                let row = c.row as usize + r;
                *value = at.penalty[row] * system.row_velocity(c, row, &self.du0);
            }
            for r in 0..dim {
                let row = c.row as usize + r;
                let mut value = at.phi[row] - at.lambda[row];
                for (k, x) in pz.iter().enumerate().take(dim) {
                    value -= at.tangents[index][r][k] * x;
                }
                self.rhs[first + r] = value;
            }
        }
    }

    /// One block `[1 - C + C p W + shift]` of the reduced matrix, from the Delassus block `w` of contacts i, j.
    fn newton_block(
        system: &RowSystem,
        at: &Iterate,
        i: usize,
        same: bool,
        w: &Block,
        shift: f64,
    ) -> Block {
        let c = &system.contacts[i];
        let dim = c.dim as usize;
        let tangent = &at.tangents[i];
        let mut out = [[0.0; MAX_ROWS]; MAX_ROWS];
        for r in 0..dim {
            for k in 0..dim {
                let factor = tangent[r][k] * at.penalty[c.row as usize + k];
                if factor != 0.0 {
                    for s in 0..MAX_ROWS {
                        out[r][s] += factor * w[k][s];
                    }
                    if at.softness > 0.0 && same && !c.bilateral {
                        out[r][k] += factor * at.softness * system.diag[c.row as usize + k];
                    }
                }
            }
            if same {
                for k in 0..dim {
                    out[r][k] -= tangent[r][k];
                }
                let row = c.row as usize + r;
                out[r][r] += 1.0 + shift * at.penalty[row] * system.diag[row];
            }
        }
        out
    }

    fn assemble_dense(&mut self, system: &RowSystem, at: &Iterate, rows: usize, shift: f64) {
        let full = self.mass.kind != MassKind::Diagonal;
        self.matrix.clear();
        self.matrix.resize(rows * rows, 0.0);
        if full {
            self.compute_compliance(system, rows);
        }
        for &(j, first_j) in &self.active {
            let cj = &system.contacts[j];
            for &(i, first_i) in &self.active {
                let ci = &system.contacts[i];
                let mut w = [[0.0; MAX_ROWS]; MAX_ROWS];
                if full {
                    let dofs = NODE_DOF * system.nodes();
                    for (s, col) in (first_j..first_j + cj.dim as usize).enumerate() {
                        let y = &self.compliance[col * dofs..(col + 1) * dofs];
                        for (r, out) in w.iter_mut().enumerate().take(ci.dim as usize) {
                            out[s] = system.row_velocity(ci, ci.row as usize + r, y);
                        }
                    }
                } else {
                    system.delassus_block(ci, cj, &mut w);
                }
                let block = Self::newton_block(system, at, i, i == j, &w, shift);
                for (r, values) in block.iter().enumerate().take(ci.dim as usize) {
                    let start = (first_i + r) * rows + first_j;
                    self.matrix[start..start + cj.dim as usize]
                        .copy_from_slice(&values[..cj.dim as usize]);
                }
            }
        }
    }

    /// Whether the factored dense matrix has a pivot that is small beside the largest: dependent rows leave rounding.
    fn nearly_singular(&self, rows: usize) -> bool {
        // The factor holds reciprocals of its pivots.
        let reciprocals = (0..rows).map(|k| self.matrix[k * (rows + 1)].abs());
        let (least, most) =
            reciprocals.fold((f64::INFINITY, 0.0f64), |(l, m), x| (l.min(x), m.max(x)));
        least < PIVOT_RATIO * most
    }

    /// `Mt^-1 G^T` column by column of the active rows.
    fn compute_compliance(&mut self, system: &RowSystem, rows: usize) {
        let dofs = NODE_DOF * system.nodes();
        self.compliance.clear();
        self.compliance.resize(rows * dofs, 0.0);
        for &(index, first) in &self.active {
            let c = &system.contacts[index];
            for r in 0..c.dim as usize {
                let y = &mut self.compliance[(first + r) * dofs..(first + r + 1) * dofs];
                let jac = &system.jac[c.row as usize + r];
                y[NODE_DOF * c.node_a as usize..][..NODE_DOF].copy_from_slice(&jac[0]);
                if c.node_b != WORLD {
                    y[NODE_DOF * c.node_b as usize..][..NODE_DOF].copy_from_slice(&jac[1]);
                }
                self.mass.apply_inverse(system, y);
            }
        }
    }

    /// Blocks of contacts that share a node.
    fn assemble_sparse(&mut self, system: &RowSystem, at: &Iterate, shift: f64) {
        let (ptr, near) = system.neighbours();
        let mut first = vec![None; system.contacts.len()];
        for &(index, row) in &self.active {
            first[index] = Some(row);
        }
        let entries = &mut self.sparse.list;
        entries.clear();
        for &(j, first_j) in &self.active {
            let cj = &system.contacts[j];
            for &i in &near[ptr[j]..ptr[j + 1]] {
                let (i, ci) = (i as usize, &system.contacts[i as usize]);
                let Some(first_i) = first[i] else {
                    continue;
                };
                let mut w = Block::default();
                system.delassus_block(ci, cj, &mut w);
                let block = Self::newton_block(system, at, i, i == j, &w, shift);
                for (r, values) in block.iter().enumerate().take(ci.dim as usize) {
                    for (c, &value) in values.iter().enumerate().take(cj.dim as usize) {
                        let at = ((first_i + r) as u32, (first_j + c) as u32);
                        entries.push((at.0, at.1, value));
                    }
                }
            }
        }
    }

    /// Full increments from the reduced ones.
    fn expand(&mut self, system: &RowSystem, at: &Iterate, d_lambda: &mut [f64], d_u: &mut [f64]) {
        self.expand_multipliers(system, at, 0, d_lambda);
        d_u.fill(0.0);
        for &(index, _) in &self.active {
            system.add_impulse(&system.contacts[index], d_lambda, d_u);
        }
        self.mass.apply_inverse(system, d_u);
        for (d, free) in d_u.iter_mut().zip(&self.du0) {
            *d += free;
        }
    }

    /// Those of the multipliers, which begin in the solution at `offset`; inactive ones go.
    fn expand_multipliers(
        &self,
        system: &RowSystem,
        at: &Iterate,
        offset: usize,
        d_lambda: &mut [f64],
    ) {
        for (d, l) in d_lambda.iter_mut().zip(at.lambda) {
            *d = -l;
        }
        for &(index, first) in &self.active {
            let rows = system.contacts[index].rows();
            let dim = rows.len();
            d_lambda[rows].copy_from_slice(&self.solution[offset + first..][..dim]);
        }
    }
}

/// The diagonal `M`.
fn mass_entries(system: &RowSystem, out: &mut Vec<(u32, u32, f64)>) {
    for node in 0..system.nodes() {
        for k in 0..NODE_DOF {
            let at = (NODE_DOF * node + k) as u32;
            out.push((at, at, 1.0 / system.inverse(node, k)));
        }
    }
}
