//! The judge of all solvers: the projection on the cones, and the natural map.

mod common;
mod problems;

use carom_solve::problem::natural::{natural_part, project_cone, residual, shift};
use carom_solve::problem::RowGroup;
use carom_solve::Bounds;
use common::Rng;
use problems::{any_bounds, coulomb, group, norm, single};

fn draw(rng: &mut Rng, n: usize, size: f64) -> Vec<f64> {
    (0..n).map(|_| rng.uniform(-size, size)).collect()
}

/// Nearest point by brute force: the squared distance is convex in the height t of the result; ternary search.
fn nearest(g: &RowGroup, x: &[f64]) -> Vec<f64> {
    let at = |t: f64| -> Vec<f64> {
        let mut p = vec![t; 1];
        for d in g.bounds.discs() {
            let part = &x[d.start..d.start + d.dim];
            let cut = (d.bound * t / norm(part).max(f64::MIN_POSITIVE)).min(1.0);
            p.extend(part.iter().map(|v| cut * v));
        }
        p
    };
    let far = |t: f64| {
        at(t)
            .iter()
            .zip(x)
            .map(|(p, x)| (p - x).powi(2))
            .sum::<f64>()
    };
    let (mut low, mut high) = (g.least, 10.0 * (1.0 + norm(x)));
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if far(a) <= far(b) {
            high = b;
        } else {
            low = a;
        }
    }
    at(if far(g.least) <= far(low) {
        g.least
    } else {
        low
    })
}

#[test]
fn projection_is_the_nearest_point() {
    let mut rng = Rng(1);
    for case in 0..4000 {
        let mut g = group(any_bounds(&mut rng, 2.0));
        g.least = rng.uniform(-1.0, 1.0).max(0.0);
        let x = draw(&mut rng, g.dim, 1.0);
        let mut p = x.clone();
        project_cone(&g, &mut p);
        let wanted = nearest(&g, &x);
        let apart = p
            .iter()
            .zip(&wanted)
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(
            apart < 1e-7,
            "case {case}: {:?} {x:?}: {p:?}, not {wanted:?}",
            g.bounds
        );
    }
}

/// Moreau: `x = p - d` with p in K, d in K*, perpendicular. Characterises the projection to rounding.
#[test]
fn projection_splits_into_cone_and_dual_cone() {
    let mut rng = Rng(2);
    let (mut inside, mut zero) = (0, 0);
    for case in 0..20_000 {
        let g = group(any_bounds(&mut rng, 10.0));
        let mut x = draw(&mut rng, g.dim, 1.0);
        if case % 5 == 0 {
            x[0] *= 1e-8; // near the tip's edge
        }
        let mut p = x.clone();
        project_cone(&g, &mut p);
        let d: Vec<f64> = p.iter().zip(&x).map(|(p, x)| p - x).collect();
        for disc in g.bounds.discs() {
            let part = norm(&p[disc.start..disc.start + disc.dim]);
            assert!(part <= disc.bound * p[0] * (1.0 + 1e-15), "case {case}");
        }
        assert!(
            p[0] >= 0.0 && d[0] >= shift(&g, &d) - 1e-14,
            "case {case}: {x:?} {p:?}"
        );
        let dot: f64 = p.iter().zip(&d).map(|(a, b)| a * b).sum();
        assert!(dot.abs() < 1e-14, "case {case}: {dot:e}");
        inside += u32::from(p == x);
        zero += u32::from(norm(&p) == 0.0);
        // Homogeneous, and idempotent to rounding.
        let mut twice: Vec<f64> = x.iter().map(|x| 4.0 * x).collect();
        project_cone(&g, &mut twice);
        assert!(twice.iter().zip(&p).all(|(a, b)| *a == 4.0 * b));
        twice.clone_from(&p);
        project_cone(&g, &mut twice);
        assert!(twice.iter().zip(&p).all(|(a, b)| (a - b).abs() <= 4e-16));
    }
    assert!(
        inside > 1000 && zero > 1000,
        "{inside} {zero}: all three regions are drawn"
    );
}

#[test]
fn joints_are_not_projected() {
    let g = RowGroup {
        row: 0,
        dim: 3,
        bounds: Bounds::default(),
        bilateral: true,
        least: 0.0,
    };
    let mut x = [-1.0, 5.0, -7.0];
    project_cone(&g, &mut x);
    assert_eq!(x, [-1.0, 5.0, -7.0]);
    assert_eq!(natural_part(&g, &[9.0, 9.0, 9.0], &[0.0; 3])[..3], [0.0; 3]);
    assert_eq!(
        natural_part(&g, &[0.0; 3], &[1.0, 2.0, 3.0])[..3],
        [1.0, 2.0, 3.0]
    );
}

