//! Contact problems as data for the tests of the solver family, and the law recomputed without it.
#![allow(dead_code)] // each test file uses its part

use carom_solve::cone::MAX_ROWS;
use carom_solve::problem::natural::residual;
use carom_solve::problem::{BlockMatrix, Problem, RowGroup};
use carom_solve::rows::{RowSystem, NODE_DOF, WORLD};
use carom_solve::solver::{self, Outcome, Settings};
use carom_solve::Bounds;

use crate::common::Rng;

pub fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub fn coulomb(mu: f64) -> Bounds {
    Bounds {
        sliding: mu,
        ..Bounds::default()
    }
}

pub fn group(bounds: Bounds) -> RowGroup {
    RowGroup {
        row: 0,
        dim: bounds.dim(),
        bounds,
        bilateral: false,
        least: 0.0,
    }
}

/// Any of the eight sets of discs.
pub fn any_bounds(rng: &mut Rng, most: f64) -> Bounds {
    let mask = rng.below(8);
    let mut draw = |bit: usize| f64::from(u8::from(mask & bit != 0)) * rng.uniform(0.05, most);
    Bounds {
        sliding: draw(1),
        rolling: draw(2),
        spinning: draw(4),
    }
}

/// A problem of one contact with block `a` (row-major) and free part `b`.
pub fn single(group: RowGroup, a: &[f64], b: &[f64]) -> Problem {
    let groups = vec![group];
    let mut w = BlockMatrix::zeros(&groups, vec![0, 1], vec![0]);
    w.block_mut(0, 0).copy_from_slice(a);
    Problem {
        groups,
        w,
        q: b.to_vec(),
    }
}

/// From a dense matrix (row-major) and groups whose rows follow one another.
pub fn dense(groups: Vec<RowGroup>, matrix: &[f64], q: &[f64]) -> Problem {
    let (n, c) = (q.len(), groups.len());
    let ptr = (0..=c).map(|i| i * c).collect();
    let col = (0..c * c).map(|k| (k % c) as u32).collect();
    let mut w = BlockMatrix::zeros(&groups, ptr, col);
    for i in 0..c {
        for j in 0..c {
            let (gi, gj) = (groups[i], groups[j]);
            for (k, v) in w.block_mut(i, i * c + j).iter_mut().enumerate() {
                *v = matrix[(gi.row + k / gj.dim) * n + gj.row + k % gj.dim];
            }
        }
    }
    Problem {
        groups,
        w,
        q: q.to_vec(),
    }
}

/// W of a problem, row-major.
pub fn full(problem: &Problem) -> Vec<f64> {
    let n = problem.rows();
    let mut out = vec![0.0; n * n];
    for (i, gi) in problem.groups.iter().enumerate() {
        for k in problem.w.ptr[i]..problem.w.ptr[i + 1] {
            let gj = problem.groups[problem.w.col[k] as usize];
            for (at, v) in problem.w.block(i, k).iter().enumerate() {
                out[(gi.row + at / gj.dim) * n + gj.row + at % gj.dim] = *v;
            }
        }
    }
    out
}

/// The problem with its contacts in another order: new place `i` holds old contact `order[i]`. Also the old row of each new one.
pub fn relabelled(problem: &Problem, order: &[usize]) -> (Problem, Vec<usize>) {
    let n = problem.rows();
    let old = full(problem);
    let (mut rows, mut groups) = (Vec::new(), Vec::new());
    for &c in order {
        let mut g = problem.groups[c];
        let first = g.row;
        g.row = rows.len();
        rows.extend(first..first + g.dim);
        groups.push(g);
    }
    let matrix: Vec<f64> = (0..n * n)
        .map(|k| old[rows[k / n] * n + rows[k % n]])
        .collect();
    let q: Vec<f64> = rows.iter().map(|&r| problem.q[r]).collect();
    (dense(groups, &matrix, &q), rows)
}

