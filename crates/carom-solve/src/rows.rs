//! A contact problem as rows over nodes: everything a solver may know.

use crate::cone::{Bounds, MAX_ROWS};
use crate::problem::RowGroup;

/// Index of "no node": the fixed world (a plane).
pub const WORLD: u32 = u32::MAX;

/// Degrees of freedom of a node: translation, then rotation (spatial).
pub const NODE_DOF: usize = 6;

/// One contact of a problem.
#[derive(Clone, Copy, Debug)]
pub struct RowContact {
    /// First node (never [`WORLD`]).
    pub node_a: u32,
    /// Second node or [`WORLD`].
    pub node_b: u32,
    /// First row.
    pub row: u32,
    /// Number of rows: `bounds.dim()`, or those of a joint.
    pub dim: u32,
    pub bounds: Bounds,
    /// A joint: its multipliers have no bounds and it is always active.
    pub bilateral: bool,
    /// Least normal multiplier: 0, but in the expansion of Poisson's law.
    pub least: f64,
    /// Leading rows that are forces and lengths; the others are moments and angles.
    pub translational: u32,
    /// Reference length r_c, m: makes rotational rows comparable and gaps relative.
    pub length: f64,
    /// Derivative of the unit normal: `curvature (1 - n n^T - f f^T)` over the relative position, 1/m (eq. 42); 0 at velocity
    /// level.
    pub curvature: f64,
    /// Current unit normal (needed with the curvature only).
    pub normal: [f64; 3],
    /// `f`: at a wall whose principal curvatures differ; else 0.
    pub flat: [f64; 3],
}

impl RowContact {
    #[inline]
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.row as usize..(self.row + self.dim) as usize
    }

    /// Its rows, without nodes.
    #[inline]
    pub fn group(&self) -> RowGroup {
        RowGroup {
            row: self.row as usize,
            dim: self.dim as usize,
            bounds: self.bounds,
            bilateral: self.bilateral,
            least: self.least,
        }
    }

    /// Entries of `-weight (1 - n n^T - f f^T)` over its nodes, with `per_node` degrees of freedom each: how a force along the normal changes as it
    /// turns.
    pub fn turning(&self, weight: f64, per_node: usize, mut add: impl FnMut(usize, usize, f64)) {
        let nodes = [(self.node_a, 1.0), (self.node_b, -1.0)];
        let there = || nodes.iter().filter(|(node, _)| *node != WORLD);
        for (node_r, sign_r) in there() {
            for (node_s, sign_s) in there() {
                for i in 0..3 {
                    for j in 0..3 {
                        let [n, f] = [self.normal, self.flat].map(|v| v[i] * v[j]);
                        let k = f64::from(i == j) - n - f;
                        let at = |node: u32, k: usize| per_node * node as usize + k;
                        let value = -sign_r * sign_s * weight * k;
                        add(at(*node_r, i), at(*node_s, j), value);
                    }
                }
            }
        }
    }

    /// A row over its nodes, on `u`.
    #[inline]
    pub fn along(&self, row: &[[f64; NODE_DOF]; 2], u: &[f64]) -> f64 {
        let mut sum = dot6(&row[0], &u[NODE_DOF * self.node_a as usize..]);
        if self.node_b != WORLD {
            sum += dot6(&row[1], &u[NODE_DOF * self.node_b as usize..]);
        }
        sum
    }
}

/// Nodes, contacts and rows. `M u = G^T lambda + b(u)`, measures `z(u)` (gaps, or relative velocities with restitution).
///
/// The mass is diagonal (free spheres). Joints are row groups without bounds beside the contacts. Loads that depend on the
/// motion bring `b(u)` and its derivative over the nodes (`load`, `load_tangent`).
#[derive(Clone, Debug, Default)]
pub struct RowSystem {
    /// Per node: 1/m, 1/I, length (radius, m).
    pub inv_mass: Vec<f64>,
    pub inv_inertia: Vec<f64>,
    pub node_length: Vec<f64>,
    pub contacts: Vec<RowContact>,
    /// Jacobian of each row over node a and node b (6 each; b unused at the world).
    pub jac: Vec<[[f64; NODE_DOF]; 2]>,
    /// Measure of each row at `u = 0`.
    pub z0: Vec<f64>,
    /// `D_cc`, diagonal of `G M^-1 G^T` per row (nominal, without the turning of the normal).
    pub diag: Vec<f64>,
    /// Change of the impulse of loads `b(u)` at the last evaluation (6 per node); empty: none.
    pub load: Vec<f64>,
    /// `-db/du` as (row, column, value); equal places add up. Empty with `load`.
    pub load_tangent: Vec<(u32, u32, f64)>,
}

