//! Forces that hold everything are found where there are such.

mod common;

use carom_solve::cone::{self, Bounds};
use carom_solve::problem::{BlockMatrix, Problem, RowGroup, Scaled};
use carom_solve::solver::InteriorPoint;
use common::Rng;

include!("common/mixed.rs");

/// Forces that were put inside of the cones are found again, or others that hold as well.
#[test]
fn what_can_be_held_is_found() {
    let mut rng = Rng(6);
    for case in 0..200 {
        let mut problem = mixed(&mut rng);
        symmetric(&mut problem);
        let mut held: Vec<f64> = problem.q.iter().map(|_| rng.uniform(-0.05, 0.05)).collect();
        for group in problem.groups.iter().filter(|g| !g.bilateral) {
            held[group.row] = rng.uniform(1.0, 2.0);
        }
        for (k, group) in problem.groups.iter().enumerate() {
            if group.bilateral || k > 2 {
                continue;
            }
            // Some near the boundary.
            let pressed = held[group.row];
            let (mut out, mut within) = (0.0, 1.0);
            for _ in 0..50 {
                let middle = 0.5 * (out + within);
                held[group.row] = middle * pressed;
                if inside(&problem, &held) {
                    within = middle;
                } else {
                    out = middle;
                }
            }
            held[group.row] = (within + 10f64.powi(-(case % 4)) * (1.0 - within)) * pressed;
        }
        assert!(inside(&problem, &held), "case {case}");
        let mut q = vec![0.0; problem.rows()];
        problem.w.add_product(&held, &mut q);
        problem.q = q.iter().map(|v| -v).collect();
        let scaled = Scaled::new(&problem);
        let found = InteriorPoint::default().hold(&scaled.problem, 1e-9, 1e-6);
        let y = found.unwrap_or_else(|| panic!("case {case}: nothing found"));
        let mut u = vec![0.0; problem.rows()];
        scaled.problem.velocity(&y, &mut u);
        assert!(norm(&u) < 1e-8 * norm(&scaled.problem.q), "case {case}");
        assert!(inside(&scaled.problem, &y), "case {case}");
    }
}

/// One contact under a load at an angle is held up to the angle of friction, not beyond.
#[test]
fn one_contact_is_held_up_to_its_friction() {
    let bounds = Bounds {
        sliding: 0.5,
        ..Bounds::default()
    };
    let groups = vec![RowGroup {
        row: 0,
        dim: 3,
        bounds,
        bilateral: false,
        least: 0.0,
    }];
    let mut w = BlockMatrix::zeros(&groups, vec![0, 1], vec![0]);
    w.values
        .copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 3.5, 0.0, 0.0, 0.0, 3.5]);
    for (share, held) in [(0.0, true), (0.999, true), (1.001, false), (3.0, false)] {
        for angle in [0.0f64, 1.0, 2.0] {
            let across = 3.5 * 0.5 * share;
            let problem = Problem {
                groups: groups.clone(),
                w: w.clone(),
                q: vec![-1.0, across * angle.cos(), across * angle.sin()],
            };
            let scaled = Scaled::new(&problem);
            let found = InteriorPoint::default().hold(&scaled.problem, 1e-8, 1e-5);
            assert_eq!(found.is_some(), held, "{share} {angle}");
        }
    }
    // Nothing pulls apart what only presses.
    let problem = Problem {
        groups,
        w,
        q: vec![1.0, 0.0, 0.0],
    };
    let scaled = Scaled::new(&problem);
    assert!(InteriorPoint::default()
        .hold(&scaled.problem, 1e-8, 1e-5)
        .is_none());
}

/// Makes W that of a motion: symmetric.
fn symmetric(problem: &mut Problem) {
    for i in 0..problem.groups.len() {
        for j in 0..=i {
            let (k, l) = (problem.w.find(i, j).unwrap(), problem.w.find(j, i).unwrap());
            let (dim, width) = (problem.groups[i].dim, problem.groups[j].dim);
            for r in 0..dim {
                for c in 0..width {
                    let value = problem.w.block(i, k)[r * width + c];
                    problem.w.block_mut(j, l)[c * dim + r] = value;
                }
            }
        }
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Whether all forces are inside of their cones, none on the boundary.
fn inside(problem: &Problem, y: &[f64]) -> bool {
    problem.groups.iter().filter(|g| !g.bilateral).all(|group| {
        let r = &y[group.rows()];
        let within = |d: cone::Disc| norm(&r[d.start..d.start + d.dim]) < d.bound * r[0];
        r[0] > 0.0 && group.bounds.discs().all(within)
    })
}
