//! Semi-smooth Newton on the multipliers: `phi(r - p (W r + q)) - r = 0` with the projections of Alart and Curnier.

use super::{ConeSolver, Judge};
use crate::cone::{self, Block, Status, MAX_ROWS};
use crate::direct::{dense, SparseLu};
use crate::problem::{Group, Problem};

/// Systems up to this many rows are dense.
const DENSE_ROWS: usize = 96;
/// Iterations when not told otherwise.
const MAX_ITERATIONS: u32 = 100;
/// Merits that the next one is compared with: the merit may rise across a change of status.
const MEMORY: usize = 6;
const MAX_LINE_SEARCH: u32 = 8;
/// Proximal shift at the start, relative to the diagonal of W, and the least one: W is mostly singular.
const SHIFT: f64 = 1e-4;
const SHIFT_FLOOR: f64 = 1e-11;
/// Factor on the shift where the matrix was singular, and how often.
const SHIFT_GROWTH: f64 = 1e3;
const SHIFT_TRIES: u32 = 4;
/// Iterations without a better residual after which a run gives up.
const PATIENCE: u32 = 25;

/// See the module. Keeps the symbolic factorisation from run to run while the pattern stands.
#[derive(Default)]
pub struct SemiSmoothNewton {
    /// Proximal term `alpha (y - centre)` that belongs to the problem solved, and not only to the step.
    pub proximal: f64,
    linear: Linear,
    y: Vec<f64>,
    centre: Vec<f64>,
    z: Vec<f64>,
    penalty: Vec<f64>,
    xi: Vec<f64>,
    phi: Vec<f64>,
    residual: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
    tangents: Vec<Block>,
    /// Statuses of the last iterate.
    pub statuses: Vec<Status>,
}

impl ConeSolver for SemiSmoothNewton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        let scaled = judge.scaled;
        let problem = &scaled.problem;
        self.resize(problem);
        self.y.clone_from(&judge.best);
        self.centre.clone_from(&judge.best);
        self.linear.plan(problem);
        let max = max_iterations.min(MAX_ITERATIONS);
        let mut merits = [0.0; MEMORY];
        let mut y = std::mem::take(&mut self.y);
        let mut merit = self.evaluate(problem, &y);
        let first = merit.max(f64::MIN_POSITIVE);
        let (mut done, mut since_better, mut best) = (0, 0, f64::INFINITY);
        while done < max {
            merits[done as usize % MEMORY] = merit;
            let shift = SHIFT * (merit / first).min(1.0).max(SHIFT_FLOOR / SHIFT);
            if !self.direction(problem, shift) {
                break;
            }
            done += 1;
            let memory = &merits[..(done as usize).min(MEMORY)];
            let bound = memory.iter().fold(0.0f64, |m, &x| m.max(x));
            merit = self.advance(problem, bound, &mut y);
            if !merit.is_finite() {
                break;
            }
            // What lies in the cones is mostly nearer.
            let err = judge.see(&self.phi).min(judge.see(&y));
            if self.proximal == 0.0 {
                since_better += 1;
                if err < 0.9 * best {
                    (best, since_better) = (err, 0);
                }
            } else if merit < 0.1 * judge.tolerance().min(first) {
                break;
            }
            if judge.stop() || since_better > PATIENCE {
                break;
            }
        }
        self.y = y;
        done
    }
}

