//! Primal-dual path following on the cones, with the slip shift of Coulomb's law in its equations.
//!
//! With `A_b r = (mu_b r_N, r_b)` in the second-order cone `Q_b` for each disc (`r_N >= 0` alone without discs) and duals
//! `l_b = (l_0, l_1)` in `Q_b`, perpendicular to `A_b r`, the problem is
//!
//! ```text
//! (W r + q)_b = l_1 for each disc,      (W r + q)_N = sum_b mu_b (l_0 - |l_1|^2 / l_0).
//! ```
//!
//! The right side is 0 where the contact slips (`l_0 = |l_1|`) or sticks (`l = 0`) and anything positive where it opens:
//! Coulomb's law, not the convex law beside it, and smooth inside of the cones. Steps use the scaling of Nesterov and Todd
//! and the predictor of Mehrotra. Where the path bends sharply (friction can wedge, the law is not monotone) steps are
//! damped by a proximal shift of W, and complementarity waits for the equations.

use super::matrix::Linear;
use super::{ConeSolver, Judge};
use crate::problem::Problem;

#[cfg(test)]
mod tests;

const MAX_ITERATIONS: u32 = 200;
/// Share of the way to the boundary that a step may go.
const SHARE: f64 = 0.995;
/// Least entry added to the diagonal (joints have no barrier).
const SHIFT: f64 = 1e-12;
/// Steps below this make the shift grow, above that shrink; factor, least value and attempts in one iteration.
const SHORT: f64 = 0.1;
const LONG: f64 = 0.5;
const SHIFT_STEP: f64 = 10.0;
const SHIFT_LEAST: f64 = 1e-4;
const MAX_TRIES: u32 = 6;
/// Share of the first complementarity, relative to the equations, that is kept until they hold.
const BALANCE: f64 = 0.1;
/// Iterations without a better residual after which a run gives up.
const PATIENCE: u32 = 40;

/// A vector of one disc: `(mu r_N, r_b)` and its duals; a half-line uses the first entry.
type Vec3 = [f64; 3];

/// One cone `Q_b` of a contact.
#[derive(Clone, Copy, Debug, Default)]
struct Cone {
    group: usize,
    /// Row of the normal, first row of the disc, its rows (0: half-line).
    normal: usize,
    start: usize,
    dim: usize,
    bound: f64,
    /// Primal `A_b r` and dual.
    primal: Vec3,
    dual: Vec3,
    /// Scaling: `F = eta (..w..)`.
    eta: f64,
    w: Vec3,
    /// `F^-1 primal = F dual`.
    v: Vec3,
    d_primal: Vec3,
    d_dual: Vec3,
}

/// See the module.
#[derive(Default)]
pub struct InteriorPoint {
    cones: Vec<Cone>,
    linear: Linear,
    y: Vec<f64>,
    u: Vec<f64>,
    dual_residual: Vec<f64>,
    rhs: Vec<f64>,
    step: Vec<f64>,
}

impl ConeSolver for InteriorPoint {
    fn name(&self) -> &'static str {
        "interior-point"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        let problem = &judge.scaled.problem;
        self.begin(problem);
        let max = max_iterations.min(MAX_ITERATIONS);
        let (mut done, mut best, mut since) = (0, f64::INFINITY, 0);
        let mut shift = SHIFT;
        let mut first = None;
        while done < max {
            let gap = self.gap();
            self.residuals(problem);
            let dual = norm(&self.dual_residual);
            let (gap_0, dual_0) = *first.get_or_insert((gap, dual.max(f64::MIN_POSITIVE)));
            // Complementarity does not run ahead of the equations.
            let behind = (BALANCE * gap_0 * dual / dual_0).min(gap);
            let mut tries = 0;
            let length = loop {
                if !self.factor(problem, shift) || !self.solve(0.0, false) {
                    return done;
                }
                let affine = self.longest();
                let mut centering = (self.gap_after(affine) / gap).powi(3).clamp(0.0, 1.0);
                if affine < SHORT {
                    centering = centering.max(0.5);
                }
                if !self.solve((centering * gap).max(behind), affine >= SHORT) {
                    return done;
                }
                let length = (SHARE * self.longest()).min(1.0);
                tries += 1;
                if length >= SHORT || tries > MAX_TRIES || judge.late() {
                    break length;
                }
                shift = (SHIFT_STEP * shift).max(SHIFT_LEAST);
            };
            if length > LONG {
                shift = (shift / SHIFT_STEP).max(SHIFT);
            }
            self.take(length);
            done += 1;
            let err = judge.see(&self.y);
            since += 1;
            if err < 0.9 * best {
                (best, since) = (err, 0);
            }
            if judge.stop() || since > PATIENCE || !err.is_finite() {
                break;
            }
        }
        done
    }
}

