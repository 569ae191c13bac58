//! One contact with all others held: `u = A r + b`, solved exactly for any block `A`.

use crate::cone::MAX_ROWS;
use crate::direct::dense;
use crate::problem::RowGroup;

/// Coupling over the diagonal (1) that counts as none: spheres, whose blocks are diagonal up to rounding. Larger, the closed
/// form of spheres answers for other bodies, with an error of this size; 0, it is never taken.
pub(super) const ISOTROPIC: f64 = 1e-14;
/// Directions of slip (1) tried when none is known. With few, two roots lie between neighbours and neither is found.
const DIRECTIONS: usize = 24;
/// Rounding of an angle's equation (1). With 0 a contact between sticking and slipping has no solution.
const NEARLY: f64 = 1e-13;
/// Determinant over the diagonal's product (1) that counts as 0: rounding. Smaller, noise passes as a sticking force, and
/// sweeps diverge.
pub(super) const SINGULAR: f64 = 1e-14;
/// First turn (rad) of the secant around the last direction of slip, and steps (1) before all directions are tried.
const FIRST_TURN: f64 = 1e-4;
const SECANTS: usize = 12;
/// A longer turn (rad) is given up: it may end at the root of another direction.
const LONGEST_TURN: f64 = 0.7;
/// A shorter one (rad) is rounding.
const LEAST_TURN: f64 = 1e-15;
/// Steps (1) of a bracketed root search: more than doubles the bits of a double.
const ROOT_STEPS: usize = 100;
/// Rounds (1) between the discs of a contact with rolling or spinning rows; bounds the time of one contact. Sweeps come back to
/// it anyway.
const ROUNDS: usize = 20;

/// Writes the multipliers `r` of a contact with block `a` (row-major) and free part `b`; `r` holds the last ones.
pub fn solve_contact(group: &RowGroup, a: &[f64], b: &[f64], r: &mut [f64]) {
    if group.bilateral {
        return solve_free(a, b, r);
    }
    let sliding = group.bounds.sliding > 0.0;
    match (group.dim, sliding) {
        (1, _) => r[0] = normal(a[0], b[0]),
        (3, true) => {
            let block = [a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8]];
            let x = coulomb(
                &block,
                [b[0], b[1], b[2]],
                group.bounds.sliding,
                [r[0], r[1], r[2]],
            );
            r.copy_from_slice(&x);
        }
        _ => solve_discs(group, a, b, r),
    }
}

#[inline]
fn normal(a: f64, b: f64) -> f64 {
    if b < 0.0 && a > 0.0 {
        -b / a
    } else {
        0.0
    }
}

/// A joint: `A r = -b`; where A is singular its rows are relaxed one by one.
fn solve_free(a: &[f64], b: &[f64], r: &mut [f64]) {
    let n = b.len();
    let mut lu = [0.0; MAX_ROWS * MAX_ROWS];
    let mut pivots = [0u32; MAX_ROWS];
    lu[..n * n].copy_from_slice(a);
    if dense::lu_factor(&mut lu[..n * n], n, &mut pivots[..n]).is_ok() {
        r.iter_mut().zip(b).for_each(|(r, b)| *r = -b);
        dense::lu_solve(&lu[..n * n], n, &pivots[..n], r);
        return;
    }
    for i in 0..n {
        let u: f64 = b[i] + (0..n).map(|j| a[i * n + j] * r[j]).sum::<f64>();
        if a[i * n + i] > 0.0 {
            r[i] -= u / a[i * n + i];
        }
    }
}

/// Coulomb's contact: open, sticking, or slipping against `u_T`, whichever holds.
pub fn coulomb(a: &[f64; 9], b: [f64; 3], mu: f64, last: [f64; 3]) -> [f64; 3] {
    if b[0] >= 0.0 {
        return [0.0; 3];
    }
    let tiny = ISOTROPIC * a[4];
    if a[1].abs() + a[2].abs() + a[3].abs() + a[6].abs() <= tiny
        && a[5].abs() + a[7].abs() + (a[4] - a[8]).abs() <= tiny
    {
        let n = normal(a[0], b[0]);
        let radius = mu * n;
        let (x, y) = if a[4] > 0.0 {
            (-b[1] / a[4], -b[2] / a[4])
        } else {
            (-b[1], -b[2]) // no force holds it: slip, or nothing to hold
        };
        let scale = onto((x * x + y * y).sqrt(), radius, a[4] <= 0.0);
        return [n, scale * x, scale * y];
    }
    if let Some(r) = stick(a, b) {
        if r[0] >= 0.0 && r[1] * r[1] + r[2] * r[2] <= mu * mu * r[0] * r[0] {
            return r;
        }
    }
    slip(a, b, mu, last).unwrap_or_else(|| {
        // No direction of slip is consistent (an unsymmetric block, or rounding): a projected step.
        let n = normal(a[0], b[0] + a[1] * last[1] + a[2] * last[2]);
        let t = a[4].max(a[8]).max(f64::MIN_POSITIVE);
        let u1 = b[1] + a[3] * n + a[4] * last[1] + a[5] * last[2];
        let u2 = b[2] + a[6] * n + a[7] * last[1] + a[8] * last[2];
        let (x, y) = (last[1] - u1 / t, last[2] - u2 / t);
        let scale = onto((x * x + y * y).sqrt(), mu * n, false);
        [n, scale * x, scale * y]
    })
}