impl SemiSmoothNewton {
    fn resize(&mut self, problem: &Problem) {
        let n = problem.rows();
        for v in [
            &mut self.z,
            &mut self.penalty,
            &mut self.xi,
            &mut self.phi,
            &mut self.residual,
            &mut self.step,
            &mut self.trial,
        ] {
            v.resize(n, 0.0);
        }
        let count = problem.groups.len();
        self.tangents.resize(count, [[0.0; MAX_ROWS]; MAX_ROWS]);
        self.statuses.resize(count, Status::Gap);
        for (i, group) in problem.groups.iter().enumerate() {
            let block = problem.w.block(i, problem.w.diagonal[i]);
            let inverse = |rows: std::ops::Range<usize>| {
                let largest = rows.map(|r| block[r * group.dim + r]).fold(0.0, f64::max);
                if largest > 0.0 {
                    1.0 / largest
                } else {
                    1.0
                }
            };
            if group.bilateral {
                for r in 0..group.dim {
                    self.penalty[group.row + r] = inverse(r..r + 1);
                }
                continue;
            }
            self.penalty[group.row] = inverse(0..1);
            for disc in group.bounds.discs() {
                let rows = disc.start..disc.start + disc.dim;
                self.penalty[group.row + disc.start..group.row + disc.start + disc.dim]
                    .fill(inverse(rows));
            }
        }
    }

    /// Projections and residual `phi - y` at `y`; the merit is its norm.
    fn evaluate(&mut self, problem: &Problem, y: &[f64]) -> f64 {
        problem.velocity(y, &mut self.z);
        let mut sum = 0.0;
        for (i, group) in problem.groups.iter().enumerate() {
            let rows = group.rows();
            for row in rows.clone() {
                let prox = self.proximal * (y[row] - self.centre[row]);
                self.xi[row] = y[row] - self.penalty[row] * (self.z[row] + prox);
            }
            let (xi, phi) = (&self.xi[rows.clone()], &mut self.phi[rows.clone()]);
            self.statuses[i] = if group.bilateral {
                cone::pass(xi, phi)
            } else {
                cone::project(&group.bounds, xi, phi)
            };
            for row in rows {
                let f = self.phi[row] - y[row];
                self.residual[row] = f;
                sum += f * f;
            }
        }
        sum.sqrt()
    }

    /// Solves `((1 - D) + D P (W + shift)) step = phi - y`.
    fn direction(&mut self, problem: &Problem, shift: f64) -> bool {
        for (i, group) in problem.groups.iter().enumerate() {
            let block = &mut self.tangents[i];
            if group.bilateral {
                cone::pass_tangent(group.dim, block);
            } else {
                cone::tangent(&group.bounds, &self.xi[group.rows()], block);
            }
        }
        let mut shift = shift;
        for _ in 0..=SHIFT_TRIES {
            self.linear.assemble(
                problem,
                &self.tangents,
                &self.penalty,
                shift + self.proximal,
            );
            if self.linear.solve(&self.residual, &mut self.step) {
                return true;
            }
            shift *= SHIFT_GROWTH;
        }
        false
    }

    /// Takes the step, shortened while the merit exceeds `bound`; if no length helps the best one tried.
    fn advance(&mut self, problem: &Problem, bound: f64, y: &mut [f64]) -> f64 {
        let mut length = 1.0;
        let mut best = (f64::INFINITY, 1.0);
        let mut trial = std::mem::take(&mut self.trial);
        let mut last = false;
        let mut tries = 0;
        let merit = loop {
            for (t, (y, s)) in trial.iter_mut().zip(y.iter().zip(&self.step)) {
                *t = y + length * s;
            }
            let merit = self.evaluate(problem, &trial);
            if merit < best.0 {
                best = (merit, length);
            }
            if merit <= bound * (1.0 + 1e-12) || last {
                break merit;
            }
            tries += 1;
            last = tries >= MAX_LINE_SEARCH;
            length = if last { best.1 } else { 0.5 * length };
        };
        y.copy_from_slice(&trial);
        self.trial = trial;
        merit
    }
}

/// The Newton matrix: dense when small, else compressed columns whose pattern is that of W.
#[derive(Default)]
struct Linear {
    n: usize,
    lu: SparseLu,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    /// Place in `values` of each value of W, in the order of W's blocks.
    place: Vec<usize>,
    /// Place of each row's diagonal.
    diagonal: Vec<usize>,
    pivots: Vec<u32>,
}

