//! The matrices of Newton's method and of path following: the pattern of W, dense when small.

use crate::cone::Block;
use crate::direct::{dense, SparseLu};
use crate::ladder::SMALL_ROWS;
use crate::problem::{Problem, RowGroup};

/// The Newton matrix: dense when small, else compressed columns whose pattern is that of W.
#[derive(Default)]
pub(super) struct NewtonMatrix {
    n: usize,
    lu: SparseLu,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    /// Place in `values` of each value of W, in the order of W's blocks.
    place: Vec<usize>,
    pivots: Vec<u32>,
}

impl NewtonMatrix {
    pub fn is_dense(&self) -> bool {
        self.n <= SMALL_ROWS
    }

    pub fn plan(&mut self, problem: &Problem) {
        let (n, w) = (problem.rows(), &problem.w);
        self.n = n;
        self.place.clear();
        self.place.resize(w.values.len(), 0);
        self.pivots.resize(n, 0);
        if self.is_dense() {
            self.values.resize(n * n, 0.0);
        } else {
            self.col_ptr.clear();
            self.col_ptr.resize(n + 1, 0);
            w.entries()
                .for_each(|(_, col, _)| self.col_ptr[col + 1] += 1);
            for c in 0..n {
                self.col_ptr[c + 1] += self.col_ptr[c];
            }
            self.row_idx.resize(self.col_ptr[n], 0);
            self.values.resize(self.col_ptr[n], 0.0);
        }
        let mut fill = self.col_ptr.clone();
        // Rows ascend within each column.
        w.entries().for_each(|(row, col, value)| {
            let place = if self.is_dense() {
                row * n + col
            } else {
                let at = fill[col];
                fill[col] += 1;
                self.row_idx[at] = row;
                at
            };
            self.place[value] = place;
        });
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
        group: &RowGroup,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cone::Bounds;
    use crate::problem::BlockMatrix;

    /// Contacts in pairs at one place: W has half the rank.
    fn pairs(count: usize) -> Problem {
        let bounds = Bounds {
            sliding: 0.5,
            ..Bounds::default()
        };
        let groups: Vec<RowGroup> = (0..2 * count)
            .map(|i| RowGroup {
                row: 3 * i,
                dim: 3,
                bounds,
                bilateral: false,
                least: 0.0,
            })
            .collect();
        let ptr = (0..=2 * count).map(|i| 2 * i).collect();
        let col = (0..2 * count)
            .flat_map(|i| [2 * (i / 2) as u32, 2 * (i / 2) as u32 + 1])
            .collect();
        let mut w = BlockMatrix::zeros(&groups, ptr, col);
        for block in w.values.chunks_exact_mut(9) {
            block.copy_from_slice(&[1.0, 0.1, 0.2, 0.1, 3.0, 0.3, 0.2, 0.3, 2.0]);
        }
        Problem {
            groups,
            w,
            q: vec![0.0; 6 * count],
        }
    }

    /// A singular W gives no direction for a right side out of its range, and with a shift an accurate one.
    #[test]
    fn singular_w_is_noticed_and_a_shift_cures_it() {
        for count in [1, 5, 40] {
            let problem = pairs(count);
            let n = problem.rows();
            let mut linear = NewtonMatrix::default();
            linear.plan(&problem);
            assert_eq!(linear.is_dense(), n <= SMALL_ROWS);
            let rhs: Vec<f64> = (0..n).map(|k| if k % 6 < 3 { 1.0 } else { -1.0 }).collect();
            let mut x = vec![0.0; n];
            linear.copy(&problem);
            assert!(!(linear.factor() && linear.solve(&rhs, &mut x)), "{n} rows");
            linear.copy(&problem);
            for i in 0..problem.groups.len() {
                for r in 0..3 {
                    linear.add(&problem, i, r, r, 1e-6);
                }
            }
            assert!(linear.factor() && linear.solve(&rhs, &mut x), "{n} rows");
            let mut u = vec![0.0; n];
            problem.velocity(&x, &mut u);
            for k in 0..n {
                assert!(
                    (u[k] + 1e-6 * x[k] - rhs[k]).abs() < 1e-8,
                    "{n} rows, row {k}"
                );
            }
        }
    }

    /// Newton's matrix entry by entry, with unsymmetric tangents and a shift, dense and sparse.
    #[test]
    fn newton_matrix_is_the_formula() {
        for count in [2, 40] {
            let mut problem = pairs(count);
            for (k, v) in problem.w.values.iter_mut().enumerate() {
                *v += 0.01 * (k % 17) as f64;
            }
            let n = problem.rows();
            let tangents: Vec<Block> = (0..problem.groups.len())
                .map(|i| {
                    let mut block = Block::default();
                    for r in 0..3 {
                        for c in 0..3 {
                            block[r][c] = 0.1 * ((3 * r + 2 * c + i) % 7) as f64;
                        }
                    }
                    block
                })
                .collect();
            let penalty: Vec<f64> = (0..n).map(|r| 0.3 + 0.05 * (r % 5) as f64).collect();
            let shift = 0.07;
            let mut linear = NewtonMatrix::default();
            linear.plan(&problem);
            linear.assemble(&problem, &tangents, &penalty, shift);
            assert!(linear.factor());
            // (1 - D) x + D p (W x + shift x) for an x, then back.
            let x: Vec<f64> = (0..n).map(|k| ((k * 7) % 11) as f64 - 5.0).collect();
            let mut wx = vec![0.0; n];
            problem.velocity(&x, &mut wx);
            let rhs: Vec<f64> = (0..n)
                .map(|row| {
                    let (first, d) = (row / 3 * 3, &tangents[row / 3]);
                    let sum: f64 = (0..3)
                        .map(|m| {
                            let k = first + m;
                            d[row % 3][m] * (penalty[k] * (wx[k] + shift * x[k]) - x[k])
                        })
                        .sum();
                    x[row] + sum
                })
                .collect();
            let mut out = vec![0.0; n];
            assert!(linear.solve(&rhs, &mut out));
            for k in 0..n {
                assert!(
                    (out[k] - x[k]).abs() < 1e-9,
                    "{n} rows, row {k}: {} {}",
                    out[k],
                    x[k]
                );
            }
        }
    }
}
