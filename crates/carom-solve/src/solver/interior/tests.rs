//! The equations of the path, their slope, the scaling and the step lengths, each against what defines it.

use super::cone::Vec3;
use super::*;
use crate::cone::Bounds;
use crate::problem::{BlockMatrix, RowGroup};

/// SplitMix64.
struct Rng(u64);

impl Rng {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Inside of the cone of `dim` rows, some points near its boundary.
    fn inside(&mut self, dim: usize) -> Vec3 {
        let mut x = [0.0; 3];
        for k in 1..=dim {
            x[k] = self.uniform(-1.0, 1.0);
        }
        x[0] = norm(&x[1..]) + 10f64.powf(self.uniform(-3.0, 0.5));
        x
    }
}

include!("../../../tests/common/mixed.rs");

/// A state inside of all cones.
fn begun(problem: &Problem, rng: &mut Rng) -> InteriorPoint {
    let mut path = InteriorPoint::default();
    path.begin(problem);
    for y in &mut path.y {
        *y = rng.uniform(-0.05, 0.05);
    }
    for group in &problem.groups {
        if !group.bilateral {
            path.y[group.row] = rng.uniform(1.0, 2.0);
        }
    }
    for c in &mut path.cones {
        c.primal = c.of(&path.y);
        c.dual = rng.inside(c.dim);
    }
    path
}

/// The left of every equation at a state: those of u, then `F^-1 A r o F l` with F held.
fn equations(path: &mut InteriorPoint, problem: &Problem) -> Vec<f64> {
    path.residuals(problem);
    let mut all = path.dual_residual.clone();
    for c in &path.cones {
        let both = product(&c.unscale(&c.primal), &c.rescale(&c.dual), c.dim);
        all.extend_from_slice(&both[..=c.dim]);
    }
    all
}

/// A full step changes the equations as their derivative along it says: by central differences along the step.
#[test]
fn step_solves_the_linearised_equations() {
    let mut rng = Rng(1);
    for case in 0..50 {
        let problem = mixed(&mut rng);
        let mut path = begun(&problem, &mut rng);
        path.residuals(&problem);
        assert!(path.factor(&problem, 0.0), "case {case}");
        let target = rng.uniform(0.0, 1.0);
        assert!(path.solve(target, false), "case {case}");
        let here = equations(&mut path, &problem);
        let h = 1e-5;
        let mut at = |length: f64| {
            path.take(length);
            let value = equations(&mut path, &problem);
            path.take(-length);
            value
        };
        let (plus, minus) = (at(h), at(-h));
        let rows = problem.rows();
        let mut goal = vec![0.0; here.len()];
        let mut place = rows;
        for c in &path.cones {
            goal[place] = target;
            place += c.dim + 1;
        }
        for (k, goal) in goal.iter().enumerate() {
            let slope = (plus[k] - minus[k]) / (2.0 * h);
            let wanted = goal - here[k];
            assert!(
                (slope - wanted).abs() < 2e-6 * (1.0 + wanted.abs()),
                "case {case}, equation {k}: {slope} {wanted}"
            );
        }
    }
}

/// The correction is the second-order term that the uncorrected step leaves in the complementarity.
#[test]
fn corrector_adds_what_the_predictor_leaves() {
    let mut rng = Rng(2);
    let problem = mixed(&mut rng);
    let mut path = begun(&problem, &mut rng);
    path.residuals(&problem);
    assert!(path.factor(&problem, 0.0) && path.solve(0.0, false));
    let left: Vec<Vec3> = path
        .cones
        .iter()
        .map(|c| product(&c.unscale(&c.d_primal), &c.rescale(&c.d_dual), c.dim))
        .collect();
    assert!(path.solve(0.3, true));
    for (c, left) in path.cones.iter().zip(left) {
        let (a, b) = (c.unscale(&c.d_primal), c.rescale(&c.d_dual));
        let (x, y) = (product(&c.v, &b, c.dim), product(&a, &c.v, c.dim));
        let vv = product(&c.v, &c.v, c.dim);
        for k in 0..=c.dim {
            let goal = if k == 0 { 0.3 } else { 0.0 };
            let sum = vv[k] + x[k] + y[k] + left[k];
            assert!((sum - goal).abs() < 1e-9, "{sum} {goal}");
        }
    }
}

#[test]
fn slope_of_the_slip_shift() {
    let mut rng = Rng(3);
    for case in 0..300 {
        let dim = case % 3;
        let mut c = Cone {
            dim,
            bound: if dim == 0 { 1.0 } else { rng.uniform(0.1, 2.0) },
            dual: rng.inside(dim),
            convex: case % 2 == 0,
            ..Cone::default()
        };
        let slope = c.closing().1;
        for k in 0..=dim {
            let x = c.dual[k];
            let h = 1e-6 * c.dual[0];
            c.dual[k] = x + h;
            let plus = c.closing().0;
            c.dual[k] = x - h;
            let minus = c.closing().0;
            c.dual[k] = x;
            assert!(
                ((plus - minus) / (2.0 * h) - slope[k]).abs() < 1e-6,
                "case {case} {k}"
            );
        }
        if c.convex {
            assert_eq!(c.closing().0, c.bound * c.dual[0]);
            continue;
        }
        // Between once and twice the exact one, mu (l_0 - |l_1|), and zero with it.
        let exact = c.bound * (c.dual[0] - norm(&c.dual[1..=dim]));
        let smooth = c.closing().0;
        assert!(smooth >= exact * (1.0 - 1e-9) && smooth <= 2.0 * exact * (1.0 + 1e-9));
    }
}

