//! A contact with rolling or spinning rows in a sweep.

use super::contact::{disc, Coupled, Simple};
use crate::cone::{Bounds, MAX_ROWS};
use crate::direct::dense;
use crate::problem::RowGroup;

/// Product (1) of the largest entries of a block and its inverse, beyond which the inverse is not used: it has lost these
/// digits.
const REGULAR: f64 = 1e10;
/// Rounds (1) between the discs of a contact; bounds the time of one. Sweeps come back to it anyway.
const ROUNDS: u32 = 6;

/// A contact with rolling or spinning rows and any block.
#[derive(Clone, Debug)]
pub struct Discs {
    /// Normal and sliding rows by themselves.
    head: Head,
    /// First row, rows, reciprocal of the largest diagonal and bound of the rolling and the spinning disc, if there.
    discs: [Option<(usize, usize, f64, f64)>; 2],
    /// `-A^-1`, row-major; empty where A is singular.
    inverse: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Head {
    /// Reciprocal diagonal of a contact without sliding rows.
    Normal(f64),
    Simple(Simple),
    Coupled(Coupled, [f64; 9]),
}

impl Discs {
    pub fn new(group: &RowGroup, a: &[f64]) -> Option<Discs> {
        let n = group.dim;
        let slides = group.bounds.sliding > 0.0;
        let head_dim = if slides { 3 } else { 1 };
        if group.bilateral || n == head_dim || (0..n).any(|r| a[r * n + r] <= 0.0) {
            return None;
        }
        let head = if slides {
            let mut block = [0.0; 9];
            for r in 0..3 {
                block[3 * r..3 * r + 3].copy_from_slice(&a[r * n..r * n + 3]);
            }
            let alone = RowGroup {
                dim: 3,
                bounds: Bounds {
                    sliding: group.bounds.sliding,
                    ..Bounds::default()
                },
                ..*group
            };
            match Simple::new(&alone, &block) {
                Some(simple) => Head::Simple(simple),
                None => Head::Coupled(Coupled::new(&alone, &block)?, block),
            }
        } else {
            Head::Normal(1.0 / a[0])
        };
        let mut discs = [None; 2];
        let others = group.bounds.discs().filter(|d| d.start >= head_dim);
        for (place, d) in discs.iter_mut().zip(others) {
            let rows = d.start..d.start + d.dim;
            let largest = rows.map(|r| a[r * n + r]).fold(0.0, f64::max);
            *place = Some((d.start, d.dim, 1.0 / largest, d.bound));
        }
        Some(Discs {
            head,
            discs,
            inverse: negative_inverse(a, n).unwrap_or_default(),
        })
    }

    /// Open, or all discs sticking, or so many rounds between the discs from the last `r` on; false where the long way is needed.
    pub fn solve(&self, a: &[f64], b: &[f64], r: &mut [f64]) -> bool {
        let n = r.len();
        if b[0] >= 0.0 {
            r.fill(0.0);
            return true;
        }
        if !self.inverse.is_empty() {
            let mut stuck = [0.0; MAX_ROWS];
            for (r, row) in stuck.iter_mut().zip(self.inverse.chunks_exact(n)) {
                *r = row.iter().zip(b).map(|(m, b)| m * b).sum();
            }
            if self.admits(&stuck) {
                r.copy_from_slice(&stuck[..n]);
                return true;
            }
        }
        // u = A r + b, kept up to date column by column.
        let mut u = [0.0; MAX_ROWS];
        u[..n].copy_from_slice(&b[..n]);
        for c in 0..n {
            add_column(a, c, r[c], &mut u[..n]);
        }
        for _ in 0..ROUNDS {
            let (mut moved, mut size) = (0.0f64, 0.0f64);
            let mut put = |c: usize, value: f64, r: &mut [f64], u: &mut [f64]| {
                let step = value - r[c];
                moved = moved.max(step.abs());
                size = size.max(value.abs());
                r[c] = value;
                add_column(a, c, step, u);
            };
            let rest = |k: usize| u[k] - (0..3).map(|c| a[k * n + c] * r[c]).sum::<f64>();
            match &self.head {
                Head::Normal(per) => {
                    let value = (r[0] - u[0] * per).max(0.0);
                    put(0, value, r, &mut u[..n]);
                }
                Head::Simple(simple) => {
                    let x = simple.solve_three([rest(0), rest(1), rest(2), 0.0]);
                    (0..3).for_each(|c| put(c, x[c], r, &mut u[..n]));
                }
                Head::Coupled(coupled, block) => {
                    let last = [r[0], r[1], r[2]];
                    let Some(x) = coupled.solve(block, [rest(0), rest(1), rest(2)], last) else {
                        return false;
                    };
                    (0..3).for_each(|c| put(c, x[c], r, &mut u[..n]));
                }
            }
            for &(at, dim, per, bound) in self.discs.iter().flatten() {
                let radius = bound * r[0];
                if dim == 2 {
                    let (x, y) = (u[at] - r[at] / per, u[at + 1] - r[at + 1] / per);
                    let pair = disc(x, y, per, radius);
                    put(at, pair[0], r, &mut u[..n]);
                    put(at + 1, pair[1], r, &mut u[..n]);
                } else {
                    let value = (r[at] - u[at] * per).clamp(-radius, radius);
                    put(at, value, r, &mut u[..n]);
                }
            }
            if moved <= f64::EPSILON * size {
                break;
            }
        }
        true
    }

