//! The linearisation of Newton's method against central differences, in every status.

mod common;

use carom_solve::cone::{self, Block, MAX_ROWS};
use carom_solve::linear_step::{Iterate, LinearStep};
use carom_solve::rows::{RowSystem, Subproblem, NODE_DOF, WORLD};
use carom_solve::Status;
use common::{bounds, heap, Rng, Spheres};
use std::collections::BTreeMap;

const STEP: f64 = 1e-6;

/// An iterate with all that follows from it.
struct Point {
    z: Vec<f64>,
    xi: Vec<f64>,
    phi: Vec<f64>,
    statuses: Vec<Status>,
    tangents: Vec<Block>,
}

fn point(
    system: &mut RowSystem,
    problem: &mut Spheres,
    p: &[f64],
    lambda: &[f64],
    u: &[f64],
    softness: f64,
) -> Point {
    let rows = system.rows();
    let mut at = Point {
        z: vec![0.0; rows],
        xi: vec![0.0; rows],
        phi: vec![0.0; rows],
        statuses: Vec::new(),
        tangents: Vec::new(),
    };
    problem.evaluate(system, u, &mut at.z);
    for r in 0..rows {
        at.z[r] += softness * system.diag[r] * lambda[r];
        at.xi[r] = lambda[r] - p[r] * at.z[r];
    }
    for c in &system.contacts {
        let rows = c.row as usize..(c.row + c.dim) as usize;
        let mut block = [[0.0; MAX_ROWS]; MAX_ROWS];
        at.statuses.push(cone::project(
            &c.bounds,
            &at.xi[rows.clone()],
            &mut at.phi[rows.clone()],
        ));
        cone::tangent(&c.bounds, &at.xi[rows], &mut block);
        at.tangents.push(block);
    }
    at
}

/// `F(u, lambda) = (M u - G^T phi, phi - lambda)`.
fn residual(
    system: &mut RowSystem,
    problem: &mut Spheres,
    p: &[f64],
    lambda: &[f64],
    u: &[f64],
    softness: f64,
) -> Vec<f64> {
    let at = point(system, problem, p, lambda, u, softness);
    let mut force = vec![0.0; u.len()];
    system.impulses(&at.phi, &mut force);
    let mut f: Vec<f64> = (0..u.len())
        .map(|i| mass(system, i) * u[i] - force[i])
        .collect();
    f.extend(at.phi.iter().zip(lambda).map(|(a, b)| a - b));
    f
}

fn mass(system: &RowSystem, i: usize) -> f64 {
    let inverse = if i % NODE_DOF < 3 {
        &system.inv_mass
    } else {
        &system.inv_inertia
    };
    1.0 / inverse[i / NODE_DOF]
}

/// The Hessian block by block, as the theory has it:
/// `[[M - sum phi_N K + G^T C p G, -G^T C], [-C p G, C - 1]]`.
fn hessian(system: &RowSystem, at: &Point, p: &[f64]) -> Vec<Vec<f64>> {
    let (d, m) = (NODE_DOF * system.nodes(), system.rows());
    let mut g = vec![vec![0.0; d]; m];
    let mut c_full = vec![vec![0.0; m]; m];
    let mut h = vec![vec![0.0; d + m]; d + m];
    for i in 0..d {
        h[i][i] = mass(system, i);
    }
    for (index, c) in system.contacts.iter().enumerate() {
        let row = c.row as usize;
        let nodes = [(c.node_a, 1.0, 0), (c.node_b, -1.0, 1)];
        for r in row..row + c.dim as usize {
            for (node, _, side) in nodes.iter().filter(|n| n.0 != WORLD) {
                for k in 0..NODE_DOF {
                    g[r][NODE_DOF * *node as usize + k] = system.jac[r][*side][k];
                }
            }
            for s in row..row + c.dim as usize {
                c_full[r][s] = at.tangents[index][r - row][s - row];
            }
        }
        let weight = at.phi[row] * c.curvature;
        for (na, sa, _) in nodes.iter().filter(|n| n.0 != WORLD) {
            for (nb, sb, _) in nodes.iter().filter(|n| n.0 != WORLD) {
                for i in 0..3 {
                    for j in 0..3 {
                        let k = f64::from(i == j) - c.normal[i] * c.normal[j];
                        h[NODE_DOF * *na as usize + i][NODE_DOF * *nb as usize + j] -=
                            weight * sa * sb * k;
                    }
                }
            }
        }
    }
    for r in 0..m {
        for s in 0..m {
            let c = c_full[r][s];
            h[d + r][d + s] = c - f64::from(r == s);
            if c == 0.0 {
                continue;
            }
            for i in 0..d {
                h[i][d + s] -= g[r][i] * c;
                h[d + r][i] -= c * p[s] * g[s][i];
                for j in 0..d {
                    h[i][j] += g[r][i] * c * p[s] * g[s][j];
                }
            }
        }
    }
    h
}