#[test]
fn scaling_maps_primal_and_dual_to_one_point() {
    let mut rng = Rng(4);
    for case in 0..300 {
        let dim = case % 3;
        let mut c = Cone {
            dim,
            primal: rng.inside(dim),
            dual: rng.inside(dim),
            ..Cone::default()
        };
        c.scale();
        let (a, b) = (c.unscale(&c.primal), c.rescale(&c.dual));
        let x = [
            rng.uniform(-1.0, 1.0),
            rng.uniform(-1.0, 1.0),
            rng.uniform(-1.0, 1.0),
        ];
        let back = c.rescale(&c.unscale(&x));
        let quotient = divide(&c.v, &x, dim);
        let product = product(&c.v, &quotient, dim);
        for k in 0..=dim {
            assert!(
                (a[k] - b[k]).abs() < 1e-9 * a[0],
                "case {case}: {a:?} {b:?}"
            );
            assert!((b[k] - c.v[k]).abs() < 1e-12 * b[0]);
            // Where points are near the boundary F has large entries that cancel.
            assert!((back[k] - x[k]).abs() < 1e-8, "case {case}: {back:?} {x:?}");
            assert!(
                (product[k] - x[k]).abs() < 1e-8,
                "case {case}: {product:?} {x:?}"
            );
        }
        // Mean complementarity is the same in both pictures.
        let dot = |x: &Vec3, y: &Vec3| (0..=dim).map(|k| x[k] * y[k]).sum::<f64>();
        assert!((dot(&c.v, &c.v) - dot(&c.primal, &c.dual)).abs() < 1e-9 * dot(&c.v, &c.v));
    }
}

#[test]
fn longest_step_ends_on_the_boundary() {
    let mut rng = Rng(5);
    let mut ended = 0;
    for case in 0..3000 {
        let dim = case % 3;
        let x = rng.inside(dim);
        let d = [
            rng.uniform(-2.0, 2.0),
            rng.uniform(-2.0, 2.0),
            rng.uniform(-2.0, 2.0),
        ];
        let length = longest(&x, &d, dim, 1.0);
        let depth = |t: f64| {
            let p: Vec<f64> = (0..=dim).map(|k| x[k] + t * d[k]).collect();
            p[0] - norm(&p[1..])
        };
        assert!(
            depth(length) > -1e-12,
            "case {case}: outside by {:e}",
            depth(length)
        );
        for t in 1..100 {
            assert!(depth(length * f64::from(t) / 100.0) > -1e-12, "case {case}");
        }
        if length < 1.0 {
            assert!(
                depth(length).abs() < 1e-9,
                "case {case}: {length} leaves {:e}",
                depth(length)
            );
            ended += 1;
        }
    }
    assert!(ended > 1000);
}

/// The companion is the least of its convex problem: inside of the cones, measures inside of the dual ones and perpendicular, and what slides moves
/// apart by the sum of bound times slip.
#[test]
fn the_companion_is_the_least_over_the_cones() {
    let mut rng = Rng(6);
    let (mut slid, mut parted) = (0, 0);
    for case in 0..200 {
        let mut problem = mixed(&mut rng);
        make_symmetric(&mut problem);
        let mut path = InteriorPoint::default();
        let y = path.companion(&problem).expect("W is definite");
        let mut u = vec![0.0; problem.rows()];
        problem.velocity(&y, &mut u);
        let dot: f64 = y.iter().zip(&u).map(|(y, u)| y * u).sum();
        assert!(dot.abs() < 1e-8, "case {case}: {dot:e}");
        // At rest is allowed, so the least is no gain.
        let loads: f64 = y.iter().zip(&problem.q).map(|(y, q)| y * q).sum();
        assert!(loads <= 1e-8, "case {case}: {loads:e}");
        for group in &problem.groups {
            let (y, u) = (&y[group.rows()], &u[group.rows()]);
            if group.bilateral {
                assert!(norm(u) < 1e-8, "case {case}: {u:?}");
                continue;
            }
            let apart = crate::companion::moved_apart(&group.bounds, u);
            assert!(u[0] >= apart - 1e-6, "case {case}: {} {apart}", u[0]);
            for d in group.bounds.discs() {
                let friction = norm(&y[d.start..d.start + d.dim]);
                assert!(friction <= d.bound * y[0] + 1e-9, "case {case}");
            }
            if y[0] > 1e-3 {
                assert!((u[0] - apart).abs() < 1e-6, "case {case}: {} {apart}", u[0]);
                slid += usize::from(apart > 1e-3);
            } else {
                parted += usize::from(u[0] > 1e-3);
            }
        }
    }
    assert!(slid > 50 && parted > 50, "{slid} {parted}");
}

fn make_symmetric(problem: &mut Problem) {
    for i in 0..problem.groups.len() {
        for j in 0..=i {
            let (Some(at), Some(back)) = (problem.w.find(i, j), problem.w.find(j, i)) else {
                continue;
            };
            let (rows, cols) = (problem.groups[i].dim, problem.groups[j].dim);
            for r in 0..rows {
                for c in 0..cols {
                    let mean = 0.5
                        * (problem.w.block(i, at)[r * cols + c]
                            + problem.w.block(j, back)[c * rows + r]);
                    problem.w.block_mut(i, at)[r * cols + c] = mean;
                    problem.w.block_mut(j, back)[c * rows + r] = mean;
                }
            }
        }
    }
}