impl InteriorPoint {
    fn begin(&mut self, problem: &Problem) {
        let n = problem.rows();
        self.cones.clear();
        self.y.clear();
        self.y.resize(n, 0.0);
        for (index, group) in problem.groups.iter().enumerate() {
            if group.bilateral {
                continue;
            }
            self.y[group.row] = 1.0;
            let cone = |start, dim, bound| Cone {
                group: index,
                normal: group.row,
                start,
                dim,
                bound,
                ..Cone::default()
            };
            let before = self.cones.len();
            for d in group.bounds.discs() {
                self.cones.push(cone(group.row + d.start, d.dim, d.bound));
            }
            if self.cones.len() == before {
                self.cones.push(cone(group.row, 0, 1.0));
            }
        }
        for c in &mut self.cones {
            c.primal = c.of(&self.y);
            c.dual = [1.0, 0.0, 0.0];
        }
        for v in [
            &mut self.u,
            &mut self.dual_residual,
            &mut self.rhs,
            &mut self.step,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.linear.plan(problem);
    }

    fn gap(&self) -> f64 {
        self.gap_after(0.0)
    }

    /// Mean complementarity after a step of this length.
    fn gap_after(&self, length: f64) -> f64 {
        let mut sum = 0.0;
        for c in &self.cones {
            for k in 0..=c.dim {
                sum += (c.primal[k] + length * c.d_primal[k]) * (c.dual[k] + length * c.d_dual[k]);
            }
        }
        sum / self.cones.len().max(1) as f64
    }

    /// What the equations of the module leave.
    fn residuals(&mut self, problem: &Problem) {
        problem.velocity(&self.y, &mut self.u);
        self.dual_residual.copy_from_slice(&self.u);
        for c in &self.cones {
            self.dual_residual[c.normal] -= c.closing().0;
            for k in 0..c.dim {
                self.dual_residual[c.start + k] -= c.dual[1 + k];
            }
        }
    }

    /// Eliminates the duals: `W + shift + sum_b B_b Theta_b A_b`, `B_b` the slope of what the duals do to `u` (without the
    /// slip shift it would be `A_b^T`, and the matrix symmetric).
    fn factor(&mut self, problem: &Problem, shift: f64) -> bool {
        self.linear.copy(problem);
        for (i, group) in problem.groups.iter().enumerate() {
            for r in 0..group.dim {
                self.linear.add(problem, i, r, r, shift);
            }
        }
        for c in &mut self.cones {
            c.scale();
            // Theta = F^-2 = eta^-2 (2 (Jw)(Jw)^T - J).
            let t = 1.0 / (c.eta * c.eta);
            let jw = [c.w[0], -c.w[1], -c.w[2]];
            let theta = |a: usize, b: usize| {
                let j = match (a == b, a) {
                    (true, 0) => 1.0,
                    (true, _) => -1.0,
                    _ => 0.0,
                };
                t * (2.0 * jw[a] * jw[b] - j)
            };
            if c.dim == 0 {
                self.linear.add(problem, c.group, 0, 0, t);
                continue;
            }
            let first = c.start - problem.groups[c.group].row;
            let slope = c.closing().1;
            // Columns of Theta A, then rows by the slope.
            for b in 0..=c.dim {
                let (col, factor) = if b == 0 {
                    (0, c.bound)
                } else {
                    (first + b - 1, 1.0)
                };
                let mut normal = slope[0] * theta(0, b);
                for a in 1..=c.dim {
                    normal += slope[a] * theta(a, b);
                    let value = theta(a, b) * factor;
                    self.linear.add(problem, c.group, first + a - 1, col, value);
                }
                self.linear.add(problem, c.group, 0, col, normal * factor);
            }
        }
        self.linear.factor()
    }

    /// Direction towards complementarity `target`, with the second-order term of the last direction if `corrected`.
    fn solve(&mut self, target: f64, corrected: bool) -> bool {
        for (rhs, d) in self.rhs.iter_mut().zip(&self.dual_residual) {
            *rhs = -d;
        }
        for c in &mut self.cones {
            // F^-1 d_primal + F d_dual = v^-1 o (target e - v o v - correction) =: d
            let mut right = product(&c.v, &c.v, c.dim);
            right.iter_mut().for_each(|x| *x = -*x);
            right[0] += target;
            if corrected {
                let (a, b) = (c.unscale(&c.d_primal), c.rescale(&c.d_dual));
                let second = product(&a, &b, c.dim);
                for k in 0..=c.dim {
                    right[k] -= second[k];
                }
            }
            let d = divide(&c.v, &right, c.dim);
            let g = c.unscale(&d);
            // Kept in d_dual until the step is known.
            c.d_dual = g;
            let slope = c.closing().1;
            self.rhs[c.normal] += slope[0] * g[0];
            for k in 0..c.dim {
                self.rhs[c.normal] += slope[1 + k] * g[1 + k];
                self.rhs[c.start + k] += g[1 + k];
            }
        }
        if !self.linear.solve(&self.rhs, &mut self.step) {
            return false;
        }
        for c in &mut self.cones {
            c.d_primal = c.of(&self.step);
            let back = c.unscale(&c.unscale(&c.d_primal));
            for k in 0..=c.dim {
                c.d_dual[k] -= back[k];
            }
        }
        true
    }

    /// Longest step that stays inside of all cones.
    fn longest(&self) -> f64 {
        let mut length = 1.0 / SHARE;
        for c in &self.cones {
            length = longest(&c.primal, &c.d_primal, c.dim, length);
            length = longest(&c.dual, &c.d_dual, c.dim, length);
        }
        length
    }

    fn take(&mut self, length: f64) {
        for (y, s) in self.y.iter_mut().zip(&self.step) {
            *y += length * s;
        }
        for c in &mut self.cones {
            c.primal = c.of(&self.y);
            for k in 0..=c.dim {
                c.dual[k] += length * c.d_dual[k];
            }
        }
    }
}

impl Cone {
    /// `A_b x`.
    fn of(&self, x: &[f64]) -> Vec3 {
        let mut out = [self.bound * x[self.normal], 0.0, 0.0];
        for k in 0..self.dim {
            out[1 + k] = x[self.start + k];
        }
        out
    }

