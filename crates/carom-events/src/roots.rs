//! The first time at which a polynomial falls through zero: what a gap does where two bodies meet.
//!
//! On `[0, end]` a polynomial lies within the hull of its Bernstein coefficients, and has no more roots than these have changes of sign.
//! So an interval without a change has no root, one with a single change has exactly one, and all others are halved, left half
//! first. What is left is one root between two times, for Newton's method held between them. No root is guessed at, and none
//! is passed over that is deeper than rounding: a polynomial that dips below zero by less than that only grazes.

/// Halvings of an interval. Its length is then a rounding of `end`: what happens within has no order any more.
const DEEPEST: u32 = 52;
/// Steps of the bracketed search. Each at least halves the bracket every other time; a root takes about five.
const MOST_STEPS: u32 = 128;
/// Rounding of a Bernstein coefficient over the sum of its parts (1). Smaller: grazing polynomials are halved in vain. Larger: shallow dips are
/// taken for grazing.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A bound is more by this (1): of its rounding.
const MORE: f64 = 1.0 + 64.0 * f64::EPSILON;

/// Value of a polynomial, lowest coefficient first.
#[inline]
pub fn value<const N: usize>(c: &[f64; N], t: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

/// Value and slope.
#[inline]
fn value_and_slope<const N: usize>(c: &[f64; N], t: f64) -> (f64, f64) {
    c.iter()
        .rev()
        .fold((0.0, 0.0), |(v, s), c| (v * t + c, s * t + v))
}

/// The polynomial as one of `t - from`.
pub fn shifted<const N: usize>(mut c: [f64; N], from: f64) -> [f64; N] {
    for k in 0..N {
        for i in (k..N - 1).rev() {
            c[i] += from * c[i + 1];
        }
    }
    c
}

/// The polynomial without its root at 0, divided by `t`.
pub fn deflated<const N: usize>(mut c: [f64; N]) -> [f64; N] {
    c.rotate_left(1);
    c[N - 1] = 0.0;
    c
}

/// The first time in `(0, end]` at which the polynomial goes from above zero to zero or below. One that starts at or below zero
/// has to rise first.
pub fn first_fall<const N: usize>(c: &[f64; N], end: f64) -> Option<f64> {
    if end.is_nan() || end <= 0.0 {
        return None;
    }
    // Coefficients over the unit interval, and those of Bernstein by sums along Pascal's triangle.
    let (mut a, mut power) = (*c, 1.0);
    for a in &mut a {
        *a *= power;
        power *= end;
    }
    // What all terms that fall can take is not enough, in most cases.
    let falls: f64 = a[1..].iter().map(|a| a.min(0.0)).sum();
    if a[0] + MORE * falls > 0.0 {
        return None;
    }
    let (mut b, mut choose) = (a, 1.0);
    for k in 1..N {
        choose *= (N - k) as f64 / k as f64;
        b[k] = a[k] / choose;
    }
    for pass in 1..N {
        for i in (pass..N).rev() {
            b[i] += b[i - 1];
        }
    }
    // Most pairs never come near.
    if b.iter().all(|&b| b > 0.0) {
        return None;
    }
    let mut search = Search {
        a,
        size: a.map(f64::abs),
        above: a[0] > 0.0,
    };
    search.within(&b, 0.0, 1.0, 0).map(|u| u * end)
}

struct Search<const N: usize> {
    /// Over the unit interval.
    a: [f64; N],
    /// Its coefficients without their signs: at the end of an interval the sum of what was added up in it.
    size: [f64; N],
    /// Whether it was above zero at the start of the interval at hand.
    above: bool,
}

impl<const N: usize> Search<N> {
    /// The fall in `[start, start + width]`, where the Bernstein coefficients are `b`.
    fn within(&mut self, b: &[f64; N], start: f64, width: f64, depth: u32) -> Option<f64> {
        let noise = ROUNDING * value(&self.size, start + width);
        if b.iter().all(|&b| b >= -noise) {
            // Never deeper than rounding.
            self.above |= b.iter().any(|&b| b > noise);
            return None;
        }
        if b.iter().all(|&b| b < noise) {
            return self.above.then_some(start);
        }
        let changes = b
            .windows(2)
            .filter(|w| (w[0] > 0.0) != (w[1] > 0.0))
            .count();
        if changes == 1 {
            if b[0] > 0.0 {
                return Some(self.refine(start, start + width));
            }
            if !self.above {
                self.above = true;
                return None;
            }
            // It was above, and is below from here on, by more than rounding perhaps: it falls where this interval begins.
            return Some(start);
        }
        if depth == DEEPEST {
            if self.above && b[N - 1] < 0.0 {
                return Some(start);
            }
            self.above = b[N - 1] > 0.0;
            return None;
        }
        let (left, right) = halves(b);
        let half = 0.5 * width;
        self.within(&left, start, half, depth + 1)
            .or_else(|| self.within(&right, start + half, half, depth + 1))
    }

    /// The only root between two places of the unit interval, above zero at `low` and below at `high`: Newton's method, or a halving
    /// where it leaves the bracket or gains too little.
    fn refine(&self, mut low: f64, mut high: f64) -> f64 {
        let mut u = 0.5 * (low + high);
        let mut last = high - low;
        for _ in 0..MOST_STEPS {
            let (v, slope) = value_and_slope(&self.a, u);
            if v > 0.0 {
                low = u;
            } else {
                high = u;
            }
            let step = -v / slope;
            let newton = u + step;
            let inside = newton > low && newton < high && 2.0 * step.abs() < last;
            let next = if inside { newton } else { 0.5 * (low + high) };
            last = (next - u).abs();
            if v == 0.0 || last <= f64::EPSILON * next.abs() || next == low || next == high {
                return if v == 0.0 { u } else { next };
            }
            u = next;
        }
        u
    }
}

/// Bernstein coefficients of both halves of an interval, by de Casteljau.
fn halves<const N: usize>(b: &[f64; N]) -> ([f64; N], [f64; N]) {
    let (mut left, mut right) = (*b, *b);
    for k in 1..N {
        for i in 0..N - k {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
        left[k] = right[0];
    }
    (left, right)
}

/// All falls in `(0, end]`, one after the other.
pub fn falls<const N: usize>(c: [f64; N], end: f64) -> impl Iterator<Item = f64> {
    let (mut c, mut at) = (c, 0.0);
    std::iter::from_fn(move || {
        let next = first_fall(&c, end - at)?;
        at += next;
        // From there on, below zero.
        c = shifted(c, next);
        c[0] = 0.0;
        Some(at)
    })
}
