//! Rolling and spinning friction in the sweeps.

use super::*;
use carom_solve::cone;
use carom_solve::spheres::Goal;

/// Some contacts roll, some spin, some do both and some neither.
fn rolls(p: &Problem, seed: u64, size: f64) -> Vec<Roll> {
    let mut rng = Rng(seed);
    let mut bound = |share: f64| {
        if rng.uniform(0.0, 1.0) < share {
            rng.uniform(0.3, 1.0) * size
        } else {
            0.0
        }
    };
    let bounds: Vec<[f64; 2]> = p
        .contacts
        .iter()
        .map(|_| [bound(0.7), bound(0.5)])
        .collect();
    bounds
        .into_iter()
        .map(|[rolling, spinning]| Roll {
            rolling,
            spinning,
            turn: rng.vector(1.5),
            length: rng.uniform(0.4, 0.8),
        })
        .collect()
}

fn rolling(p: &Problem, rolls: &[Roll], threads: usize) -> Sweeps {
    let mut s = sweeps(p, threads);
    let none = vec![[0.0; 3]; rolls.len()];
    s.set_rolls(&p.bodies, &p.contacts, rolls, &none)
        .expect("good friction");
    s
}

/// Impulses and moments as rows of `rows_with`.
fn packed(p: &Problem, rolls: &[Roll], s: &Sweeps) -> Vec<f64> {
    let moving = |body: u32| body != WORLD && p.bodies[body as usize].inv_mass > 0.0;
    let mut lambda = Vec::new();
    let solved = s.impulses().into_iter().zip(s.moments());
    for ((c, roll), (r, m)) in p.contacts.iter().zip(rolls).zip(solved) {
        let sign = if moving(c.a) { 1.0 } else { -1.0 };
        let (n, r, m) = (scaled(sign, c.normal), scaled(sign, r), scaled(sign, m));
        let bounds = Bounds {
            sliding: c.friction,
            rolling: roll.rolling,
            spinning: roll.spinning,
        };
        lambda.push(dot(n, r));
        if c.friction > 0.0 {
            lambda.extend(tangents(n).map(|t| dot(t, r)));
        }
        lambda.extend(moment_axes(&bounds, n).into_iter().map(|t| dot(t, m)));
    }
    lambda
}

#[test]
fn rolling_sweeps_reach_a_solution_of_the_rows() {
    let (mut full, mut sticking) = (false, false);
    for (seed, balls, friction, size) in [
        (1, 4, 0.3, 0.1),
        (2, 12, 0.6, 0.3),
        (3, 40, 0.2, 0.02),
        (4, 60, 0.0, 0.1),
        (5, 30, 1.5, 1.0),
    ] {
        let p = heap(seed, balls, friction);
        let rolls = rolls(&p, seed, size);
        let mut s = rolling(&p, &rolls, 1);
        let (done, residual) = solve(&mut s, 1e-14, 50, 40_000);
        assert!(
            residual <= 1e-14,
            "seed {seed}: residual {residual:e} after {done} sweeps"
        );
        let system = rows_with(&p, &rolls);
        let lambda = packed(&p, &rolls, &s);
        let u: Vec<f64> = s.velocities()[..system.nodes()].concat();
        let mut z = vec![0.0; system.rows()];
        system.linear_measures(&u, &mut z);
        let violation = common::violation(&system, &z, &lambda, &u) / common::largest(&lambda);
        assert!(violation < 1e-12, "seed {seed}: violation {violation:e}");
        let (impulses, moments) = (s.impulses(), s.moments());
        assert!(moments.concat().iter().any(|m| m.abs() > 1e-3), "no moment");
        // Discs are filled and not: both cases are there.
        let used = p
            .contacts
            .iter()
            .zip(&rolls)
            .zip(impulses.iter().zip(&moments));
        let shares: Vec<f64> = used
            .filter(|((c, roll), (r, _))| roll.rolling * dot(**r, c.normal) > 0.0)
            .map(|((c, roll), (r, m))| {
                let across = [0, 1, 2].map(|k| m[k] - dot(*m, c.normal) * c.normal[k]);
                dot(across, across).sqrt() / (roll.rolling * dot(*r, c.normal).abs())
            })
            .collect();
        assert!(shares.iter().all(|&s| s < 1.0 + 1e-12), "{shares:?}");
        full |= shares.iter().any(|&s| s > 0.999);
        sticking |= shares.iter().any(|&s| s < 0.99);
    }
    assert!(full && sticking, "both cases of the discs");
}

