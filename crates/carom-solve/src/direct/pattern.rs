//! Where the entries of a sparse matrix are, remembered to know when it changed.

use super::DirectError;
use faer::sparse::SymbolicSparseColMatRef;

/// Pattern of a square matrix in compressed columns, checked once.
#[derive(Clone, Debug, Default)]
pub(super) struct Pattern {
    pub n: usize,
    pub col_ptr: Vec<usize>,
    pub row_idx: Vec<usize>,
}

impl Pattern {
    pub fn is(&self, n: usize, col_ptr: &[usize], row_idx: &[usize]) -> bool {
        self.n == n && self.col_ptr == col_ptr && self.row_idx == row_idx
    }

    pub fn set(
        &mut self,
        n: usize,
        col_ptr: &[usize],
        row_idx: &[usize],
    ) -> Result<(), DirectError> {
        check(n, col_ptr, row_idx).map_err(DirectError::BadPattern)?;
        self.n = n;
        self.col_ptr.clear();
        self.col_ptr.extend_from_slice(col_ptr);
        self.row_idx.clear();
        self.row_idx.extend_from_slice(row_idx);
        Ok(())
    }

    pub fn as_faer(&self) -> SymbolicSparseColMatRef<'_, usize> {
        SymbolicSparseColMatRef::new_checked(self.n, self.n, &self.col_ptr, None, &self.row_idx)
    }

    /// `(column, range of entries)`.
    pub fn columns(&self) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> + '_ {
        self.col_ptr
            .windows(2)
            .enumerate()
            .map(|(j, w)| (j, w[0]..w[1]))
    }
}

fn check(n: usize, col_ptr: &[usize], row_idx: &[usize]) -> Result<(), &'static str> {
    if col_ptr.len() != n + 1 {
        return Err("col_ptr must have n + 1 entries");
    }
    if col_ptr[0] != 0 || col_ptr[n] != row_idx.len() {
        return Err("col_ptr must run from 0 to the number of entries");
    }
    if col_ptr.windows(2).any(|w| w[0] > w[1]) {
        return Err("col_ptr must not descend");
    }
    for w in col_ptr.windows(2) {
        let rows = &row_idx[w[0]..w[1]];
        if rows.windows(2).any(|r| r[0] >= r[1]) {
            return Err("row_idx must ascend within a column");
        }
        if rows.last().is_some_and(|&r| r >= n) {
            return Err("a row index is out of range");
        }
    }
    Ok(())
}