/// The same problem in other units: `r = scale r'` row by row, so `W' = S W S` and `q' = S q`. The scales of a contact's
/// normal and sliding rows must agree.
pub fn rescaled(problem: &Problem, scale: &[f64], load: f64) -> Problem {
    let mut out = problem.clone();
    for (i, gi) in problem.groups.iter().enumerate() {
        for k in problem.w.ptr[i]..problem.w.ptr[i + 1] {
            let gj = problem.groups[problem.w.col[k] as usize];
            for (at, v) in out.w.block_mut(i, k).iter_mut().enumerate() {
                *v *= scale[gi.row + at / gj.dim] * scale[gj.row + at % gj.dim];
            }
        }
        let g = &mut out.groups[i];
        for d in gi.bounds.discs() {
            let turn = scale[gi.row] / scale[gi.row + d.start];
            if d.dim == 1 {
                g.bounds.spinning *= turn;
            } else if d.start == 1 && gi.bounds.sliding > 0.0 {
                assert_eq!(turn, 1.0);
            } else {
                g.bounds.rolling *= turn;
            }
        }
    }
    for (q, s) in out.q.iter_mut().zip(scale) {
        *q *= s * load;
    }
    out
}

/// Bodies with six velocities, and rows of any direction between them or against the world.
pub struct Bodies {
    pub system: RowSystem,
    pub q: Vec<f64>,
}

impl Bodies {
    pub fn problem(&self) -> Problem {
        Problem::from_rows(&self.system, &self.q)
    }

    /// `u = H^T M^-1 H r + q` over the bodies, without W.
    pub fn velocity(&self, r: &[f64]) -> Vec<f64> {
        let dofs = NODE_DOF * self.system.nodes();
        let (mut f, mut v, mut u) = (vec![0.0; dofs], vec![0.0; dofs], vec![0.0; r.len()]);
        self.system.impulses(r, &mut f);
        self.system.apply_inverse_mass(&f, &mut v);
        self.system.linear_measures(&v, &mut u);
        u.iter_mut().zip(&self.q).for_each(|(u, q)| *u += q);
        u
    }
}

/// Random bodies under random contacts; every third of `joints` rows is bilateral. A motion `v*` that opens all contacts
/// and obeys all joints exists (so the problem has a solution), and the free motion is mostly against it (so contacts
/// are loaded). With more rows than `6 bodies` W is singular.
pub fn bodies(rng: &mut Rng, count: usize, contacts: usize, joints: usize, most: f64) -> Bodies {
    let mut system = RowSystem::default();
    for _ in 0..count {
        let mass = rng.uniform(0.2, 5.0);
        system.push_node(mass, rng.uniform(0.1, 0.6) * mass, 1.0);
    }
    let opening: Vec<f64> = (0..NODE_DOF * count)
        .map(|_| rng.uniform(-1.0, 1.0))
        .collect();
    let side = |node: u32| -> [f64; NODE_DOF] {
        std::array::from_fn(|k| {
            if node == WORLD {
                0.0
            } else {
                opening[NODE_DOF * node as usize + k]
            }
        })
    };
    for index in 0..contacts + joints {
        let a = if index < count {
            index
        } else {
            rng.below(count)
        };
        let b = if count == 1 || rng.below(3) == 0 {
            WORLD
        } else {
            ((a + 1 + rng.below(count - 1)) % count) as u32
        };
        let a = a as u32;
        let motion = [side(a), side(b)];
        let size: f64 = motion.iter().flatten().map(|x| x * x).sum();
        let along = |row: &[[f64; NODE_DOF]; 2]| -> f64 {
            row.iter()
                .flatten()
                .zip(motion.iter().flatten())
                .map(|(x, y)| x * y)
                .sum()
        };
        let steer = |row: &mut [[f64; NODE_DOF]; 2], wanted: f64| {
            let factor = (wanted - along(row)) / size;
            for (x, m) in row.iter_mut().flatten().zip(motion.iter().flatten()) {
                *x += factor * m;
            }
        };
        let mut draw = |dim: usize| -> Vec<[[f64; NODE_DOF]; 2]> {
            (0..dim)
                .map(|_| {
                    [a, b].map(|node| {
                        std::array::from_fn(|_| {
                            if node == WORLD {
                                0.0
                            } else {
                                rng.uniform(-1.0, 1.0)
                            }
                        })
                    })
                })
                .collect()
        };
        if index >= contacts {
            let mut rows = draw(1 + index % 3);
            for row in &mut rows {
                steer(row, 0.0);
            }
            let zeros = vec![0.0; rows.len()];
            system.push_joint((a, b), rows.len(), 1.0, &rows, &zeros);
            continue;
        }
        let mut rows = draw(MAX_ROWS);
        let bounds = any_bounds(rng, most);
        rows.truncate(bounds.dim());
        let slip: f64 = bounds
            .discs()
            .map(|d| {
                let part: Vec<f64> = rows[d.start..d.start + d.dim].iter().map(along).collect();
                d.bound * norm(&part)
            })
            .sum();
        steer(&mut rows[0], slip + 0.2);
        let zeros = vec![0.0; rows.len()];
        system.push_contact(a, b, bounds, 1.0, [0.0, 0.0, 1.0], &rows, &zeros);
    }
    let free: Vec<f64> = opening
        .iter()
        .map(|v| -v + rng.uniform(-0.5, 0.5))
        .collect();
    let mut q = vec![0.0; system.rows()];
    system.linear_measures(&free, &mut q);
    Bodies { system, q }
}

