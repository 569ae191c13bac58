//! Primal-dual path following for the cone problem with a given slip shift `s`, which is updated on the way.
//!
//! With `A_b r = (mu_b r_N, r_b)` in the second-order cone `Q_b` for each disc (and `r_N >= 0` alone without discs) the
//! problem is `W r + q + s n = sum_b A_b^T l_b`, `l_b in Q_b`, `l_b o A_b r = 0`. Steps use the scaling of Nesterov and Todd and
//! the predictor of Mehrotra; the matrix `W + sum A_b^T Theta_b A_b` is positive definite also where W is singular, so
//! Cholesky may be used: the barrier, not trust, makes its pivots.

use super::{ConeSolver, Judge};
use crate::direct::SparseLlt;
use crate::problem::{Group, Problem};

const MAX_ITERATIONS: u32 = 120;
/// Share of the way to the boundary that a step may go.
const SHARE: f64 = 0.995;
/// Least entry added to the diagonal (joints have no barrier).
const SHIFT: f64 = 1e-12;
/// Iterations without a better residual after which a run gives up.
const PATIENCE: u32 = 20;

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
    llt: SparseLlt,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    base: Vec<f64>,
    values: Vec<f64>,
    /// Place of the lower entry (r, c) of each contact's diagonal block, by row of the contact: `own[row][c]`.
    own: Vec<[usize; 6]>,
    y: Vec<f64>,
    u: Vec<f64>,
    shift: Vec<f64>,
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
        while done < max {
            let gap = self.gap();
            self.residuals(problem);
            if !self.factor(problem) {
                break;
            }
            // Predictor.
            if !self.solve(problem, 0.0, false) {
                break;
            }
            let length = self.longest();
            let predicted = self.gap_after(length);
            let centering = (predicted / gap).powi(3).clamp(0.0, 1.0);
            // Corrector.
            if !self.solve(problem, centering * gap, true) {
                break;
            }
            let length = (SHARE * self.longest()).min(1.0);
            self.take(problem, length);
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
            &mut self.shift,
            &mut self.dual_residual,
            &mut self.rhs,
            &mut self.step,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.plan(problem);
    }

    /// Lower triangle of the symmetric part of W in compressed columns.
    fn plan(&mut self, problem: &Problem) {
        let (n, w) = (problem.rows(), &problem.w);
        let (col_ptr, row_idx, base, place) = super::admm::lower_half(problem);
        self.own.clear();
        self.own.resize(n, [usize::MAX; 6]);
        for i in 0..w.len() {
            let (row, dim) = w.shape(i);
            for r in 0..dim {
                for c in 0..=r {
                    self.own[row + r][c] = place(row + r, row + c);
                }
            }
        }
        (self.col_ptr, self.row_idx, self.base) = (col_ptr, row_idx, base);
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

    /// `W y + q + s n - sum A^T l`, with `s` from the duals (`l_b` is `u_b` where it is not at its end).
    fn residuals(&mut self, problem: &Problem) {
        problem.velocity(&self.y, &mut self.u);
        self.dual_residual.copy_from_slice(&self.u);
        self.shift.fill(0.0);
        for c in &self.cones {
            let slip = norm(&c.dual[1..=c.dim]);
            self.dual_residual[c.normal] += c.bound * slip * f64::from(u8::from(c.dim > 0));
            self.dual_residual[c.normal] -= c.bound * c.dual[0];
            for k in 0..c.dim {
                self.dual_residual[c.start + k] -= c.dual[1 + k];
            }
        }
    }

    fn factor(&mut self, problem: &Problem) -> bool {
        self.values.clone_from(&self.base);
        for group in &problem.groups {
            for r in 0..group.dim {
                self.values[self.own[group.row + r][r]] += SHIFT;
            }
        }
        for c in &mut self.cones {
            c.scale();
            // Theta = F^-2 = eta^-2 (2 (Jw)(Jw)^T - J).
            let t = 1.0 / (c.eta * c.eta);
            let group: &Group = &problem.groups[c.group];
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
                self.values[self.own[c.normal][0]] += t;
                continue;
            }
            self.values[self.own[c.normal][0]] += c.bound * c.bound * theta(0, 0);
            let first = c.start - group.row;
            for a in 0..c.dim {
                let row = c.start + a;
                self.values[self.own[row][0]] += c.bound * theta(1 + a, 0);
                for b in 0..=a {
                    self.values[self.own[row][first + b]] += theta(1 + a, 1 + b);
                }
            }
        }
        let n = problem.rows();
        self.llt
            .refactor(n, &self.col_ptr, &self.row_idx, &self.values)
            .is_ok()
    }

    /// Direction towards complementarity `target`, with the second-order term of the last direction if `corrected`.
    fn solve(&mut self, problem: &Problem, target: f64, corrected: bool) -> bool {
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
            self.rhs[c.normal] += c.bound * g[0];
            for k in 0..c.dim {
                self.rhs[c.start + k] += g[1 + k];
            }
        }
        let _ = problem;
        if self.llt.solve(&self.rhs, &mut self.step).is_err() {
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

    fn take(&mut self, _: &Problem, length: f64) {
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
        return if d[0] < 0.0 { bound.min(-x[0] / d[0]) } else { bound };
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
