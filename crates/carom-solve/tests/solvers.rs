//! The family of solvers: what each reaches, says, and may not depend on.

mod common;
mod problems;

use carom_solve::problem::natural::residual;
use carom_solve::problem::{Group, Problem};
use carom_solve::solver::{by_name, Settings, SOLVERS};
use carom_solve::Bounds;
use common::Rng;
use problems::{
    bodies, coulomb, dense, distance_from_the_law, group, norm, relabelled, rescaled, single,
    solve, solve_with,
};
use std::time::{Duration, Instant};

const TOLERANCE: f64 = 1e-8;
const METHODS: [&str; 4] = ["newton", "gauss-seidel", "admm", "interior-point"];

/// Solves and holds what the solver says against what was found.
fn honest(problem: &Problem, name: &str, tolerance: f64, case: &str) -> problems::Solved {
    let limited = if name == "auto" { 0 } else { 3000 };
    let found = solve_with(
        problem,
        name,
        Settings {
            tolerance,
            max_iterations: limited,
            ..Settings::default()
        },
    );
    let err = residual(problem, &found.r, &mut vec![0.0; problem.rows()]);
    assert!(found.r.iter().all(|r| r.is_finite()), "{case} {name}");
    assert_eq!(
        found.outcome.converged,
        err <= tolerance,
        "{case} {name}: {err:e}"
    );
    assert!(
        (found.outcome.err - err).abs() <= 1e-3 * err + 1e-15,
        "{case} {name}: says {:e}, is {err:e}",
        found.outcome.err
    );
    if found.outcome.converged {
        let law = distance_from_the_law(&problem.groups, &found.r, &found.u);
        assert!(
            law <= 10.0 * tolerance,
            "{case} {name}: err {err:e}, but {law:e} from the law"
        );
    }
    found
}

/// Mixed cones with joints; in three of four cases more rows than the bodies have velocities. `auto` always arrives.
#[test]
fn random_problems_are_solved_or_said_not_to_be() {
    let mut rng = Rng(1);
    let mut solved = [0; METHODS.len()];
    let cases = 120;
    for case in 0..cases {
        let count = 1 + rng.below(8);
        let contacts = 1 + rng.below(4 * count);
        let joints = if case % 3 == 0 {
            rng.below(1 + count / 2)
        } else {
            0
        };
        let most = [0.3, 0.8, 1.5][rng.below(3)];
        let data = bodies(&mut rng, count, contacts, joints, most);
        let problem = data.problem();
        let name = format!(
            "case {case}: {count} bodies, {contacts} contacts, {joints} joints, bounds to {most}"
        );
        let best = honest(&problem, "auto", TOLERANCE, &name);
        assert!(
            best.outcome.converged,
            "{name}: auto ends at {:e}",
            best.outcome.err
        );
        // u of the bodies, without W.
        let u = data.velocity(&best.r);
        let law = distance_from_the_law(&problem.groups, &best.r, &u);
        assert!(
            law <= 10.0 * TOLERANCE,
            "{name}: {law:e} from the law on the bodies"
        );
        for (k, method) in METHODS.iter().enumerate() {
            solved[k] += u32::from(honest(&problem, method, TOLERANCE, &name).outcome.converged);
        }
    }
    println!("{METHODS:?}: {solved:?} of {cases}");
    assert!(
        solved.iter().all(|&s| s >= cases / 2),
        "{METHODS:?}: {solved:?} of {cases}"
    );
    assert!(
        solved[3] >= cases - cases / 20,
        "interior point: {} of {cases}",
        solved[3]
    );
}

/// Diagonally dominant W: nothing is difficult, and every solver arrives.
#[test]
fn easy_problems_are_solved_by_all() {
    let mut rng = Rng(2);
    for case in 0..200 {
        let contacts = 1 + rng.below(12);
        let mut groups: Vec<Group> = Vec::new();
        for _ in 0..contacts {
            let row = groups.last().map_or(0, |g| g.row + g.dim);
            let g = group(problems::any_bounds(&mut rng, 0.8));
            groups.push(Group { row, ..g });
        }
        let n = groups.last().map_or(0, |g| g.row + g.dim);
        let a: Vec<f64> = (0..n * n).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let matrix: Vec<f64> = (0..n * n)
            .map(|k| {
                let (i, j) = (k / n, k % n);
                let gram: f64 = (0..n).map(|m| a[i * n + m] * a[j * n + m]).sum();
                0.3 * gram / n as f64 + if i == j { rng.uniform(1.0, 2.0) } else { 0.0 }
            })
            .collect();
        let q: Vec<f64> = (0..n).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let problem = dense(groups, &matrix, &q);
        for (name, _) in SOLVERS {
            let found = honest(&problem, name, TOLERANCE, &format!("case {case}"));
            assert!(
                found.outcome.converged,
                "case {case}: {name} ends at {:e}",
                found.outcome.err
            );
        }
    }
}

