//! Dense LU and Cholesky: random, singular, badly scaled and permuted systems.

use super::{dense_matrix, powers_of_two, Matrix};
use carom_solve::direct::dense::lu_factor;
use proptest::prelude::*;

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
