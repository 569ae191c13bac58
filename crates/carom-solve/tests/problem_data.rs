//! From arrays to a problem and back: what is taken, what is refused, what the row map does.

mod common;
mod problems;

use carom_solve::problem::natural::residual;
use carom_solve::problem::{Problem, Scaled};
use carom_solve::Bounds;
use common::Rng;
use problems::{bodies, coulomb, distance_from_the_law, full, solve};

/// A dense matrix (row-major) in compressed rows, zeros left out.
fn csr(matrix: &[f64], n: usize) -> (Vec<i64>, Vec<i64>, Vec<f64>) {
    let (mut ptr, mut col, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in matrix.chunks(n.max(1)) {
        for (c, v) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            col.push(c as i64);
            values.push(*v);
        }
        ptr.push(col.len() as i64);
    }
    (ptr, col, values)
}

fn random_w(rng: &mut Rng, n: usize, rank: usize) -> Vec<f64> {
    let h: Vec<f64> = (0..n * rank).map(|_| rng.uniform(-1.0, 1.0)).collect();
    (0..n * n)
        .map(|k| {
            (0..rank)
                .map(|m| h[k / n * rank + m] * h[k % n * rank + m])
                .sum()
        })
        .collect()
}

#[test]
fn what_is_no_problem_is_refused_with_its_place() {
    let (ptr, col, w) = csr(&[2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0], 3);
    let q = [-1.0, 0.5, 0.0];
    let mu = [coulomb(0.5)];
    let good = Problem::from_csr(&ptr, &col, &w, &q, 3, &mu);
    assert!(good.is_ok());
    let refused =
        |ptr: &[i64], col: &[i64], w: &[f64], q: &[f64], d: usize, mu: &[Bounds], place: &str| {
            let error = Problem::from_csr(ptr, col, w, q, d, mu).unwrap_err();
            assert_eq!(error.place, place, "{error}");
            assert!(!error.to_string().contains('\n'));
            error.to_string()
        };
    for d in [0, 1, 4, 7] {
        refused(&ptr, &col, &w, &q, d, &mu, "dimension");
    }
    refused(&ptr, &col, &w, &q[..2], 3, &mu, "q");
    refused(&ptr, &col, &w, &q, 3, &[coulomb(0.5); 2], "q");
    refused(&ptr[..3], &col, &w, &q, 3, &mu, "W");
    refused(&[], &col, &w, &q, 3, &mu, "W");
    refused(&[0, 2, 1, 3], &col, &w, &q, 3, &mu, "W");
    refused(&[1, 1, 2, 3], &col, &w, &q, 3, &mu, "W");
    refused(&[0, 1, 2, 4], &col, &w, &q, 3, &mu, "W");
    refused(&[0, -1, 2, 3], &col, &w, &q, 3, &mu, "W");
    refused(&ptr, &col[..2], &w, &q, 3, &mu, "W");
    refused(&ptr, &col, &w[..2], &q, 3, &mu, "W");
    assert!(refused(&ptr, &[0, 1, 3], &w, &q, 3, &mu, "W").contains("column 3"));
    refused(&ptr, &[0, -1, 2], &w, &q, 3, &mu, "W");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(refused(&ptr, &col, &[1.0, bad, 1.0], &q, 3, &mu, "W").contains("value 1"));
        assert!(refused(&ptr, &col, &w, &[-1.0, 0.0, bad], 3, &mu, "q").contains("value 2"));
        refused(&ptr, &col, &w, &q, 3, &[coulomb(bad)], "mu");
    }
    assert!(refused(&ptr, &col, &w, &q, 3, &[coulomb(-0.1)], "mu").contains("-0.1 at contact 0"));
    let rolls = Bounds {
        rolling: -1.0,
        ..coulomb(0.1)
    };
    refused(&ptr, &col, &w, &q, 3, &[rolls], "mu_r");
    let spins = Bounds {
        spinning: f64::NAN,
        ..coulomb(0.1)
    };
    refused(&ptr, &col, &w, &q, 3, &[spins], "mu_s");
    let (empty, map) = Problem::from_csr(&[0], &[], &[], &[], 3, &[]).unwrap();
    assert_eq!(empty.rows(), 0);
    assert!(map.leave(&[]).is_empty());
}