/// Large enough for the sparse factorisations: a wall of bodies, each on the one before.
#[test]
fn problems_above_the_dense_bound_are_solved() {
    let mut rng = Rng(3);
    for (count, contacts) in [(30, 60), (25, 100)] {
        let data = bodies(&mut rng, count, contacts, 5, 0.6);
        let problem = data.problem();
        assert!(problem.rows() > 96);
        for name in ["auto", "interior-point"] {
            let found = honest(&problem, name, TOLERANCE, "large");
            assert!(found.outcome.converged, "{name}: {:e}", found.outcome.err);
        }
        honest(&problem, "newton", TOLERANCE, "large");
        honest(&problem, "admm", TOLERANCE, "large");
        // One object for problems of several sizes, one after another.
        let mut method = by_name("auto").unwrap();
        for size in [40, 2, 40] {
            let problem = bodies(&mut rng, size, size, 0, 0.5).problem();
            let mut r = vec![0.0; problem.rows()];
            let outcome =
                carom_solve::solver::solve(&problem, method.as_mut(), Settings::default(), &mut r);
            assert!(outcome.converged, "{size}: {:e}", outcome.err);
        }
    }
}

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
                // Far below what is asked for, so that both measures of err end the run together.
                let settings = Settings {
                    tolerance: 1e-30,
                    max_iterations: 12,
                    ..Settings::default()
                };
                if name == "auto" {
                    let (x, y) = (solve(&problem, name, 1e-10), solve(&other, name, 1e-10));
                    assert!(
                        x.outcome.converged && y.outcome.converged,
                        "case {case} {kind}"
                    );
                    continue;
                }
                let [x, y] = [&problem, &other].map(|p| best_scaled(p, name, settings));
                assert_eq!(x, y, "case {case} {kind} {name}");
            }
        }
    }
}

