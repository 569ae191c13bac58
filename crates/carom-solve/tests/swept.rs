//! Large islands by sweeps over their rows: bodies whose contacts act on them off their centres, as those of clumps do.

mod common;

use carom_solve::rows::{Measured, RowSystem, Subproblem, WORLD};
use carom_solve::{Beside, Newton, NewtonOptions};
use common::{bounds, cross, heap, sharp, solve, violation, Rng, Solved};

/// The finest options with which large islands are swept.
fn coarse() -> NewtonOptions {
    NewtonOptions {
        tolerance: 1e-5,
        beside: Beside {
            sweeps: true,
            ..sharp().beside
        },
        ..sharp()
    }
}

/// Random levers of the contacts: rows of one contact act on one another.
fn off_centre(system: &mut RowSystem, rng: &mut Rng, size: f64) {
    for contact in system.contacts.clone() {
        for side in 0..2 {
            let lever = rng.vector(size);
            for row in contact.rows() {
                let along = &mut system.jac[row][side];
                let turn = cross(lever, [along[0], along[1], along[2]]);
                (0..3).for_each(|k| along[3 + k] += turn[k]);
            }
        }
        let mut block = Default::default();
        system.delassus_block(&contact, &contact, &mut block);
        let diagonal: Vec<f64> = (0..contact.dim as usize).map(|k| block[k][k]).collect();
        system.diag[contact.rows()].copy_from_slice(&diagonal);
        // Slips are slowed against their direction: both rows of a disc have one scale.
        for disc in contact.bounds.discs() {
            let first = contact.row as usize + disc.start;
            let both = &mut system.diag[first..first + disc.dim];
            both.fill(both.iter().copied().fold(0.0, f64::max));
        }
    }
}

/// A heap of `contacts` contacts that are pushed together at random.
fn pushed(seed: u64, contacts: usize, mask: usize) -> RowSystem {
    levered(seed, contacts, mask, 0.8, 0.6)
}

/// The same with friction up to `most`, and levers of a length.
fn levered(seed: u64, contacts: usize, mask: usize, most: f64, levers: f64) -> RowSystem {
    let rng = &mut Rng(seed);
    let spheres = heap(rng, contacts, true, false);
    let laws: Vec<_> = spheres
        .pairs
        .iter()
        .map(|_| bounds(mask, rng, 0.5, most))
        .collect();
    let mut system = spheres.system(&laws, |_, row| match row {
        0 => rng.uniform(-1.0, 0.2),
        _ => rng.uniform(-0.5, 0.5),
    });
    off_centre(&mut system, &mut Rng(seed + 1), levers);
    system
}

fn swept(system: &mut RowSystem, options: &NewtonOptions) -> Solved {
    let found = solve(system, &mut Measured(&[]), options);
    assert!(found.report.converged, "{:?}", found.report);
    assert_eq!(found.report.rung, "sweeps");
    assert!(!found.report.fallback);
    found
}

#[test]
fn coulomb_contacts_of_bodies_with_levers_meet_their_conditions() {
    for mask in [0, 1, 3, 5, 7] {
        for seed in 0..8 {
            let mut system = pushed(100 * mask as u64 + seed, 80, mask);
            let found = swept(&mut system, &coarse());
            assert!(found.violation < 2e-4, "{mask} {seed}: {}", found.violation);
        }
    }
}

/// Without friction the velocities are unique: the minimum of the kinetic energy over what the gaps admit.
#[test]
fn without_friction_sweeps_find_what_newtons_method_finds() {
    for seed in 0..8 {
        let mut system = pushed(seed, 80, 0);
        let found = swept(&mut system, &coarse());
        let exact = solve(&mut system, &mut Measured(&[]), &sharp());
        assert!(exact.report.converged && exact.report.rung != "sweeps");
        let size = exact.u.iter().fold(0.0f64, |most, u| most.max(u.abs()));
        for (u, exact) in found.u.iter().zip(&exact.u) {
            assert!((u - exact).abs() < 1e-3 * size, "{seed}: {u} and {exact}");
        }
    }
}

