//! Matrix-free sweeps against Newton's method, closed forms and conservation laws.

#[path = "spheres/coarse.rs"]
mod coarse;
mod common;
#[path = "spheres/laws.rs"]
mod laws;
#[path = "spheres/order.rs"]
mod order;
#[path = "spheres/rolling.rs"]
mod rolling;

use carom_solve::rows::{Measured, RowSystem, WORLD};
use carom_solve::spheres::{Body, Contact, Goal, Instructions, Place, Roll, SpheresError, Sweeps};
use carom_solve::Bounds;
use common::{cross, dot, scaled, sharp, Rng};

struct Problem {
    bodies: Vec<Body>,
    contacts: Vec<Contact>,
    places: Vec<Place>,
}

/// Balls at random places, each joined to near ones, some to the world and to a fixed ball.
fn heap(seed: u64, balls: usize, friction: f64) -> Problem {
    let mut rng = Rng(seed);
    let side = (balls as f64).cbrt();
    let mut bodies: Vec<Body> = (0..balls)
        .map(|_| {
            let (mass, radius) = (rng.uniform(0.5, 2.0), rng.uniform(0.4, 0.8));
            Body {
                inv_mass: 1.0 / mass,
                inv_inertia: 1.0 / (rng.uniform(0.3, 0.6) * mass * radius * radius),
                radius,
            }
        })
        .collect();
    let mut places: Vec<Place> = (0..balls)
        .map(|_| [(); 3].map(|()| rng.uniform(0.0, side)))
        .collect();
    bodies.push(Body {
        inv_mass: 0.0,
        inv_inertia: 0.0,
        radius: 3.0,
    });
    places.push([0.5 * side, 0.5 * side, -3.0]);
    let mut contacts = Vec::new();
    for a in 0..=balls {
        for b in 0..a {
            let d = [0, 1, 2].map(|k| places[a][k] - places[b][k]);
            let l = dot(d, d).sqrt();
            if l < 0.75 * (bodies[a].radius + bodies[b].radius) {
                contacts.push(touch(
                    &mut rng,
                    a as u32,
                    b as u32,
                    scaled(1.0 / l, d),
                    friction,
                ));
            }
        }
        if a < balls && places[a][0] < 0.3 {
            contacts.push(touch(&mut rng, a as u32, WORLD, [1.0, 0.0, 0.0], friction));
        }
        if a < balls && places[a][1] < 0.3 {
            contacts.push(touch(&mut rng, WORLD, a as u32, [0.0, -1.0, 0.0], friction));
        }
    }
    Problem {
        bodies,
        contacts,
        places,
    }
}

fn touch(rng: &mut Rng, a: u32, b: u32, normal: [f64; 3], friction: f64) -> Contact {
    let slip = rng.vector(0.6);
    let slip = [0, 1, 2].map(|k| slip[k] - 0.3 * normal[k]);
    Contact {
        a,
        b,
        normal,
        slip,
        friction,
    }
}

fn sweeps(p: &Problem, threads: usize) -> Sweeps {
    Sweeps::new(&p.bodies, &p.contacts, Some(&p.places), threads).expect("a good problem")
}

/// `|P(r - z/w) - r|` over all contacts, N s: 0 at solutions, nowhere else.
fn residual(s: &Sweeps) -> f64 {
    s.norms(1.0).residual
}

/// Sweeps until the residual is at most `tolerance`, and looks after every `interval` of them; the sweeps and what is left.
fn solve(s: &mut Sweeps, tolerance: f64, interval: usize, most: usize) -> (usize, f64) {
    let mut done = 0;
    while residual(s) > tolerance && done < most {
        s.sweep(interval);
        done += interval;
    }
    (done, residual(s))
}

