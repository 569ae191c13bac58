//! Contact problems of spheres for the tests of the solver, and the conditions recomputed without it.
#![allow(dead_code)] // each test file uses its part

use carom_solve::rows::{RowSystem, Subproblem, NODE_DOF, WORLD};
use carom_solve::{Beside, Bounds, Newton, NewtonOptions, SolveReport};

/// SplitMix64: the same numbers on every machine.
pub struct Rng(pub u64);

impl Rng {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn vector(&mut self, size: f64) -> [f64; 3] {
        [(); 3].map(|()| self.uniform(-size, size))
    }
    pub fn unit(&mut self) -> [f64; 3] {
        loop {
            let v = self.vector(1.0);
            let l = dot(v, v).sqrt();
            if l > 0.2 && l < 1.0 {
                return scaled(1.0 / l, v);
            }
        }
    }
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
pub fn scaled(s: f64, a: [f64; 3]) -> [f64; 3] {
    a.map(|x| s * x)
}
pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub struct Ball {
    pub mass: f64,
    pub inertia: f64,
    pub radius: f64,
    /// Where the normals of the rows are taken, and where `u` starts from.
    pub frame: [f64; 3],
    pub centre: [f64; 3],
}

/// One contact: balls, or a ball and the plane `normal . x = 0`.
#[derive(Clone, Copy)]
pub enum Pair {
    Balls(usize, usize),
    Plane(usize, [f64; 3]),
}

/// Gaps of spheres: the nonlinear measures of the position level (or frozen ones, for the velocity level).
pub struct Spheres {
    pub balls: Vec<Ball>,
    pub pairs: Vec<Pair>,
    /// Gaps depend on `u` through the turning normal; else measures are linear.
    pub curved: bool,
}

impl Spheres {
    fn at(&self, i: usize, u: &[f64]) -> [f64; 3] {
        let k = NODE_DOF * i;
        let c = self.balls[i].centre;
        [c[0] + u[k], c[1] + u[k + 1], c[2] + u[k + 2]]
    }

    /// Gap, unit normal, curvature of a contact.
    pub fn proximity(&self, pair: Pair, u: &[f64]) -> (f64, [f64; 3], f64) {
        match pair {
            Pair::Balls(a, b) => {
                let d = minus(self.at(a, u), self.at(b, u));
                let l = dot(d, d).sqrt();
                (
                    l - self.balls[a].radius - self.balls[b].radius,
                    scaled(1.0 / l, d),
                    1.0 / l,
                )
            }
            Pair::Plane(a, n) => (dot(n, self.at(a, u)) - self.balls[a].radius, n, 0.0),
        }
    }

