//! The solvers by name, and how one of them is run.

use super::admm::Admm;
use super::auto::Auto;
use super::gauss_seidel::GaussSeidel;
use super::interior::InteriorPoint;
use super::judge::{ConeSolver, Judge, Outcome, Settings};
use super::semi_smooth::SemiSmoothNewton;
use crate::problem::{Problem, Scaled};

/// Names and one line each, `auto` first.
pub const SOLVERS: [(&str, &str); 5] = [
    (
        "auto",
        "hybrid with checkpoints: sweeps, Newton, and what else is needed",
    ),
    (
        "newton",
        "semi-smooth Newton on the multipliers with sparse LU and vanishing proximal shift",
    ),
    (
        "gauss-seidel",
        "block Gauss-Seidel, every contact solved exactly in turn",
    ),
    (
        "admm",
        "alternating directions with one Cholesky factorisation and accelerated restart",
    ),
    (
        "interior-point",
        "primal-dual path following on the cones, the slip shift in its equations",
    ),
];

/// A solver by name.
pub fn by_name(name: &str) -> Option<Box<dyn ConeSolver + Send>> {
    Some(match name {
        "auto" => Box::new(Auto::default()),
        "newton" => Box::new(SemiSmoothNewton::default()),
        "gauss-seidel" => Box::new(GaussSeidel::default()),
        "admm" => Box::new(Admm::default()),
        "interior-point" => Box::new(InteriorPoint::default()),
        _ => return None,
    })
}

/// Solves `problem` from `r` (scaled inside), leaving the best multipliers in `r`.
pub fn solve(
    problem: &Problem,
    solver: &mut dyn ConeSolver,
    settings: Settings<'_>,
    r: &mut [f64],
) -> Outcome {
    let scaled = Scaled::new(problem);
    let mut judge = Judge::new(problem, &scaled, r, settings);
    if solver.name() == "auto" {
        solver.run(&mut judge, u32::MAX);
    } else if !judge.solved() {
        judge.stage(solver.name(), solver, u32::MAX, "asked for".into());
    }
    scaled.leave(&judge.best, r);
    Outcome {
        converged: judge.solved(),
        err: judge.best_given,
        err_scaled: judge.best_scaled,
        iterations: judge.stages.iter().map(|s| s.iterations).sum(),
        stages: judge.stages,
    }
}