    fn admits(&self, r: &[f64; MAX_ROWS]) -> bool {
        let inside = |x: f64, y: f64, bound: f64| x * x + y * y <= bound * bound * r[0] * r[0];
        let head = match &self.head {
            Head::Normal(_) => true,
            Head::Simple(simple) => inside(r[1], r[2], simple.bounds[0]),
            Head::Coupled(coupled, _) => inside(r[1], r[2], coupled.friction),
        };
        let mut discs = self.discs.iter().flatten();
        r[0] >= 0.0
            && head
            && discs.all(|&(at, dim, _, bound)| {
                let second = if dim == 2 { r[at + 1] } else { 0.0 };
                inside(r[at], second, bound)
            })
    }
}

/// `u += (column c of a) x`.
#[inline(always)]
fn add_column(a: &[f64], c: usize, x: f64, u: &mut [f64]) {
    let n = u.len();
    for (u, row) in u.iter_mut().zip(a.chunks_exact(n)) {
        *u += row[c] * x;
    }
}

/// `-a^-1` by columns of the identity.
fn negative_inverse(a: &[f64], n: usize) -> Option<Vec<f64>> {
    let mut lu = a.to_vec();
    let mut pivots = vec![0u32; n];
    dense::lu_factor(&mut lu, n, &mut pivots).ok()?;
    let mut inverse = vec![0.0; n * n];
    for c in 0..n {
        let mut x = [0.0; MAX_ROWS];
        x[c] = -1.0;
        dense::lu_solve(&lu, n, &pivots, &mut x[..n]);
        (0..n).for_each(|r| inverse[r * n + c] = x[r]);
    }
    let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    (largest(a) * largest(&inverse) < REGULAR).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{group, miss};
    use super::*;
    use crate::solver::solve_contact;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// As sweeps do: again and again from the last `r`.
        #[test]
        fn rolling_and_spinning_contacts_are_solved_in_a_few_visits(
            mask in 2usize..8,
            mu in prop::array::uniform3(0.05f64..1.5),
            g in prop::collection::vec(-0.1f64..0.1, 36),
            b in prop::array::uniform6(-1.0f64..1.0),
        ) {
            let on = |k: usize| if mask >> k & 1 == 1 { mu[k] } else { 0.0 };
            let group = group(on(0), on(1), on(2));
            let n = group.dim;
            let mut a = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    a[i * n + j] = if i == j { 1.0 } else { g[6 * i.min(j) + i.max(j)] };
                }
            }
            let discs = Discs::new(&group, &a).expect("a regular block");
            let mut r = vec![0.0; n];
            for _ in 0..5 {
                if !discs.solve(&a, &b[..n], &mut r) {
                    solve_contact(&group, &a, &b[..n], &mut r);
                }
            }
            prop_assert!(miss(&group, &a, &b[..n], &r) < 1e-11, "{:?}", r);
        }
    }

    #[test]
    fn an_inverse_of_rounding_is_not_used() {
        let mut a = [0.0; 25];
        for i in 0..5 {
            a[6 * i] = 1.0;
        }
        let ball = group(0.5, 0.1, 0.0);
        assert_eq!(Discs::new(&ball, &a).expect("a block").inverse.len(), 25);
        (a[8], a[16]) = (1.0, 1.0); // rows 1 and 3 are the same
        assert!(Discs::new(&ball, &a).expect("a block").inverse.is_empty());
        a[0] = 0.0;
        assert!(Discs::new(&ball, &a).is_none());
    }
}
