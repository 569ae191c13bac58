//! A contact problem in local form, as data: `u = W r + q`, bodies eliminated, one group of rows for each contact.
//!
//! Find `r` with `K* contains u + s(u) n, perpendicular to r in K` for every contact, `s(u) = sum_b mu_b |u_b|`
//! (docs/reference/problems.md). `W` may be singular, unsymmetric by little, and its blocks of any form: contacts of
//! bodies that are no spheres.

mod blocks;
mod build;
pub mod natural;
mod scaled;

pub use blocks::BlockMatrix;
pub use build::{ProblemError, RowMap};
pub use scaled::Scaled;

use crate::cone::Bounds;

/// One contact, or joint, of a [`Problem`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Group {
    /// First row.
    pub row: usize,
    /// Rows: those of [`Bounds::dim`], or of a joint.
    pub dim: usize,
    /// All bounds that have rows are positive: rows whose bound is 0 take no force and are left out.
    pub bounds: Bounds,
    /// A joint: its multipliers have no bounds.
    pub bilateral: bool,
}

impl Group {
    #[inline]
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.row..self.row + self.dim
    }
}

/// `u = W r + q` over groups of rows.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    pub groups: Vec<Group>,
    pub w: BlockMatrix,
    pub q: Vec<f64>,
}

impl Problem {
    #[inline]
    pub fn rows(&self) -> usize {
        self.q.len()
    }

    /// `u = W r + q`.
    pub fn velocity(&self, r: &[f64], u: &mut [f64]) {
        u.copy_from_slice(&self.q);
        self.w.add_product(r, u);
    }
}