    /// Normal part of the dual with the slip shift taken off, `mu (l_0 - |l_1|^2 / l_0)`, and its slope over the dual.
    fn closing(&self) -> (f64, Vec3) {
        if self.dim == 0 {
            return (self.dual[0], [1.0, 0.0, 0.0]);
        }
        let inverse = 1.0 / self.dual[0];
        let square: f64 = (1..=self.dim)
            .map(|k| (self.dual[k] * inverse).powi(2))
            .sum();
        let mut slope = [self.bound * (1.0 + square), 0.0, 0.0];
        for k in 1..=self.dim {
            slope[k] = -2.0 * self.bound * self.dual[k] * inverse;
        }
        (self.bound * det(&self.dual, self.dim) * inverse, slope)
    }

    fn scale(&mut self) {
        let (dp, dd) = (det(&self.primal, self.dim), det(&self.dual, self.dim));
        self.eta = (dp / dd).sqrt().sqrt();
        let (p, d) = (1.0 / dp.sqrt(), 1.0 / dd.sqrt());
        let mut dot = 0.0;
        for k in 0..=self.dim {
            dot += p * self.primal[k] * d * self.dual[k];
        }
        let gamma = (0.5 * (1.0 + dot)).sqrt();
        self.w = [0.0; 3];
        self.w[0] = (p * self.primal[0] + d * self.dual[0]) / (2.0 * gamma);
        for k in 1..=self.dim {
            self.w[k] = (p * self.primal[k] - d * self.dual[k]) / (2.0 * gamma);
        }
        self.v = self.rescale(&self.dual);
    }

