//! Semi-smooth Newton on the multipliers: `phi(r - p (W r + q)) - r = 0` with the projections of Alart and Curnier.

use super::matrix::NewtonMatrix;
use super::{ConeSolver, Judge};
use crate::cone::{self, Block, Status, MAX_ROWS};
use crate::problem::Problem;

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
/// Patience of a run that stands alone.
const PATIENCE: u32 = 25;

/// See the module. Keeps the symbolic factorisation from run to run while the pattern stands.
pub struct SemiSmoothNewton {
    /// Iterations that do not halve the residual after which a run gives up.
    pub patience: u32,
    linear: NewtonMatrix,
    y: Vec<f64>,
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

impl Default for SemiSmoothNewton {
    fn default() -> Self {
        SemiSmoothNewton {
            patience: PATIENCE,
            linear: NewtonMatrix::default(),
            y: Vec::new(),
            z: Vec::new(),
            penalty: Vec::new(),
            xi: Vec::new(),
            phi: Vec::new(),
            residual: Vec::new(),
            step: Vec::new(),
            trial: Vec::new(),
            tangents: Vec::new(),
            statuses: Vec::new(),
        }
    }
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
        self.linear.plan(problem);
        let max = max_iterations.min(MAX_ITERATIONS);
        let mut merits = [0.0; MEMORY];
        let mut y = std::mem::take(&mut self.y);
        let mut merit = self.evaluate(problem, &y);
        let first = merit.max(f64::MIN_POSITIVE);
        let (mut done, mut since_better, mut best) = (0, 0, f64::INFINITY);
        while done < max {
            merits[done as usize % MEMORY] = merit;
            let shift = SHIFT * (merit / first).clamp(SHIFT_FLOOR / SHIFT, 1.0);
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
            since_better += 1;
            if err < 0.5 * best {
                (best, since_better) = (err, 0);
            }
            if judge.stop() || since_better > self.patience {
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
                self.xi[row] = y[row] - self.penalty[row] * self.z[row];
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
            self.linear
                .assemble(problem, &self.tangents, &self.penalty, shift);
            if self.linear.factor() && self.linear.solve(&self.residual, &mut self.step) {
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