/// Rows with bound 0 have no place, take no force, and their columns do nothing.
#[test]
fn rows_without_a_bound_are_left_out() {
    let mut rng = Rng(1);
    let all = [0.0, 0.4];
    let bounds: Vec<Bounds> = (0..8)
        .map(|k| Bounds {
            sliding: all[k & 1],
            rolling: all[k >> 1 & 1],
            spinning: all[k >> 2],
        })
        .collect();
    let n = 6 * bounds.len();
    let matrix = random_w(&mut rng, n, n + 5);
    let (ptr, col, w) = csr(&matrix, n);
    let q: Vec<f64> = (0..n).map(|_| rng.uniform(-1.0, 1.0)).collect();
    let (problem, map) = Problem::from_csr(&ptr, &col, &w, &q, 6, &bounds).unwrap();
    for (g, b) in problem.groups.iter().zip(&bounds) {
        assert_eq!((g.bounds, g.dim), (*b, b.dim()));
    }
    // Which row is which: by its own number.
    let numbers: Vec<f64> = (0..n).map(|k| k as f64).collect();
    let rows: Vec<usize> = map.enter(&numbers).iter().map(|x| *x as usize).collect();
    let small = full(&problem);
    let m = problem.rows();
    for i in 0..m {
        assert_eq!(problem.q[i], q[rows[i]]);
        for j in 0..m {
            assert_eq!(small[i * m + j], matrix[rows[i] * n + rows[j]]);
        }
    }
    let found = solve(&problem, "auto", 1e-10);
    assert!(found.outcome.converged);
    let r = map.leave(&found.r);
    assert_eq!(
        r.iter().filter(|r| **r != 0.0).count(),
        found.r.iter().filter(|r| **r != 0.0).count()
    );
    for (k, b) in bounds.iter().enumerate() {
        let r = &r[6 * k..6 * k + 6];
        assert!(b.sliding > 0.0 || r[1..3] == [0.0; 2]);
        assert!(b.rolling > 0.0 || r[3..5] == [0.0; 2]);
        assert!(b.spinning > 0.0 || r[5] == 0.0);
    }
}

/// `mu_r` and `mu_s` of contacts that have no such rows are not looked at, as in the data of three rows.
#[test]
fn bounds_beyond_the_dimension_do_not_act() {
    let (ptr, col, w) = csr(&[2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0], 3);
    let bounds = Bounds {
        sliding: 0.5,
        rolling: 0.3,
        spinning: 0.2,
    };
    let (problem, _) = Problem::from_csr(&ptr, &col, &w, &[-1.0; 3], 3, &[bounds]).unwrap();
    assert_eq!(problem.groups[0].bounds, coulomb(0.5));
}

#[test]
fn equal_places_add_up_and_one_sided_patterns_are_taken() {
    // Twice the diagonal as halves; the coupling is given in one direction only.
    let ptr = [0, 3, 5, 7, 9, 11, 13];
    let col = [0, 0, 3, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5];
    let w = [
        1.0, 1.0, 0.25, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
    ];
    let (problem, _) =
        Problem::from_csr(&ptr, &col, &w, &[-1.0; 6], 3, &[coulomb(0.5); 2]).unwrap();
    let matrix = full(&problem);
    assert_eq!((matrix[0], matrix[3], matrix[18]), (2.0, 0.25, 0.0));
    assert!((problem.w.asymmetry() - 0.125).abs() < 1e-15);
    for (name, _) in carom_solve::solver::SOLVERS {
        let found = solve(&problem, name, 1e-8);
        assert!(found.r.iter().all(|r| r.is_finite()), "{name}");
        assert!(
            found.outcome.converged || name == "admm",
            "{name}: {:e}",
            found.outcome.err
        );
    }
}

/// The plane problem, and the same with a second direction of sliding that nothing drives.
#[test]
fn plane_contacts_equal_those_in_space() {
    let mut rng = Rng(2);
    for case in 0..40 {
        let contacts = 1 + rng.below(6);
        let (n2, n3) = (2 * contacts, 3 * contacts);
        // Nodes with three velocities in the plane; rows random, with rows to spare in every second case.
        let matrix = random_w(&mut rng, n2, if case % 2 == 0 { n2 + 2 } else { n2 });
        let mut q: Vec<f64> = (0..n2).map(|_| rng.uniform(-1.0, 1.0)).collect();
        if case % 5 == 0 {
            q.iter_mut().skip(1).step_by(2).for_each(|q| *q = 0.0);
        }
        let mu: Vec<Bounds> = (0..contacts)
            .map(|k| coulomb(if k == 3 { 0.0 } else { rng.uniform(0.1, 0.9) }))
            .collect();
        let place = |k: usize| k / 2 * 3 + k % 2;
        let (mut matrix3, mut q3) = (vec![0.0; n3 * n3], vec![0.0; n3]);
        for i in 0..n2 {
            q3[place(i)] = q[i];
            for j in 0..n2 {
                matrix3[place(i) * n3 + place(j)] = matrix[i * n2 + j];
            }
        }
        for c in 0..contacts {
            matrix3[(3 * c + 2) * n3 + 3 * c + 2] = 1.0;
        }
        let (p2, c2, v2) = csr(&matrix, n2);
        let (p3, c3, v3) = csr(&matrix3, n3);
        let (flat, map2) = Problem::from_csr(&p2, &c2, &v2, &q, 2, &mu).unwrap();
        let (space, map3) = Problem::from_csr(&p3, &c3, &v3, &q3, 3, &mu).unwrap();
        for name in ["auto", "gauss-seidel", "interior-point"] {
            let [x, y] = [&flat, &space].map(|p| solve(p, name, 1e-9));
            assert!(
                x.outcome.converged && y.outcome.converged,
                "case {case} {name}"
            );
            let (r2, r3) = (map2.leave(&x.r), map3.leave(&y.r));
            assert_eq!(r2.len(), n2);
            let across: f64 = (0..contacts)
                .map(|c| r3[3 * c + 2].abs())
                .fold(0.0, f64::max);
            assert!(
                across < 1e-8,
                "case {case} {name}: {across:e} across the plane"
            );
            // Each one's forces solve the other's problem.
            let moved: Vec<f64> = (0..n3)
                .map(|k| {
                    if k % 3 == 2 {
                        0.0
                    } else {
                        r2[k / 3 * 2 + k % 3]
                    }
                })
                .collect();
            let r = map3.enter(&moved);
            assert!(
                residual(&space, &r, &mut vec![0.0; r.len()]) < 2e-9,
                "case {case} {name}"
            );
            let moved: Vec<f64> = (0..n2).map(|k| r3[place(k)]).collect();
            let r = map2.enter(&moved);
            assert!(
                residual(&flat, &r, &mut vec![0.0; r.len()]) < 2e-9,
                "case {case} {name}"
            );
        }
    }
}

