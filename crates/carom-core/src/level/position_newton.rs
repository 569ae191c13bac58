//! An island at the position level by Newton's method: its rows, and what becomes of its solution.

use super::position_measures::{CoupledPositions, Positions};
use super::{newton_options, position_floor, worst_group, Demand, Task};
use crate::clump::places::{ClumpPositions, Clumps};
use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::outcome::Level;
use crate::problem::{Keeper, Solve};
use crate::rows::{along, flat, halves, Rows};
use crate::stepper::Span;
use crate::workspace::{self, IslandScratch, On, SolveScratch};
use carom_solve::rows::{RowSystem, Subproblem, NODE_DOF};
use carom_solve::{Bounds, Newton, NewtonOptions, SolveReport, Status};
use glam::DVec3;

/// Solves one island; writes the corrections U of its bodies and `nu` of its contacts. False: not solved.
pub(super) fn solve(on: &mut On) -> bool {
    if on.task.model.options.is_printed() {
        push_contacts(on);
    } else {
        push_normals(on);
    }
    let found = find(on);
    if !found.converged {
        if on.task.demand != Demand::Accepted {
            return false;
        }
        on.report.unconverged += 1;
    }
    write(on);
    true
}

/// States the normals of an island as rows of the solver.
fn push_normals(on: &mut On) {
    let (model, island, scratch) = (on.task.model, on.island, &mut *on.scratch);
    let (contacts, solve) = (&*scratch.contacts, &mut *scratch.solve);
    solve.begin(model, contacts, island);
    let mut rows: Rows = Default::default();
    for &m in island.contacts {
        let c = Contact {
            bounds: Bounds::default(),
            ..contacts[m as usize]
        };
        scratch.clumps.rows(model, &c, c.n1, &mut rows);
        let (a, b) = (solve.node(model, c.a), solve.node(model, c.b));
        let normal = c.n1.to_array();
        let z = [c.gap];
        (solve.system).push_contact(a, b, c.bounds, c.length, normal, &rows[..1], &z);
    }
}

/// States the contacts of an island as rows of the solver.
fn push_contacts(on: &mut On) {
    let (scratch, Task { model, state, .. }) = (&mut *on.scratch, *on.task);
    let (contacts, solve) = (&*scratch.contacts, &mut *scratch.solve);
    let (linear, angular, walls) = (scratch.linear, scratch.angular, scratch.walls);
    solve.begin(model, contacts, on.island);
    let moved = |body: u32| {
        let i = body as usize;
        (linear[i].displacement, angular[i].displacement)
    };
    let mut rows: Rows = Default::default();
    for &m in on.island.contacts {
        let c = &contacts[m as usize];
        let dim = c.rows(model, c.n0, &mut rows);
        // A wall is a body B whose motion is known; an image has one on top of that of its body.
        let mut of_b = (!c.is_wall(model)).then(|| moved(c.b));
        if walls.any_moves() {
            let (from, to) = (state.position[c.a as usize], scratch.position[c.a as usize]);
            if let Some([way, turn]) = walls.displacement(model, c, from, to) {
                let of_body = of_b.unwrap_or_default();
                of_b = Some((of_body.0 + way, of_body.1 + turn));
            }
        }
        let (way, turn) = moved(c.a);
        let mut z0 = [0.0; 6];
        for (z, row) in z0.iter_mut().zip(&rows[..dim]).skip(1) {
            *z = along(&row[0], way, turn);
            if let Some((way, turn)) = of_b {
                *z += along(&row[1], way, turn);
            }
        }
        z0[0] = c.gap_check;
        let nodes = (solve.node(model, c.a), solve.node(model, c.b));
        let normal = c.n0.to_array();
        solve.system.push_contact(
            nodes.0,
            nodes.1,
            c.bounds,
            c.length,
            normal,
            &rows[..dim],
            &z0[..dim],
        );
    }
}

/// Solves the rows, and tells the step how.
fn find(on: &mut On) -> SolveReport {
    let Task {
        model, state, span, ..
    } = *on.task;
    let island = on.island;
    let IslandScratch {
        contacts,
        solve,
        linear,
        angular,
        position,
        history,
        keeper,
        trial,
        walls,
        shift,
        clumps,
        ..
    } = &mut *on.scratch;
    let SolveScratch {
        newton,
        system,
        bodies,
        node_of,
        lambda,
        u,
    } = &mut **solve;
    newton.attempts.clear();
    let coupled = (!island.is_free()).then(|| {
        CoupledPositions::open(
            (model, clumps),
            state,
            island,
            span,
            ((*linear, *angular), (*position, *shift)),
            system,
            (bodies, node_of, trial),
        )
    });
    lambda.clear();
    lambda.resize(system.rows(), 0.0);
    u.clear();
    u.resize(NODE_DOF * bodies.len(), 0.0);
    let centres: Vec<DVec3> = bodies.iter().map(|&b| position[b as usize]).collect();
    let of_loads = start_from_loads(model, contacts, island, span, (system, lambda));
    let groups = island.contacts.len() + island.joints.len();
    let options = options(model, bodies, &centres, groups);
    let mut measures = Positions {
        model,
        walls,
        contacts,
        members: island.contacts,
        centres: &centres,
        coupled,
        of_loads,
        clumps: (!model.clumps.is_empty()).then_some(ClumpPositions {
            model,
            state,
            clumps,
            angular,
            load_shift: shift,
        }),
    };
    let found = newton.solve(system, &mut measures, &options, lambda, u);
    on.report.add_position(&found);
    history[1].keep_longest(&newton.history, 0, island.contacts.len());
    if !found.converged || keeper.wants(found.iterations) {
        let moved = |i| workspace::moved(linear, angular, shift, i);
        let motion = bodies
            .iter()
            .flat_map(|&b| flat(clumps.to_node(model, b, moved(b as usize))));
        let motion: Vec<f64> = motion.collect();
        let solution = (&lambda[..], &u[..]);
        let solver = (&*newton, system, &mut measures);
        keep(keeper, solver, solution, (bodies, &motion), found);
    }
    found
}

