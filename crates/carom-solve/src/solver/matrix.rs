//! The matrices of Newton's method and of path following: the pattern of W, dense when small.

use crate::cone::Block;
use crate::direct::{dense, SparseLu};
use crate::problem::{Group, Problem};

/// Systems up to this many rows are dense.
const DENSE_ROWS: usize = 96;

/// The Newton matrix: dense when small, else compressed columns whose pattern is that of W.
#[derive(Default)]
pub(super) struct Linear {
    n: usize,
    lu: SparseLu,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    /// Place in `values` of each value of W, in the order of W's blocks.
    place: Vec<usize>,
    /// Place of each row's diagonal.
    diagonal: Vec<usize>,
    pivots: Vec<u32>,
}

impl Linear {
    pub fn is_dense(&self) -> bool {
        self.n <= DENSE_ROWS
    }

    pub fn plan(&mut self, problem: &Problem) {
        let (n, w) = (problem.rows(), &problem.w);
        self.n = n;
        self.place.clear();
        self.place.resize(w.values.len(), 0);
        self.diagonal.clear();
        self.diagonal.resize(n, 0);
        self.pivots.resize(n, 0);
        if self.is_dense() {
            self.values.resize(n * n, 0.0);
        } else {
            self.col_ptr.clear();
            self.col_ptr.resize(n + 1, 0);
            self.each(problem, |_, col, _, this| this.col_ptr[col + 1] += 1);
            for c in 0..n {
                self.col_ptr[c + 1] += self.col_ptr[c];
            }
            self.row_idx.resize(self.col_ptr[n], 0);
            self.values.resize(self.col_ptr[n], 0.0);
        }
        let mut fill = self.col_ptr.clone();
        self.each(problem, |row, col, value, this| {
            let place = if this.is_dense() {
                row * n + col
            } else {
                let at = fill[col];
                fill[col] += 1;
                this.row_idx[at] = row;
                at
            };
            this.place[value] = place;
            if row == col {
                this.diagonal[row] = place;
            }
        });
    }

    /// Row, column and index of every value of W, rows ascending within each column.
    fn each(&mut self, problem: &Problem, mut f: impl FnMut(usize, usize, usize, &mut Linear)) {
        let w = &problem.w;
        for i in 0..w.len() {
            let (row, dim) = w.shape(i);
            for r in 0..dim {
                for k in w.ptr[i]..w.ptr[i + 1] {
                    let (col, width) = w.shape(w.col[k] as usize);
                    for c in 0..width {
                        f(row + r, col + c, w.start[k] + r * width + c, self);
                    }
                }
            }
        }
    }

    pub fn assemble(&mut self, problem: &Problem, tangents: &[Block], penalty: &[f64], shift: f64) {
        let w = &problem.w;
        if self.is_dense() {
            self.values.fill(0.0);
        }
        for (i, group) in problem.groups.iter().enumerate() {
            let (row, dim) = (group.row, group.dim);
            let d = &tangents[i];
            for k in w.ptr[i]..w.ptr[i + 1] {
                let width = w.shape(w.col[k] as usize).1;
                let block = w.block(i, k);
                let place = &self.place[w.start[k]..w.start[k] + dim * width];
                for r in 0..dim {
                    for c in 0..width {
                        let mut sum = 0.0;
                        for m in 0..dim {
                            sum += d[r][m] * penalty[row + m] * block[m * width + c];
                        }
                        self.values[place[r * width + c]] = sum;
                    }
                }
            }
            self.add_diagonal(group, d, penalty, shift, problem, i);
        }
    }

    /// W itself.
    pub fn copy(&mut self, problem: &Problem) {
        if self.is_dense() {
            self.values.fill(0.0);
        }
        for (value, &place) in problem.w.values.iter().zip(&self.place) {
            self.values[place] = *value;
        }
    }

    /// Adds to entry (r, c) of the diagonal block of contact `i`.
    pub fn add(&mut self, problem: &Problem, i: usize, r: usize, c: usize, value: f64) {
        let start = problem.w.start[problem.w.diagonal[i]];
        self.values[self.place[start + r * problem.groups[i].dim + c]] += value;
    }

    fn add_diagonal(
        &mut self,
        group: &Group,
        d: &Block,
        penalty: &[f64],
        shift: f64,
        problem: &Problem,
        i: usize,
    ) {
        let (row, dim) = (group.row, group.dim);
        let start = problem.w.start[problem.w.diagonal[i]];
        for r in 0..dim {
            for c in 0..dim {
                let unit = f64::from(u8::from(r == c));
                self.values[self.place[start + r * dim + c]] +=
                    unit - d[r][c] + d[r][c] * penalty[row + c] * shift;
            }
        }
    }

    pub fn factor(&mut self) -> bool {
        let n = self.n;
        if self.is_dense() {
            return dense::lu_factor(&mut self.values, n, &mut self.pivots).is_ok();
        }
        self.lu
            .refactor(n, &self.col_ptr, &self.row_idx, &self.values)
            .is_ok()
    }

    pub fn solve(&mut self, rhs: &[f64], out: &mut [f64]) -> bool {
        if self.is_dense() {
            out.copy_from_slice(rhs);
            dense::lu_solve(&self.values, self.n, &self.pivots, out);
            return out.iter().all(|v| v.is_finite());
        }
        self.lu.solve(rhs, out).is_ok()
    }
}