/// How far `r`, `u` are from the law, over the largest of q and both: the cones, power, joints. Written from the law's words, not
/// from the natural map.
pub fn distance_from_the_law(groups: &[RowGroup], q: &[f64], r: &[f64], u: &[f64]) -> f64 {
    // In units of the largest number: 1e-200 has no square.
    let unit = r
        .iter()
        .chain(u)
        .fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    let [q, r, u] = [q, r, u].map(|v| v.iter().map(|x| x / unit).collect::<Vec<f64>>());
    let scale = norm(&q).max(norm(&r)).max(norm(&u)).max(f64::MIN_POSITIVE);
    let mut worst = 0.0f64;
    for g in groups {
        let (r, u) = (&r[g.rows()], &u[g.rows()]);
        if g.bilateral {
            worst = worst.max(norm(u) / scale);
            continue;
        }
        let mut sum = 1.0;
        // Forces and velocities times each other: their sizes alone follow from err with its root only.
        let mut power = (r[0] * u[0]).abs();
        let mut outside = (-r[0]).max(-u[0]);
        for d in g.bounds.discs() {
            let (r_b, u_b) = (&r[d.start..d.start + d.dim], &u[d.start..d.start + d.dim]);
            let radius = d.bound * r[0].max(0.0);
            let along: f64 = r_b.iter().zip(u_b).map(|(r, u)| r * u).sum();
            outside = outside.max(norm(r_b) - radius);
            // At the bound and against the motion: r_b . u_b = -radius |u_b|.
            power = power.max((along + radius * norm(u_b)).abs());
            sum += d.bound;
        }
        worst = worst
            .max(outside / scale / sum)
            .max(power / scale / scale / sum);
    }
    worst
}

pub struct Solved {
    pub outcome: Outcome,
    pub r: Vec<f64>,
    pub u: Vec<f64>,
}

pub fn solve(problem: &Problem, name: &str, tolerance: f64) -> Solved {
    solve_with(
        problem,
        name,
        Settings {
            tolerance,
            ..Settings::default()
        },
    )
}

pub fn solve_with(problem: &Problem, name: &str, settings: Settings) -> Solved {
    let mut method = solver::by_name(name).unwrap();
    let mut r = vec![0.0; problem.rows()];
    let outcome = solver::solve(problem, method.as_mut(), settings, &mut r);
    let mut u = vec![0.0; problem.rows()];
    problem.velocity(&r, &mut u);
    Solved { outcome, r, u }
}

/// Solves and holds what the solver says against what was found.
pub fn honest(problem: &Problem, name: &str, tolerance: f64, case: &str) -> Solved {
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
        let law = distance_from_the_law(&problem.groups, &problem.q, &found.r, &found.u);
        assert!(
            law <= 10.0 * tolerance,
            "{case} {name}: err {err:e}, but {law:e} from the law"
        );
    }
    found
}