/// Starts from what the loads have moved along normals, which the correction counts from: empty where that is nothing, and as printed.
fn start_from_loads(
    model: &Model,
    contacts: &[Contact],
    island: Island,
    span: Span,
    (system, lambda): (&mut RowSystem, &mut [f64]),
) -> Vec<f64> {
    if model.options.is_printed() {
        return Vec::new();
    }
    let of_load = |&m: &u32| contacts[m as usize].of_load(span.h);
    let of_loads: Vec<f64> = island.contacts.iter().map(of_load).collect();
    lambda[..of_loads.len()].copy_from_slice(&of_loads);
    if of_loads.iter().all(|&l| l == 0.0) {
        return Vec::new();
    }
    if !system.has_load() {
        system.open_load();
    }
    of_loads
}

/// Of Newton's method for so many contacts and joints.
fn options(model: &Model, bodies: &[u32], centres: &[DVec3], groups: usize) -> NewtonOptions {
    let nodes = bodies.len() as f64;
    let mean =
        |f: &dyn Fn(usize) -> f64| bodies.iter().map(|&b| f(b as usize)).sum::<f64>() / nodes;
    // Gaps are differences of coordinates: far from the origin rounding, not the radius, sets what can be asked.
    let largest = centres.iter().map(|x| x.abs().max_element());
    let rounding = f64::EPSILON * largest.fold(0.0, f64::max);
    let share = position_floor(&model.options, groups);
    let way = mean(&|i| (share * model.radius[i]).max(4.0 * rounding));
    let floor = way / mean(&|i| model.inv_mass[i]);
    NewtonOptions {
        rounding,
        ..newton_options(&model.options, groups, floor, true)
    }
}

/// Hands the problem, with what was found, to the keeper.
#[cold]
fn keep(
    keeper: &mut Keeper,
    (newton, system, measures): (&Newton, &mut RowSystem, &mut Positions),
    (lambda, u): (&[f64], &[f64]),
    (bodies, motion): (&[u32], &[f64]),
    report: SolveReport,
) {
    let worst = worst_group(system, newton.residual_rows());
    let none = Clumps::default();
    let clumps = measures.clumps.as_ref().map_or(&none, |c| c.clumps);
    let mut z = vec![0.0; system.rows()];
    let (mut multiplier, mut correction) = (lambda.to_vec(), u.to_vec());
    if !multiplier.iter().chain(&correction).all(|x| x.is_finite()) {
        // An iterate that ran away says nothing: the problem is stated at its start.
        multiplier.fill(0.0);
        correction.fill(0.0);
    }
    measures.evaluate(system, &correction, &mut z);
    keeper.keep(&Solve {
        model: measures.model,
        contacts: measures.contacts,
        clumps,
        members: measures.members,
        spheres: bodies,
        system,
        measures: &z,
        multiplier: &multiplier,
        correction: &correction,
        motion,
        level: Level::Position,
        index: 0,
        report,
        attempts: &newton.attempts,
        worst,
    });
}

/// Writes a solution into the step.
fn write(on: &mut On) {
    let (model, scratch) = (on.task.model, &mut *on.scratch);
    let solve = &*scratch.solve;
    for (node, &body) in solve.bodies.iter().enumerate() {
        let v = &solve.u[NODE_DOF * node..NODE_DOF * (node + 1)];
        let correction = scratch.clumps.from_node(model, body, halves(v));
        scratch.corrections.set(body, correction);
    }
    for (slot, &m) in on.island.contacts.iter().enumerate() {
        let rc = &solve.system.contacts[slot];
        let c = &mut scratch.contacts[m as usize];
        // The loads come first, and tell what rested.
        c.rested &= c.resting;
        c.nu = [0.0; 6];
        if solve.newton.statuses()[slot] != Status::Gap {
            c.nu[..rc.dim as usize].copy_from_slice(&solve.lambda[rc.rows()]);
        }
    }
}
