//! Rows of contacts where joints keep what they do: what joints leave of `M^-1 G^T`.
//!
//! What the velocities before the impact break of them is taken away: by it slips of one body's contacts would contradict one another.
//! With `y = M^-1/2 G^T` of a row, joints leave the part of it that is orthogonal to theirs. Gram and Schmidt's basis needs no factor of a matrix that
//! redundant joints make singular.

use carom_solve::rows::{RowContact, RowSystem};

/// Part (1) of a row below which other joints have all of it. At 0 a joint that is said twice is rounding, and rounding a direction.
const HELD: f64 = 1e-9;

/// What rows of contacts do; without joints as the system says.
pub struct Reduced {
    /// Velocities (6 per node) for a unit impulse; none without joints.
    response: Vec<Vec<f64>>,
    /// Inverse mass.
    pub inverse: Vec<f64>,
    /// Measures before impulses.
    pub free: Vec<f64>,
}

impl Reduced {
    /// Of a system whose first groups are `contacts`, and the others joints.
    pub fn new(system: &RowSystem, contacts: usize) -> Reduced {
        let (contacts, joints) = system.contacts.split_at(contacts);
        let mut found = Reduced {
            response: Vec::new(),
            inverse: system.diag.clone(),
            free: system.z0.clone(),
        };
        if joints.is_empty() {
            return found;
        }
        let root = root_of_inverse_mass(system);
        let mut basis: Vec<(Vec<f64>, f64)> = Vec::new();
        for c in joints {
            for row in c.rows() {
                let (mut y, z) = left(system, c, row, &root, &basis);
                let size = dot(&y, &y).sqrt();
                if size > 0.0 {
                    y.iter_mut().for_each(|y| *y /= size);
                    basis.push((y, z / size));
                }
            }
        }
        for c in contacts {
            for row in c.rows() {
                let (y, z) = left(system, c, row, &root, &basis);
                found.free[row] = z;
                found.inverse[row] = dot(&y, &y);
                found.response.push(y);
            }
        }
        for y in &mut found.response {
            y.iter_mut().zip(&root).for_each(|(y, root)| *y *= root);
        }
        found
    }

    /// Inverse masses of both rows of friction of a contact: of the first, between both, of the second.
    pub fn friction(&self, system: &RowSystem, c: &RowContact) -> [f64; 3] {
        let rows = [c.row as usize + 1, c.row as usize + 2];
        let [Some(x), Some(y)] = rows.map(|row| self.response.get(row)) else {
            return system.inverse_masses(c, rows);
        };
        [(0, x), (0, y), (1, y)].map(|(k, u)| system.row_velocity(c, rows[k], u))
    }

    /// Velocities `u` after an impulse in a row of a contact.
    pub fn push(
        &self,
        system: &RowSystem,
        c: &RowContact,
        row: usize,
        impulse: f64,
        u: &mut [f64],
    ) {
        match self.response.get(row) {
            None => system.push_row(c, row, impulse, u),
            Some(response) => (u.iter_mut().zip(response)).for_each(|(u, r)| *u += r * impulse),
        }
    }
}

/// Diagonal of `M^-1/2`.
fn root_of_inverse_mass(system: &RowSystem) -> Vec<f64> {
    let nodes = system.inv_mass.iter().zip(&system.inv_inertia);
    let of_node =
        |(m, i): (&f64, &f64)| [m.sqrt(), m.sqrt(), m.sqrt(), i.sqrt(), i.sqrt(), i.sqrt()];
    nodes.flat_map(of_node).collect()
}

/// The part of `M^-1/2 G^T` of a row that is orthogonal to a basis, 0 where rounding is all of it, and its measure.
fn left(
    system: &RowSystem,
    c: &RowContact,
    row: usize,
    root: &[f64],
    basis: &[(Vec<f64>, f64)],
) -> (Vec<f64>, f64) {
    let (mut y, mut z) = (vec![0.0; root.len()], system.z0[row]);
    system.push_row(c, row, 1.0, &mut y);
    for (y, root) in y.iter_mut().zip(root) {
        *y = if *root > 0.0 { *y / root } else { 0.0 };
    }
    let whole = dot(&y, &y).sqrt();
    // Twice: the first pass leaves rounding of the whole.
    for (q, of_q) in basis.iter().chain(basis) {
        let part = dot(&y, q);
        y.iter_mut().zip(q).for_each(|(y, q)| *y -= part * q);
        z -= part * of_q;
    }
    if dot(&y, &y).sqrt() <= HELD * whole {
        y.fill(0.0);
    }
    (y, z)
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}