/// A sub-problem of a step: measures as functions of the correction `u`.
pub trait Subproblem {
    /// Writes `z(u)`. May refresh the Jacobian rows, normals, curvatures and loads that depend on `u`.
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]);
}

/// Measures that are linear in `u` (velocity level: gradients frozen at the corrected positions), along rows of their own; none: those of the
/// impulses.
pub struct Measured<'a>(pub &'a [[[f64; NODE_DOF]; 2]]);

impl Measured<'_> {
    /// Writes the measures at `u`.
    pub fn write(&self, system: &RowSystem, u: &[f64], z: &mut [f64]) {
        if self.0.is_empty() {
            return system.linear_measures(u, z);
        }
        for c in &system.contacts {
            for row in c.rows() {
                z[row] = system.z0[row] + c.along(&self.0[row], u);
            }
        }
    }
}

impl Subproblem for Measured<'_> {
    #[inline]
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]) {
        self.write(system, u, z);
    }
}

impl RowSystem {
    pub fn clear(&mut self) {
        self.inv_mass.clear();
        self.inv_inertia.clear();
        self.node_length.clear();
        self.contacts.clear();
        self.jac.clear();
        self.z0.clear();
        self.diag.clear();
        self.load.clear();
        self.load_tangent.clear();
    }

    /// Whether loads change with the correction.
    #[inline]
    pub fn has_load(&self) -> bool {
        !self.load.is_empty()
    }

    /// Makes room for loads that change with the correction; call it after the last node.
    pub fn open_load(&mut self) {
        let dofs = NODE_DOF * self.nodes();
        self.load.clear();
        self.load.resize(dofs, 0.0);
        self.load_tangent.clear();
    }

    /// Largest sum of the sizes in a row of `M^-1 db/du` at the last evaluation, angles over lengths of nodes: how much of a change of velocities
    /// loads give back, or take.
    pub fn load_feedback(&self) -> f64 {
        let mut sums = vec![0.0; NODE_DOF * self.nodes()];
        let scale = |dof: usize| match dof % NODE_DOF {
            0..3 => 1.0,
            _ => self.node_length[dof / NODE_DOF],
        };
        for &(row, column, value) in &self.load_tangent {
            let (row, column) = (row as usize, column as usize);
            let inverse = self.inverse(row / NODE_DOF, row % NODE_DOF);
            sums[row] += inverse * value.abs() * scale(row) / scale(column);
        }
        sums.into_iter().fold(0.0, f64::max)
    }

    #[inline]
    pub fn nodes(&self) -> usize {
        self.inv_mass.len()
    }

    #[inline]
    pub fn rows(&self) -> usize {
        self.jac.len()
    }

    /// 1/m or 1/I, as degree of freedom `k` of a node has it.
    #[inline]
    pub fn inverse(&self, node: usize, k: usize) -> f64 {
        let of = if k < 3 {
            &self.inv_mass
        } else {
            &self.inv_inertia
        };
        of[node]
    }

    /// Adds a node; returns its index.
    pub fn push_node(&mut self, mass: f64, inertia: f64, length: f64) -> u32 {
        let index = self.inv_mass.len() as u32;
        self.inv_mass.push(1.0 / mass);
        self.inv_inertia.push(1.0 / inertia);
        self.node_length.push(length);
        index
    }

    /// Adds what an impulse in a row gives the velocities `u` of its nodes.
    #[inline]
    pub fn push_row(&self, c: &RowContact, row: usize, impulse: f64, u: &mut [f64]) {
        for (side, node) in [(0, c.node_a), (1, c.node_b)] {
            if node == WORLD {
                continue;
            }
            let u = &mut u[NODE_DOF * node as usize..][..NODE_DOF];
            for (k, u) in u.iter_mut().enumerate() {
                *u += self.inverse(node as usize, k) * self.jac[row][side][k] * impulse;
            }
        }
    }

