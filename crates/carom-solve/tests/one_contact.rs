//! One contact with the others held: the exact solution, against an exhaustive search.

mod common;
mod problems;

use carom_solve::problem::natural::natural_part;
use carom_solve::problem::RowGroup;
use carom_solve::solver::solve_contact;
use carom_solve::Bounds;
use common::Rng;
use problems::{any_bounds, coulomb, distance_from_the_law, group, norm};

fn velocity(a: &[f64], b: &[f64], r: &[f64]) -> Vec<f64> {
    let n = b.len();
    (0..n)
        .map(|i| b[i] + (0..n).map(|j| a[n * i + j] * r[j]).sum::<f64>())
        .collect()
}

/// Natural map over the larger of b, r and u.
fn err(g: &RowGroup, a: &[f64], b: &[f64], r: &[f64]) -> f64 {
    let u = velocity(a, b, r);
    norm(&natural_part(g, r, &u)) / norm(b).max(norm(r)).max(norm(&u)).max(f64::MIN_POSITIVE)
}

fn solved(g: &RowGroup, a: &[f64], b: &[f64], start: &[f64]) -> (Vec<f64>, f64) {
    let mut r = start.to_vec();
    solve_contact(g, a, b, &mut r);
    let e = err(g, a, b, &r);
    (r, e)
}

/// `L L^T + shift` with axes of very different lengths, turned: the stronger `skew`, the stronger coupled.
fn spd(rng: &mut Rng, n: usize, skew: f64) -> Vec<f64> {
    let l: Vec<f64> = (0..n * n)
        .map(|k| rng.uniform(-1.0, 1.0) * skew.powi((k % n) as i32))
        .collect();
    let mut a = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            a[n * i + j] = (0..n).map(|k| l[n * i + k] * l[n * j + k]).sum();
        }
        a[n * i + i] += 1e-3;
    }
    // As a scaled problem has it: the mean of the diagonal is 1.
    let mean = (0..n).map(|i| a[n * i + i]).sum::<f64>() / n as f64;
    a.iter_mut().for_each(|v| *v /= mean);
    a
}

/// Slip found without any cleverness: the equation of the angle on a fine grid, brackets bisected. All solutions.
fn slips(a: &[f64], b: &[f64], mu: f64) -> Vec<[f64; 3]> {
    let at = |t: f64| {
        let (s, c) = t.sin_cos();
        let den = a[0] - mu * (a[1] * c + a[2] * s);
        let n = -b[0] / den;
        let r = [n, -mu * n * c, -mu * n * s];
        let u = velocity(a, b, &r);
        // The angle's equation times den: finite all around.
        (den * (c * u[2] - s * u[1]), c * u[1] + s * u[2], r)
    };
    let count = 20_000;
    let mut found = Vec::new();
    for k in 0..count {
        let angle = |k: usize| std::f64::consts::TAU * (k as f64 + 0.5) / count as f64;
        let (mut x, mut y) = (angle(k), angle(k + 1));
        let sign = at(x).0 > 0.0;
        if sign == (at(y).0 > 0.0) {
            continue;
        }
        for _ in 0..60 {
            let m = 0.5 * (x + y);
            if (at(m).0 > 0.0) == sign {
                x = m;
            } else {
                y = m;
            }
        }
        let (_, along, r) = at(x);
        if along >= 0.0 && r[0] > 0.0 {
            found.push(r);
        }
    }
    found
}

/// Whether open, stick or slip holds, each with a margin.
fn exhaustive(a: &[f64], b: &[f64], mu: f64) -> [bool; 3] {
    let g = group(coulomb(mu));
    let fits = |r: &[f64]| err(&g, a, b, r) < 1e-9;
    let free = RowGroup {
        bilateral: true,
        ..g
    };
    let mut held = [0.0; 3];
    solve_contact(&free, a, b, &mut held);
    [
        fits(&[0.0; 3]),
        fits(&held),
        slips(a, b, mu).iter().any(|r| fits(r)),
    ]
}