/// Points of neighbours joined in a chain, one of them twice and one held in the world, beside a heap's contacts.
fn joined(seed: u64, contacts: usize, mask: usize) -> RowSystem {
    let mut system = pushed(seed, contacts, mask);
    let rng = &mut Rng(seed + 2);
    let mut pairs: Vec<(u32, u32)> = (0..12).map(|k| (k, k + 1)).collect();
    pairs.push((14, WORLD));
    for (a, b) in pairs {
        let arms = [rng.vector(0.5), rng.vector(0.5)];
        let jac: [[[f64; 6]; 2]; 3] = std::array::from_fn(|k| {
            let unit: [f64; 3] = std::array::from_fn(|i| f64::from(i == k));
            let half = |arm: [f64; 3], sign: f64| {
                let turn = cross(arm, unit);
                std::array::from_fn(|i| sign * if i < 3 { unit[i] } else { turn[i - 3] })
            };
            [half(arms[0], 1.0), half(arms[1], -1.0)]
        });
        let z0 = rng.vector(0.5);
        for _ in 0..1 + usize::from(a == 3) {
            system.push_joint((a, b), 3, 0.5, &jac, &z0);
        }
    }
    system
}

/// Joints are exact at the coarse tolerance of contacts, and without friction the velocities are those of Newton's method.
#[test]
fn joints_are_held_whatever_the_tolerance() {
    let mut by_sweeps = 0;
    for (seed, mask) in (0..8).flat_map(|seed| [(seed, 0), (seed, 1)]) {
        let mut system = joined(seed, 80, mask);
        let found = solve(&mut system, &mut Measured(&[]), &coarse());
        assert!(found.report.converged);
        if found.report.rung != "sweeps" {
            // Friction of bodies with levers that joints hold may go round in circles.
            assert_eq!(mask, 1, "{seed}");
            continue;
        }
        by_sweeps += 1;
        assert!(found.violation < 2e-4, "{seed}: {}", found.violation);
        let mut z = vec![0.0; system.rows()];
        system.linear_measures(&found.u, &mut z);
        let joints = system.contacts.iter().filter(|c| c.bilateral);
        let open = joints.flat_map(|c| c.rows()).map(|row| z[row].abs());
        let open = open.fold(0.0, f64::max);
        assert!(open < 1e-11, "{seed} {mask}: {open}");
        if mask == 0 {
            let exact = solve(&mut system, &mut Measured(&[]), &sharp());
            assert!(exact.report.converged && exact.report.rung != "sweeps");
            let size = exact.u.iter().fold(0.0f64, |most, u| most.max(u.abs()));
            let off = found.u.iter().zip(&exact.u).map(|(u, v)| (u - v).abs());
            assert!(off.fold(0.0, f64::max) < 1e-3 * size, "{seed}");
        }
    }
    assert!(by_sweeps >= 13, "{by_sweeps}");
}

/// The norm of all is mild with the worst contact: where no contact may close, none does, and nothing else is asked more finely.
#[test]
fn the_worst_contact_closes_no_faster_than_it_may() {
    let mut missed = 0;
    for seed in 0..8 {
        let closing = 1e-6;
        let worst = |found: &Solved, system: &RowSystem| {
            let mut z = vec![0.0; system.rows()];
            system.linear_measures(&found.u, &mut z);
            let normal = system.contacts.iter().map(|c| -z[c.row as usize]);
            normal.fold(0.0, f64::max)
        };
        let mut system = pushed(seed, 80, 1);
        let found = swept(&mut system, &coarse());
        missed += usize::from(worst(&found, &system) > closing);
        let asked = NewtonOptions {
            closing,
            ..coarse()
        };
        let found = swept(&mut system, &asked);
        assert!(worst(&found, &system) <= closing, "{seed}");
    }
    assert!(missed > 4, "{missed}");
}

/// Contacts with levers that are long beside the radii of gyration lock one another: sweeps alone crawl, and go on from alternating directions.
#[test]
fn what_locks_is_split() {
    let mut split = 0;
    for seed in 0..24 {
        let mut system = levered(seed, 150, 1, 1.5, 8.0);
        let found = solve(&mut system, &mut Measured(&[]), &coarse());
        assert!(found.report.converged, "{seed}");
        assert!(found.violation < 2e-4, "{seed}: {}", found.violation);
        assert_eq!(found.report.fallback, found.report.rung != "sweeps");
        split += usize::from(found.report.rung == "split");
    }
    assert!(split > 5, "{split}");
}

/// So they do where normal impulses have a least: of all ways the companion alone does not know of it.
#[test]
fn what_locks_is_split_where_impulses_have_a_least_too() {
    for seed in [3, 4, 6] {
        let mut system = levered(seed, 150, 1, 1.5, 8.0);
        let (mut newton, mut lambda) = (Newton::default(), vec![0.0; system.rows()]);
        let mut u = vec![0.0; 6 * system.nodes()];
        system.contacts[0].least = 0.1;
        let problem = &mut Measured(&[]);
        let report = newton.solve(&mut system, problem, &coarse(), &mut lambda, &mut u);
        assert!(report.converged && lambda[0] >= 0.1, "{seed}: {report:?}");
        assert_ne!(report.rung, "companion");
    }
}

