//! Sparse LU and Cholesky: the pattern cache, refinement, and every path to an error.

use super::{dense_matrix, sparse_matrix, Matrix};
use carom_solve::direct::{
    DirectError, Factor, Llt, Lu, SolveQuality, Sparse, SparseLlt, SparseLu,
};
use proptest::prelude::*;

fn solve<F: Factor>(
    m: &Matrix,
    b: &[f64],
    lower: bool,
) -> Result<(Vec<f64>, SolveQuality), DirectError> {
    let (ptr, rows, values) = m.columns(|i, j| !lower || i >= j);
    let mut solver = Sparse::<F>::new();
    solver.refactor(m.n, &ptr, &rows, &values)?;
    let mut x = vec![f64::NAN; m.n];
    let quality = solver.solve(b, &mut x)?;
    Ok((x, quality))
}

proptest! {
    #[test]
    fn what_is_not_finite_is_refused((mut m, b) in dense_matrix(12), at in 0..144usize, bad in prop_oneof![Just(f64::NAN), Just(f64::INFINITY)]) {
        let at = at % (m.n * m.n);
        m.a[at] = bad;
        prop_assert_eq!(solve::<Lu>(&m, &b, false).err(), Some(DirectError::NotFinite));
    }

    #[test]
    fn sparse_lu_solves((m, b) in sparse_matrix(60)) {
        let (x, quality) = solve::<Lu>(&m, &b, false).expect("diagonally strong");
        prop_assert!(quality.residual < 1e-12 && quality.backward_error < 1e-14, "{:?}", quality);
        prop_assert!(m.backward_error(&x, &b) < 1e-14);
    }

    #[test]
    fn sparse_cholesky_takes_the_lower_triangle_or_all((m, b) in sparse_matrix(60)) {
        let spd = m.gram(0.0);
        let (x, quality) = solve::<Llt>(&spd, &b, true).expect("positive definite");
        prop_assert!(quality.backward_error < 1e-14, "{:?}", quality);
        prop_assert!(spd.backward_error(&x, &b) < 1e-14);
        prop_assert_eq!(x, solve::<Llt>(&spd, &b, false).expect("positive definite").0);
    }
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
    let (x, quality) = solve::<Lu>(&m, &b, false).expect("regular");
    assert!(quality.residual < 1e-13 && m.backward_error(&x, &b) < 1e-14);
    let spd = m.gram(0.0);
    assert!(
        solve::<Llt>(&spd, &b, false)
            .expect("positive definite")
            .1
            .residual
            < 1e-11
    );
    let zeros = Matrix::from_fn(200, |_, _| 1.0);
    assert!(solve::<Lu>(&zeros, &b, false).is_err());
    assert!(solve::<Llt>(&zeros, &b, false).is_err());
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