/// The factor that brings a vector of this length into a disc, or onto its edge.
#[inline]
fn onto(length: f64, radius: f64, edge: bool) -> f64 {
    if length > radius || edge {
        radius / length.max(f64::MIN_POSITIVE)
    } else {
        1.0
    }
}

/// `-A^-1 b`.
fn stick(a: &[f64; 9], b: [f64; 3]) -> Option<[f64; 3]> {
    let c = [
        a[4] * a[8] - a[5] * a[7],
        a[5] * a[6] - a[3] * a[8],
        a[3] * a[7] - a[4] * a[6],
    ];
    let det = a[0] * c[0] + a[1] * c[1] + a[2] * c[2];
    let size = a[0].abs() * a[4].abs() * a[8].abs();
    if det.is_nan() || det.abs() <= SINGULAR * size {
        return None;
    }
    let (x, y, z) = (-b[0], -b[1], -b[2]);
    Some([
        (x * c[0] + y * (a[2] * a[7] - a[1] * a[8]) + z * (a[1] * a[5] - a[2] * a[4])) / det,
        (x * c[1] + y * (a[0] * a[8] - a[2] * a[6]) + z * (a[2] * a[3] - a[0] * a[5])) / det,
        (x * c[2] + y * (a[1] * a[6] - a[0] * a[7]) + z * (a[0] * a[4] - a[1] * a[3])) / det,
    ])
}

/// Slip with direction `tau` of `u_T`: `u_N = 0`, `r_T = -mu r_N tau`, `u_T` along `tau`. The angle of `tau` is a root of
/// `tau x u_T`; times the positive `-b_N / r_N` that is a trigonometric polynomial of degree 2, finite all around:
/// at most four roots, and at most four extrema between them.
fn slip(a: &[f64; 9], b: [f64; 3], mu: f64, last: [f64; 3]) -> Option<[f64; 3]> {
    // v = p + q cos + r sin, by rows of the tangent.
    let row = |k: usize| {
        [
            b[k] * a[0] - b[0] * a[3 * k],
            mu * (b[0] * a[3 * k + 1] - b[k] * a[1]),
            mu * (b[0] * a[3 * k + 2] - b[k] * a[2]),
        ]
    };
    let rows = [row(1), row(2)];
    let at = |angle: f64| {
        let (s, c) = angle.sin_cos();
        let [v1, v2] = rows.map(|[p, q, r]| p + q * c + r * s);
        let [d1, d2] = rows.map(|[_, q, r]| r * c - q * s);
        let along = c * v1 + s * v2;
        Trial {
            angle,
            cross: c * v2 - s * v1,
            slope: c * d2 - s * d1 - along,
            along,
            size: v1.abs() + v2.abs(),
            den: a[0] - mu * (a[1] * c + a[2] * s),
        }
    };
    let force = |t: &Trial| {
        let n = -b[0] / t.den;
        let (s, c) = t.angle.sin_cos();
        [n, -mu * n * c, -mu * n * s]
    };
    let start = if last[1] != 0.0 || last[2] != 0.0 {
        (-last[2]).atan2(-last[1])
    } else {
        b[2].atan2(b[1])
    };
    // Near the last direction first, then all around.
    if let Some(t) = secant(&at, start).filter(|t| t.den > 0.0 && t.along >= 0.0) {
        return Some(force(&t));
    }
    let step = std::f64::consts::TAU / DIRECTIONS as f64;
    let mut best: Option<Trial> = None;
    let mut keep = |t: Trial| {
        // A contact between sticking and slipping has `u_T = 0` up to rounding.
        let fits = t.den > 0.0 && t.along >= -NEARLY * t.den * (b[1].abs() + b[2].abs());
        if fits
            && best
                .as_ref()
                .is_none_or(|b| t.along * b.den > b.along * t.den)
        {
            best = Some(t);
        }
    };
    let mut before = at(start);
    for k in 1..=DIRECTIONS {
        let here = at(start + step * k as f64);
        if before.differs(&here) {
            keep(bracketed(&at, before, here, |t| t.cross));
        } else if before.cross * before.slope < 0.0 && here.cross * here.slope > 0.0 {
            // Towards zero and away again: two roots may hide around the extremum.
            let low = bracketed(&at, before, here, |t| t.slope);
            if before.differs(&low) {
                keep(bracketed(&at, before, low, |t| t.cross));
                keep(bracketed(&at, low, here, |t| t.cross));
            } else if low.cross.abs() <= NEARLY * low.size {
                keep(low);
            }
        }
        before = here;
    }
    best.map(|t| force(&t))
}

