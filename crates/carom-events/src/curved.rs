//! A slide out of line, with rolling resistance: slip `u` and the part `q = r n x w` of it that turning makes change by
//!
//! ```text
//! v' = -a u/|u|,   q' = -c u/|u| - b q/|q|,   u = v + q
//! ```
//!
//! and turn. There is no closed form; the power series of the motion about any moment is computed term by term, and holds for as long as its last
//! terms are below rounding. A slide is some tens of such pieces.

use glam::DVec3;

/// Terms of a place. More: fewer pieces, each with more work; and the squares of the last terms leave the range of numbers where turning is about to
/// change its direction (in 1e-12 s at least).
pub const TERMS: usize = 13;
/// Size of the last terms of a slip at the end of a piece, over the speeds of the ball (1). Larger: not exact; smaller: more pieces.
const LAST: f64 = 1e-14;
/// Share (1) of what is left of a slide that a piece may take: beyond its end a series means nothing.
const MOST: f64 = 0.5;

/// A power series of vectors.
type Series = [DVec3; TERMS - 1];

/// What takes from `v` and `q`, m/s^2: friction on the centre `a`, on turning `c`, rolling resistance on turning `b`.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    pub a: f64,
    pub b: f64,
    pub c: f64,
}

/// Direction of a series whose first `k` terms are known, term by term.
#[derive(Default)]
struct Direction {
    square: [f64; TERMS - 1],
    /// Of `1/|u|`.
    inverse: [f64; TERMS - 1],
}

impl Direction {
    /// Term `k` of `u/|u|`, from terms up to `k` of `u`.
    fn term(&mut self, u: &Series, k: usize) -> DVec3 {
        self.square[k] = (0..=k).map(|i| u[i].dot(u[k - i])).sum();
        let (s, y) = (&self.square, &mut self.inverse);
        y[k] = if k == 0 {
            1.0 / s[0].sqrt()
        } else {
            let terms = (1..=k).map(|j| (-0.5 * j as f64 - (k - j) as f64) * s[j] * y[k - j]);
            terms.sum::<f64>() / (k as f64 * s[0])
        };
        (0..=k).map(|i| u[i] * self.inverse[k - i]).sum()
    }
}

/// Series of `v` and `q`, and for how long they hold, s.
pub fn series(v: DVec3, q: DVec3, rates: Rates) -> (Series, Series, f64) {
    let mut s = [[DVec3::ZERO; TERMS - 1]; 3];
    (s[0][0], s[1][0], s[2][0]) = (v, q, v + q);
    let (mut along_u, mut along_q) = (Direction::default(), Direction::default());
    for k in 0..TERMS - 2 {
        let (u, q) = (along_u.term(&s[2], k), along_q.term(&s[1], k));
        let dv = -rates.a * u;
        let dq = -rates.c * u - rates.b * q;
        let next = 1.0 / (k + 1) as f64;
        (s[0][k + 1], s[1][k + 1], s[2][k + 1]) = (next * dv, next * dq, next * (dv + dq));
    }
    let last = LAST * (v.length() + q.length());
    let left = MOST * (v + q).length() / (rates.a + rates.b + rates.c);
    let holds = |k: usize| {
        let size = s[1][k].length_squared().max(s[2][k].length_squared());
        (last * last / size).powf(0.5 / k as f64)
    };
    (s[0], s[1], holds(TERMS - 2).min(holds(TERMS - 3)).min(left))
}
