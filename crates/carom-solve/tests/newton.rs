//! Newton against the conditions, against Gauss-Seidel and against the closed form; its rate.

mod common;

use carom_solve::problem::Problem;
use carom_solve::rows::{Measured, RowSystem, Subproblem, NODE_DOF, WORLD};
use carom_solve::single::SingleContact;
use carom_solve::solver::sweep::ConeSweeps;
use carom_solve::{Bounds, NewtonOptions};
use common::{bounds, heap, largest, scaled, sharp, solve, Ball, Pair, Rng, Spheres};

/// A heap of balls with friction: overlaps (position level) or approach speeds (velocity level) as they come.
fn random_problem(
    rng: &mut Rng,
    contacts: usize,
    curved: bool,
    friction: bool,
) -> (RowSystem, Spheres) {
    let problem = heap(rng, contacts, true, curved);
    let laws: Vec<Bounds> = problem
        .pairs
        .iter()
        .map(|_| {
            let mask = if friction { 1 + rng.below(7) } else { 0 };
            bounds(mask, rng, 0.7, 0.5)
        })
        .collect();
    let size = if curved { 0.05 } else { 1.0 };
    let mut draw = Rng(rng.next());
    let mut system = problem.system(&laws, |_, r| {
        if r == 0 {
            draw.uniform(-1.0, 0.2)
        } else {
            size * draw.uniform(-1.0, 1.0)
        }
    });
    let mut problem = problem;
    let mut z = vec![0.0; system.rows()];
    let u = vec![0.0; NODE_DOF * system.nodes()];
    problem.evaluate(&mut system, &u, &mut z);
    (system, problem)
}

