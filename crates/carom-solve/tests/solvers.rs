//! The family of solvers: what each reaches, and what it says.

mod common;
mod problems;

use carom_solve::problem::RowGroup;
use carom_solve::solver::{by_name, Settings, SOLVERS};
use carom_solve::Bounds;
use common::Rng;
use problems::{
    bodies, coulomb, dense, distance_from_the_law, group, honest, single, solve, solve_with,
};
use std::time::{Duration, Instant};

const TOLERANCE: f64 = 1e-8;
const METHODS: [&str; 4] = ["newton", "gauss-seidel", "admm", "interior-point"];

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
        let law = distance_from_the_law(&problem.groups, &problem.q, &best.r, &u);
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
        let mut groups: Vec<RowGroup> = Vec::new();
        for _ in 0..contacts {
            let row = groups.last().map_or(0, |g| g.row + g.dim);
            let g = group(problems::any_bounds(&mut rng, 0.8));
            groups.push(RowGroup { row, ..g });
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

#[test]
fn limits_are_kept_and_stages_add_up() {
    let mut rng = Rng(7);
    // No solution: two contacts at one place push against each other from both sides, and both approach.
    let groups = vec![
        group(coulomb(0.5)),
        RowGroup {
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
                // No stage is listed that had no iterations left.
                let idle = found.outcome.stages.iter().filter(|s| s.iterations == 0);
                assert!(idle.count() <= 1, "{name}: {:?}", found.outcome.stages);
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
            RowGroup {
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
        let joint = RowGroup {
            row: 0,
            dim: 2,
            bounds: Bounds::default(),
            bilateral: true,
            least: 0.0,
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
