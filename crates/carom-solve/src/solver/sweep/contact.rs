//! One contact in a sweep: what can be prepared once, and short ways for blocks that allow them.
//!
//! Both short ways give a solution of the contact or none; what they leave goes to [`super::super::solve_contact`].

use super::super::one_contact::{ISOTROPIC, SINGULAR};
use crate::problem::RowGroup;

/// Newton steps (1) for the direction of slip, before the slow search takes over; it needs two or three.
const STEPS: u32 = 8;
/// The longest of them (tangent of the angle, 1). Longer, it may end at the root of another direction, against the slip.
const LONGEST: f64 = 0.8;
/// Rounding of the sine of an angle (1). Smaller, all steps are made in vain.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A contact whose block is diagonal, with one number for each disc, as spheres have it: reciprocals of the normal, sliding,
/// rolling and spinning diagonals, and the bounds; 0 for a disc without rows.
#[derive(Clone, Copy, Debug)]
pub struct Simple {
    per: [f64; 4],
    pub bounds: [f64; 3],
}

impl Simple {
    pub fn new(group: &RowGroup, a: &[f64]) -> Option<Simple> {
        let n = group.dim;
        let b = &group.bounds;
        if group.bilateral {
            return None;
        }
        let bounds = [b.sliding, b.rolling, b.spinning];
        let mut per = [0.0; 4];
        // Part of each row.
        let mut part = [0; 6];
        let mut at = 1;
        for (k, dim) in [(1, 2), (2, 2), (3, 1)] {
            if bounds[k - 1] > 0.0 {
                part[at..at + dim].fill(k);
                at += dim;
            }
        }
        debug_assert_eq!(at, n);
        for r in (0..n).rev() {
            if a[r * n + r] <= 0.0 {
                return None;
            }
            per[part[r]] = 1.0 / a[r * n + r];
        }
        for r in 0..n {
            let first = (0..n).find(|&c| part[c] == part[r]).unwrap_or(r);
            for c in 0..n {
                let expected = if r == c { a[first * n + first] } else { 0.0 };
                let tiny = ISOTROPIC * a[r * n + r].min(a[c * n + c]);
                if (a[r * n + c] - expected).abs() > tiny {
                    return None;
                }
            }
        }
        Some(Simple { per, bounds })
    }

    /// Solves `u = diag(w) r + b` of three rows.
    #[inline(always)]
    pub fn solve_three(&self, b: [f64; 4]) -> [f64; 3] {
        let normal = (-b[0] * self.per[0]).max(0.0);
        let [x, y] = disc(b[1], b[2], self.per[1], self.bounds[0] * normal);
        [normal, x, y]
    }

    /// Solves `u = diag(w) r + b` of any rows.
    #[inline(always)]
    pub fn solve(&self, b: &[f64; 8], r: &mut [f64]) {
        let normal = (-b[0] * self.per[0]).max(0.0);
        r[0] = normal;
        let mut at = 1;
        for k in [0, 1] {
            if self.bounds[k] > 0.0 {
                let pair = disc(b[at], b[at + 1], self.per[k + 1], self.bounds[k] * normal);
                r[at..at + 2].copy_from_slice(&pair);
                at += 2;
            }
        }
        if self.bounds[2] > 0.0 {
            let radius = self.bounds[2] * normal;
            r[at] = (-b[at] * self.per[3]).clamp(-radius, radius);
        }
    }
}

/// `-b per`, cut to the radius.
#[inline(always)]
pub fn disc(b1: f64, b2: f64, per: f64, radius: f64) -> [f64; 2] {
    let (x, y) = (-b1 * per, -b2 * per);
    let square = x * x + y * y;
    if square > radius * radius {
        let scale = ratio(radius, square);
        [scale * x, scale * y]
    } else {
        [x, y]
    }
}

/// `radius / sqrt(square)`. A call of its own: compilers would compute it for contacts that stick too, a third of their time.
#[inline(never)]
fn ratio(radius: f64, square: f64) -> f64 {
    radius / square.sqrt()
}

/// A sliding contact of three rows with any block.
#[derive(Clone, Copy, Debug)]
pub struct Coupled {
    /// `-A^-1`, row-major.
    inverse: [f64; 9],
    pub friction: f64,
}

impl Coupled {
    pub fn new(group: &RowGroup, a: &[f64]) -> Option<Coupled> {
        if group.bilateral || group.dim != 3 || group.bounds.sliding <= 0.0 {
            return None;
        }
        let cofactor = |i: usize, j: usize| {
            let (p, q, r, s) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
            a[3 * p + r] * a[3 * q + s] - a[3 * p + s] * a[3 * q + r]
        };
        let det = (0..3).map(|j| a[j] * cofactor(0, j)).sum::<f64>();
        if det <= SINGULAR * (a[0] * a[4] * a[8]).abs() {
            return None;
        }
        let mut inverse = [0.0; 9];
        for i in 0..3 {
            for j in 0..3 {
                inverse[3 * i + j] = -cofactor(j, i) / det;
            }
        }
        Some(Coupled {
            inverse,
            friction: group.bounds.sliding,
        })
    }

