//! What rows over bodies give one another, `G M^-1 G^T`, as of joints.

use super::{DirectError, Entries, SparseLlt};

/// What is added to the diagonal (1, a share of it): rows that repeat one another stay solvable. Less is lost in the rounding of the factors; more, and
/// what nearly repeats another row takes more rounds.
const SHIFT: f64 = 1e-12;

/// A body, and the rows that act on it.
#[derive(Clone, Debug)]
pub struct Touched {
    /// Inverse mass, kg^-1, three times, and inverse moment of inertia, kg^-1 m^-2.
    pub inverse: [f64; 6],
    /// Numbers of the rows, ascending, each with its part over velocity and angular velocity.
    pub rows: Vec<(usize, [f64; 6])>,
}

/// The matrix, shifted and factored.
#[derive(Default)]
pub struct Gram {
    entries: Entries,
    llt: SparseLlt,
}

impl Gram {
    /// Of `n` rows.
    pub fn factor<'a>(
        &mut self,
        n: usize,
        bodies: impl IntoIterator<Item = &'a Touched>,
    ) -> Result<(), DirectError> {
        self.entries.list.clear();
        for body in bodies {
            for (k, (row, g)) in body.rows.iter().enumerate() {
                for (col, h) in &body.rows[..=k] {
                    let value: f64 = (0..6).map(|c| body.inverse[c] * g[c] * h[c]).sum();
                    let shift = if row == col { 1.0 + SHIFT } else { 1.0 };
                    let entry = (*row as u32, *col as u32, shift * value);
                    self.entries.list.push(entry);
                }
            }
        }
        let (col_ptr, row_idx, values) = self.entries.compressed(n);
        self.llt.refactor(n, col_ptr, row_idx, values)
    }

    /// Multipliers `out` that give the rows the measures `rhs`.
    pub fn solve(&mut self, rhs: &[f64], out: &mut [f64]) -> Result<(), DirectError> {
        self.llt.solve(rhs, out).map(|_| ())
    }
}
