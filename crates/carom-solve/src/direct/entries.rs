//! A square matrix given entry by entry, and a system with it.

use super::dense::{lu_factor, lu_solve};
use super::{DirectError, SparseLu};

/// (row, column, value); equal places add up, in the order of the list. The plan of a sparse factorisation is kept while its pattern stands.
#[derive(Default)]
pub struct Entries {
    pub list: Vec<(u32, u32, f64)>,
    /// Columns and rows of the list that the plan is of, and the place of each among the values.
    keys: Vec<u64>,
    slots: Vec<u32>,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    lu: SparseLu,
    pivots: Vec<u32>,
}

impl Entries {
    /// Solves `A x = rhs`: dense up to `most_dense` unknowns, else sparse.
    pub fn solve(
        &mut self,
        most_dense: usize,
        rhs: &[f64],
        x: &mut Vec<f64>,
    ) -> Result<(), DirectError> {
        let n = rhs.len();
        x.clear();
        x.extend_from_slice(rhs);
        if n > most_dense {
            self.compress(n);
            (self.lu).refactor(n, &self.col_ptr, &self.row_idx, &self.values)?;
            return self.lu.solve(rhs, x).map(|_| ());
        }
        self.values.clear();
        self.values.resize(n * n, 0.0);
        for &(row, col, value) in &self.list {
            self.values[row as usize * n + col as usize] += value;
        }
        self.pivots.resize(n, 0);
        lu_factor(&mut self.values, n, &mut self.pivots)?;
        lu_solve(&self.values, n, &self.pivots, x);
        Ok(())
    }

    /// Compressed columns: their starts, row indices and values.
    pub fn compressed(&mut self, n: usize) -> (&[usize], &[usize], &[f64]) {
        self.compress(n);
        (&self.col_ptr, &self.row_idx, &self.values)
    }

    fn compress(&mut self, n: usize) {
        let key = |&(row, col, _): &(u32, u32, f64)| (u64::from(col) << 32) | u64::from(row);
        if self.col_ptr.len() != n + 1 || !self.list.iter().map(key).eq(self.keys.iter().copied()) {
            self.keys.clear();
            self.keys.extend(self.list.iter().map(key));
            self.plan(n);
        }
        self.values.clear();
        self.values.resize(self.row_idx.len(), 0.0);
        for (&(_, _, value), &slot) in self.list.iter().zip(&self.slots) {
            self.values[slot as usize] += value;
        }
    }

    /// Where each entry of the list goes.
    fn plan(&mut self, n: usize) {
        let mut places = self.keys.clone();
        places.sort_unstable();
        places.dedup();
        let slot = |key: &u64| places.partition_point(|place| place < key) as u32;
        self.slots.clear();
        self.slots.extend(self.keys.iter().map(slot));
        self.col_ptr.clear();
        self.col_ptr.resize(n + 1, 0);
        self.row_idx.clear();
        for place in places {
            self.row_idx.push(place as u32 as usize);
            self.col_ptr[(place >> 32) as usize + 1] += 1;
        }
        for col in 0..n {
            self.col_ptr[col + 1] += self.col_ptr[col];
        }
    }
}