/// Numbers chosen so that nothing rounds: open, sticking, slipping (3-4-5), and slip with the tip of the cone under it.
#[test]
fn natural_map_is_exactly_zero_at_solutions() {
    let g = group(coulomb(0.5));
    for (r, u) in [
        ([0.0; 3], [1.0, 0.0, 0.0]),
        ([0.0; 3], [0.25, 3.0, -4.0]),
        ([0.0; 3], [0.0; 3]),
        ([2.0, 0.5, -0.25], [0.0; 3]),
        ([10.0, -3.0, -4.0], [0.0, 3.0, 4.0]),
        ([10.0, -3.0, -4.0], [0.0, 30.0, 40.0]),
        ([0.0; 3], [0.0, 3.0, 4.0]),
    ] {
        assert_eq!(natural_part(&g, &r, &u)[..3], [0.0; 3], "{r:?} {u:?}");
    }
    // At the least normal impulse a contact may open, and slips and sticks as it does.
    let held = RowGroup { least: 10.0, ..g };
    for (r, u) in [
        ([10.0, -3.0, -4.0], [0.75, 3.0, 4.0]),
        ([10.0, 1.0, -2.0], [0.75, 0.0, 0.0]),
        ([12.0, 1.0, -2.0], [0.0; 3]),
    ] {
        assert_eq!(natural_part(&held, &r, &u)[..3], [0.0; 3], "{r:?} {u:?}");
    }
    let discs = group(Bounds {
        sliding: 0.5,
        rolling: 0.25,
        spinning: 0.125,
    });
    // Sliding at its bound, rolling held, spinning at its bound: all three at once.
    let (r, u) = (
        [16.0, 0.0, -8.0, 1.0, 2.0, 2.0],
        [0.0, 0.0, 2.0, 0.0, 0.0, -8.0],
    );
    assert!(natural_part(&discs, &r, &u).iter().all(|f| f.abs() < 1e-14));
    let r = [16.0, 0.0, -8.0, 1.0, 2.0, 1.5];
    assert!(
        norm(&natural_part(&discs, &r, &u)) > 0.1,
        "spins below its bound"
    );
}

/// Solutions of one contact drawn status by status, disc by disc; then each condition broken alone.
#[test]
fn natural_map_sees_every_condition() {
    let mut rng = Rng(3);
    for case in 0..5000 {
        let g = group(any_bounds(&mut rng, 2.0));
        let (mut r, mut u) = (vec![0.0; g.dim], vec![0.0; g.dim]);
        let open = rng.below(4) == 0;
        if open {
            u = draw(&mut rng, g.dim, 1.0);
            u[0] = u[0].abs();
        } else {
            r[0] = rng.uniform(0.5, 2.0);
        }
        let mut stuck = None;
        for d in g.bounds.discs().filter(|_| !open) {
            let way = draw(&mut rng, d.dim, 1.0);
            let length = norm(&way).max(1e-3);
            let slips = rng.below(2) == 0;
            let share = if slips { 1.0 } else { rng.uniform(0.0, 0.9) };
            for k in 0..d.dim {
                r[d.start + k] = -share * d.bound * r[0] * way[k] / length;
                if slips {
                    u[d.start + k] = way[k];
                }
            }
            if !slips {
                stuck = Some(d);
            }
        }
        let size = |f: &[f64]| norm(&f[..g.dim]);
        let scale = norm(&r).max(norm(&u));
        let here = size(&natural_part(&g, &r, &u));
        assert!(
            here <= 4e-15 * scale,
            "case {case}: {here:e} of {:?} {r:?} {u:?}",
            g.bounds
        );
        let e = 0.01;
        let broken = |r: &[f64], u: &[f64], what: &str| {
            let f = size(&natural_part(&g, r, u));
            assert!(
                f > 1e-4,
                "case {case}: {what} gives {f:e} for {:?} {r:?} {u:?}",
                g.bounds
            );
        };
        let (mut r2, mut u2) = (r.clone(), u.clone());
        u2[0] = if open { -e } else { e };
        broken(&r, &u2, "penetration, or force at a distance");
        if open {
            r2[0] = e;
            if u[0] > e {
                broken(&r2, &u, "force at a distance");
            }
            r2[0] = -e;
            broken(&r2, &u, "adhesion");
        }
        if let Some(d) = stuck {
            u2.clone_from(&u);
            u2[d.start] = e;
            broken(&r, &u2, "slip below the bound");
        }
        for d in g.bounds.discs().filter(|_| !open) {
            r2.clone_from(&r);
            let x = r[d.start];
            r2[d.start] = x + x.signum() * (d.bound * r[0] + e) * 2.0;
            broken(&r2, &u, "more than the bound");
        }
    }
}

#[test]
fn residual_is_relative_and_honest_about_what_is_not_finite() {
    let g = group(coulomb(0.5));
    let a = [2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0];
    let mut u = [0.0; 3];
    // By hand: q = (-2, 0, 0), r = 0: u + s n = q, r - u = (2, 0, 0), F = (-2, 0, 0), scale 2.
    let p = single(g, &a, &[-2.0, 0.0, 0.0]);
    assert_eq!(residual(&p, &[0.0; 3], &mut u), 1.0);
    assert_eq!(residual(&p, &[1.0, 0.0, 0.0], &mut u), 0.0);
    assert_eq!(u, [0.0; 3]);
    assert_eq!(residual(&p, &[f64::NAN, 0.0, 0.0], &mut u), f64::INFINITY);
    assert_eq!(
        residual(&p, &[f64::INFINITY, 0.0, 0.0], &mut u),
        f64::INFINITY
    );
    assert_eq!(residual(&single(g, &a, &[0.0; 3]), &[0.0; 3], &mut u), 0.0);
    // Forces and velocities far from 1: the squares of neither exist.
    for size in [1e-200, 1e200, 1e-300, 1e300] {
        let p = single(g, &a, &[-2.0 * size, 0.0, 0.0]);
        let err = residual(&p, &[0.0; 3], &mut u);
        assert!((err - 1.0).abs() < 1e-12, "{size:e}: {err:e}");
        let err = residual(&p, &[size, 0.0, 0.0], &mut u);
        assert!(err < 1e-12, "{size:e}: {err:e}");
    }
}