impl Linear {
    fn is_dense(&self) -> bool {
        self.n <= DENSE_ROWS
    }

    fn plan(&mut self, problem: &Problem) {
        let (n, w) = (problem.rows(), &problem.w);
        self.n = n;
        self.place.clear();
        self.place.resize(w.values.len(), 0);
        self.diagonal.clear();
        self.diagonal.resize(n, 0);
        self.pivots.resize(n, 0);
        if self.is_dense() {
            self.values.resize(n * n, 0.0);
        } else {
            self.col_ptr.clear();
            self.col_ptr.resize(n + 1, 0);
            self.each(problem, |_, col, _, this| this.col_ptr[col + 1] += 1);
            for c in 0..n {
                self.col_ptr[c + 1] += self.col_ptr[c];
            }
            self.row_idx.resize(self.col_ptr[n], 0);
            self.values.resize(self.col_ptr[n], 0.0);
        }
        let mut fill = self.col_ptr.clone();
        self.each(problem, |row, col, value, this| {
            let place = if this.is_dense() {
                row * n + col
            } else {
                let at = fill[col];
                fill[col] += 1;
                this.row_idx[at] = row;
                at
            };
            this.place[value] = place;
            if row == col {
                this.diagonal[row] = place;
            }
        });
    }

    /// Row, column and index of every value of W, rows ascending within each column.
    fn each(&mut self, problem: &Problem, mut f: impl FnMut(usize, usize, usize, &mut Linear)) {
        let w = &problem.w;
        for i in 0..w.len() {
            let (row, dim) = w.shape(i);
            for r in 0..dim {
                for k in w.ptr[i]..w.ptr[i + 1] {
                    let (col, width) = w.shape(w.col[k] as usize);
                    for c in 0..width {
                        f(row + r, col + c, w.start[k] + r * width + c, self);
                    }
                }
            }
        }
    }

    fn assemble(&mut self, problem: &Problem, tangents: &[Block], penalty: &[f64], shift: f64) {
        let w = &problem.w;
        if self.is_dense() {
            self.values.fill(0.0);
        }
        for (i, group) in problem.groups.iter().enumerate() {
            let (row, dim) = (group.row, group.dim);
            let d = &tangents[i];
            for k in w.ptr[i]..w.ptr[i + 1] {
                let width = w.shape(w.col[k] as usize).1;
                let block = w.block(i, k);
                let place = &self.place[w.start[k]..w.start[k] + dim * width];
                for r in 0..dim {
                    for c in 0..width {
                        let mut sum = 0.0;
                        for m in 0..dim {
                            sum += d[r][m] * penalty[row + m] * block[m * width + c];
                        }
                        self.values[place[r * width + c]] = sum;
                    }
                }
            }
            self.add_diagonal(group, d, penalty, shift, problem, i);
        }
    }

    fn add_diagonal(
        &mut self,
        group: &Group,
        d: &Block,
        penalty: &[f64],
        shift: f64,
        problem: &Problem,
        i: usize,
    ) {
        let (row, dim) = (group.row, group.dim);
        let start = problem.w.start[problem.w.diagonal[i]];
        for r in 0..dim {
            for c in 0..dim {
                let unit = f64::from(u8::from(r == c));
                self.values[self.place[start + r * dim + c]] +=
                    unit - d[r][c] + d[r][c] * penalty[row + c] * shift;
            }
        }
    }

    fn solve(&mut self, rhs: &[f64], out: &mut [f64]) -> bool {
        let n = self.n;
        if self.is_dense() {
            if dense::lu_factor(&mut self.values, n, &mut self.pivots).is_err() {
                return false;
            }
            out.copy_from_slice(rhs);
            dense::lu_solve(&self.values, n, &self.pivots, out);
            return out.iter().all(|v| v.is_finite());
        }
        self.lu
            .refactor(n, &self.col_ptr, &self.row_idx, &self.values)
            .is_ok()
            && self.lu.solve(rhs, out).is_ok()
    }
}