/// Far from every kink: the tangent is unique and central differences are smooth.
fn smooth(system: &RowSystem, xi: &[f64]) -> bool {
    system.contacts.iter().all(|c| {
        let xi = &xi[c.row as usize..(c.row + c.dim) as usize];
        xi[0].abs() > 1e-2
            && c.bounds.discs().all(|disc| {
                let l = xi[disc.start..disc.start + disc.dim]
                    .iter()
                    .map(|x| x * x)
                    .sum::<f64>()
                    .sqrt();
                (l - disc.bound * xi[0]).abs() > 1e-2 && l > 5e-2
            })
    })
}

/// Names of the statuses of a contact: "TR ball: contact, T slip, R stick".
fn names(system: &RowSystem, index: usize, xi: &[f64]) -> Vec<String> {
    let c = &system.contacts[index];
    let xi = &xi[c.row as usize..(c.row + c.dim) as usize];
    let with = if c.node_b == WORLD { "plane" } else { "ball" };
    let kinds: String = [
        (c.bounds.sliding, 'T'),
        (c.bounds.rolling, 'R'),
        (c.bounds.spinning, 'S'),
    ]
    .iter()
    .filter(|(b, _)| *b > 0.0)
    .map(|(_, k)| *k)
    .collect();
    let mut states = String::new();
    for (disc, kind) in c.bounds.discs().zip(kinds.chars()) {
        let l = xi[disc.start..disc.start + disc.dim]
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt();
        states.push(kind);
        states.push_str(if l >= disc.bound * xi[0] {
            " slip "
        } else {
            " stick "
        });
    }
    let whole = if xi[0] < 0.0 {
        format!("{kinds} {with}: gap")
    } else {
        format!("{kinds} {with}: contact {states}")
    };
    vec![whole]
}

struct Case {
    system: RowSystem,
    problem: Spheres,
    p: Vec<f64>,
    lambda: Vec<f64>,
    u: Vec<f64>,
}

/// One to three contacts at an arbitrary iterate (not even with `M u = G^T lambda`), and any penalties.
fn random_case(rng: &mut Rng, curved: bool) -> Case {
    let contacts = 1 + rng.below(3);
    let problem = heap(rng, contacts, true, curved);
    let laws: Vec<_> = problem
        .pairs
        .iter()
        .map(|_| {
            let mask = rng.below(8);
            bounds(mask, rng, 0.7, 3.0)
        })
        .collect();
    let mut draw = Rng(rng.next());
    let mut system = problem.system(&laws, |_, _| draw.uniform(-1.0, 1.0));
    let rows = system.rows();
    let mut p = Vec::with_capacity(rows);
    for r in 0..rows {
        p.push(rng.uniform(0.3, 1.5) / system.diag[r]);
    }
    // One penalty per disc, as in the solver.
    for c in &system.contacts {
        for disc in c.bounds.discs() {
            let first = c.row as usize + disc.start;
            for r in first..first + disc.dim {
                p[r] = p[first];
            }
        }
    }
    let lambda = (0..rows).map(|_| rng.uniform(-0.7, 1.0)).collect();
    let u: Vec<f64> = (0..NODE_DOF * system.nodes())
        .map(|_| rng.uniform(-0.1, 0.1))
        .collect();
    let mut z = vec![0.0; rows];
    let mut problem = problem;
    problem.evaluate(&mut system, &u, &mut z);
    Case {
        system,
        problem,
        p,
        lambda,
        u,
    }
}

fn shifted(x: &[f64], d: &[f64], t: f64) -> Vec<f64> {
    x.iter().zip(d).map(|(a, b)| a + t * b).collect()
}