    /// The rows of all contacts; `z0` of the discs is drawn by `free`, that of the normals is the gap.
    pub fn system(
        &self,
        bounds: &[Bounds],
        mut free: impl FnMut(usize, usize) -> f64,
    ) -> RowSystem {
        let mut system = RowSystem::default();
        for b in &self.balls {
            system.push_node(b.mass, b.inertia, b.radius);
        }
        let still = vec![0.0; NODE_DOF * self.balls.len()];
        for (index, (&pair, bounds)) in self.pairs.iter().zip(bounds).enumerate() {
            let (a, b) = match pair {
                Pair::Balls(a, b) => (a, Some(b)),
                Pair::Plane(a, _) => (a, None),
            };
            let n0 = match pair {
                Pair::Balls(a, b) => {
                    let d = minus(self.balls[a].frame, self.balls[b].frame);
                    scaled(1.0 / dot(d, d).sqrt(), d)
                }
                Pair::Plane(_, n) => n,
            };
            let pick = if n0[0].abs() < 0.6 {
                [1.0, 0.0, 0.0]
            } else {
                [0.0, 1.0, 0.0]
            };
            let t1 = cross(n0, pick);
            let t1 = scaled(1.0 / dot(t1, t1).sqrt(), t1);
            let t2 = cross(n0, t1);
            let (ra, rb) = (
                self.balls[a].radius,
                b.map_or(0.0, |b| self.balls[b].radius),
            );
            let (gap, normal, _) = self.proximity(pair, &still);
            let zero = [0.0; 3];
            let row = |va: [f64; 3], wa: [f64; 3], wb: [f64; 3]| {
                let side = |v: [f64; 3], w: [f64; 3]| [v[0], v[1], v[2], w[0], w[1], w[2]];
                [side(va, wa), side(scaled(-1.0, va), wb)]
            };
            let mut jac = vec![row(normal, zero, zero)];
            if bounds.sliding > 0.0 {
                // t . (n x (r_A w_A + r_B w_B)) = (t x n) . (r_A w_A + r_B w_B)
                for t in [t1, t2] {
                    let arm = cross(t, n0);
                    jac.push(row(t, scaled(ra, arm), scaled(rb, arm)));
                }
            }
            if bounds.rolling > 0.0 {
                for t in [t1, t2] {
                    jac.push(row(zero, t, scaled(-1.0, t)));
                }
            }
            if bounds.spinning > 0.0 {
                jac.push(row(zero, n0, scaled(-1.0, n0)));
            }
            let mut z0: Vec<f64> = (0..jac.len()).map(|r| free(index, r)).collect();
            if self.curved {
                z0[0] = gap;
            }
            let node_b = b.map_or(WORLD, |b| b as u32);
            let length = b.map_or(ra, |b| ra.min(self.balls[b].radius));
            system.push_contact(a as u32, node_b, *bounds, length, normal, &jac, &z0);
        }
        system
    }
}

impl Subproblem for Spheres {
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]) {
        system.linear_measures(u, z);
        if !self.curved {
            return;
        }
        for (slot, &pair) in self.pairs.iter().enumerate() {
            let (gap, n, curvature) = self.proximity(pair, u);
            let row = system.contacts[slot].row as usize;
            z[row] = gap;
            if let Pair::Balls(..) = pair {
                system.jac[row] = [
                    [n[0], n[1], n[2], 0.0, 0.0, 0.0],
                    [-n[0], -n[1], -n[2], 0.0, 0.0, 0.0],
                ];
                system.contacts[slot].normal = n;
                system.contacts[slot].curvature = curvature;
            }
        }
    }
}

/// Options as the core uses them, but to rounding.
pub fn sharp() -> NewtonOptions {
    NewtonOptions {
        tolerance: 1e-12,
        floor: 1e-16,
        gap_tolerance: f64::INFINITY,
        closing: f64::INFINITY,
        missed: f64::INFINITY,
        rounding: 0.0,
        max_iterations: 50,
        penalty_scale: 0.5,
        proximal_shift: 1e-4,
        max_line_search: 10,
        dense_contacts: 10,
        softness: 0.0,
        beside: Beside {
            linearised: true,
            ..Beside::default()
        },
    }
}

/// How far `(lambda, u)` is from the conditions of section 4 of the algorithm page, in the unit of the multipliers: the
/// natural map with p = 1/D_cc (not the solver's p), and the balance `M u = G^T lambda`. Written without `cone`.
pub fn violation(system: &RowSystem, z: &[f64], lambda: &[f64], u: &[f64]) -> f64 {
    let mut worst = 0.0f64;
    for c in &system.contacts {
        let first = c.row as usize;
        if c.bilateral {
            let open = c.rows().map(|row| z[row].abs() / system.diag[row]);
            worst = open.fold(worst, f64::max);
            continue;
        }
        let normal = lambda[first];
        worst = worst.max((normal - (normal - z[first] / system.diag[first]).max(0.0)).abs());
        let mut row = first + 1;
        for (bound, dim) in [
            (c.bounds.sliding, 2),
            (c.bounds.rolling, 2),
            (c.bounds.spinning, 1),
        ] {
            if bound == 0.0 {
                continue;
            }
            let scale = if bound == c.bounds.sliding && row == first + 1 {
                1.0
            } else {
                1.0 / c.length
            };
            let xi: Vec<f64> = (row..row + dim)
                .map(|r| lambda[r] - z[r] / system.diag[r])
                .collect();
            let size = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
            let shrink = if size > bound * normal {
                bound * normal / size
            } else {
                1.0
            };
            for (r, x) in (row..row + dim).zip(&xi) {
                worst = worst.max(scale * (lambda[r] - shrink * x).abs());
            }
            row += dim;
        }
    }
    let mut force = vec![0.0; u.len()];
    system.impulses(lambda, &mut force);
    for node in 0..system.nodes() {
        for k in 0..NODE_DOF {
            let (inverse, scale) = if k < 3 {
                (system.inv_mass[node], 1.0)
            } else {
                (system.inv_inertia[node], 1.0 / system.node_length[node])
            };
            let i = NODE_DOF * node + k;
            worst = worst.max(scale * (u[i] / inverse - force[i]).abs());
        }
    }
    worst
}

