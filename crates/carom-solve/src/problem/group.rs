//! The rows of one contact.

use crate::cone::Bounds;

/// One contact, or joint, of a [`super::Problem`].
#[derive(Clone, Copy, Debug, Default)]
pub struct RowGroup {
    /// First row.
    pub row: usize,
    /// Rows: those of [`Bounds::dim`], or of a joint.
    pub dim: usize,
    /// All bounds that have rows are positive: rows whose bound is 0 take no force and are left out.
    pub bounds: Bounds,
    /// A joint: its multipliers have no bounds.
    pub bilateral: bool,
    /// Least normal multiplier, above 0 in the expansion by Poisson's law: Newton's method and alternating directions know it.
    pub least: f64,
}

impl RowGroup {
    #[inline]
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.row..self.row + self.dim
    }
}