    /// `F x`.
    fn rescale(&self, x: &Vec3) -> Vec3 {
        hyperbolic(&self.w, x, self.dim, self.eta)
    }

    /// `F^-1 x`.
    fn unscale(&self, x: &Vec3) -> Vec3 {
        let mirrored = [self.w[0], -self.w[1], -self.w[2]];
        hyperbolic(&mirrored, x, self.dim, 1.0 / self.eta)
    }
}

/// `scale [w0 w1^T; w1 1 + w1 w1^T / (1 + w0)] x`.
fn hyperbolic(w: &Vec3, x: &Vec3, dim: usize, scale: f64) -> Vec3 {
    let dot: f64 = (1..=dim).map(|k| w[k] * x[k]).sum();
    let mut out = [0.0; 3];
    out[0] = scale * (w[0] * x[0] + dot);
    let along = x[0] + dot / (1.0 + w[0]);
    for k in 1..=dim {
        out[k] = scale * (x[k] + along * w[k]);
    }
    out
}

/// Jordan product `x o y = (x.y, x0 y1 + y0 x1)`.
fn product(x: &Vec3, y: &Vec3, dim: usize) -> Vec3 {
    let mut out = [0.0; 3];
    out[0] = (0..=dim).map(|k| x[k] * y[k]).sum();
    for k in 1..=dim {
        out[k] = x[0] * y[k] + y[0] * x[k];
    }
    out
}

/// Solves `x o y = b` for `y`.
fn divide(x: &Vec3, b: &Vec3, dim: usize) -> Vec3 {
    let d = det(x, dim);
    let dot: f64 = (1..=dim).map(|k| x[k] * b[k]).sum();
    let mut y = [0.0; 3];
    y[0] = (x[0] * b[0] - dot) / d;
    for k in 1..=dim {
        y[k] = (b[k] - y[0] * x[k]) / x[0];
    }
    y
}

/// `x0^2 - |x1|^2`, without cancellation of squares.
fn det(x: &Vec3, dim: usize) -> f64 {
    let length = norm(&x[1..=dim]);
    ((x[0] - length) * (x[0] + length)).max(f64::MIN_POSITIVE)
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Longest `length <= bound` with `x + length d` in the cone, `x` inside.
fn longest(x: &Vec3, d: &Vec3, dim: usize, bound: f64) -> f64 {
    if dim == 0 {
        return if d[0] < 0.0 {
            bound.min(-x[0] / d[0])
        } else {
            bound
        };
    }
    let a = d[0] * d[0] - (1..=dim).map(|k| d[k] * d[k]).sum::<f64>();
    let b = x[0] * d[0] - (1..=dim).map(|k| x[k] * d[k]).sum::<f64>();
    let c = det(x, dim);
    // First positive root of a t^2 + 2 b t + c, and of x0 + t d0.
    let mut length = bound;
    let disc = b * b - a * c;
    if disc >= 0.0 {
        let root = disc.sqrt();
        for t in [c / (-b + root), c / (-b - root)] {
            if t > 0.0 && t < length {
                length = t;
            }
        }
    }
    if d[0] < 0.0 {
        length = length.min(-x[0] / d[0]);
    }
    length
}