/// What a solver has solved before, with more contacts or other discs, changes no bit.
#[test]
fn a_solver_that_was_used_finds_the_same() {
    let mut used = Newton::default();
    let of = |contacts: usize, mask| pushed(contacts as u64, contacts, mask);
    let systems = [
        of(80, 7),
        joined(5, 80, 1),
        levered(3, 150, 1, 1.5, 8.0),
        of(30, 0),
        of(60, 3),
        levered(13, 150, 1, 1.5, 8.0),
        of(40, 1),
        of(80, 5),
    ];
    for system in systems {
        let of = |newton: &mut Newton| {
            let (mut system, mut lambda) = (system.clone(), vec![0.0; system.rows()]);
            let mut u = vec![0.0; 6 * system.nodes()];
            let problem = &mut Measured(&[]);
            let report = newton.solve(&mut system, problem, &coarse(), &mut lambda, &mut u);
            assert!(report.converged);
            (lambda, u, report.rung)
        };
        assert_eq!(of(&mut used), of(&mut Newton::default()));
    }
}

/// Gaps of turning normals: each look states the problem anew.
#[test]
fn gaps_of_a_heap_are_closed() {
    for seed in 0..8 {
        let rng = &mut Rng(seed);
        let mut spheres = heap(rng, 60, true, true);
        let laws = vec![Default::default(); spheres.pairs.len()];
        let mut system = spheres.system(&laws, |_, _| 0.0);
        let options = NewtonOptions {
            gap_tolerance: 1e-10,
            ..coarse()
        };
        let found = solve(&mut system, &mut spheres, &options);
        assert!(found.report.converged && found.report.rung == "sweeps");
        assert!(found.violation < 2e-4, "{seed}: {}", found.violation);
        let mut z = vec![0.0; system.rows()];
        spheres.evaluate(&mut system, &found.u, &mut z);
        for c in &system.contacts {
            assert!(z[c.row as usize] >= -0.9e-5 * c.length, "{seed}");
        }
    }
}

/// Drag on all nodes, `b = -c u`.
struct Drag(f64);

impl Subproblem for Drag {
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]) {
        system.linear_measures(u, z);
        system.open_load();
        for (dof, u) in (0..).zip(u) {
            system.load[dof as usize] = -self.0 * u;
            system.load_tangent.push((dof, dof, self.0));
        }
    }
}

/// Loads are those of the look before: weak ones settle, and strong ones, which would diverge, are left to Newton's method.
#[test]
fn only_loads_that_follow_the_motion_weakly_are_swept() {
    for (drag, rung) in [(0.005, "sweeps"), (50.0, "newton")] {
        let mut system = pushed(3, 80, 0);
        let found = solve(&mut system, &mut Drag(drag), &coarse());
        assert!(found.report.converged && !found.report.fallback);
        assert_eq!(found.report.rung, rung, "{}", system.load_feedback());
        let mut exact = pushed(3, 80, 0);
        let exact = solve(&mut exact, &mut Drag(drag), &sharp());
        let size = exact.u.iter().fold(0.0f64, |most, u| most.max(u.abs()));
        let off = found.u.iter().zip(&exact.u).map(|(u, v)| (u - v).abs());
        assert!(off.fold(0.0, f64::max) < 1e-3 * size);
    }
}

/// What starts at the solution keeps its multipliers in their cones and its corrections theirs.
#[test]
fn a_solution_stays() {
    let mut system = pushed(7, 80, 1);
    let found = swept(&mut system, &coarse());
    let mut newton = carom_solve::Newton::default();
    let (mut lambda, mut u) = (found.lambda.clone(), found.u.clone());
    // Off its cone by less than the tolerance.
    lambda[1] += 1e-8;
    let report = newton.solve(
        &mut system,
        &mut Measured(&[]),
        &coarse(),
        &mut lambda,
        &mut u,
    );
    assert_eq!((report.iterations, report.rung), (0, "sweeps"));
    let mut z = vec![0.0; system.rows()];
    system.linear_measures(&u, &mut z);
    let mut force = vec![0.0; u.len()];
    system.impulses(&lambda, &mut force);
    let mut by_impulses = vec![0.0; u.len()];
    system.apply_inverse_mass(&force, &mut by_impulses);
    assert!(u
        .iter()
        .zip(&by_impulses)
        .all(|(u, v)| (u - v).abs() <= 1e-12));
    assert!(violation(&system, &z, &lambda, &u) < 1e-3);
}
