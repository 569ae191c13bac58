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

use super::matrix::NewtonMatrix;
use super::{ConeSolver, Judge};
use crate::problem::Problem;

mod cone;
mod convex;
#[cfg(test)]
mod tests;

use cone::{divide, longest, norm, product, Cone};

/// Iterations (1) at most; some tens are usual.
const MAX_ITERATIONS: u32 = 200;
/// Share of the way to the boundary of the cones (1) that a step may go. With 1 an iterate lies on it and has no inverse;
/// small, many iterations.
const SHARE: f64 = 0.995;
/// Least entry added to the diagonal of a scaled W (1): joints have no barrier. Less is lost in rounding; more bends the path.
const SHIFT: f64 = 1e-12;
/// Length of a step (1) below which the shift grows: the path is too crooked.
const SHORT: f64 = 0.1;
/// Length (1) above which it shrinks again.
const LONG: f64 = 0.5;
/// Factor (1) by which it does.
const SHIFT_STEP: f64 = 10.0;
/// The first one worth adding (1, as [`SHIFT`]).
const SHIFT_LEAST: f64 = 1e-4;
/// Larger shifts (1) in one iteration, each of which is a factorisation; bounds its time.
const MAX_TRIES: u32 = 6;
/// Share (1) of the first complementarity, relative to the equations, that is kept until they hold. With 0 iterates run into a
/// corner of the cones, and steps have no length.
const BALANCE: f64 = 0.1;
/// Iterations (1) without a better residual after which a run gives up.
const PATIENCE: u32 = 40;

/// See the module.
#[derive(Default)]
pub struct InteriorPoint {
    cones: Vec<Cone>,
    linear: NewtonMatrix,
    y: Vec<f64>,
    u: Vec<f64>,
    dual_residual: Vec<f64>,
    rhs: Vec<f64>,
    step: Vec<f64>,
    /// Without the slip shift ([`convex`]).
    convex: bool,
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
            let convex = self.convex;
            let cone = |start, dim, bound| Cone {
                group: index,
                normal: group.row,
                start,
                dim,
                bound,
                convex,
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
