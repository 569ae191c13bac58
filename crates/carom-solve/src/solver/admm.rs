//! Alternating directions: one Cholesky factorisation of `W + rho`, then products and projections only.

use super::{ConeSolver, Judge};
use crate::direct::SparseLlt;
use crate::problem::natural::{project_cone, shift};
use crate::problem::Problem;

/// Iterations (1) of a run that is not bounded otherwise.
const MAX_ITERATIONS: u32 = 50_000;
/// Iterations (1) between looks at the residual and at the balance of rho. Few, most of the time goes into looks.
const LOOK_EVERY: u32 = 20;
/// Quotient (1) of primal and dual residual at which rho changes. Near 1 it changes all the time, and with each change the
/// factorisation.
const IMBALANCE: f64 = 10.0;
/// Changes of rho (1) at most: without end it need not converge.
const MAX_CHANGES: u32 = 12;
/// Share (1) of the last combined residual below which the acceleration goes on. Above 1 it may swing without end.
const RESTART: f64 = 0.999;

/// Fast alternating directions with restart (Goldstein and others), slip shift updated in every iteration.
#[derive(Default)]
pub struct Admm {
    llt: SparseLlt,
}

/// The copy of the multipliers in the cones and the scaled dual `w = -(u + s n)/rho`: now, before, and extrapolated.
struct Copies {
    rho: f64,
    y: Vec<f64>,
    w: Vec<f64>,
    y_old: Vec<f64>,
    w_old: Vec<f64>,
    y_hat: Vec<f64>,
    w_hat: Vec<f64>,
    momentum: f64,
    /// Primal and dual residuals together.
    combined: f64,
}

impl ConeSolver for Admm {
    fn name(&self) -> &'static str {
        "admm"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        let problem = &judge.scaled.problem;
        let n = problem.rows();
        let (col_ptr, row_idx, base, place) = lower_half(problem);
        let diagonal: Vec<usize> = (0..n).map(|r| place(r, r)).collect();
        let mut at = Copies::new(problem, &judge.best);
        let (mut x, mut rhs) = (at.y.clone(), vec![0.0; n]);
        let (mut done, mut changes, mut factored) = (0, 0, 0.0);
        let max = max_iterations.min(MAX_ITERATIONS);
        while done < max {
            if at.rho != factored {
                let mut values = base.clone();
                for &d in &diagonal {
                    values[d] += at.rho;
                }
                if self.llt.refactor(n, &col_ptr, &row_idx, &values).is_err() {
                    break;
                }
                factored = at.rho;
            }
            at.right_side(problem, &mut rhs);
            if self.llt.solve(&rhs, &mut x).is_err() {
                break;
            }
            let [primal, dual] = at.step(problem, &x);
            done += 1;
            if done % LOOK_EVERY == 0 || done == max || judge.late() {
                let err = judge.see(&at.y);
                if judge.stop() || !err.is_finite() {
                    break;
                }
                let factor = if primal > IMBALANCE * IMBALANCE * dual {
                    2.0
                } else if dual > IMBALANCE * IMBALANCE * primal {
                    0.5
                } else {
                    1.0
                };
                if factor != 1.0 && changes < MAX_CHANGES {
                    at.rescale(factor);
                    changes += 1;
                }
            }
        }
        done
    }
}

impl Copies {
    fn new(problem: &Problem, start: &[f64]) -> Copies {
        let rho = 1.0 / (problem.groups.len().max(1) as f64).sqrt();
        let (y, mut w) = (start.to_vec(), vec![0.0; problem.rows()]);
        problem.velocity(&y, &mut w);
        for group in &problem.groups {
            let s = shift(group, &w[group.rows()]);
            for row in group.rows() {
                w[row] = -w[row] / rho;
            }
            w[group.row] -= s / rho;
        }
        Copies {
            rho,
            y_hat: y.clone(),
            w_hat: w.clone(),
            y_old: y.clone(),
            w_old: w.clone(),
            y,
            w,
            momentum: 1.0,
            combined: f64::INFINITY,
        }
    }