#[test]
fn coulomb_block_is_solved_whenever_a_solution_exists() {
    let mut rng = Rng(7);
    let mut met = [0; 3];
    for case in 0..30_000 {
        let skew = [1.0, 0.3, 3.0, 0.05][case % 4];
        let a = spd(&mut rng, 3, skew);
        let b: Vec<f64> = (0..3).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let mu = rng.uniform(0.01, 2.0);
        let start: Vec<f64> = if case % 2 == 0 {
            vec![0.0; 3]
        } else {
            (0..3).map(|_| rng.uniform(-1.0, 1.0)).collect()
        };
        let (r, e) = solved(&group(coulomb(mu)), &a, &b, &start);
        // Positive definite: a solution always exists.
        assert!(
            e < 1e-12,
            "case {case}: err {e:e}, mu {mu}, a {a:?}, b {b:?}, r {r:?}"
        );
        let slides = (norm(&r[1..]) - mu * r[0]).abs() < 1e-9 * r[0];
        met[if r[0] == 0.0 {
            0
        } else {
            1 + usize::from(slides)
        }] += 1;
        if case % 100 == 0 {
            let which = exhaustive(&a, &b, mu);
            assert!(
                which.iter().any(|&w| w),
                "case {case}: the search itself misses it"
            );
        }
    }
    assert!(
        met.iter().all(|&m| m > 1000),
        "{met:?}: open, stick and slip are all drawn"
    );
}

#[test]
fn unsymmetric_coulomb_block_is_solved_whenever_the_search_finds_something() {
    let mut rng = Rng(8);
    let (mut solvable, mut none) = (0, 0);
    for case in 0..1500 {
        let mut a = spd(&mut rng, 3, [1.0, 0.3][case % 2]);
        for k in [1, 2, 3, 5, 6, 7] {
            a[k] += rng.uniform(-0.4, 0.4);
        }
        let b: Vec<f64> = (0..3).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let mu = rng.uniform(0.01, 2.0);
        let (r, e) = solved(&group(coulomb(mu)), &a, &b, &[0.0; 3]);
        assert!(r.iter().all(|r| r.is_finite()));
        if e < 1e-10 {
            solvable += 1;
            continue;
        }
        let which = exhaustive(&a, &b, mu);
        assert_eq!(
            which, [false; 3],
            "case {case}: mu {mu}, a {a:?}, b {b:?}: {e:e}"
        );
        none += 1;
    }
    assert!(
        solvable > 1000,
        "{solvable} solved, {none} without a solution"
    );
}

/// Diagonal block: normal, then tangent, in closed form by hand.
#[test]
fn sphere_block_by_hand() {
    let a = [1.0, 0.0, 0.0, 0.0, 3.5, 0.0, 0.0, 0.0, 3.5];
    let g = group(coulomb(0.5));
    assert_eq!(solved(&g, &a, &[0.1, 1.0, 1.0], &[1.0; 3]).0, [0.0; 3]);
    assert_eq!(
        solved(&g, &a, &[-2.0, 1.75, 0.0], &[0.0; 3]).0,
        [2.0, -0.5, 0.0]
    );
    let r = solved(&g, &a, &[-10.0, 30.0, 40.0], &[0.0; 3]).0;
    assert!(
        r.iter()
            .zip([10.0, -3.0, -4.0])
            .all(|(r, x)| (r - x).abs() < 1e-14),
        "{r:?}"
    );
}