/// One direction of slip: `tau x v` and its slope over the angle, `tau . v` and the size of `v = u_T den`, with
/// `den = -b_N / r_N`.
#[derive(Clone, Copy)]
struct Trial {
    angle: f64,
    cross: f64,
    slope: f64,
    along: f64,
    size: f64,
    den: f64,
}

impl Trial {
    fn differs(&self, other: &Trial) -> bool {
        (self.cross < 0.0) != (other.cross < 0.0)
    }
}

fn secant(at: &impl Fn(f64) -> Trial, start: f64) -> Option<Trial> {
    let (mut x0, mut x1) = (start, start + FIRST_TURN);
    let mut f0 = at(x0).cross;
    for _ in 0..SECANTS {
        let t = at(x1);
        if t.cross.abs() <= 4.0 * f64::EPSILON * t.size {
            return Some(t);
        }
        let slope = (t.cross - f0) / (x1 - x0);
        let next = x1 - t.cross / slope;
        if !next.is_finite() || (next - x1).abs() > LONGEST_TURN {
            return None;
        }
        if (next - x1).abs() < LEAST_TURN {
            return Some(t);
        }
        (x0, f0, x1) = (x1, t.cross, next);
    }
    None
}

/// The root of `of` between two directions where it differs in sign: a bracketed secant (Illinois).
fn bracketed(
    at: &impl Fn(f64) -> Trial,
    low: Trial,
    high: Trial,
    of: impl Fn(&Trial) -> f64,
) -> Trial {
    let (mut x0, mut f0, mut x1, mut f1) = (low.angle, of(&low), high.angle, of(&high));
    let mut found = if f0.abs() < f1.abs() { low } else { high };
    let mut side = 0;
    for _ in 0..ROOT_STEPS {
        let mut x = (x0 * f1 - x1 * f0) / (f1 - f0);
        if !(x > x0.min(x1) && x < x0.max(x1)) {
            x = 0.5 * (x0 + x1);
        }
        let here = at(x);
        let f = of(&here);
        if f.abs() <= of(&found).abs() {
            found = here;
        }
        if f == 0.0 || (x1 - x0).abs() < LEAST_TURN * (1.0 + x.abs()) {
            break;
        }
        if (f < 0.0) == (f1 < 0.0) {
            (x1, f1) = (x, f);
            if side == -1 {
                f0 *= 0.5;
            }
            side = -1;
        } else {
            (x0, f0) = (x, f);
            if side == 1 {
                f1 *= 0.5;
            }
            side = 1;
        }
    }
    found
}

/// Sliding, rolling and spinning in turn, each exactly with the others held, until nothing moves.
fn solve_discs(group: &RowGroup, a: &[f64], b: &[f64], r: &mut [f64]) {
    let n = group.dim;
    let head = if group.bounds.sliding > 0.0 { 3 } else { 1 };
    let mut before = [0.0; MAX_ROWS];
    for _ in 0..ROUNDS {
        before[..n].copy_from_slice(r);
        let free = |r: &[f64], row: usize, skip: std::ops::Range<usize>| {
            b[row]
                + (0..n)
                    .filter(|j| !skip.contains(j))
                    .map(|j| a[row * n + j] * r[j])
                    .sum::<f64>()
        };
        if head == 3 {
            let mut block = [0.0; 9];
            for i in 0..3 {
                block[3 * i..3 * i + 3].copy_from_slice(&a[i * n..i * n + 3]);
            }
            let rest = [free(r, 0, 0..3), free(r, 1, 0..3), free(r, 2, 0..3)];
            let x = coulomb(&block, rest, group.bounds.sliding, [r[0], r[1], r[2]]);
            r[..3].copy_from_slice(&x);
        } else {
            r[0] = normal(a[0], free(r, 0, 0..1));
        }
        for disc in group.bounds.discs().filter(|d| d.start >= head) {
            let rows = disc.start..disc.start + disc.dim;
            let radius = disc.bound * r[0];
            let largest = rows.clone().map(|i| a[i * n + i]).fold(0.0, f64::max);
            let mut target = [0.0; 2];
            let (mut length, mut speed) = (0.0, 0.0);
            for (t, i) in target.iter_mut().zip(rows.clone()) {
                let u = free(r, i, 0..0);
                *t = if largest > 0.0 {
                    r[i] - u / largest
                } else {
                    -u
                };
                length += *t * *t;
                speed += u * u;
            }
            // No force holds a disc without stiffness: it moves, at its bound, or nothing is to be held.
            let full = largest <= 0.0 && speed > 0.0;
            let scale = onto(length.sqrt(), radius, full);
            for (t, i) in target.iter().zip(rows) {
                r[i] = scale * t;
            }
        }
        let moved = before[..n]
            .iter()
            .zip(r.iter())
            .map(|(x, y)| (x - y).abs())
            .fold(0.0, f64::max);
        let size = r.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if moved <= 1e-15 * size {
            break;
        }
    }
}