    /// Adds a contact with its rows (`jac[row] = [over a, over b]`, `z0[row]`), computing `D_cc`.
    #[allow(clippy::too_many_arguments)] // one call site; a struct would only repeat the names
    pub fn push_contact(
        &mut self,
        node_a: u32,
        node_b: u32,
        bounds: Bounds,
        length: f64,
        normal: [f64; 3],
        jac: &[[[f64; NODE_DOF]; 2]],
        z0: &[f64],
    ) {
        debug_assert_eq!(jac.len(), bounds.dim());
        let group = RowContact {
            bounds,
            translational: if bounds.sliding > 0.0 { 3 } else { 1 },
            normal,
            ..self.next_group([node_a, node_b], jac.len(), length)
        };
        self.push_rows(group, jac, z0);
    }

    /// Adds a joint: rows without bounds, the first `translational` of them forces.
    pub fn push_joint(
        &mut self,
        (node_a, node_b): (u32, u32),
        translational: usize,
        length: f64,
        jac: &[[[f64; NODE_DOF]; 2]],
        z0: &[f64],
    ) {
        debug_assert!(jac.len() <= MAX_ROWS);
        let group = RowContact {
            bilateral: true,
            translational: translational as u32,
            ..self.next_group([node_a, node_b], jac.len(), length)
        };
        self.push_rows(group, jac, z0);
    }

    /// Rows behind all others, of a frictionless contact.
    fn next_group(&self, [node_a, node_b]: [u32; 2], dim: usize, length: f64) -> RowContact {
        RowContact {
            node_a,
            node_b,
            row: self.jac.len() as u32,
            dim: dim as u32,
            bounds: Bounds::default(),
            bilateral: false,
            least: 0.0,
            translational: 1,
            length,
            curvature: 0.0,
            normal: [0.0; 3],
            flat: [0.0; 3],
        }
    }

    fn push_rows(&mut self, group: RowContact, jac: &[[[f64; NODE_DOF]; 2]], z0: &[f64]) {
        let (node_a, node_b) = (group.node_a, group.node_b);
        self.contacts.push(group);
        for (j, z) in jac.iter().zip(z0) {
            let mut d = self.weighted_dot(node_a, &j[0], &j[0]);
            if node_b != WORLD {
                d += self.weighted_dot(node_b, &j[1], &j[1]);
            }
            self.jac.push(*j);
            self.z0.push(*z);
            self.diag.push(d);
        }
    }

    /// `x . M^-1 y` on one node.
    #[inline]
    pub fn weighted_dot(&self, node: u32, x: &[f64; NODE_DOF], y: &[f64; NODE_DOF]) -> f64 {
        let (im, ii) = (
            self.inv_mass[node as usize],
            self.inv_inertia[node as usize],
        );
        im * (x[0] * y[0] + x[1] * y[1] + x[2] * y[2])
            + ii * (x[3] * y[3] + x[4] * y[4] + x[5] * y[5])
    }

    /// `G u` of one row.
    #[inline]
    pub fn row_velocity(&self, contact: &RowContact, row: usize, u: &[f64]) -> f64 {
        contact.along(&self.jac[row], u)
    }

    /// `z - G (u - M^-1 b)` for all rows: measures without multipliers, with the loads of the last evaluation.
    pub fn free(&self, z: &[f64], u: &[f64]) -> Vec<f64> {
        self.shifted(z, u, -1.0)
    }

    /// `z + G (u - M^-1 b)` for all rows: measures by multipliers, from those without.
    pub fn with_multipliers(&self, free: &[f64], u: &[f64]) -> Vec<f64> {
        self.shifted(free, u, 1.0)
    }

    fn shifted(&self, z: &[f64], u: &[f64], sign: f64) -> Vec<f64> {
        let mut own = u.to_vec();
        if self.has_load() {
            let mut by_load = vec![0.0; u.len()];
            self.apply_inverse_mass(&self.load, &mut by_load);
            own.iter_mut().zip(&by_load).for_each(|(u, b)| *u -= b);
        }
        let mut shifted = z.to_vec();
        for c in &self.contacts {
            for row in c.rows() {
                shifted[row] += sign * self.row_velocity(c, row, &own);
            }
        }
        shifted
    }

