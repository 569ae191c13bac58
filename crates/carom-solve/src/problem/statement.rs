//! The problem itself.

use super::blocks::BlockMatrix;
use super::group::RowGroup;

/// `u = W r + q` over groups of rows.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    pub groups: Vec<RowGroup>,
    pub w: BlockMatrix,
    pub q: Vec<f64>,
}

impl Problem {
    #[inline]
    pub fn rows(&self) -> usize {
        self.q.len()
    }

    /// Whether a normal multiplier has a least above 0.
    pub fn is_held(&self) -> bool {
        self.groups.iter().any(|group| group.least > 0.0)
    }

    /// `u = W r + q`.
    pub fn velocity(&self, r: &[f64], u: &mut [f64]) {
        u.copy_from_slice(&self.q);
        self.w.add_product(r, u);
    }
}