    /// That of the equations, `(W + rho) x = rho (y^ - w^) - q - s(-rho w^) n`.
    fn right_side(&self, problem: &Problem, rhs: &mut [f64]) {
        for (row, value) in rhs.iter_mut().enumerate() {
            *value = self.rho * (self.y_hat[row] - self.w_hat[row]) - problem.q[row];
        }
        for group in &problem.groups {
            let mut slip = [0.0; 6];
            for (k, row) in group.rows().enumerate() {
                slip[k] = -self.rho * self.w_hat[row];
            }
            rhs[group.row] -= shift(group, &slip[..group.dim]);
        }
    }

    /// From the solution `x` of the equations to the cones, and further on the way; squares of the primal and the dual residual.
    fn step(&mut self, problem: &Problem, x: &[f64]) -> [f64; 2] {
        std::mem::swap(&mut self.y, &mut self.y_old);
        std::mem::swap(&mut self.w, &mut self.w_old);
        for group in &problem.groups {
            let rows = group.rows();
            for row in rows.clone() {
                self.y[row] = x[row] + self.w_hat[row];
            }
            project_cone(group, &mut self.y[rows.clone()]);
            for row in rows {
                self.w[row] = self.w_hat[row] + x[row] - self.y[row];
            }
        }
        let (mut primal, mut dual) = (0.0, 0.0);
        for row in 0..x.len() {
            primal += (self.w[row] - self.w_hat[row]).powi(2);
            dual += (self.y[row] - self.y_hat[row]).powi(2);
        }
        let now = primal + dual;
        if now < RESTART * self.combined {
            let next = 0.5 * (1.0 + (1.0 + 4.0 * self.momentum * self.momentum).sqrt());
            let beta = (self.momentum - 1.0) / next;
            for row in 0..x.len() {
                self.y_hat[row] = self.y[row] + beta * (self.y[row] - self.y_old[row]);
                self.w_hat[row] = self.w[row] + beta * (self.w[row] - self.w_old[row]);
            }
            (self.momentum, self.combined) = (next, now);
        } else {
            self.restart(now / RESTART);
        }
        [primal, dual]
    }

    fn restart(&mut self, combined: f64) {
        (self.momentum, self.combined) = (1.0, combined);
        self.y_hat.copy_from_slice(&self.y);
        self.w_hat.copy_from_slice(&self.w);
    }

    fn rescale(&mut self, factor: f64) {
        self.rho *= factor;
        for v in [&mut self.w, &mut self.w_old] {
            v.iter_mut().for_each(|v| *v /= factor);
        }
        self.restart(f64::INFINITY);
    }
}

/// Lower triangle of the symmetric part of W, in compressed columns, and the place of an entry.
#[allow(clippy::type_complexity)]
pub(super) fn lower_half(
    problem: &Problem,
) -> (
    Vec<usize>,
    Vec<usize>,
    Vec<f64>,
    impl Fn(usize, usize) -> usize,
) {
    let (n, w) = (problem.rows(), &problem.w);
    let lower = || w.entries().filter(|(row, col, _)| row >= col);
    let mut col_ptr = vec![0usize; n + 1];
    lower().for_each(|(_, col, _)| col_ptr[col + 1] += 1);
    for c in 0..n {
        col_ptr[c + 1] += col_ptr[c];
    }
    let mut row_idx = vec![0usize; col_ptr[n]];
    let mut values = vec![0.0; col_ptr[n]];
    let mut fill = col_ptr.clone();
    lower().for_each(|(row, col, at)| {
        row_idx[fill[col]] = row;
        values[fill[col]] = if row == col {
            w.values[at]
        } else {
            0.5 * w.values[at]
        };
        fill[col] += 1;
    });
    let (ptr, idx) = (col_ptr.clone(), row_idx.clone());
    let place = move |row: usize, col: usize| {
        let range = ptr[col]..ptr[col + 1];
        range.start + idx[range].binary_search(&row).unwrap_or(usize::MAX / 2)
    };
    // The other half of each off-diagonal entry.
    for (row, col, at) in w.entries().filter(|(row, col, _)| row < col) {
        values[place(col, row)] += 0.5 * w.values[at];
    }
    (col_ptr, row_idx, values, place)
}