/// W of the rows equals `G M^-1 G^T` computed densely, and its product that over the bodies.
#[test]
fn blocks_of_bodies_are_those_of_the_dense_matrix() {
    let mut rng = Rng(3);
    for _ in 0..20 {
        let count = 1 + rng.below(6);
        let data = bodies(&mut rng, count, 3 * count, 2, 0.5);
        let problem = data.problem();
        assert_eq!(full(&problem), common::dense_delassus(&data.system));
        let r: Vec<f64> = (0..problem.rows())
            .map(|_| rng.uniform(-1.0, 1.0))
            .collect();
        let mut u = vec![0.0; r.len()];
        problem.velocity(&r, &mut u);
        assert!(u
            .iter()
            .zip(data.velocity(&r))
            .all(|(a, b)| (a - b).abs() < 1e-10));
        assert!(problem.w.asymmetry() < 1e-15);
    }
}

/// The scaled problem has diagonals near 1 and loads up to 1, and its solutions are those of the problem.
#[test]
fn scaling_keeps_cones_and_solutions() {
    let mut rng = Rng(4);
    for _ in 0..20 {
        let problem = bodies(&mut rng, 3, 5, 1, 0.7).problem();
        let scaled = Scaled::new(&problem);
        let largest = scaled.problem.q.iter().fold(0.0f64, |m, q| m.max(q.abs()));
        assert_eq!(largest, 1.0);
        let (matrix, n) = (full(&scaled.problem), problem.rows());
        for g in &scaled.problem.groups {
            let mean = g.rows().map(|r| matrix[r * n + r]).sum::<f64>() / g.dim as f64;
            assert!((mean - 1.0).abs() < 1e-12);
        }
        let found = solve(&scaled.problem, "auto", 1e-11);
        assert!(found.outcome.converged);
        let (mut r, mut u, mut back) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        scaled.leave(&found.r, &mut r);
        problem.velocity(&r, &mut u);
        assert!(distance_from_the_law(&problem.groups, &problem.q, &r, &u) < 1e-8);
        scaled.enter(&r, &mut back);
        assert!(back
            .iter()
            .zip(&found.r)
            .all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs()));
    }
}

#[test]
fn numbers_at_the_end_of_their_range_give_finite_forces() {
    // Found by fuzzing: factors of the scaling whose inverse or product is infinite made all forces NaN.
    let mu = [Bounds {
        sliding: 0.5,
        rolling: 0.1,
        spinning: 0.1,
    }];
    for (w, q) in [
        (1e308, -1.0),
        (5e-324, -1.0),
        (1e-300, 1e300),
        (1e300, -1e300),
    ] {
        let mut matrix = vec![0.0; 36];
        (0..6).for_each(|k| matrix[7 * k] = w);
        let (ptr, col, values) = csr(&matrix, 6);
        let (problem, _) =
            Problem::from_csr(&ptr, &col, &values, &[q; 6], 6, &mu).expect("a problem");
        for (name, _) in carom_solve::solver::SOLVERS {
            let mut method = carom_solve::solver::by_name(name).expect("listed");
            let mut r = vec![0.0; problem.rows()];
            let settings = carom_solve::solver::Settings::default();
            carom_solve::solver::solve(&problem, method.as_mut(), settings, &mut r);
            assert!(r.iter().all(|v| v.is_finite()), "{name} {w:e} {q:e}: {r:?}");
        }
    }
}
