//! Random, singular, badly scaled and permuted systems; every path to an error.

use super::dense::{chol_factor, chol_solve, lu_factor, lu_solve};
use super::{DirectError, Factor, LinearBackend, Sparse, SparseLlt, SparseLu};
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
                *a = 3.0 + *a;
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

fn solve<F: Factor>(
    m: &Matrix,
    b: &[f64],
    lower: bool,
) -> Result<(Vec<f64>, super::SolveQuality), DirectError> {
    let (ptr, rows, values) = m.columns(|i, j| !lower || i >= j);
    let mut solver = Sparse::<F>::new();
    solver.refactor(m.n, &ptr, &rows, &values)?;
    let mut x = vec![f64::NAN; m.n];
    let quality = solver.solve(b, &mut x)?;
    Ok((x, quality))
}

proptest! {
    #[test]
    fn dense_lu_solves((m, b) in dense_matrix(80)) {
        // Random matrices are hardly ever near singular; where one is, a refusal is the right answer.
        if let Some(x) = m.lu(&b) {
            prop_assert!(m.backward_error(&x, &b) < 1e-13);
        } else {
            prop_assert!(m.n < 3);
        }
    }

    #[test]
    fn dense_cholesky_solves((m, b) in dense_matrix(60)) {
        let spd = m.gram(1e-3);
        let x = spd.chol(&b).expect("positive definite");
        prop_assert!(spd.backward_error(&x, &b) < 1e-14);
    }

    #[test]
    fn permuted_rows_and_columns_give_the_permuted_solution((m, b) in dense_matrix(30), seed in 0..1000usize) {
        let n = m.n;
        // An affine map modulo a prime above n, restricted by rank, is permutation enough.
        let mut perm: Vec<usize> = (0..n).collect();
        perm.sort_by_key(|&i| (i * (seed % 30 + 1) + seed) % 31);
        let moved = Matrix::from_fn(n, |i, j| m.a[perm[i] * n + j]);
        let b2: Vec<f64> = perm.iter().map(|&i| b[i]).collect();
        // The same pivots in another order: the same bits wherever no two candidates are equal.
        prop_assert_eq!(m.lu(&b), moved.lu(&b2));
    }

    #[test]
    fn column_scaling_by_powers_of_two_is_exact((m, b) in dense_matrix(20), scale in powers_of_two(20)) {
        let scaled = Matrix::from_fn(m.n, |i, j| m.a[i * m.n + j] * scale[j]);
        let back = scaled.lu(&b).map(|x| x.iter().zip(&scale).map(|(x, s)| x * s).collect::<Vec<_>>());
        prop_assert_eq!(back, m.lu(&b));
    }

    #[test]
    fn symmetric_scaling_by_powers_of_two_is_exact_for_cholesky((m, b) in dense_matrix(20), scale in powers_of_two(20)) {
        let spd = m.gram(1e-3);
        let scaled = Matrix::from_fn(m.n, |i, j| scale[i] * spd.a[i * m.n + j] * scale[j]);
        let b2: Vec<f64> = b.iter().zip(&scale).map(|(b, s)| b * s).collect();
        let back = scaled.chol(&b2).map(|x| x.iter().zip(&scale).map(|(x, s)| x * s).collect::<Vec<_>>());
        prop_assert_eq!(back, spd.chol(&b));
    }

    #[test]
    fn duplicate_rows_are_singular((mut m, b) in dense_matrix(40), i in 0..40usize, j in 0..40usize) {
        prop_assume!(m.n > 1);
        let (i, j) = (i % m.n, j % m.n);
        prop_assume!(i != j);
        m.a.copy_within(i * m.n..(i + 1) * m.n, j * m.n);
        prop_assert_eq!(m.lu(&b), None);
    }

    #[test]
    fn no_nan_goes_unseen((mut m, b) in dense_matrix(12), at in 0..144usize, bad in prop_oneof![Just(f64::NAN), Just(f64::INFINITY)]) {
        let at = at % (m.n * m.n);
        let spd_at = (at / m.n).max(at % m.n) * m.n + (at / m.n).min(at % m.n);
        let mut spd = m.gram(1.0);
        spd.a[spd_at] = bad;
        prop_assert_eq!(spd.chol(&b), None);
        m.a[at] = bad;
        prop_assert_eq!(m.lu(&b), None);
        prop_assert_eq!(solve::<super::lu::Lu>(&m, &b, false).err(), Some(DirectError::NotFinite));
    }

    #[test]
    fn sparse_lu_solves((m, b) in sparse_matrix(60)) {
        let (x, quality) = solve::<super::lu::Lu>(&m, &b, false).expect("diagonally strong");
        prop_assert!(quality.residual < 1e-12 && quality.backward_error < 1e-14, "{:?}", quality);
        prop_assert!(m.backward_error(&x, &b) < 1e-14);
    }

    #[test]
    fn sparse_cholesky_takes_the_lower_triangle_or_all((m, b) in sparse_matrix(60)) {
        let spd = m.gram(0.0);
        let (x, quality) = solve::<super::llt::Llt>(&spd, &b, true).expect("positive definite");
        prop_assert!(quality.backward_error < 1e-14, "{:?}", quality);
        prop_assert!(spd.backward_error(&x, &b) < 1e-14);
        prop_assert_eq!(x, solve::<super::llt::Llt>(&spd, &b, false).expect("positive definite").0);
    }
}