/// Largest normal multiplier: the scale of a problem.
pub fn largest(lambda: &[f64]) -> f64 {
    lambda.iter().fold(1e-300, |m, l| m.max(l.abs()))
}

/// What a solve from zero gave.
pub struct Solved {
    pub report: SolveReport,
    pub history: Vec<f64>,
    pub lambda: Vec<f64>,
    pub u: Vec<f64>,
    /// Distance from the conditions over the largest multiplier.
    pub violation: f64,
}

pub fn solve<P: Subproblem>(
    system: &mut RowSystem,
    problem: &mut P,
    options: &NewtonOptions,
) -> Solved {
    let mut newton = Newton::default();
    let (mut lambda, mut u) = (
        vec![0.0; system.rows()],
        vec![0.0; NODE_DOF * system.nodes()],
    );
    let report = newton.solve(system, problem, options, &mut lambda, &mut u);
    let mut z = vec![0.0; system.rows()];
    problem.evaluate(system, &u, &mut z);
    let violation = violation(system, &z, &lambda, &u) / largest(&lambda);
    Solved {
        report,
        history: newton.history.clone(),
        lambda,
        u,
        violation,
    }
}

/// `mask` chooses sliding (1), rolling (2), spinning (4); `most` is the largest coefficient.
pub fn bounds(mask: usize, rng: &mut Rng, radius: f64, most: f64) -> Bounds {
    let mut draw = |bit: usize| f64::from(u8::from(mask & bit != 0)) * rng.uniform(0.1, most);
    Bounds {
        sliding: draw(1),
        rolling: draw(2) * radius,
        spinning: draw(4) * radius,
    }
}

/// Balls of which each overlaps earlier ones or a plane through the origin, and up to `contacts` contacts.
pub fn heap(rng: &mut Rng, contacts: usize, planes: bool, curved: bool) -> Spheres {
    let mut spheres = Spheres {
        balls: Vec::new(),
        pairs: Vec::new(),
        curved,
    };
    while spheres.pairs.len() < contacts {
        let radius = rng.uniform(0.5, 1.0);
        let mass = rng.uniform(0.5, 2.0);
        let index = spheres.balls.len();
        let depth = rng.uniform(0.0, 0.05) * radius;
        let centre = if index == 0 {
            [0.0, 0.0, radius - depth]
        } else {
            let on = &spheres.balls[rng.below(index)];
            let n = rng.unit();
            let d = on.radius + radius - depth;
            [
                on.centre[0] + d * n[0],
                on.centre[1] + d * n[1],
                on.centre[2] + d * n[2],
            ]
        };
        let turned = rng.vector(0.1 * radius);
        spheres.balls.push(Ball {
            mass,
            inertia: rng.uniform(0.2, 0.6) * mass * radius * radius,
            radius,
            frame: minus(centre, turned),
            centre,
        });
        let still = vec![0.0; NODE_DOF * (index + 1)];
        let mut near: Vec<Pair> = (0..index).map(|b| Pair::Balls(b, index)).collect();
        if planes {
            near.push(Pair::Plane(index, [0.0, 0.0, 1.0]));
        }
        for pair in near {
            let gap = spheres.proximity(pair, &still).0;
            if gap < 0.05 * radius && gap > -0.3 * radius && spheres.pairs.len() < contacts {
                spheres.pairs.push(pair);
            }
        }
    }
    spheres
}

/// Dense `W = G M^-1 G^T`, row-major.
pub fn dense_delassus(system: &RowSystem) -> Vec<f64> {
    let n = system.rows();
    let mut w = vec![0.0; n * n];
    for i in &system.contacts {
        for j in &system.contacts {
            let mut block = [[0.0; carom_solve::cone::MAX_ROWS]; carom_solve::cone::MAX_ROWS];
            system.delassus_block(i, j, &mut block);
            for r in 0..i.dim as usize {
                for s in 0..j.dim as usize {
                    w[(i.row as usize + r) * n + j.row as usize + s] = block[r][s];
                }
            }
        }
    }
    w
}