    /// Open, sticking, or slipping in a direction near the `last` one: the angle of `u_T` is a root of `tau x u_T`
    /// (`one_contact`), taken by Newton's method on a unit vector.
    #[inline]
    pub fn solve(&self, a: &[f64], b: [f64; 3], last: [f64; 3]) -> Option<[f64; 3]> {
        if b[0] >= 0.0 {
            return Some([0.0; 3]);
        }
        let mu = self.friction;
        let m = &self.inverse;
        let r = [0, 3, 6].map(|i| m[i] * b[0] + m[i + 1] * b[1] + m[i + 2] * b[2]);
        if r[0] >= 0.0 && r[1] * r[1] + r[2] * r[2] <= mu * mu * r[0] * r[0] {
            return Some(r);
        }
        let [x, y] = if last[1] != 0.0 || last[2] != 0.0 {
            [-last[1], -last[2]]
        } else {
            [b[1], b[2]]
        };
        let length = (x * x + y * y).sqrt();
        let (mut c, mut s) = (x / length, y / length);
        for _ in 0..STEPS {
            // tau = (c, s), its derivative (-s, c); v = u_T den, den = -b_N / r_N.
            let den = a[0] - mu * (a[1] * c + a[2] * s);
            let v1 = b[1] * den - b[0] * (a[3] - mu * (a[4] * c + a[5] * s));
            let v2 = b[2] * den - b[0] * (a[6] - mu * (a[7] * c + a[8] * s));
            let (cross, along) = (c * v2 - s * v1, c * v1 + s * v2);
            if cross.abs() <= ROUNDING * (v1.abs() + v2.abs()) {
                let n = -b[0] / den;
                return (den > 0.0 && along >= 0.0).then_some([n, -mu * n * c, -mu * n * s]);
            }
            let turn = -mu * (a[2] * c - a[1] * s);
            let w1 = b[1] * turn + b[0] * mu * (a[5] * c - a[4] * s);
            let w2 = b[2] * turn + b[0] * mu * (a[8] * c - a[7] * s);
            let step = cross / (along - (c * w2 - s * w1));
            if step.is_nan() || step.abs() > LONGEST {
                return None;
            }
            let shrink = 1.0 / (1.0 + step * step).sqrt();
            (c, s) = (shrink * (c - step * s), shrink * (s + step * c));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{group, miss};
    use super::*;
    use crate::solver::solve_contact;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn a_diagonal_block_is_solved_at_once(
            mask in 0usize..8,
            w in prop::array::uniform4(0.1f64..3.0),
            mu in prop::array::uniform3(0.05f64..1.5),
            b in prop::array::uniform8(-1.0f64..1.0),
        ) {
            let on = |k: usize| if mask >> k & 1 == 1 { mu[k] } else { 0.0 };
            let group = group(on(0), on(1), on(2));
            let n = group.dim;
            let mut a = vec![0.0; n * n];
            let mut parts = vec![w[0]];
            for (k, dim) in [(0, 2), (1, 2), (2, 1)] {
                if on(k) > 0.0 { parts.extend(vec![w[k + 1]; dim]); }
            }
            for i in 0..n { a[i * n + i] = parts[i]; }
            let simple = Simple::new(&group, &a).expect("a diagonal block");
            let mut r = vec![0.0; n];
            simple.solve(&b, &mut r);
            prop_assert!(miss(&group, &a, &b, &r) < 1e-14);
            if mask == 1 {
                prop_assert_eq!(&simple.solve_three([b[0], b[1], b[2], 0.0])[..], &r[..]);
            }
            if n > 1 {
                a[1] += 1e-9;
                prop_assert!(Simple::new(&group, &a).is_none());
            }
        }

        /// What the short way answers is a solution; where it has none the long way is asked.
        #[test]
        fn a_coupled_block_is_solved_or_left(
            g in prop::array::uniform9(-1.0f64..1.0),
            b in prop::array::uniform3(-1.0f64..1.0),
            last in prop::array::uniform3(-1.0f64..1.0),
            mu in 0.05f64..2.0,
        ) {
            let group = group(mu, 0.0, 0.0);
            let mut a = [0.0; 9];
            for i in 0..3 {
                for j in 0..3 {
                    a[3 * i + j] = (0..3).map(|k| g[3 * i + k] * g[3 * j + k]).sum::<f64>()
                        + if i == j { 0.1 } else { 0.0 };
                }
            }
            let coupled = Coupled::new(&group, &a).expect("a regular block");
            let mut long = last;
            solve_contact(&group, &a, &b, &mut long);
            if let Some(r) = coupled.solve(&a, b, last) {
                prop_assert!(miss(&group, &a, &b, &r) < 1e-12, "{r:?} {long:?}");
            }
        }
    }

    #[test]
    fn most_coupled_blocks_need_no_long_way() {
        // Blocks of bodies that are no spheres: coupling of a third of the diagonal.
        let a = [1.0, 0.3, -0.2, 0.3, 1.5, 0.1, -0.2, 0.1, 1.2];
        let coupled = Coupled::new(&group(0.5, 0.0, 0.0), &a).expect("a regular block");
        let count = (0..360).filter(|k| {
            let (s, c) = (*k as f64).to_radians().sin_cos();
            coupled
                .solve(&a, [-1.0, 2.0 * c, 2.0 * s], [0.0; 3])
                .is_some()
        });
        assert!(count.count() > 350);
    }

    #[test]
    fn joints_and_singular_blocks_are_left() {
        let joint = RowGroup {
            dim: 3,
            bilateral: true,
            ..RowGroup::default()
        };
        let unit = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        assert!(Simple::new(&joint, &unit).is_none() && Coupled::new(&joint, &unit).is_none());
        let ball = group(0.5, 0.0, 0.0);
        assert!(
            Simple::new(&ball, &[0.0; 9]).is_none() && Coupled::new(&ball, &[0.0; 9]).is_none()
        );
        assert!(Coupled::new(&ball, &[1.0; 9]).is_none());
    }
}