/// Every block, in every status of every combination of discs, to 1e-7.
#[test]
fn every_block_is_the_derivative_of_the_residual() {
    let mut rng = Rng(7);
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    let mut worst = 0.0f64;
    for round in 0..6000 {
        let Case {
            mut system,
            mut problem,
            p,
            lambda,
            u,
        } = random_case(&mut rng, round % 2 == 0);
        let at = point(&mut system, &mut problem, &p, &lambda, &u, 0.0);
        if !smooth(&system, &at.xi) {
            continue;
        }
        let h = hessian(&system, &at, &p);
        let (d, m) = (u.len(), lambda.len());
        let scale = h
            .iter()
            .flatten()
            .fold(1.0f64, |s: f64, x: &f64| s.max(x.abs()));
        for col in 0..d + m {
            let mut e = vec![0.0; d + m];
            e[col] = 1.0;
            let mut side = |t: f64| {
                let (up, lp) = (shifted(&u, &e[..d], t), shifted(&lambda, &e[d..], t));
                residual(&mut system, &mut problem, &p, &lp, &up, 0.0)
            };
            let (plus, minus) = (side(STEP), side(-STEP));
            for row in 0..d + m {
                let difference = (plus[row] - minus[row]) / (2.0 * STEP);
                worst = worst.max((difference - h[row][col]).abs() / scale);
            }
        }
        for index in 0..system.contacts.len() {
            for name in names(&system, index, &at.xi) {
                *seen.entry(name).or_default() += 1;
            }
        }
    }
    println!(
        "worst block: {worst:.1e}; {} statuses: {seen:?}",
        seen.len()
    );
    assert!(worst < 1e-7, "{worst}");
    // 8 combinations of discs, with a gap and with 2^discs contacts: 8 + 27, for balls and for planes.
    assert_eq!(seen.len(), 2 * (8 + 27), "{seen:?}");
    assert!(seen.values().all(|&count| count >= 5), "{seen:?}");
}

/// `linear_step` (which eliminates `du` and the inactive rows) solves the whole system: along its step the residual
/// falls as `(1 - t) F`, and the derivative there is `-F`.
#[test]
fn the_reduced_step_is_the_newton_step() {
    let mut rng = Rng(8);
    let (mut worst, mut line, mut counted) = (0.0f64, 0.0f64, 0);
    let mut solver = LinearStep::default();
    for round in 0..4000 {
        let curved = round % 2 == 0;
        // Half of them with contacts that give way.
        let softness = [0.0, 0.3][round / 2 % 2];
        let Case {
            mut system,
            mut problem,
            p,
            lambda,
            u,
        } = random_case(&mut rng, curved);
        let at = point(&mut system, &mut problem, &p, &lambda, &u, softness);
        if !smooth(&system, &at.xi) {
            continue;
        }
        // Where overlaps are so deep that the curved mass is no longer positive definite, the step is a quasi-Newton one.
        let load = |c: &carom_solve::rows::RowContact| at.phi[c.row as usize] * c.curvature;
        let least = (0..u.len())
            .map(|i| mass(&system, i))
            .fold(f64::INFINITY, f64::min);
        if system.contacts.iter().map(load).sum::<f64>() > 0.4 * least {
            continue;
        }
        let iterate = Iterate {
            penalty: &p,
            phi: &at.phi,
            tangents: &at.tangents,
            statuses: &at.statuses,
            lambda: &lambda,
            u: &u,
            softness,
        };
        let (mut dl, mut du) = (vec![0.0; lambda.len()], vec![0.0; u.len()]);
        // A shift of zero: the plain Newton step. Both ways of assembling and factoring, where they mean the same.
        for dense in [true, false] {
            if !dense && curved {
                continue;
            }
            if solver
                .solve(&system, &iterate, 0.0, true, dense, &mut dl, &mut du)
                .is_err()
            {
                continue;
            }
            let size = du.iter().chain(&dl).fold(1.0f64, |s, x| s.max(x.abs()));
            let f = residual(&mut system, &mut problem, &p, &lambda, &u, softness);
            let mut along = |t: f64| {
                residual(
                    &mut system,
                    &mut problem,
                    &p,
                    &shifted(&lambda, &dl, t),
                    &shifted(&u, &du, t),
                    softness,
                )
            };
            let step = STEP / size;
            let (plus, minus) = (along(step), along(-step));
            let small = along(1e-3 * step);
            for row in 0..f.len() {
                let derivative = (plus[row] - minus[row]) / (2.0 * step);
                worst = worst.max((derivative + f[row]).abs() / size);
                line = line.max((small[row] - (1.0 - 1e-3 * step) * f[row]).abs());
            }
            counted += 1;
        }
    }
    println!("worst: {worst:.1e} over {counted} steps; off the line {line:.1e}");
    assert!(worst < 1e-7, "{worst}");
    assert!(line < 1e-12, "{line}");
    assert!(counted > 2000);
}
