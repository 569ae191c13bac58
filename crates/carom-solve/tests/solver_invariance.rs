//! What solvers may not depend on: units, the order of contacts, the size of numbers, the run.

mod common;
mod problems;

use carom_solve::problem::natural::residual;
use carom_solve::problem::{Problem, Scaled};
use carom_solve::solver::{self, by_name, Settings, SOLVERS};
use common::Rng;
use problems::{bodies, honest, norm, relabelled, rescaled, solve, solve_with};

const TOLERANCE: f64 = 1e-8;

/// Units of mass, length and time, and a scale for each contact: solvers see the same scaled problem.
#[test]
fn units_change_nothing() {
    let mut rng = Rng(4);
    for case in 0..20 {
        let problem = bodies(&mut rng, 3, 5, 0, 0.6).problem();
        let n = problem.rows();
        for kind in 0..3 {
            // Powers of 2: no rounding, so that iterates agree bit for bit.
            let power = |e: i32| 2f64.powi(e);
            let mut scale = vec![1.0; n];
            for g in &problem.groups {
                let head = if g.bounds.sliding > 0.0 { 3 } else { 1 };
                let (force, moment) = match kind {
                    0 => (power(-13), power(-13)),
                    1 => (power(7), power(17)),
                    _ => (
                        power(rng.below(21) as i32 - 10),
                        power(rng.below(21) as i32 - 10),
                    ),
                };
                for k in 0..g.dim {
                    scale[g.row + k] = if k < head { force } else { moment };
                }
            }
            let load = power(-9);
            let other = rescaled(&problem, &scale, load);
            for (name, _) in SOLVERS {
                let [x, y] =
                    [&problem, &other].map(|p| few_iterations(&Scaled::new(p).problem, name));
                assert_eq!(x, y, "case {case} {kind} {name}");
            }
            let [x, y] = [&problem, &other].map(|p| solve(p, "auto", 1e-10));
            assert!(
                x.outcome.converged && y.outcome.converged,
                "case {case} {kind}"
            );
        }
    }
}

fn few_iterations(problem: &Problem, name: &str) -> Vec<f64> {
    let settings = Settings {
        tolerance: 1e-30,
        max_iterations: 12,
        ..Settings::default()
    };
    solve_with(problem, name, settings).r
}

#[test]
fn order_of_contacts_changes_nothing_but_the_way() {
    let mut rng = Rng(5);
    for case in 0..25 {
        let count = 2 + rng.below(5);
        // Fewer rows than velocities: W is regular.
        let problem = bodies(&mut rng, count, count, 0, 0.4).problem();
        let mut order: Vec<usize> = (0..problem.groups.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, rng.below(i + 1));
        }
        let (other, rows) = relabelled(&problem, &order);
        let u: Vec<f64> = rows.iter().map(|&r| problem.q[r]).collect();
        assert_eq!(u, other.q);
        for (name, tolerance) in [("auto", 1e-11), ("interior-point", 1e-9)] {
            let [x, y] = [&problem, &other].map(|p| solve(p, name, tolerance));
            assert!(
                x.outcome.converged && y.outcome.converged,
                "case {case} {name}: {:e} {:e}",
                x.outcome.err,
                y.outcome.err
            );
            let apart: Vec<f64> = rows.iter().zip(&y.u).map(|(&r, u)| x.u[r] - u).collect();
            assert!(
                norm(&apart) <= 1e-6 * norm(&x.u).max(norm(&x.r)),
                "case {case} {name}: {:e}",
                norm(&apart)
            );
            // The solution of the one solves the other.
            let moved: Vec<f64> = rows.iter().map(|&r| x.r[r]).collect();
            let err = residual(&other, &moved, &mut vec![0.0; moved.len()]);
            assert!(err <= 1.1 * tolerance, "case {case} {name}: {err:e}");
        }
    }
}

#[test]
fn same_bits_twice() {
    let mut rng = Rng(6);
    let small = bodies(&mut rng, 4, 12, 1, 0.7).problem();
    let large = bodies(&mut rng, 30, 70, 3, 0.5).problem();
    for problem in [small, large] {
        for (name, _) in SOLVERS {
            let settings = Settings {
                max_iterations: 300,
                ..Settings::default()
            };
            let (x, y) = (
                solve_with(&problem, name, settings),
                solve_with(&problem, name, settings),
            );
            assert_eq!(x.r, y.r, "{name}");
            assert_eq!(x.outcome.iterations, y.outcome.iterations, "{name}");
        }
    }
}

/// Numbers of any size; the only honest failures left are those of a plain method.
#[test]
fn numbers_of_any_size() {
    let mut rng = Rng(8);
    let problem = bodies(&mut rng, 3, 4, 0, 0.6).problem();
    for (force, load) in [
        (1e100, 1e-150),
        (1e-100, 1.0),
        (1.0, 1e-200),
        (1.0, 1e200),
        (1e-50, 1e250),
    ] {
        let p = rescaled(&problem, &vec![force; problem.rows()], load);
        for name in ["auto", "interior-point"] {
            let found = honest(
                &p,
                name,
                TOLERANCE,
                &format!("W x {force:e}^2, q x {load:e}"),
            );
            assert!(
                found.outcome.converged,
                "{name}, {force:e} {load:e}: {:e}",
                found.outcome.err
            );
        }
    }
    for mu in [1e-8, 1e-3, 1e3, 1e6] {
        let mut p = problem.clone();
        for g in &mut p.groups {
            if g.bounds.sliding > 0.0 {
                g.bounds.sliding = mu;
            }
        }
        let found = honest(&p, "auto", TOLERANCE, &format!("mu = {mu:e}"));
        assert!(
            found.outcome.converged,
            "mu = {mu:e}: {:e}",
            found.outcome.err
        );
    }
}

/// The start is used, and a start of rubbish does no harm.
#[test]
fn starts() {
    let mut rng = Rng(9);
    let problem = bodies(&mut rng, 4, 8, 0, 0.6).problem();
    let known = solve(&problem, "auto", 1e-11);
    assert!(known.outcome.converged);
    for (name, _) in SOLVERS {
        let mut method = by_name(name).unwrap();
        let mut r = known.r.clone();
        let outcome = solver::solve(&problem, method.as_mut(), Settings::default(), &mut r);
        assert!(outcome.converged && outcome.iterations == 0, "{name}");
        assert!(
            r.iter()
                .zip(&known.r)
                .all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs()),
            "{name}"
        );
        let mut r = vec![f64::NAN; problem.rows()];
        solver::solve(&problem, method.as_mut(), Settings::default(), &mut r);
        assert!(r.iter().all(|r| r.is_finite()), "{name}");
    }
    let mut r = vec![1e30; problem.rows()];
    let outcome = solver::solve(
        &problem,
        by_name("auto").unwrap().as_mut(),
        Settings::default(),
        &mut r,
    );
    assert!(outcome.converged);
}