#[test]
fn dense_needs_its_pivots() {
    // Zero diagonal, and the textbook case in which a tiny pivot would ruin everything.
    let swap = Matrix {
        n: 2,
        a: vec![0.0, 1.0, 1.0, 0.0],
    };
    assert_eq!(swap.lu(&[3.0, 4.0]), Some(vec![4.0, 3.0]));
    let tiny = Matrix {
        n: 2,
        a: vec![1e-20, 1.0, 1.0, 1.0],
    };
    assert_eq!(tiny.lu(&[1.0, 2.0]), Some(vec![1.0, 1.0]));
    // Small is not singular.
    let small = Matrix::from_fn(3, |i, j| if i == j { 1e-200 } else { 0.0 });
    assert_eq!(
        small.lu(&[1e-200, 2e-200, 3e-200]),
        Some(vec![1.0, 2.0, 3.0])
    );
    assert_eq!(
        small.chol(&[1e-200, 2e-200, 3e-200]).map(|x| x[2].round()),
        Some(3.0)
    );
}

#[test]
fn dense_refuses_what_it_cannot_solve() {
    let zero = Matrix::from_fn(3, |_, _| 0.0);
    assert!(zero.lu(&[0.0; 3]).is_none() && zero.chol(&[0.0; 3]).is_none());
    let indefinite = Matrix {
        n: 2,
        a: vec![1.0, 2.0, 2.0, 1.0],
    };
    assert!(indefinite.lu(&[1.0; 2]).is_some() && indefinite.chol(&[1.0; 2]).is_none());
    // Rank two, entries with rounding: the last pivot is noise, not zero.
    let rank_two = Matrix::from_fn(4, |i, j| {
        0.1 * (i as f64 + 1.3) + 0.7 * ((j * j) as f64 + 0.1)
    });
    assert!(rank_two.lu(&[1.0, 2.0, 3.0, 5.0]).is_none());
    assert!(lu_factor(&mut [], 0, &mut []).is_ok());
}

/// Delassus-like matrix of a chain: 3 x 3 blocks, tridiagonal, unsymmetric by `slip`.
fn chain(blocks: usize, slip: f64) -> Matrix {
    Matrix::from_fn(3 * blocks, |i, j| match (i / 3).abs_diff(j / 3) {
        0 if i == j => 4.0,
        0 => 0.5 + slip * (i as f64 - j as f64),
        1 => -0.6 + 0.1 * slip * ((i % 3) as f64),
        _ => 0.0,
    })
}

#[test]
fn large_patterns_take_the_supernodal_road_too() {
    // Dense enough for faer to switch kernels.
    let m = Matrix::from_fn(200, |i, j| {
        if i == j {
            50.0
        } else {
            ((i * 7 + j * 13) % 10) as f64 * 0.1
        }
    });
    let b: Vec<f64> = (0..200).map(|i| (i as f64).sin()).collect();
    let (x, quality) = solve::<super::lu::Lu>(&m, &b, false).expect("regular");
    assert!(quality.residual < 1e-13 && m.backward_error(&x, &b) < 1e-14);
    let spd = m.gram(0.0);
    assert!(
        solve::<super::llt::Llt>(&spd, &b, false)
            .expect("positive definite")
            .1
            .residual
            < 1e-11
    );
    let zeros = Matrix::from_fn(200, |_, _| 1.0);
    assert!(solve::<super::lu::Lu>(&zeros, &b, false).is_err());
    assert!(solve::<super::llt::Llt>(&zeros, &b, false).is_err());
}