#[test]
fn random_problems_are_solved_and_the_end_is_quadratic() {
    let mut rng = Rng(11);
    for curved in [true, false] {
        let (mut worst, mut later, mut most) = (0.0f64, 0, 0);
        let mut rates = Vec::new();
        for round in 0..2000 {
            let contacts = 1 + round % 8;
            let (mut system, mut problem) = random_problem(&mut rng, contacts, curved, true);
            let s = solve(&mut system, &mut problem, &sharp());
            assert!(s.report.converged, "round {round}: {:?}", s.report);
            worst = worst.max(s.violation);
            most = most.max(s.report.iterations);
            if s.report.fallback {
                later += 1;
                continue;
            }
            // The last step that was not yet among rounding: r_{k+1} <= C r_k^2.
            let tail = s.history.windows(2).rev();
            let tail = tail
                .filter(|w| w[0] < 1e-4 && w[0] > 1e-8 && w[1] < w[0])
                .map(|w| (w[1] - 1e-13).max(0.0) / (w[0] * w[0]));
            rates.extend(tail.take(1));
        }
        rates.sort_by(f64::total_cmp);
        let at = |share: f64| rates[((rates.len() - 1) as f64 * share) as usize];
        println!(
            "curved {curved}: violation {worst:.1e}, iterations up to {most}, later rungs {later}; C of {}: median {:.1e}, \
             99 % {:.1}, largest {:.0}",
            rates.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
        assert!(worst < 1e-10, "{worst}");
        // C grows where the friction that slips is nearly none: its direction turns fast.
        assert!(at(0.5) < 20.0 && at(0.99) < 1e3);
        assert!(rates.len() > 200 && later < 40);
    }
}

#[test]
fn one_contact_in_closed_form_is_what_newton_finds() {
    let mut rng = Rng(12);
    let mut worst = 0.0f64;
    for _ in 0..2000 {
        let (mass, radius) = (rng.uniform(0.5, 2.0), rng.uniform(0.3, 1.5));
        let inertia = rng.uniform(0.2, 0.7) * mass * radius * radius;
        let mask = rng.below(8);
        let law = bounds(mask, &mut rng, radius, 0.6);
        let centre = [0.0, 0.0, radius];
        let mut problem = Spheres {
            balls: vec![Ball {
                mass,
                inertia,
                radius,
                frame: centre,
                centre,
            }],
            pairs: vec![Pair::Plane(0, [0.0, 0.0, 1.0])],
            curved: false,
        };
        let mut z = [0.0; 6];
        for value in &mut z {
            *value = rng.uniform(-1.0, 1.0);
        }
        let mut draw = z.iter();
        let mut system = problem.system(&[law], |_, _| *draw.next().unwrap_or(&0.0));
        let s = solve(&mut system, &mut problem, &sharp());
        assert!(s.report.converged && s.violation < 1e-10 || system.z0[0] >= 0.0);
        // Rows in the order N, T, R, S; rolling in the turned basis (-R2, R1).
        let mut rows = system.z0.iter().copied();
        let mut next = |present: bool| {
            if present {
                rows.next().unwrap_or(0.0)
            } else {
                0.0
            }
        };
        let (t, r, w) = (law.sliding > 0.0, law.rolling > 0.0, law.spinning > 0.0);
        let normal = next(true);
        let sliding = [next(t), next(t)];
        let turn = [next(r), next(r)];
        let single = SingleContact {
            z_normal: normal,
            z_sliding: sliding,
            z_rolling: [-turn[1], turn[0]],
            z_spinning: next(w),
            d_normal: 1.0 / mass,
            d_sliding: 1.0 / mass + radius * radius / inertia,
            d_turn: 1.0 / inertia,
            d_coupling: radius / inertia,
            mu: law.sliding,
            rho: law.rolling,
            delta: law.spinning,
        }
        .solve();
        let mut expected = vec![single.normal];
        if t {
            expected.extend(single.sliding);
        }
        if r {
            expected.extend([single.rolling[1], -single.rolling[0]]);
        }
        if w {
            expected.push(single.spinning);
        }
        for (a, b) in expected.iter().zip(&s.lambda) {
            worst = worst.max((a - b).abs());
        }
    }
    println!("closed form and Newton: {worst:.1e}");
    assert!(worst < 1e-9, "{worst}");
}

/// Runs Gauss-Seidel until nothing changes.
fn by_sweeps(system: &RowSystem) -> (Vec<f64>, Vec<f64>) {
    let mut sweeps = ConeSweeps::new(&Problem::from_rows(system, &system.z0), 1);
    let mut lambda = vec![0.0; system.rows()];
    for _ in 0..200 {
        let before = lambda.clone();
        sweeps.sweep(200, || false);
        sweeps.leave(&mut lambda);
        let change = before
            .iter()
            .zip(&lambda)
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        if change < 1e-15 * largest(&lambda) {
            break;
        }
    }
    let mut u = vec![0.0; NODE_DOF * system.nodes()];
    system.correction(&lambda, &mut u);
    (lambda, u)
}

/// Velocities are unique without friction, also where multipliers are not; with friction where rows are independent.
#[test]
fn gauss_seidel_and_newton_agree_where_the_solution_is_unique() {
    let mut rng = Rng(13);
    for (friction, planes) in [(false, true), (true, false)] {
        let (mut worst, mut multipliers) = (0.0f64, 0.0f64);
        for round in 0..300 {
            let contacts = 1 + round % 8;
            let mut tree = heap(&mut rng, contacts, planes, false);
            // Contacts that form a tree have independent rows.
            if friction {
                tree.pairs = spanning(&tree);
            }
            let laws: Vec<Bounds> = tree
                .pairs
                .iter()
                .map(|_| bounds(usize::from(friction), &mut rng, 0.7, 0.4))
                .collect();
            let mut draw = Rng(rng.next());
            let mut system = tree.system(&laws, |_, r| {
                draw.uniform(-1.0, if r == 0 { 0.2 } else { 1.0 })
            });
            let (lambda, u) = by_sweeps(&system);
            let s = solve(&mut system, &mut Measured(&[]), &sharp());
            assert!(s.report.converged);
            let scale = largest(&s.u);
            for (a, b) in u.iter().zip(&s.u) {
                worst = worst.max((a - b).abs() / scale);
            }
            for (a, b) in lambda.iter().zip(&s.lambda) {
                multipliers = multipliers.max((a - b).abs() / largest(&lambda));
            }
        }
        println!("friction {friction}: velocities differ by {worst:.1e}, multipliers by {multipliers:.1e}");
        assert!(worst < 1e-9, "{worst}");
        assert!(!friction || multipliers < 1e-8, "{multipliers}");
    }
}

/// The contacts by which each ball after the first hangs on an earlier one.
fn spanning(spheres: &Spheres) -> Vec<Pair> {
    let mut joined = vec![false; spheres.balls.len()];
    let mut kept = Vec::new();
    for &pair in &spheres.pairs {
        if let Pair::Balls(_, b) = pair {
            if !joined[b] {
                joined[b] = true;
                kept.push(pair);
            }
        }
    }
    kept
}

/// The largest problems that are solved dense, and the same through the sparse route.
#[test]
fn dense_and_sparse_find_the_same_velocities_without_friction() {
    let mut rng = Rng(14);
    let mut worst = 0.0f64;
    for _ in 0..200 {
        let (mut system, _) = random_problem(&mut rng, 10, false, false);
        let dense = solve(&mut system, &mut Measured(&[]), &sharp());
        let sparse = solve(
            &mut system,
            &mut Measured(&[]),
            &NewtonOptions {
                dense_contacts: 0,
                softness: 0.0,
                ..sharp()
            },
        );
        assert!(dense.report.converged && sparse.report.converged);
        for (a, b) in dense.u.iter().zip(&sparse.u) {
            worst = worst.max((a - b).abs() / largest(&dense.u));
        }
    }
    println!("dense and sparse: {worst:.1e}");
    assert!(worst < 1e-9, "{worst}");
}

/// What cannot be solved is said, not hidden: an unsolvable tolerance, and numbers that are not finite.
#[test]
fn failure_is_reported() {
    let mut rng = Rng(15);
    let (mut system, mut problem) = random_problem(&mut rng, 6, false, true);
    let hopeless = NewtonOptions {
        tolerance: 1e-300,
        floor: 1e-300,
        ..sharp()
    };
    let s = solve(&mut system, &mut problem, &hopeless);
    assert!(!s.report.converged);
    assert_eq!(s.report.rung, "linearised");
    // What is left is the best there is, inside its cones.
    assert!(s.violation < 1e-9, "{}", s.violation);
    system.z0[0] = f64::NAN;
    let s = solve(&mut system, &mut Measured(&[]), &sharp());
    assert!(!s.report.converged);
}

/// Contacts of [`wedged`]: nodes, normal, tangents of the start of the step, measures at rest.
type Row = (u32, u32, [f64; 3], [f64; 3], [f64; 3], [f64; 3]);

#[rustfmt::skip]
const WEDGED: [Row; 5] = [
    (0, 1, [0.9946242698125103, 0.10354980395891857, 0.0], [0.010710363964622105, -0.10293518382150547, -0.9946304017248708], [-0.10293518382150547, 0.9892896360353782, -0.1034908883169035], [1.978522777337506e-07, -0.0003612134131453136, 2.813795254148375e-05]),
    (0, WORLD, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0006124618327935619, 1.5291793888631442e-08, 4.223398838987258e-09]),
    (0, WORLD, [-0.9917750025541668, 0.12799353229238825, 0.0], [0.01638289888010147, 0.12694289859770036, 0.9917747229688295], [0.12694289859770036, 0.9836171011198983, -0.12799569867812616], [-2.3136092329581253e-08, -0.0006074295340580879, 7.839695573576234e-05]),
    (1, 2, [0.5525362601175186, -0.1344312462979705, -0.8225763923637247], [0.8327473096405889, 0.040590418397100037, 0.5521633238641531], [-0.040590418397100037, -0.9901491446139902, 0.13400406469406778], [3.3798212117043145e-05, -0.0003912217506007621, 8.892705312659246e-05]),
    (1, WORLD, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0003541679353903483, -8.256077441046487e-05, 0.00017004602101148517]),
];