/// Eq. 44 on rows: `|P(r - p z) - r|` with moment rows over the reference length.
#[test]
fn norms_are_those_of_the_rows() {
    let p = heap(8, 30, 0.4);
    let rolls = rolls(&p, 8, 0.2);
    let mut s = rolling(&p, &rolls, 1);
    s.sweep(3);
    let scale = 0.5;
    let system = rows_with(&p, &rolls);
    let lambda = packed(&p, &rolls, &s);
    let u: Vec<f64> = s.velocities()[..system.nodes()].concat();
    let mut z = vec![0.0; system.rows()];
    system.linear_measures(&u, &mut z);
    let [mut residual, mut projected, mut size] = [0.0; 3];
    for c in &system.contacts {
        let range = c.row as usize..(c.row + c.dim) as usize;
        let xi: Vec<f64> = range
            .clone()
            .map(|r| lambda[r] - scale * z[r] / system.diag[r])
            .collect();
        let mut phi = vec![0.0; xi.len()];
        cone::project(&c.bounds, &xi, &mut phi);
        for (k, row) in range.enumerate() {
            let over = if k < c.translational as usize {
                1.0
            } else {
                c.length
            };
            residual += ((phi[k] - lambda[row]) / over).powi(2);
            projected += (phi[k] / over).powi(2);
            size += (lambda[row] / over).powi(2);
        }
    }
    let mut momentum = 0.0;
    for (b, u) in p
        .bodies
        .iter()
        .zip(s.velocities())
        .filter(|(b, _)| b.inv_mass > 0.0)
    {
        let (v, w) = ([u[0], u[1], u[2]], [u[3], u[4], u[5]]);
        momentum += dot(v, v) / b.inv_mass.powi(2) + dot(w, w) / (b.inv_inertia * b.radius).powi(2);
    }
    let norms = s.norms(scale);
    let terms = 2.0 * momentum.sqrt() + projected.sqrt() + size.sqrt();
    assert!(residual > 1e-6);
    assert!((norms.residual - residual.sqrt()).abs() < 1e-12 * residual.sqrt());
    assert!((norms.terms - terms).abs() < 1e-12 * terms);
}

