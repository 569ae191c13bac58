//! Matrices in compressed columns.

use crate::direct::SparseLu;

/// The arrays, and the factorisation whose plan is kept while the pattern stands.
#[derive(Default)]
pub(super) struct SparseParts {
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
}
