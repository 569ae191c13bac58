//! The residual by which all solvers are judged: the natural map of the cone problem, computed outside of them.

use super::{Problem, RowGroup};
use crate::cone::{norm, MAX_ROWS};

/// Nearest point of the cone `K = { r_N >= least, |r_b| <= mu_b r_N }` to `x`, in place. (Where `least` is above 0 it is cut off there.)
///
/// Given the height `t` of the result each disc is cut to `mu_b t`, so `t` minimises
/// `(t - x_N)^2 + sum_b max(0, |x_b| - mu_b t)^2`; with the `k` discs of largest `|x_b|/mu_b` cut the minimum is in closed
/// form, and the first `k` whose `t` is not below the next ratio is right. It is convex: `t` is not below `least`.
pub fn project_cone(group: &RowGroup, x: &mut [f64]) {
    if group.bilateral {
        return;
    }
    // (ratio, length, bound) of each disc, by descending ratio.
    let mut discs = [(0.0, 0.0, 0.0); 3];
    let mut count = 0;
    for disc in group.bounds.discs() {
        let length = norm(&x[disc.start..disc.start + disc.dim]);
        let mut at = count;
        let entry = (length / disc.bound, length, disc.bound);
        while at > 0 && discs[at - 1].0 < entry.0 {
            discs[at] = discs[at - 1];
            at -= 1;
        }
        discs[at] = entry;
        count += 1;
    }
    let (mut above, mut below) = (x[0], 1.0);
    let mut height = above;
    for &(ratio, length, bound) in &discs[..count] {
        if height >= ratio {
            break;
        }
        above += bound * length;
        below += bound * bound;
        height = above / below;
    }
    let height = height.max(group.least);
    x[0] = height;
    for disc in group.bounds.discs() {
        let part = &mut x[disc.start..disc.start + disc.dim];
        let (length, radius) = (norm(part), disc.bound * height);
        if length > radius {
            let scale = radius / length;
            part.iter_mut().for_each(|v| *v *= scale);
        }
    }
}

/// `s(u) = sum_b mu_b |u_b|` of one contact.
#[inline]
pub fn shift(group: &RowGroup, u: &[f64]) -> f64 {
    if group.bilateral {
        return 0.0;
    }
    group
        .bounds
        .discs()
        .map(|d| d.bound * norm(&u[d.start..d.start + d.dim]))
        .sum()
}

/// `F = r - P_K(r - (u + s(u) n))` of one contact; for a joint `F = u`.
#[inline]
pub fn natural_part(group: &RowGroup, r: &[f64], u: &[f64]) -> [f64; MAX_ROWS] {
    let mut f = [0.0; MAX_ROWS];
    if group.bilateral {
        f[..group.dim].copy_from_slice(u);
        return f;
    }
    let mut x = [0.0; MAX_ROWS];
    for (x, (r, u)) in x.iter_mut().zip(r.iter().zip(u)) {
        *x = r - u;
    }
    x[0] -= shift(group, u);
    project_cone(group, &mut x[..group.dim]);
    for (f, (r, x)) in f.iter_mut().zip(r.iter().zip(&x)) {
        *f = r - x;
    }
    f
}

/// Sizes (in the unit of the problem) that have squares, and so have parts of them that are 1e-20 times as large. Wider, norms
/// are 0 or infinite and `err` is NaN.
const SQUARES: std::ops::Range<f64> = 1e-130..1e130;

/// `err = |F| / max(|q|, |r|, |u|)`; 0 where all three are 0, infinite if `r` or `u` is not finite. Writes `u = W r + q`.
pub fn residual(problem: &Problem, r: &[f64], u: &mut [f64]) -> f64 {
    residuals(problem, r, u)[0]
}

/// [`residual`], and `|F|` and `|min(u_N, 0)|` over `max(|q|, |u|)`: forces that run away on a singular W make the first as small as one likes where
/// contacts cannot be kept apart, but not the others; and so does friction that lets the cone be nearly a half-space, beside which `F` is `u_N/mu`.
pub fn residuals(problem: &Problem, r: &[f64], u: &mut [f64]) -> [f64; 3] {
    problem.velocity(r, u);
    let (moves, force) = (norm(&problem.q).max(norm(u)), norm(r));
    if SQUARES.contains(&moves.max(force)) {
        let sizes = natural_map(problem, r, u);
        return quotients(sizes, moves, force);
    }
    // Homogeneous of degree 1: measured in units of the largest number. A NaN is lost neither here nor above.
    let mut largest = 0.0;
    for v in problem.q.iter().chain(r).chain(u.iter()) {
        if !v.is_finite() {
            return [f64::INFINITY; 3];
        }
        largest = v.abs().max(largest);
    }
    if largest == 0.0 {
        return [0.0; 3];
    }
    let units = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| x / largest).collect() };
    let (q, r, u) = (units(&problem.q), units(r), units(u));
    let f = natural_map(problem, &r, &u);
    quotients(f, norm(&q).max(norm(&u)), norm(&r))
}

fn quotients([f, closing]: [f64; 2], moves: f64, force: f64) -> [f64; 3] {
    let over = |size: f64, by: f64| if size == 0.0 { 0.0 } else { size / by };
    match f.is_finite() {
        true => [
            over(f, moves.max(force)),
            over(f, moves),
            over(closing, moves),
        ],
        false => [f64::INFINITY; 3],
    }
}

/// `|F|` and `|min(u_N, 0)|`.
fn natural_map(problem: &Problem, r: &[f64], u: &[f64]) -> [f64; 2] {
    let (mut sum, mut closing) = (0.0, 0.0);
    for group in &problem.groups {
        let rows = group.rows();
        if !group.bilateral {
            closing += u[rows.start].min(0.0).powi(2);
        }
        let f = natural_part(group, &r[rows.clone()], &u[rows]);
        sum += f.iter().map(|f| f * f).sum::<f64>();
    }
    [sum, closing].map(f64::sqrt)
}