#[test]
fn a_pattern_is_analysed_once() {
    let mut lu = SparseLu::new();
    let mut x = vec![0.0; 30];
    let b = vec![1.0; 30];
    for slip in [0.01, 0.02, 0.03] {
        let (ptr, rows, values) = chain(10, slip).columns(|_, _| true);
        lu.refactor(30, &ptr, &rows, &values).expect("regular");
        assert!(lu.solve(&b, &mut x).expect("regular").residual < 1e-13);
    }
    assert_eq!(lu.analyses(), 1);
    let (ptr, rows, values) = chain(7, 0.01).columns(|_, _| true);
    lu.refactor(21, &ptr, &rows, &values).expect("regular");
    lu.solve(&b[..21], &mut x[..21]).expect("regular");
    assert_eq!(lu.analyses(), 2);
}

#[test]
fn singular_systems_are_errors_and_the_solver_survives_them() {
    let mut lu = SparseLu::new();
    let b: Vec<f64> = (0..30).map(|i| 1.0 + i as f64).collect();
    let mut x = vec![0.0; 30];
    let m = chain(10, 0.01);
    let (ptr, rows, good) = m.columns(|_, _| true);
    // Same pattern throughout: a zero matrix, two equal rows, a structurally empty column, then a good one.
    let zero = vec![0.0; good.len()];
    let outcome = lu
        .refactor(30, &ptr, &rows, &zero)
        .and_then(|()| lu.solve(&b, &mut x));
    assert!(
        matches!(outcome, Err(DirectError::Singular { .. })),
        "{outcome:?}"
    );
    let mut equal = m.clone();
    for j in 0..30 {
        equal.a[30 + j] = equal.a[j];
    }
    let (_, _, values) = equal.columns(|_, _| true);
    let outcome = lu
        .refactor(30, &ptr, &rows, &values)
        .and_then(|()| lu.solve(&b, &mut x));
    assert!(outcome.is_err(), "{outcome:?}");
    let mut empty = good.clone();
    empty[ptr[4]..ptr[5]].fill(0.0);
    let outcome = lu
        .refactor(30, &ptr, &rows, &empty)
        .and_then(|()| lu.solve(&b, &mut x));
    assert!(outcome.is_err(), "{outcome:?}");
    lu.refactor(30, &ptr, &rows, &good).expect("regular");
    assert!(lu.solve(&b, &mut x).expect("regular").residual < 1e-13);
    // A column without entries.
    let mut lu = SparseLu::new();
    let outcome = lu
        .refactor(2, &[0, 2, 2], &[0, 1], &[1.0, 1.0])
        .and_then(|()| lu.solve(&[1.0, 2.0], &mut x[..2]));
    assert!(
        matches!(outcome, Err(DirectError::Singular { .. })),
        "{outcome:?}"
    );
}

#[test]
fn not_positive_definite_is_said() {
    let mut llt = SparseLlt::new();
    let outcome = llt.refactor(2, &[0, 2, 3], &[0, 1, 1], &[1.0, 2.0, 1.0]);
    assert_eq!(outcome, Err(DirectError::NotPositiveDefinite));
    assert_eq!(
        llt.solve(&[1.0; 2], &mut [0.0; 2]),
        Err(DirectError::NotFactored)
    );
    assert!(
        <SparseLlt as LinearBackend>::NEEDS_SYMMETRY
            && !<SparseLu as LinearBackend>::NEEDS_SYMMETRY
    );
}

#[test]
fn bad_input_is_an_error_and_not_a_panic() {
    let mut lu = SparseLu::new();
    assert_eq!(lu.solve(&[], &mut []), Err(DirectError::NotFactored));
    for (n, ptr, rows) in [
        (2, vec![0, 1], vec![0]),
        (1, vec![1, 1], vec![0]),
        (2, vec![0, 2, 1], vec![0]),
        (2, vec![0, 2, 2], vec![1, 0]),
        (2, vec![0, 2, 2], vec![0, 0]),
        (2, vec![0, 1, 2], vec![0, 2]),
    ] {
        let outcome = lu.refactor(n, &ptr, &rows, &vec![1.0; rows.len()]);
        assert!(
            matches!(outcome, Err(DirectError::BadPattern(_))),
            "{ptr:?} {rows:?}"
        );
    }
    assert!(lu.refactor(1, &[0, 1], &[0], &[]).is_err());
    lu.refactor(1, &[0, 1], &[0], &[2.0]).expect("regular");
    let mut x = [9.0];
    assert_eq!(lu.solve(&[f64::NAN], &mut x), Err(DirectError::NotFinite));
    assert_eq!(lu.solve(&[0.0], &mut x).map(|q| q.residual), Ok(0.0));
    assert_eq!(x, [0.0]);
    lu.refactor(0, &[0], &[], &[]).expect("nothing to do");
    lu.solve(&[], &mut []).expect("nothing to do");
}
