//! Direct solvers; here the matrices of their tests, and the measure that they are judged by.

#[path = "direct/dense.rs"]
mod dense;
#[path = "direct/sparse.rs"]
mod sparse;

use carom_solve::direct::dense::{chol_factor, chol_solve, lu_factor, lu_solve};
use proptest::prelude::*;

/// Row-major square matrix.
#[derive(Clone, Debug)]
struct Matrix {
    n: usize,
    a: Vec<f64>,
}

impl Matrix {
    fn from_fn(n: usize, f: impl Fn(usize, usize) -> f64) -> Self {
        Self {
            n,
            a: (0..n * n).map(|k| f(k / n, k % n)).collect(),
        }
    }

    fn times(&self, x: &[f64]) -> Vec<f64> {
        self.a
            .chunks(self.n)
            .map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum())
            .collect()
    }

    /// `A A^T + shift 1`.
    fn gram(&self, shift: f64) -> Self {
        let row = |i: usize| &self.a[i * self.n..(i + 1) * self.n];
        Self::from_fn(self.n, |i, j| {
            row(i).iter().zip(row(j)).map(|(x, y)| x * y).sum::<f64>()
                + if i == j { shift } else { 0.0 }
        })
    }

    /// Compressed columns without the zeros; `keep(i, j)` selects.
    fn columns(&self, keep: impl Fn(usize, usize) -> bool) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
        let (mut ptr, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for j in 0..self.n {
            for i in 0..self.n {
                let v = self.a[i * self.n + j];
                if v != 0.0 && keep(i, j) {
                    rows.push(i);
                    values.push(v);
                }
            }
            ptr.push(rows.len());
        }
        (ptr, rows, values)
    }

    fn lu(&self, b: &[f64]) -> Option<Vec<f64>> {
        let (mut a, mut piv, mut x) = (self.a.clone(), vec![0; self.n], b.to_vec());
        lu_factor(&mut a, self.n, &mut piv).ok()?;
        lu_solve(&a, self.n, &piv, &mut x);
        Some(x)
    }

    fn chol(&self, b: &[f64]) -> Option<Vec<f64>> {
        let (mut a, mut x) = (self.a.clone(), b.to_vec());
        // The strict upper triangle must not be read.
        for i in 0..self.n {
            a[i * self.n + i + 1..(i + 1) * self.n].fill(f64::NAN);
        }
        chol_factor(&mut a, self.n).ok()?;
        chol_solve(&a, self.n, &mut x);
        Some(x)
    }

    /// `max|b - A x| / (|A|_inf max|x| + max|b|)`.
    fn backward_error(&self, x: &[f64], b: &[f64]) -> f64 {
        let max = |v: &mut dyn Iterator<Item = f64>| {
            v.fold(0.0, |m: f64, x| if x.is_nan() { x } else { m.max(x.abs()) })
        };
        let left = max(&mut self.times(x).iter().zip(b).map(|(ax, b)| b - ax));
        let norm = max(&mut self
            .a
            .chunks(self.n)
            .map(|row| row.iter().map(|v| v.abs()).sum::<f64>()));
        left / (norm * max(&mut x.iter().copied()) + max(&mut b.iter().copied()))
    }
}

fn dense_matrix(largest: usize) -> impl Strategy<Value = (Matrix, Vec<f64>)> {
    (1..=largest).prop_flat_map(|n| {
        (
            prop::collection::vec(-1.0..1.0f64, n * n),
            prop::collection::vec(-1.0..1.0f64, n),
        )
            .prop_map(move |(a, b)| (Matrix { n, a }, b))
    })
}

/// Mostly zeros, with a diagonal that keeps it regular.
fn sparse_matrix(largest: usize) -> impl Strategy<Value = (Matrix, Vec<f64>)> {
    dense_matrix(largest).prop_map(|(mut m, b)| {
        let n = m.n;
        for (k, a) in m.a.iter_mut().enumerate() {
            let (i, j) = (k / n, k % n);
            if i == j {
                *a += 3.0;
            } else if (i * 31 + j * 17) % 11 > 2 {
                *a = 0.0;
            }
        }
        (m, b)
    })
}

fn powers_of_two(n: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec((-60..60i32).prop_map(|e| 2f64.powi(e)), n)
}
