//! Redundant contacts: rows of balls on a floor, whose matrices are singular.

mod common;

use carom_solve::rows::{Measured, RowSystem, NODE_DOF};
use carom_solve::{Bounds, NewtonOptions};
use common::{sharp, solve, Ball, Pair, Spheres};

/// `n` balls in a row on a floor: the rank is below the rows. All would move by `push`, but for a `squeeze` along the row
/// that is largest at its ends and loads the contacts between the balls.
fn row_on_a_floor(n: usize, push: [f64; 3], squeeze: f64, mu: f64) -> (RowSystem, Spheres) {
    let (mass, radius) = (0.2, 0.5);
    let balls: Vec<Ball> = (0..n)
        .map(|i| {
            let centre = [i as f64 * 2.0 * radius, 0.0, radius];
            Ball {
                mass,
                inertia: 0.4 * mass * radius * radius,
                radius,
                frame: centre,
                centre,
            }
        })
        .collect();
    let mut pairs: Vec<Pair> = (1..n).map(|i| Pair::Balls(i - 1, i)).collect();
    pairs.extend((0..n).map(|i| Pair::Plane(i, [0.0, 0.0, 1.0])));
    let problem = Spheres {
        balls,
        pairs,
        curved: false,
    };
    let law = Bounds {
        sliding: mu,
        ..Bounds::default()
    };
    let mut system = problem.system(&vec![law; problem.pairs.len()], |_, _| 0.0);
    let free: Vec<f64> = (0..n)
        .flat_map(|i| {
            let x = push[0] + squeeze * (1.0 - 2.0 * i as f64 / (n - 1) as f64);
            [x, push[1], push[2], 0.0, 0.0, 0.0]
        })
        .collect();
    let mut z = vec![0.0; system.rows()];
    system.linear_measures(&free, &mut z);
    system.z0 = z;
    (system, problem)
}

/// Rank by elimination with complete pivoting.
fn rank(mut a: Vec<f64>, n: usize) -> usize {
    for k in 0..n {
        let (mut r, mut c, mut best) = (k, k, 0.0);
        for i in k..n {
            for j in k..n {
                if a[i * n + j].abs() > best {
                    (r, c, best) = (i, j, a[i * n + j].abs());
                }
            }
        }
        if best < 1e-9 {
            return k;
        }
        for j in 0..n {
            a.swap(k * n + j, r * n + j);
        }
        for i in 0..n {
            a.swap(i * n + k, i * n + c);
        }
        for i in k + 1..n {
            let f = a[i * n + k] / a[k * n + k];
            for j in k..n {
                a[i * n + j] -= f * a[k * n + j];
            }
        }
    }
    n
}

#[test]
fn redundant_contacts_are_solved() {
    for (n, expected) in [(3, 14), (5, 24), (12, 0)] {
        for (push, squeeze, mu) in [
            ([0.0, 0.0, -1.0], 0.0, 0.5),
            ([0.3, 0.1, -1.0], 0.0, 0.9),
            ([0.0, 0.0, -1.0], 1.0, 0.9),
            ([0.3, 0.0, -1.0], 0.7, 0.9),
            ([0.3, 0.1, -1.0], 0.7, 0.3),
            ([1.0, 0.2, -1.0], 2.0, 0.2),
        ] {
            let (mut system, _) = row_on_a_floor(n, push, squeeze, mu);
            let rows = system.rows();
            let found = rank(common::dense_delassus(&system), rows);
            assert!(found < rows);
            assert!(expected == 0 || found == expected, "{found} of {rows}");
            for options in [
                NewtonOptions {
                    dense_contacts: 100,
                    softness: 0.0,
                    ..sharp()
                },
                NewtonOptions {
                    dense_contacts: 0,
                    softness: 0.0,
                    ..sharp()
                },
            ] {
                let s = solve(&mut system, &mut Measured(&[]), &options);
                println!(
                    "{n} balls, rank {found} of {rows}, push {push:?}, squeeze {squeeze}, dense {}: {} iterations, {:?}, violation {:.1e}",
                    options.dense_contacts, s.report.iterations, s.report.rung, s.violation
                );
                assert!(s.report.converged);
                assert!(s.violation < 1e-9, "{}", s.violation);
                if squeeze == 0.0 {
                    // It stays: the balls stop, and the floor carries what was falling.
                    for i in 0..n {
                        assert!((s.u[NODE_DOF * i + 2] - 1.0).abs() < 1e-9);
                    }
                }
            }
        }
    }
}
