//! Alternating directions: one Cholesky factorisation of `W + rho`, then products and projections only.

use super::{ConeSolver, Judge};
use crate::direct::SparseLlt;
use crate::problem::natural::{project_cone, shift};
use crate::problem::Problem;

const MAX_ITERATIONS: u32 = 50_000;
/// Iterations between looks at the residual and at the balance of rho.
const LOOK_EVERY: u32 = 20;
/// Imbalance of primal and dual residuals at which rho changes, and how often it may.
const IMBALANCE: f64 = 10.0;
const MAX_CHANGES: u32 = 12;
/// The combined residual must fall by this factor or the acceleration starts anew.
const RESTART: f64 = 0.999;

/// Fast alternating directions with restart (Goldstein and others), slip shift updated in every iteration.
#[derive(Default)]
pub struct Admm {
    llt: SparseLlt,
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
        let mut rho = 1.0 / (problem.groups.len().max(1) as f64).sqrt();
        let mut factored = 0.0;
        let mut y = judge.best.clone();
        let (mut x, mut rhs) = (y.clone(), vec![0.0; n]);
        // Scaled dual: -(u + s n)/rho.
        let mut w = vec![0.0; n];
        problem.velocity(&y, &mut rhs);
        for group in &problem.groups {
            let s = shift(group, &rhs[group.rows()]);
            for row in group.rows() {
                w[row] = -rhs[row] / rho;
            }
            w[group.row] -= s / rho;
        }
        let (mut y_hat, mut w_hat) = (y.clone(), w.clone());
        let (mut y_old, mut w_old) = (y.clone(), w.clone());
        let (mut momentum, mut combined) = (1.0f64, f64::INFINITY);
        let (mut done, mut changes) = (0, 0);
        let max = max_iterations.min(MAX_ITERATIONS);
        while done < max {
            if rho != factored {
                let mut values = base.clone();
                for &d in &diagonal {
                    values[d] += rho;
                }
                if self.llt.refactor(n, &col_ptr, &row_idx, &values).is_err() {
                    break;
                }
                factored = rho;
            }
            for (row, value) in rhs.iter_mut().enumerate() {
                *value = rho * (y_hat[row] - w_hat[row]) - problem.q[row];
            }
            for group in &problem.groups {
                let mut slip = [0.0; 6];
                for (k, row) in group.rows().enumerate() {
                    slip[k] = -rho * w_hat[row];
                }
                rhs[group.row] -= shift(group, &slip[..group.dim]);
            }
            if self.llt.solve(&rhs, &mut x).is_err() {
                break;
            }
            std::mem::swap(&mut y, &mut y_old);
            std::mem::swap(&mut w, &mut w_old);
            for group in &problem.groups {
                let rows = group.rows();
                for row in rows.clone() {
                    y[row] = x[row] + w_hat[row];
                }
                project_cone(group, &mut y[rows.clone()]);
                for row in rows {
                    w[row] = w_hat[row] + x[row] - y[row];
                }
            }
            done += 1;
            let (mut primal, mut dual) = (0.0, 0.0);
            for row in 0..n {
                primal += (w[row] - w_hat[row]).powi(2);
                dual += (y[row] - y_hat[row]).powi(2);
            }
            let now = primal + dual;
            if now < RESTART * combined {
                let next = 0.5 * (1.0 + (1.0 + 4.0 * momentum * momentum).sqrt());
                let beta = (momentum - 1.0) / next;
                for row in 0..n {
                    y_hat[row] = y[row] + beta * (y[row] - y_old[row]);
                    w_hat[row] = w[row] + beta * (w[row] - w_old[row]);
                }
                momentum = next;
                combined = now;
            } else {
                momentum = 1.0;
                y_hat.copy_from_slice(&y);
                w_hat.copy_from_slice(&w);
                combined = now / RESTART;
            }
            if done % LOOK_EVERY == 0 || done == max || judge.late() {
                let err = judge.see(&y);
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
                    rho *= factor;
                    changes += 1;
                    for v in [&mut w, &mut w_hat, &mut w_old] {
                        v.iter_mut().for_each(|v| *v /= factor);
                    }
                    momentum = 1.0;
                    y_hat.copy_from_slice(&y);
                    w_hat.copy_from_slice(&w);
                    combined = f64::INFINITY;
                }
            }
        }
        done
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
    let mut col_ptr = vec![0usize; n + 1];
    let each = |f: &mut dyn FnMut(usize, usize, f64)| {
        for i in 0..w.len() {
            let (row, dim) = w.shape(i);
            for r in 0..dim {
                for k in w.ptr[i]..w.ptr[i + 1] {
                    let (col, width) = w.shape(w.col[k] as usize);
                    let block = w.block(i, k);
                    for c in 0..width {
                        f(row + r, col + c, block[r * width + c]);
                    }
                }
            }
        }
    };
    each(&mut |row, col, _| {
        if row >= col {
            col_ptr[col + 1] += 1;
        }
    });
    for c in 0..n {
        col_ptr[c + 1] += col_ptr[c];
    }
    let mut row_idx = vec![0usize; col_ptr[n]];
    let mut values = vec![0.0; col_ptr[n]];
    let mut fill = col_ptr.clone();
    each(&mut |row, col, value| {
        if row >= col {
            row_idx[fill[col]] = row;
            values[fill[col]] = if row == col { value } else { 0.5 * value };
            fill[col] += 1;
        }
    });
    let (ptr, idx) = (col_ptr.clone(), row_idx.clone());
    let place = move |row: usize, col: usize| {
        let range = ptr[col]..ptr[col + 1];
        range.start + idx[range].binary_search(&row).unwrap_or(usize::MAX / 2)
    };
    // The other half of each off-diagonal entry.
    each(&mut |row, col, value| {
        if row < col {
            values[place(col, row)] += 0.5 * value;
        }
    });
    (col_ptr, row_idx, values, place)
}
