//! Semi-smooth Newton (`newton`) on `u = W r + q`.

use super::matrix::NewtonMatrix;
use super::{ConeSolver, Judge};
use crate::newton::{Augmented, Equations, Rule, Steps};
use crate::problem::Problem;

/// Iterations (1) when not told otherwise; bounds the time of a run that does not converge.
const MAX_ITERATIONS: u32 = 100;
/// Proximal shift at the start over the diagonal of W (1): W is mostly singular. Large, linear convergence; small, directions
/// along its null space, cut by the line search.
const SHIFT: f64 = 1e-4;
/// The least shift, over the same (1), a little above rounding.
const SHIFT_FLOOR: f64 = 1e-11;
/// The merit may rise across a change of status: it is compared with so many last ones.
const RULE: Rule = Rule {
    shift: SHIFT,
    shift_floor: SHIFT_FLOOR / SHIFT,
    least: f64::MIN_POSITIVE,
    memory: 6,
    start_counts: Some(true),
    max_line_search: 8,
    patience: u32::MAX,
};
/// Factor (1) on the shift where the matrix was singular.
const SHIFT_GROWTH: f64 = 1e3;
/// How often it grows (1) in one iteration before the run ends: `SHIFT_GROWTH^4` leads from the floor to [`SHIFT`] and beyond.
const SHIFT_TRIES: u32 = 4;
/// Iterations (1) without a better `err` before a run that stands alone gives up.
const PATIENCE: u32 = 25;

/// See the module. Keeps the symbolic factorisation from run to run while the pattern stands.
pub struct SemiSmoothNewton {
    /// Iterations that do not halve the residual after which a run gives up.
    pub patience: u32,
    linear: NewtonMatrix,
    at: Augmented,
    steps: Steps,
}

impl Default for SemiSmoothNewton {
    fn default() -> Self {
        SemiSmoothNewton {
            patience: PATIENCE,
            linear: NewtonMatrix::default(),
            at: Augmented::default(),
            steps: Steps::default(),
        }
    }
}

impl ConeSolver for SemiSmoothNewton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        let problem = &judge.scaled.problem;
        self.at.resize(problem.rows(), problem.groups.len());
        set_penalty(problem, &mut self.at.penalty);
        self.linear.plan(problem);
        let mut y = judge.best.clone();
        let mut on = OnBlocks {
            problem,
            judge,
            linear: &mut self.linear,
            at: &mut self.at,
            most: max_iterations.min(MAX_ITERATIONS),
            patience: self.patience,
            since_better: 0,
            best: f64::INFINITY,
        };
        self.steps.iterate(&mut on, &mut y, &RULE)[0]
    }
}

/// One value for all rows of a disc: the reciprocal of their largest diagonal.
fn set_penalty(problem: &Problem, penalty: &mut [f64]) {
    for (i, group) in problem.groups.iter().enumerate() {
        let block = problem.w.block(i, problem.w.diagonal[i]);
        let mut set = |rows: std::ops::Range<usize>| {
            let diagonal = rows.clone().map(|r| block[r * group.dim + r]);
            let largest = diagonal.fold(0.0, f64::max);
            let inverse = if largest > 0.0 { 1.0 / largest } else { 1.0 };
            penalty[group.row + rows.start..group.row + rows.end].fill(inverse);
        };
        if group.bilateral {
            (0..group.dim).for_each(|r| set(r..r + 1));
            continue;
        }
        set(0..1);
        for disc in group.bounds.discs() {
            set(disc.start..disc.start + disc.dim);
        }
    }
}

/// A run.
struct OnBlocks<'r, 'j> {
    problem: &'j Problem,
    judge: &'r mut Judge<'j>,
    linear: &'r mut NewtonMatrix,
    at: &'r mut Augmented,
    most: u32,
    patience: u32,
    since_better: u32,
    best: f64,
}

impl Equations for OnBlocks<'_, '_> {
    fn evaluate(&mut self, y: &[f64]) -> f64 {
        self.problem.velocity(y, &mut self.at.z);
        self.at.project(self.problem.groups.iter().copied(), y);
        let squares = self.at.residual.iter().map(|f| f * f);
        squares.sum::<f64>().sqrt()
    }

    fn stop(&mut self, y: &mut [f64], merit: f64, iterations: u32) -> bool {
        if iterations == 0 {
            return self.most == 0;
        }
        if !merit.is_finite() {
            return true;
        }
        // What lies in the cones is mostly nearer.
        let err = self.judge.see(&self.at.phi).min(self.judge.see(y));
        self.since_better += 1;
        if err < 0.5 * self.best {
            (self.best, self.since_better) = (err, 0);
        }
        self.judge.stop() || self.since_better > self.patience || iterations >= self.most
    }

    /// Solves `((1 - D) + D P (W + shift)) step = phi - y`.
    fn direction(&mut self, _: &[f64], _: f64, mut shift: f64, step: &mut [f64]) -> bool {
        let (problem, at) = (self.problem, &mut *self.at);
        at.differentiate(problem.groups.iter().copied());
        for _ in 0..=SHIFT_TRIES {
            self.linear
                .assemble(problem, &at.tangents, &at.penalty, shift);
            if self.linear.factor() && self.linear.solve(&at.residual, step) {
                return true;
            }
            shift *= SHIFT_GROWTH;
        }
        false
    }
}