/// Blocks without stiffness in some rows: no NaN, and the law where it can hold.
#[test]
fn zero_rows_of_a_block_are_survived() {
    let zero = [0.0; 9];
    let g = group(coulomb(0.5));
    for b in [[0.0; 3], [0.0, 1.0, 0.0], [1.0, -1.0, 2.0]] {
        let (r, e) = solved(&g, &zero, &b, &[1.0, 0.1, 0.1]);
        assert!(e == 0.0, "W = 0, b = {b:?}: {r:?} {e:e}");
    }
    // Nothing stops it: no solution, but numbers.
    let (r, _) = solved(&g, &zero, &[-1.0, 0.0, 0.0], &[0.0; 3]);
    assert!(r.iter().all(|r| r.is_finite()), "{r:?}");
    // The tangent cannot be moved by forces: it slips at the bound, or lies still under any force.
    let a = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for b in [[-2.0, 3.0, 4.0], [-2.0, 0.0, 0.0], [-2.0, 0.0, -1.0]] {
        let (r, e) = solved(&g, &a, &b, &[0.0; 3]);
        assert!(e < 1e-15, "b = {b:?}: {r:?} {e:e}");
    }
    // Rolling and spinning rows without stiffness.
    for bounds in [
        Bounds {
            rolling: 0.3,
            ..Bounds::default()
        },
        Bounds {
            spinning: 0.3,
            ..Bounds::default()
        },
        Bounds {
            sliding: 0.5,
            rolling: 0.3,
            spinning: 0.2,
        },
    ] {
        let g = group(bounds);
        let mut a = vec![0.0; g.dim * g.dim];
        a[0] = 1.0;
        let mut b = vec![0.5; g.dim];
        b[0] = -2.0;
        let (r, e) = solved(&g, &a, &b, &vec![0.0; g.dim]);
        assert!(e < 1e-15, "{bounds:?}: {r:?} {e:e}");
    }
}

#[test]
fn stiffness_of_any_size() {
    let mut rng = Rng(9);
    for case in 0..2000 {
        let a = spd(&mut rng, 3, 0.5);
        let b: Vec<f64> = (0..3).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let mu = 10f64.powf(rng.uniform(-6.0, 6.0));
        let (r, e) = solved(&group(coulomb(mu)), &a, &b, &[0.0; 3]);
        // The shift mu |u_T| has the rounding of u_T, mu times as large.
        assert!(
            e < 1e-14 * (100.0 + mu),
            "case {case}: mu {mu:e}, a {a:?}, b {b:?}: {r:?} {e:e}"
        );
    }
}

/// Contacts with any discs: exact where the blocks hardly feel each other; where they do the step is one of sweeps, and
/// repeated it arrives.
#[test]
fn discs_are_solved_by_repeated_steps() {
    let mut rng = Rng(10);
    for case in 0..3000 {
        let g = group(any_bounds(&mut rng, 0.5));
        let mut a = spd(&mut rng, g.dim, 1.0);
        for i in 0..g.dim {
            for j in 0..g.dim {
                a[g.dim * i + j] *= if i == j { 1.0 } else { 0.2 };
            }
        }
        let b: Vec<f64> = (0..g.dim).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let mut r = vec![0.0; g.dim];
        let mut steps = 0;
        while err(&g, &a, &b, &r) > 1e-12 {
            solve_contact(&g, &a, &b, &mut r);
            steps += 1;
            assert!(
                steps < 200,
                "case {case}: {:?} a {a:?} b {b:?}: {r:?}",
                g.bounds
            );
        }
        let u = velocity(&a, &b, &r);
        assert!(
            distance_from_the_law(&[g], &b, &r, &u) < 1e-11,
            "case {case}"
        );
    }
}

#[test]
fn joints_are_solved_exactly_and_singular_ones_too() {
    let mut rng = Rng(11);
    for dim in 1..=6 {
        let g = RowGroup {
            row: 0,
            dim,
            bounds: Bounds::default(),
            bilateral: true,
            least: 0.0,
        };
        let a = spd(&mut rng, dim, 1.0);
        let b: Vec<f64> = (0..dim).map(|_| rng.uniform(-1.0, 1.0)).collect();
        assert!(solved(&g, &a, &b, &vec![0.0; dim]).1 < 1e-12);
        // Every row twice as one: any split of the force does.
        let ones = vec![1.0; dim * dim];
        let mut r = vec![0.0; dim];
        for _ in 0..3 {
            solve_contact(&g, &ones, &vec![1.0; dim], &mut r);
        }
        assert!(err(&g, &ones, &vec![1.0; dim], &r) < 1e-14, "{r:?}");
        let mut r = vec![0.0; dim];
        solve_contact(&g, &vec![0.0; dim * dim], &vec![1.0; dim], &mut r);
        assert!(r.iter().all(|r| r.is_finite()));
    }
}