/// Two grains between a floor, a rim and a third one, from a heap that was poured: five contacts, of which friction makes one
/// row too many. Newton and sweeps go round in circles at 4 % of what is asked in all rungs.
#[test]
fn wedged_balls_are_solved_linearised() {
    let (radius, density) = (2.5e-3, 2500.0);
    let mass = density * 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius;
    let mut system = RowSystem::default();
    for _ in 0..3 {
        system.push_node(mass, 0.4 * mass * radius * radius, radius);
    }
    let bounds = Bounds {
        sliding: 0.5,
        ..Bounds::default()
    };
    for (a, b, normal, t1, t2, z0) in WEDGED {
        let zero = [0.0; 3];
        let arm = if b == WORLD { 0.0 } else { radius };
        let row = |v: [f64; 3], wa: [f64; 3], wb: [f64; 3]| {
            let side = |v: [f64; 3], w: [f64; 3]| [v[0], v[1], v[2], w[0], w[1], w[2]];
            [side(v, wa), side(scaled(-1.0, v), wb)]
        };
        let jac = [
            row(normal, zero, zero),
            row(t1, scaled(-radius, t2), scaled(-arm, t2)),
            row(t2, scaled(radius, t1), scaled(arm, t1)),
        ];
        system.push_contact(a, b, bounds, radius, normal, &jac, &z0);
    }
    let s = solve(&mut system, &mut Measured(&[]), &sharp());
    assert!(s.report.converged, "{:?}", s.report);
    assert_eq!(s.report.rung, "linearised");
    assert!(s.violation < 1e-9 * largest(&s.u), "{:e}", s.violation);
}
