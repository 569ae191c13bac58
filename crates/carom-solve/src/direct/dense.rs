//! Small dense systems in place: LU with partial pivoting and Cholesky.
//!
//! Matrices are row-major `n x n` slices that the caller owns; nothing allocates. Loops run along rows, so they
//! vectorise, and products and sums are rounded one by one (no fused multiply-add): the same bits on every machine.

use std::fmt;

/// A pivot this small against the numbers (1) it was subtracted from is rounding noise.
///
/// Noise grows from step to step, so this does not catch every singular matrix, but it must not refuse a merely stiff one:
/// condition numbers up to about 1e13 pass. With 0 a singular matrix gives directions of 1e16; large, stiff piles fall back for
/// no reason.
const NOISE: f64 = 64.0 * f64::EPSILON;

/// The matrix has no usable pivot in this column: singular to rounding, not positive definite (Cholesky), or it holds
/// a number that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Singular {
    /// Column, from 0.
    pub column: usize,
}

impl fmt::Display for Singular {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no usable pivot in column {}", self.column)
    }
}

impl std::error::Error for Singular {}

/// `P A = L U` in place: `a` (n x n, row-major) gets `U` above the diagonal, `1/u_kk` on it and the unit lower `L` below;
/// `piv[k]` is the row that changed places with row `k` at step `k`.
///
/// A pivot `u_kk` is refused unless it stands out from the rounding of its own sum,
/// `|u_kk| > 64 eps (|u_kk| + sum_j |l_kj u_jk|)`. The test is the same for any scaling of rows or columns, and since
/// it reads every entry of both factors no NaN passes it.
pub fn lu_factor(a: &mut [f64], n: usize, piv: &mut [u32]) -> Result<(), Singular> {
    let a = &mut a[..n * n];
    let piv = &mut piv[..n];
    for k in 0..n {
        let mut best = k;
        let mut size = a[k * n + k].abs();
        for i in k + 1..n {
            let candidate = a[i * n + k].abs();
            if candidate > size {
                (best, size) = (i, candidate);
            }
        }
        piv[k] = best as u32;
        let (above, below) = a.split_at_mut((k + 1) * n);
        let row_k = &mut above[k * n..];
        if best != k {
            let start = (best - k - 1) * n;
            row_k.swap_with_slice(&mut below[start..start + n]);
        }
        let (solved, row_k) = above.split_at_mut(k * n);
        let terms = row_k[..k].iter().zip(solved.iter().skip(k).step_by(n));
        let noise = terms.fold(size, |sum, (l, u)| sum + (l * u).abs()) * NOISE;
        // NaN compares false.
        let stands_out = size > noise;
        if !stands_out {
            return Err(Singular { column: k });
        }
        let pivot = row_k[k];
        let inverse = 1.0 / pivot;
        if inverse.is_infinite() {
            return Err(Singular { column: k });
        }
        row_k[k] = inverse;
        let tail_k = &row_k[k + 1..];
        for row in below.chunks_exact_mut(n) {
            // Divided, not multiplied by the inverse: equal rows then cancel to zero exactly.
            let l = row[k] / pivot;
            row[k] = l;
            // Contact matrices are full of zero blocks.
            if l != 0.0 {
                for (x, u) in row[k + 1..].iter_mut().zip(tail_k) {
                    *x -= l * u;
                }
            }
        }
    }
    Ok(())
}

/// `x <- A^-1 x` with the result of [`lu_factor`]; `x` (n).
pub fn lu_solve(a: &[f64], n: usize, piv: &[u32], x: &mut [f64]) {
    let (a, piv, x) = (&a[..n * n], &piv[..n], &mut x[..n]);
    for (k, &p) in piv.iter().enumerate() {
        x.swap(k, p as usize);
    }
    // By columns although the matrix lies in rows: the next unknown then waits for one product, not for a whole
    // inner product, which is what counts at these sizes.
    for i in 0..n {
        let (solved, rest) = x.split_at_mut(i + 1);
        take_out(solved[i], below_diagonal(a, n, i), rest);
    }
    for i in (0..n).rev() {
        let (rest, solved) = x.split_at_mut(i);
        solved[0] *= a[i * n + i];
        take_out(solved[0], a[i..].iter().step_by(n), rest);
    }
}

/// `A = L L^T` in place for symmetric positive definite `a` (n x n, row-major). Only the lower triangle is read, and
/// overwritten with `L`, `1/l_kk` on the diagonal; the strict upper one is left alone.
///
/// A pivot is refused where `a_kk - sum l_kj^2 <= 64 eps a_kk`, with NaN, as in [`lu_factor`].
pub fn chol_factor(a: &mut [f64], n: usize) -> Result<(), Singular> {
    let a = &mut a[..n * n];
    for i in 0..n {
        let (above, row_i) = a.split_at_mut(i * n);
        for j in 0..i {
            let row_j = &above[j * n..j * n + j + 1];
            row_i[j] = (row_i[j] - dot(&row_i[..j], &row_j[..j])) * row_j[j];
        }
        let square = row_i[i] - dot(&row_i[..i], &row_i[..i]);
        let stands_out = square > NOISE * row_i[i] && square < f64::INFINITY;
        if !stands_out {
            return Err(Singular { column: i });
        }
        row_i[i] = 1.0 / square.sqrt();
    }
    Ok(())
}

/// `x <- A^-1 x` with the result of [`chol_factor`]; `x` (n).
pub fn chol_solve(a: &[f64], n: usize, x: &mut [f64]) {
    let (a, x) = (&a[..n * n], &mut x[..n]);
    for i in 0..n {
        let (solved, rest) = x.split_at_mut(i + 1);
        solved[i] *= a[i * n + i];
        take_out(solved[i], below_diagonal(a, n, i), rest);
    }
    // The columns of L^T are the rows of L.
    for i in (0..n).rev() {
        let (rest, solved) = x.split_at_mut(i);
        solved[0] *= a[i * n + i];
        take_out(solved[0], a[i * n..i * n + i].iter(), rest);
    }
}

/// Entries of column `i` below the diagonal.
#[inline(always)]
fn below_diagonal(a: &[f64], n: usize, i: usize) -> impl Iterator<Item = &f64> {
    a.iter().skip((i + 1) * n + i).step_by(n)
}

/// `rest -= xi column`: moves a solved unknown to the right-hand side.
#[inline(always)]
fn take_out<'a>(xi: f64, column: impl Iterator<Item = &'a f64>, rest: &mut [f64]) {
    for (x, c) in rest.iter_mut().zip(column) {
        *x -= c * xi;
    }
}

/// Inner product in a fixed order: four running sums, which the processor can add side by side.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| x * y)
        .sum();
    let mut s = [0.0; 4];
    for (x, y) in a4.zip(b4) {
        for k in 0..4 {
            s[k] += x[k] * y[k];
        }
    }
    (s[0] + s[2]) + (s[1] + s[3]) + tail
}
