//! A slide out of line, with rolling resistance: slip `u` and the part `q = r n x w` of it that turning makes change by
//!
//! ```text
//! v' = -a u/|u|,   q' = -c u/|u| - b q/|q|,   u = v + q
//! ```
//!
//! and turn. There is no closed form. The power series of the motion about any moment is computed term by term: with `s = |u|` and `e = u/s`,
//! `s' = e u'` and `s e = u` give each term from those before. Its last terms are then replaced by lower ones that differ least over the piece
//! (Chebyshev's polynomials in place of powers: C. Lanczos, *Applied Analysis*, 1956, ch. VII): a piece is longer than a series of so few terms holds.
//! A slide is some tens of such pieces.

use glam::{DVec2, DVec3};

/// Terms of a place. More: fewer pieces, each with more work; and the squares of the last terms leave the range of numbers where turning is about to
/// change its direction (in 1e-12 s at least).
pub const TERMS: usize = 13;
/// Terms of a velocity that are kept.
const KEPT: usize = TERMS - 1;
/// Terms of a velocity that are computed. More: longer pieces, by less and less.
const ALL: usize = 20;
/// First terms of a velocity that stay as they are: what touches is asked for them.
const FIRST: usize = 3;
/// Size of what is left out of a velocity at the end of a piece, over the speeds of the ball (1). Larger: not exact; smaller: more pieces.
const LAST: f64 = 5e-15;
/// Share (1) of what is left of a slide that a piece may take: beyond its end a series means nothing.
const MOST: f64 = 0.9;

/// A power series of vectors in the surface.
type Series = [DVec2; ALL];

/// What takes from `v` and `q`, m/s^2: friction on the centre `a`, on turning `c`, rolling resistance on turning `b`.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    pub a: f64,
    pub b: f64,
    pub c: f64,
}

/// What a power of a share in `[0, 1]` is about, from [`KEPT`] on, in lower ones: `x^k` less `x^3 T(x)`, with Chebyshev's polynomial.
const LOWER: [[f64; ALL]; ALL - KEPT] = lower();
/// By how much that is wrong.
const ERROR: [f64; ALL - KEPT] = error();

const fn lower() -> [[f64; ALL]; ALL - KEPT] {
    let mut rows = [[0.0; ALL]; ALL - KEPT];
    // T of (2 x - 1): 1, 2 x - 1, then (4 x - 2) T - the one before.
    let (mut before, mut now) = ([0.0; ALL + 1], [0.0; ALL + 1]);
    before[0] = 1.0;
    (now[0], now[1]) = (-1.0, 2.0);
    let mut n = 1;
    while n + FIRST < ALL {
        if n + FIRST >= KEPT {
            let mut k = 0;
            while k < n {
                rows[n + FIRST - KEPT][k + FIRST] = -now[k] / now[n];
                k += 1;
            }
        }
        let mut next = [0.0; ALL + 1];
        let mut k = 0;
        while k < ALL {
            let below = if k > 0 { now[k - 1] } else { 0.0 };
            next[k] = 4.0 * below - 2.0 * now[k] - before[k];
            k += 1;
        }
        (before, now) = (now, next);
        n += 1;
    }
    rows
}

const fn error() -> [f64; ALL - KEPT] {
    let mut errors = [0.0; ALL - KEPT];
    let mut k = 0;
    while k < ALL - KEPT {
        errors[k] = 2.0 / (1u64 << (2 * (k + KEPT - FIRST))) as f64;
        k += 1;
    }
    errors
}

/// Terms of two vectors in the surface: of `u` and `q`, their sizes or their directions.
type Both = [f64; 4];

/// Sizes and directions of two series whose first `k` terms are known, term by term.
#[derive(Default)]
struct Directions {
    /// Term `k + 1` times `k + 1`, and the size.
    rates: [[Both; 2]; ALL],
    along: [Both; ALL],
    first: Both,
}

impl Directions {
    /// Term `k` of both directions, from terms up to `k`.
    fn term(&mut self, of: Both, k: usize) -> [DVec2; 2] {
        let twice = |a: Both| [a[0] + a[1], a[0] + a[1], a[2] + a[3], a[2] + a[3]];
        let mut rest = of;
        if k == 0 {
            self.first = twice(of.map(|u| u * u)).map(f64::sqrt);
        } else {
            self.rates[k - 1][0] = of.map(|u| k as f64 * u);
            let mut sums = [[0.0; 4]; 2];
            for (factors, e) in self.rates[..k].iter().zip(self.along[..k].iter().rev()) {
                for (sum, factor) in sums.iter_mut().zip(factors) {
                    for i in 0..4 {
                        sum[i] += factor[i] * e[i];
                    }
                }
            }
            let size = twice(sums[0]).map(|rise| rise / k as f64);
            self.rates[k - 1][1] = size;
            rest = std::array::from_fn(|i| of[i] - sums[1][i] - size[i] * self.along[0][i]);
        }
        let found: Both = std::array::from_fn(|i| rest[i] / self.first[i]);
        self.along[k] = found;
        [
            DVec2::new(found[0], found[1]),
            DVec2::new(found[2], found[3]),
        ]
    }
}

/// Terms of `v` and `q` on a surface with normal `n`, and for how long they hold, s.
pub fn series(v: DVec3, q: DVec3, n: DVec3, rates: Rates) -> ([DVec3; KEPT], [DVec3; KEPT], f64) {
    let along = (v + q).normalize();
    let across = n.cross(along);
    let flat = |d: DVec3| DVec2::new(along.dot(d), across.dot(d));
    let (mut v, mut q, mut u) = ([flat(v); ALL], [flat(q); ALL], [flat(v + q); ALL]);
    // Time in units of what is left at least until something ends: terms then have sizes that numbers have.
    let (slip, turning) = (u[0].length(), q[0].length());
    let unit = slip.min(turning) / (rates.a + rates.b + rates.c);
    let mut directions = Directions::default();
    for k in 0..ALL - 1 {
        let [of_u, of_q] = directions.term([u[k].x, u[k].y, q[k].x, q[k].y], k);
        let by = unit / (k + 1) as f64;
        v[k + 1] = -rates.a * by * of_u;
        q[k + 1] = -by * (rates.c * of_u + rates.b * of_q);
        u[k + 1] = v[k + 1] + q[k + 1];
    }
    let last = LAST * (v[0].length() + turning);
    // Until a term times its share in an error is below rounding.
    let holds = |k: usize, share: f64| {
        let size = share * share * q[k].length_squared().max(u[k].length_squared());
        (last * last / size).powf(0.5 / k as f64)
    };
    let share = holds(ALL - 1, 1.0)
        .min(holds(ALL - 2, 1.0))
        .min(holds(KEPT, ERROR[0]))
        .min(holds(KEPT + 1, ERROR[1]))
        .min(MOST * slip / slip.min(turning));
    let kept = |series: Series| {
        let mut d = series;
        let mut power = 1.0;
        for d in &mut d {
            *d *= power;
            power *= share;
        }
        for k in (KEPT..ALL).rev() {
            let high = d[k];
            for (low, of) in d[FIRST..k].iter_mut().zip(&LOWER[k - KEPT][FIRST..k]) {
                *low += *of * high;
            }
        }
        let (mut power, by) = (1.0, 1.0 / (unit * share));
        let mut found = [DVec3::ZERO; KEPT];
        for (found, d) in found.iter_mut().zip(d) {
            *found = power * (d.x * along + d.y * across);
            power *= by;
        }
        found
    };
    (kept(v), kept(q), unit * share)
}