/// The scaled residual's course does not depend on units, so neither do the iterates: the last err that the judge of the
/// scaled problem saw.
fn best_scaled(problem: &Problem, name: &str, settings: Settings) -> Vec<f64> {
    let scaled = carom_solve::problem::Scaled::new(problem);
    let found = solve_with(&scaled.problem, name, settings);
    found.r
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

#[test]
fn limits_are_kept_and_stages_add_up() {
    let mut rng = Rng(7);
    // No solution: two contacts at one place push against each other from both sides, and both approach.
    let groups = vec![
        group(coulomb(0.5)),
        Group {
            row: 3,
            ..group(coulomb(0.5))
        },
    ];
    let mut matrix = vec![0.0; 36];
    for i in 0..3 {
        for (r, c, v) in [
            (i, i, 1.0),
            (i, i + 3, -1.0),
            (i + 3, i, -1.0),
            (i + 3, i + 3, 1.0),
        ] {
            matrix[6 * r + c] = v;
        }
    }
    let stuck = dense(groups, &matrix, &[-1.0, 0.0, 0.0, -1.0, 0.0, 0.0]);
    let good = bodies(&mut rng, 5, 14, 0, 0.8).problem();
    for (name, _) in SOLVERS {
        for problem in [&stuck, &good] {
            for max_iterations in [1, 7, 70] {
                let settings = Settings {
                    max_iterations,
                    tolerance: 1e-14,
                    ..Settings::default()
                };
                let found = solve_with(problem, name, settings);
                let sum: u32 = found.outcome.stages.iter().map(|s| s.iterations).sum();
                assert_eq!(sum, found.outcome.iterations, "{name}");
                assert!(sum <= max_iterations, "{name}: {sum} of {max_iterations}");
                let errs: Vec<f64> = found.outcome.stages.iter().map(|s| s.err).collect();
                assert_eq!(errs.last().copied(), Some(found.outcome.err), "{name}");
            }
        }
        let settings = Settings {
            time_limit: Some(Duration::from_millis(20)),
            tolerance: 1e-13,
            ..Settings::default()
        };
        let began = Instant::now();
        let found = solve_with(&stuck, name, settings);
        assert!(
            began.elapsed() < Duration::from_secs(2),
            "{name}: {:?}",
            began.elapsed()
        );
        assert!(
            !found.outcome.converged && found.outcome.err > 1e-4,
            "{name} solves the unsolvable"
        );
        assert!(found.r.iter().all(|r| r.is_finite()), "{name}");
    }
}

#[test]
fn small_and_degenerate_problems() {
    let empty = dense(Vec::new(), &[], &[]);
    let sphere = [1.0, 0.0, 0.0, 0.0, 3.5, 0.0, 0.0, 0.0, 3.5];
    for (name, _) in SOLVERS {
        let found = solve(&empty, name, TOLERANCE);
        assert!(found.outcome.converged && found.r.is_empty(), "{name}");
        // One contact, in closed form.
        let p = single(group(coulomb(0.5)), &sphere, &[-10.0, 30.0, 40.0]);
        let found = honest(&p, name, 1e-9, "one");
        assert!(found.outcome.converged, "{name}");
        for (r, x) in found.r.iter().zip([10.0, -3.0, -4.0]) {
            assert!((r - x).abs() < 1e-6, "{name}: {:?}", found.r);
        }
        // q = 0, W = 0, and both.
        for (a, b) in [
            (sphere, [0.0; 3]),
            ([0.0; 9], [0.0; 3]),
            ([0.0; 9], [1.0, 2.0, 0.0]),
        ] {
            let p = single(group(coulomb(0.5)), &a, &b);
            let found = honest(&p, name, TOLERANCE, "zeros");
            assert!(
                found.outcome.converged,
                "{name}: {a:?} {b:?} {:e}",
                found.outcome.err
            );
        }
        // A W without tangential stiffness, and a row of zeros beside a good contact.
        let mut a = [0.0; 9];
        a[0] = 1.0;
        let p = single(group(coulomb(0.5)), &a, &[-2.0, 3.0, 4.0]);
        assert!(
            honest(&p, name, TOLERANCE, "soft").outcome.converged,
            "{name}"
        );
        let mut matrix = vec![0.0; 16];
        matrix[..3].copy_from_slice(&sphere[..3]);
        matrix[5] = 3.5;
        matrix[10] = 3.5;
        let groups = vec![
            group(coulomb(0.5)),
            Group {
                row: 3,
                ..group(Bounds::default())
            },
        ];
        let p = dense(groups, &matrix, &[-10.0, 30.0, 40.0, 0.5]);
        assert!(
            honest(&p, name, TOLERANCE, "beside").outcome.converged,
            "{name}"
        );
        // Frictionless rows, and only joints.
        let g = group(Bounds::default());
        let p = single(g, &[2.0], &[-3.0]);
        let found = honest(&p, name, TOLERANCE, "normal");
        assert!(
            found.outcome.converged && (found.r[0] - 1.5).abs() < 1e-6,
            "{name}"
        );
        let joint = Group {
            row: 0,
            dim: 2,
            bounds: Bounds::default(),
            bilateral: true,
        };
        let p = single(joint, &[2.0, 1.0, 1.0, 2.0], &[-3.0, 0.0]);
        let found = honest(&p, name, TOLERANCE, "joint");
        assert!(found.outcome.converged, "{name}: {:e}", found.outcome.err);
        assert!(
            (found.r[0] - 2.0).abs() < 1e-6 && (found.r[1] + 1.0).abs() < 1e-6,
            "{name}: {:?}",
            found.r
        );
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
        let outcome =
            carom_solve::solver::solve(&problem, method.as_mut(), Settings::default(), &mut r);
        assert!(outcome.converged && outcome.iterations == 0, "{name}");
        assert!(
            r.iter()
                .zip(&known.r)
                .all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs()),
            "{name}"
        );
        let mut r = vec![f64::NAN; problem.rows()];
        carom_solve::solver::solve(&problem, method.as_mut(), Settings::default(), &mut r);
        assert!(r.iter().all(|r| r.is_finite()), "{name}");
    }
    let mut r = vec![1e30; problem.rows()];
    let outcome = carom_solve::solver::solve(
        &problem,
        by_name("auto").unwrap().as_mut(),
        Settings::default(),
        &mut r,
    );
    assert!(outcome.converged);
}