/// A ball that is pressed on the floor and spins, or rolls where it cannot slide: closed forms.
#[test]
fn one_ball_is_slowed_by_what_its_load_admits() {
    let (mass, radius) = (2.0, 0.5);
    let bodies = [Body {
        inv_mass: 1.0 / mass,
        inv_inertia: 2.5 / (mass * radius * radius),
        radius,
    }];
    for (spin, [rolling, spinning]) in [(4.0, [0.0, 0.1]), (0.5, [0.1, 0.2]), (-4.0, [0.1, 0.1])] {
        let contact = Contact {
            a: 0,
            b: WORLD,
            normal: [0.0, 0.0, 1.0],
            slip: [0.0, 0.0, -1.0],
            friction: 0.5,
        };
        let roll = Roll {
            rolling,
            spinning,
            turn: [0.0, 0.0, spin],
            length: radius,
        };
        let p = Problem {
            bodies: bodies.to_vec(),
            contacts: vec![contact],
            places: vec![[0.0; 3]],
        };
        let mut s = rolling_one(&p, roll);
        s.sweep(1);
        let stop: f64 = spin / bodies[0].inv_inertia;
        let expected = -stop.signum() * stop.abs().min(spinning * mass);
        let m = s.moments()[0];
        assert!(
            (m[2] - expected).abs() < 1e-15 && m[0] == 0.0 && m[1] == 0.0,
            "{m:?}"
        );
        assert!((s.velocities()[0][5] - expected * bodies[0].inv_inertia).abs() < 1e-14);
        assert!(residual(&s) < 1e-15);
    }
    // Rolling without sliding about y: the moment takes rho N r / (I + m r^2) of the turn.
    let (rho, turn) = (0.05, 3.0);
    let contact = Contact {
        a: 0,
        b: WORLD,
        normal: [0.0, 0.0, 1.0],
        slip: [0.0, 0.0, -1.0],
        friction: 0.9,
    };
    let p = Problem {
        bodies: bodies.to_vec(),
        contacts: vec![contact],
        places: vec![[0.0; 3]],
    };
    let mut s = rolling_one(
        &p,
        Roll {
            rolling: rho,
            spinning: 0.0,
            turn: [0.0, turn, 0.0],
            length: radius,
        },
    );
    solve(&mut s, 1e-15, 1, 500);
    let inertia = 1.0 / bodies[0].inv_inertia;
    let slowed = -rho * mass / (inertia + mass * radius * radius);
    let u = s.velocities()[0];
    assert!((u[4] - slowed).abs() < 1e-13, "{u:?} {slowed}");
    assert!((u[0] - radius * slowed).abs() < 1e-13);
}

fn rolling_one(p: &Problem, roll: Roll) -> Sweeps {
    rolling(p, &[roll], 1)
}

#[test]
fn the_bits_of_rolling_do_not_depend_on_threads_or_instructions() {
    let p = pile(21, 10, 1.0);
    let rolls = rolls(&p, 4, 0.1);
    let all = |s: &Sweeps| {
        let moments = s.moments().into_iter().flatten().map(f64::to_bits);
        bits(s).into_iter().chain(moments).collect::<Vec<u64>>()
    };
    let goal = Goal {
        tolerance: 1e-6,
        floor: 0.0,
        scale: 0.0,
        closing: 1.0,
        worst: 1.0,
        penalty_scale: 0.5,
        patience: 1000,
        most: 20,
        had: 0,
        rescale: usize::MAX,
        weighed: false,
        calm: 1.0,
    };
    let run = |threads: usize, instructions| {
        let mut s = rolling(&p, &rolls, threads);
        s.instructions = instructions;
        s.sweep(3);
        s.settle(&goal);
        (all(&s), residual(&s).to_bits())
    };
    let first = run(1, Instructions::Widest);
    for threads in [2, 5, 8] {
        assert!(
            run(threads, Instructions::Widest) == first,
            "{threads} threads"
        );
    }
    assert!(run(1, Instructions::Scalar).0 == first.0, "scalar");
}

/// Momentum takes contacts that roll to a solution, and many times sooner.
#[test]
fn rolling_sweeps_with_momentum_settle() {
    let p = pile(22, 6, 0.7);
    let rolls = rolls(&p, 6, 0.05);
    let goal = Goal {
        tolerance: 1e-9,
        floor: 0.0,
        scale: 0.0,
        closing: 1e-6,
        worst: 1.0,
        penalty_scale: 0.5,
        patience: 10_000,
        most: 10_000,
        had: 0,
        rescale: usize::MAX,
        weighed: false,
        calm: 1.0,
    };
    let mut s = rolling(&p, &rolls, 1);
    let progress = s.settle(&goal);
    assert!(progress.converged, "{progress:?}");
    let mut plain = rolling(&p, &rolls, 1);
    plain.sweep(progress.sweeps);
    let residual = plain.judge(&goal, 0).residual;
    assert!(
        residual > 10.0 * progress.residual,
        "{residual:e} {progress:?}"
    );
    // Rounding has left nothing that `refresh` would clear.
    let before = s.velocities().concat();
    s.refresh();
    for (x, y) in before.iter().zip(s.velocities().concat()) {
        assert!((x - y).abs() < 1e-11, "{x} {y}");
    }
}