fn tangents(n: [f64; 3]) -> [[f64; 3]; 2] {
    let pick = if n[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let t = cross(n, pick);
    let t = scaled(1.0 / dot(t, t).sqrt(), t);
    [t, cross(n, t)]
}

/// The same problem as rows. Fixed bodies are the world; a contact whose first side is fixed is turned round.
fn rows(p: &Problem) -> RowSystem {
    rows_with(p, &[])
}

/// The same, with rolling and spinning friction of the contacts or none.
fn rows_with(p: &Problem, rolls: &[Roll]) -> RowSystem {
    let mut system = RowSystem::default();
    for b in p.bodies.iter().filter(|b| b.inv_mass > 0.0) {
        system.push_node(1.0 / b.inv_mass, 1.0 / b.inv_inertia, b.radius);
    }
    let moving = |body: u32| body != WORLD && p.bodies[body as usize].inv_mass > 0.0;
    for (index, c) in p.contacts.iter().enumerate() {
        let roll = rolls.get(index).copied().unwrap_or(Roll {
            length: 1.0,
            ..Roll::default()
        });
        let (a, b, sign) = if moving(c.a) {
            (c.a, c.b, 1.0)
        } else {
            (c.b, c.a, -1.0)
        };
        let (n, slip) = (scaled(sign, c.normal), scaled(sign, c.slip));
        let radius = |body: u32| {
            if moving(body) {
                p.bodies[body as usize].radius
            } else {
                0.0
            }
        };
        let side = |v: [f64; 3], w: [f64; 3]| [v[0], v[1], v[2], w[0], w[1], w[2]];
        let row = |t: [f64; 3]| {
            let arm = cross(t, n);
            [
                side(t, scaled(radius(a), arm)),
                side(scaled(-1.0, t), scaled(radius(b), arm)),
            ]
        };
        let bounds = Bounds {
            sliding: c.friction,
            rolling: roll.rolling,
            spinning: roll.spinning,
        };
        let mut axes = vec![n];
        if c.friction > 0.0 {
            axes.extend(tangents(n));
        }
        let mut jac: Vec<_> = axes.iter().map(|&t| row(t)).collect();
        let mut z0: Vec<f64> = axes.iter().map(|&t| dot(t, slip)).collect();
        for t in moment_axes(&bounds, n) {
            jac.push([side([0.0; 3], t), side([0.0; 3], scaled(-1.0, t))]);
            z0.push(sign * dot(t, roll.turn));
        }
        let node_b = if moving(b) { b } else { WORLD };
        system.push_contact(a, node_b, bounds, roll.length, n, &jac, &z0);
    }
    system
}

/// Directions of the rolling and spinning rows.
fn moment_axes(bounds: &Bounds, n: [f64; 3]) -> Vec<[f64; 3]> {
    let mut axes = Vec::new();
    if bounds.rolling > 0.0 {
        axes.extend(tangents(n));
    }
    if bounds.spinning > 0.0 {
        axes.push(n);
    }
    axes
}

/// Impulses of the sweeps as rows of `rows`.
fn as_rows(p: &Problem, impulses: &[[f64; 3]]) -> Vec<f64> {
    let moving = |body: u32| body != WORLD && p.bodies[body as usize].inv_mass > 0.0;
    let mut lambda = Vec::new();
    for (c, &r) in p.contacts.iter().zip(impulses) {
        let sign = if moving(c.a) { 1.0 } else { -1.0 };
        let (n, r) = (scaled(sign, c.normal), scaled(sign, r));
        lambda.push(dot(n, r));
        if c.friction > 0.0 {
            lambda.extend(tangents(n).map(|t| dot(t, r)));
        }
    }
    lambda
}

fn bits(sweeps: &Sweeps) -> Vec<u64> {
    let impulses = sweeps.impulses().into_iter().flatten();
    let velocities = sweeps.velocities().into_iter().flatten();
    impulses.chain(velocities).map(f64::to_bits).collect()
}

fn asked(tolerance: f64, most: usize) -> Goal {
    Goal {
        tolerance,
        floor: 0.0,
        scale: 0.0,
        closing: f64::INFINITY,
        worst: 1.0,
        penalty_scale: 1.0,
        patience: usize::MAX,
        most,
        had: 0,
        rescale: usize::MAX,
        weighed: false,
        calm: 1.0,
    }
}

#[test]
fn sweeps_reach_a_solution_of_the_rows() {
    for (seed, balls, friction) in [
        (1, 4, 0.3),
        (2, 12, 0.6),
        (3, 40, 0.2),
        (4, 60, 0.0),
        (5, 30, 1.5),
    ] {
        let p = heap(seed, balls, friction);
        let mut s = sweeps(&p, 1);
        let (done, residual) = solve(&mut s, 1e-14, 50, 40_000);
        assert!(
            residual <= 1e-14,
            "seed {seed}: residual {residual:e} after {done} sweeps"
        );
        let system = rows(&p);
        let lambda = as_rows(&p, &s.impulses());
        let u: Vec<f64> = s.velocities()[..system.nodes()].concat();
        let mut z = vec![0.0; system.rows()];
        system.linear_measures(&u, &mut z);
        let violation = common::violation(&system, &z, &lambda, &u) / common::largest(&lambda);
        assert!(violation < 1e-12, "seed {seed}: violation {violation:e}");
        assert!(
            lambda.iter().any(|&l| l > 1e-3),
            "seed {seed}: nothing is pressed"
        );
    }
}

/// With whole steps along normals sweeps solve 10 of these 20 (`kernel`).
#[test]
fn much_friction_converges() {
    let solved = (1..=20).filter(|&seed| {
        let mut s = sweeps(&heap(seed, 12, 10.0), 1);
        s.settle(&asked(1e-6, 4_000)).converged
    });
    assert!(solved.count() >= 16);
}

/// The companion's measures are in the dual cones and at right angles to its impulses, which are in the cones.
#[test]
fn the_companion_is_a_convex_problem() {
    for (seed, friction) in [(1, 0.3), (2, 0.9), (3, 3.0)] {
        let p = heap(seed, 30, friction);
        let mut s = sweeps(&p, 1);
        let progress = s.settle_companion(&asked(1e-12, 40_000));
        assert!(progress.converged, "{progress:?}");
        let system = rows(&p);
        let lambda = as_rows(&p, &s.impulses());
        let u: Vec<f64> = s.velocities()[..system.nodes()].concat();
        let mut z = vec![0.0; system.rows()];
        system.linear_measures(&u, &mut z);
        let [most, fastest] = [&lambda, &z].map(|x| common::largest(x));
        let mut slides = 0;
        for (l, z) in lambda.chunks_exact(3).zip(z.chunks_exact(3)) {
            let [force, slip] = [l, z].map(|x| x[1].hypot(x[2]));
            assert!(force <= friction * l[0] + 1e-9 * most);
            assert!(
                z[0] >= friction * slip - 1e-7 * fastest,
                "{l:?} {z:?} {most} {fastest}"
            );
            let power: f64 = l.iter().zip(z).map(|(l, z)| l * z).sum();
            assert!(power.abs() <= 1e-7 * most * fastest);
            slides += u32::from(l[0] > 1e-6 * most && slip > 1e-6 * fastest);
        }
        assert!(slides > 0, "seed {seed}: nothing slides");
    }
}

/// Balls between walls that come together have no velocities that do not close: sweeps say so early.
#[test]
fn what_has_no_solution_is_given_up() {
    let ball = Body {
        inv_mass: 1.0,
        inv_inertia: 2.5,
        radius: 1.0,
    };
    let wall = |x: f64| Contact {
        a: 0,
        b: WORLD,
        normal: [x, 0.0, 0.0],
        slip: [-x, 0.0, 0.0],
        friction: 0.5,
    };
    let contacts = [wall(1.0), wall(-1.0)];
    let mut s = Sweeps::new(&[ball], &contacts, None, 1).expect("a good problem");
    let progress = s.settle(&Goal {
        tolerance: 1e-2,
        closing: 1e-6,
        ..asked(1e-2, 64_000)
    });
    assert!(!progress.converged);
    assert!(progress.sweeps < 5_000, "{progress:?}");
}

/// Without friction velocities are unique: those of Newton's method.
#[test]
fn velocities_are_those_of_newton() {
    for (seed, balls) in [(11, 6), (12, 20), (13, 50)] {
        let p = heap(seed, balls, 0.0);
        let mut s = sweeps(&p, 1);
        solve(&mut s, 1e-15, 50, 40_000);
        let mut system = rows(&p);
        let newton = common::solve(&mut system, &mut Measured(&[]), &sharp());
        assert!(newton.report.converged);
        for (x, y) in s.velocities().concat().iter().zip(&newton.u) {
            assert!((x - y).abs() < 1e-9, "seed {seed}: {x} and {y}");
        }
    }
}

/// One contact: closed form after one sweep.
#[test]
fn one_contact_is_solved_at_once() {
    let body = |mass: f64, radius: f64| Body {
        inv_mass: 1.0 / mass,
        inv_inertia: 2.5 / (mass * radius * radius),
        radius,
    };
    let bodies = [body(2.0, 0.5), body(3.0, 0.25)];
    // w_N = 1/2 + 1/3, w_T = 3.5 w_N for solid spheres.
    let (w_n, w_t) = (5.0 / 6.0, 3.5 * 5.0 / 6.0);
    for (approach, across, friction) in [
        (-1.0, 0.4, 0.5),
        (-1.0, 3.0, 0.2),
        (0.5, 1.0, 0.5),
        (-1.0, 1.0, 0.0),
    ] {
        let contact = Contact {
            a: 0,
            b: 1,
            normal: [0.0, 0.0, 1.0],
            slip: [0.6 * across, -0.8 * across, approach],
            friction,
        };
        let mut s = Sweeps::new(&bodies, &[contact], None, 1).expect("a good problem");
        s.sweep(1);
        let normal: f64 = (-approach / w_n).max(0.0);
        let sliding = (across / w_t).min(friction * normal);
        let expected = [-0.6 * sliding, 0.8 * sliding, normal];
        let r = s.impulses()[0];
        for k in 0..3 {
            assert!(
                (r[k] - expected[k]).abs() < 1e-15,
                "{r:?} is not {expected:?}"
            );
        }
        assert!(residual(&s) < 1e-15);
        // Lever arm of body 0: -r n. Torque of the impulse, over I.
        let spin = cross(
            scaled(-0.5, contact.normal),
            scaled(bodies[0].inv_inertia, r),
        );
        for k in 0..3 {
            assert!((s.velocities()[0][k] - 0.5 * r[k]).abs() < 1e-15);
            assert!((s.velocities()[0][3 + k] - spin[k]).abs() < 1e-14);
        }
    }
}

/// A long bar of balls, with this share of the possible contacts: many chunks, blocks between them, several stages.
fn pile(seed: u64, side: usize, share: f64) -> Problem {
    let mut rng = Rng(seed);
    let (long, count) = (8 * side, 8 * side * side * side);
    let mut name: Vec<u32> = (0..count as u32).collect();
    for i in (1..count).rev() {
        name.swap(i, rng.below(i + 1));
    }
    let number = |x: usize, y: usize, z: usize| name[(x * side + y) * side + z] as usize;
    let mut places = vec![[0.0; 3]; count];
    for x in 0..long {
        for y in 0..side {
            for z in 0..side {
                let j = rng.vector(0.1);
                places[number(x, y, z)] = [x as f64 + j[0], y as f64 + j[1], z as f64 + j[2]];
            }
        }
    }
    let bodies = (0..count)
        .map(|_| {
            let (mass, radius) = (rng.uniform(0.5, 2.0), rng.uniform(0.4, 0.6));
            Body {
                inv_mass: 1.0 / mass,
                inv_inertia: 2.5 / (mass * radius * radius),
                radius,
            }
        })
        .collect();
    let mut contacts = Vec::new();
    for x in 0..long {
        for y in 0..side {
            for z in 0..side {
                let a = number(x, y, z);
                if z == 0 {
                    contacts.push(touch(&mut rng, a as u32, WORLD, [0.0, 0.0, 1.0], 0.4));
                }
                for [i, j, k] in [[1, 0, 0], [0, 1, 0], [0, 0, 1]] {
                    if x + i < long && y + j < side && z + k < side && rng.uniform(0.0, 1.0) < share
                    {
                        let b = number(x + i, y + j, z + k);
                        let d = [0, 1, 2].map(|k| places[a][k] - places[b][k]);
                        let n = scaled(1.0 / dot(d, d).sqrt(), d);
                        contacts.push(touch(&mut rng, a as u32, b as u32, n, 0.4));
                    }
                }
            }
        }
    }
    Problem {
        bodies,
        contacts,
        places,
    }
}