    /// `z = z0 + G u` for all rows.
    pub fn linear_measures(&self, u: &[f64], z: &mut [f64]) {
        for c in &self.contacts {
            for row in c.rows() {
                z[row] = self.z0[row] + self.row_velocity(c, row, u);
            }
        }
    }

    /// `f += G^T lambda` over the rows of one contact.
    #[inline]
    pub fn add_impulse(&self, c: &RowContact, lambda: &[f64], f: &mut [f64]) {
        for row in c.rows() {
            let l = lambda[row];
            if l == 0.0 {
                continue;
            }
            axpy6(l, &self.jac[row][0], &mut f[NODE_DOF * c.node_a as usize..]);
            if c.node_b != WORLD {
                axpy6(l, &self.jac[row][1], &mut f[NODE_DOF * c.node_b as usize..]);
            }
        }
    }

    /// Inverse masses of two rows of a contact: of the first, between both, of the second.
    pub fn inverse_masses(&self, c: &RowContact, [i, j]: [usize; 2]) -> [f64; 3] {
        let of = |r: usize, s: usize| {
            let side = |k: usize, node: u32| {
                let (a, b) = (&self.jac[r][k], &self.jac[s][k]);
                let part =
                    |range: std::ops::Range<usize>| -> f64 { range.map(|d| a[d] * b[d]).sum() };
                let n = node as usize;
                self.inv_mass[n] * part(0..3) + self.inv_inertia[n] * part(3..6)
            };
            let of_b = (c.node_b != WORLD).then(|| side(1, c.node_b));
            side(0, c.node_a) + of_b.unwrap_or(0.0)
        };
        [of(i, i), of(i, j), of(j, j)]
    }

    /// `f = G^T lambda`.
    pub fn impulses(&self, lambda: &[f64], f: &mut [f64]) {
        f.fill(0.0);
        for c in &self.contacts {
            self.add_impulse(c, lambda, f);
        }
    }

    /// `f = G^T lambda + b`: what `M u` has to equal.
    pub fn momentum(&self, lambda: &[f64], f: &mut [f64]) {
        self.impulses(lambda, f);
        for (f, b) in f.iter_mut().zip(&self.load) {
            *f += b;
        }
    }

    /// `u = M^-1 f`.
    pub fn apply_inverse_mass(&self, f: &[f64], u: &mut [f64]) {
        for node in 0..self.nodes() {
            let (im, ii) = (self.inv_mass[node], self.inv_inertia[node]);
            for k in 0..3 {
                u[NODE_DOF * node + k] = im * f[NODE_DOF * node + k];
                u[NODE_DOF * node + 3 + k] = ii * f[NODE_DOF * node + 3 + k];
            }
        }
    }

    /// `u = M^-1 (G^T lambda + b)`, with the loads of the last evaluation.
    pub fn correction(&self, lambda: &[f64], u: &mut [f64]) {
        let mut force = vec![0.0; u.len()];
        self.momentum(lambda, &mut force);
        self.apply_inverse_mass(&force, u);
    }

    /// Delassus block `G_i M^-1 G_j^T` over the nodes that contacts `i` and `j` share, added to `block`.
    pub fn delassus_block(
        &self,
        i: &RowContact,
        j: &RowContact,
        block: &mut [[f64; MAX_ROWS]; MAX_ROWS],
    ) {
        for (side_i, node_i) in [(0, i.node_a), (1, i.node_b)] {
            for (side_j, node_j) in [(0, j.node_a), (1, j.node_b)] {
                if node_i == WORLD || node_i != node_j {
                    continue;
                }
                for (r, out) in block.iter_mut().enumerate().take(i.dim as usize) {
                    let ji = &self.jac[i.row as usize + r][side_i];
                    for (s, value) in out.iter_mut().enumerate().take(j.dim as usize) {
                        *value +=
                            self.weighted_dot(node_i, ji, &self.jac[j.row as usize + s][side_j]);
                    }
                }
            }
        }
    }
}

#[inline]
fn dot6(x: &[f64; NODE_DOF], y: &[f64]) -> f64 {
    let y = &y[..NODE_DOF];
    x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3] + x[4] * y[4] + x[5] * y[5]
}

#[inline]
fn axpy6(a: f64, x: &[f64; NODE_DOF], y: &mut [f64]) {
    for (yi, xi) in y[..NODE_DOF].iter_mut().zip(x) {
        *yi += a * xi;
    }
}