#[test]
fn exchanged_sides_roll_as_the_same_contact() {
    let p = heap(31, 30, 0.5);
    let mut q = heap(31, 30, 0.5);
    let own = rolls(&p, 31, 0.2);
    let mut other = own.clone();
    for (c, roll) in q.contacts.iter_mut().zip(&mut other) {
        (c.a, c.b) = (c.b, c.a);
        c.normal = scaled(-1.0, c.normal);
        c.slip = scaled(-1.0, c.slip);
        roll.turn = scaled(-1.0, roll.turn);
    }
    let (mut s, mut t) = (rolling(&p, &own, 1), rolling(&q, &other, 1));
    s.sweep(20);
    t.sweep(20);
    let pairs = |x: Vec<[f64; 3]>, y: Vec<[f64; 3]>| x.concat().into_iter().zip(y.concat());
    for (x, y) in s.velocities().concat().iter().zip(t.velocities().concat()) {
        assert!((x - y).abs() < 1e-12);
    }
    for (r, o) in pairs(s.moments(), t.moments()).chain(pairs(s.impulses(), t.impulses())) {
        assert!((r + o).abs() < 1e-12);
    }
}

#[test]
fn a_warm_start_has_the_moments_too() {
    let p = heap(61, 50, 0.5);
    let own = rolls(&p, 61, 0.1);
    let mut s = rolling(&p, &own, 1);
    s.sweep(25);
    let mut warm = sweeps(&p, 2);
    warm.warm_start(&s.impulses());
    warm.set_rolls(&p.bodies, &p.contacts, &own, &s.moments())
        .expect("good friction");
    for (x, y) in s
        .velocities()
        .concat()
        .iter()
        .zip(warm.velocities().concat())
    {
        assert!((x - y).abs() < 1e-13, "{x} and {y}");
    }
    assert!((residual(&s) - residual(&warm)).abs() < 1e-13);
    // Other measures of the same contacts.
    let mut turned = own.clone();
    for roll in &mut turned {
        roll.turn = scaled(0.5, roll.turn);
    }
    warm.change_rolls(&turned).expect("good friction");
    let mut fresh = sweeps(&p, 1);
    fresh.warm_start(&s.impulses());
    fresh
        .set_rolls(&p.bodies, &p.contacts, &turned, &s.moments())
        .expect("good friction");
    assert_eq!(residual(&warm).to_bits(), residual(&fresh).to_bits());
    // The next problem in the same memory rolls no more.
    let none = vec![[0.0; 3]; p.contacts.len()];
    warm.renew_from(&p.bodies, &p.contacts, Some(&p.places), &none)
        .expect("a good problem");
    assert!(warm.moments().concat().iter().all(|&m| m == 0.0));
}

#[test]
fn bad_rolling_friction_is_refused() {
    let p = heap(3, 6, 0.2);
    let good = rolls(&p, 3, 0.1);
    let none = vec![[0.0; 3]; good.len()];
    let refuse = |change: &dyn Fn(&mut Roll)| {
        let mut bad = good.clone();
        change(&mut bad[2]);
        sweeps(&p, 1).set_rolls(&p.bodies, &p.contacts, &bad, &none)
    };
    let bad = Err(SpheresError::Roll { contact: 2 });
    assert_eq!(refuse(&|_| ()), Ok(()));
    assert_eq!(refuse(&|r| r.rolling = -0.1), bad);
    assert_eq!(refuse(&|r| r.spinning = f64::NAN), bad);
    assert_eq!(refuse(&|r| r.turn[1] = f64::INFINITY), bad);
    assert_eq!(refuse(&|r| r.length = 0.0), bad);
    let mut s = rolling(&p, &good, 1);
    let last = good.len() - 1;
    let changed = Err(SpheresError::Changed { contact: last });
    assert_eq!(s.change_rolls(&good[..last]), changed);
}
