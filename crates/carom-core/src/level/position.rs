//! Position sub-problem (eqs. 1c-e, 14, 21): removes penetration and the slip that friction does not allow.
//!
//! `M U = G^T lambda` with the normal row at the current iterate (its derivative, eq. 42, is in the Hessian) and all
//! other rows in the frame of t_n, acting on the increments over the whole step (eq. 37). Joints stand beside the
//! contacts, and loads that depend on positions act through their change, `(h^2/2) f_p` (eq. 3).

use super::less_friction::with_less_friction;
use super::position_measures::{Coupled, Positions};
use super::rest::{self, Resting};
use super::{
    closed_form, newton_options, position_floor, single, wedge, worst_group, Demand, LESS_FRICTION,
};
use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::outcome::Level;
use crate::pile::limits::{fits, may_fall_back};
use crate::problem::Solve;
use crate::report::StepReport;
use crate::rows::{along, Rows};
use crate::state::State;
use crate::stepper::Span;
use crate::workspace::{IslandScratch, SolveScratch};
use crate::{pile, rotation};
use carom_solve::rows::{RowSystem, Subproblem, NODE_DOF, WORLD};
use carom_solve::{Newton, SolveReport, Status};
use glam::DVec3;

/// Gaps that what rests may keep where nothing closes them, over the length of the contact and the tolerance of the island.
const GAPS_AT_REST: f64 = 0.1;

/// Nothing overlaps and nothing is held: U = 0 satisfies every condition.
#[inline]
pub(crate) fn is_apart(contacts: &[Contact], island: Island) -> bool {
    let apart = |&m: &u32| contacts[m as usize].gap_check >= 0.0;
    island.joints.is_empty() && island.contacts.iter().all(apart)
}

/// Solves one island; writes the corrections U of its bodies and `nu` of its contacts. False: not converged.
pub fn solve_island(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    demand: Demand,
) -> bool {
    if is_apart(scratch.contacts, island) {
        return true;
    }
    if let ([m], true) = (island.contacts, island.is_free()) {
        let m = *m;
        // By reference: a contact is hundreds of bytes, and this is the whole of a rolling ball's step.
        let c = &scratch.contacts[m as usize];
        if closed_form(model, c) {
            let i = c.a as usize;
            let (linear, angular) = (
                scratch.linear[i].displacement,
                scratch.angular[i].displacement,
            );
            let mut z = single::motion(c, model.radius[i], linear, angular);
            if scratch.walls.any_moves() {
                let (from, to) = (state.position[i], scratch.position[i]);
                if let Some([way, turn]) = scratch.walls.displacement(model, c, from, to) {
                    z.subtract(&single::driven(c, way, way, turn));
                }
            }
            z.normal = c.gap_check;
            let s = single::problem(model, c, &z).solve();
            let nu = single::pack(c, &s);
            let shift = single::correction(model, c, &s);
            scratch.corrections.set(c.a, shift);
            scratch.contacts[m as usize].nu = nu;
            report.add_position(&SolveReport::CLOSED_FORM);
            if scratch.keeper.wants(1) {
                let at = (Level::Position, 0);
                single::keep(model, scratch, m, at, &z, nu, [linear, angular], shift);
            }
            return true;
        }
    }
    let resting = Resting::find(model, state, scratch, island, span.h);
    if fits(model, island) {
        let others = may_fall_back(island);
        if let Some(resting) = &resting {
            let (before, asked) = (*report, demand.unless_accepted());
            let failed = scratch.keeper.failed.take();
            let own = Some(resting);
            if pile::solve_positions(model, state, scratch, island, span, report, asked, own) {
                return true;
            }
            // What it moved by is no part of the step.
            *report = before;
            let way = Way::Hold(resting);
            let unsolved = scratch.keeper.failed.is_some();
            let held = solve_by_newton(model, state, scratch, island, span, report, way);
            if held || !unsolved {
                scratch.keeper.failed = failed;
            }
            if held {
                report.fallbacks += u32::from(unsolved);
                return true;
            }
        }
        let asked = if others {
            demand.unless_accepted()
        } else {
            demand
        };
        if pile::solve_positions(model, state, scratch, island, span, report, asked, None) {
            return true;
        }
        if !others {
            let asked = Demand::Converged;
            return span.smallest
                && demand != Demand::Accepted
                && with_less_friction(scratch, island, report, |scratch, report| {
                    pile::solve_positions(model, state, scratch, island, span, report, asked, None)
                });
        }
        report.fallbacks += 1;
    }
    let way = Way::Solve {
        resting: resting.as_ref(),
        accept: demand == Demand::Accepted,
    };
    solve_by_newton(model, state, scratch, island, span, report, way)
}

/// What is asked of [`solve_by_newton`].
#[derive(Clone, Copy)]
enum Way<'a> {
    /// The solution, at rest where that is looked for; one that does not converge where that is accepted.
    Solve {
        resting: Option<&'a Resting>,
        accept: bool,
    },
    /// The solution at rest or none.
    Hold(&'a Resting),
}

fn solve_by_newton(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    way: Way,
) -> bool {
    let IslandScratch {
        contacts,
        solve,
        linear,
        angular,
        position,
        corrections,
        history,
        keeper,
        trial,
        walls,
        ..
    } = scratch;
    let members = island.contacts;
    solve.begin(model, contacts, island);
    let mut rows: Rows = Default::default();
    let frames: Vec<_> = match way {
        Way::Hold(_) => members
            .iter()
            .map(|&m| &contacts[m as usize])
            .map(|c| (c.t1, c.t2, c.end_frame))
            .collect(),
        Way::Solve { .. } => Vec::new(),
    };
    for &m in members {
        // A pile may have had it before.
        contacts[m as usize].set_start_frame();
        let c = &contacts[m as usize];
        let dim = c.rows(model, c.n0, &mut rows);
        let (ja, jb) = (solve.node(model, c.a), solve.node(model, c.b));
        let mut z0 = [0.0; 6];
        // A wall is a body B whose motion is known.
        let mut driven = None;
        if walls.any_moves() {
            let (from, to) = (state.position[c.a as usize], position[c.a as usize]);
            driven = walls.displacement(model, c, from, to);
        }
        for (z, row) in z0.iter_mut().zip(&rows[..dim]).skip(1) {
            *z = along(
                &row[0],
                linear[c.a as usize].displacement,
                angular[c.a as usize].displacement,
            );
            if !c.is_wall(model) {
                *z += along(
                    &row[1],
                    linear[c.b as usize].displacement,
                    angular[c.b as usize].displacement,
                );
            } else if let Some([way, turn]) = driven {
                *z += along(&row[1], way, turn);
            }
        }
        z0[0] = c.gap_check;
        let bounds = c.bounds;
        solve.system.push_contact(
            ja,
            jb,
            bounds,
            c.length,
            c.n0.to_array(),
            &rows[..dim],
            &z0[..dim],
        );
    }
    let SolveScratch {
        newton,
        system,
        bodies,
        node_of,
        lambda,
        u,
    } = solve;
    let node = |body: u32| node_of.get(body as usize).copied().unwrap_or(WORLD);
    let mut coupled = None;
    if !island.is_free() {
        for &body in bodies.iter() {
            let i = body as usize;
            // Velocities stay those of the smooth step at this level (eq. 3).
            trial.velocity[i] = linear[i].velocity;
            trial.angular_velocity[i] = angular[i].velocity;
            trial.position[i] = position[i];
            trial.orientation[i] = rotation::advance(angular[i].displacement, state.orientation[i]);
        }
        for &index in island.joints {
            let joint = &model.joints[index as usize];
            // Nominal rows for D_cc; the measures come with the first evaluation.
            let dim = joint.gradient_at(&trial.poses(joint), &mut rows);
            let nodes = (node(joint.a), node(joint.b));
            let zeros = [0.0; 6];
            system.push_joint(
                nodes,
                joint.translational,
                joint.length,
                &rows[..dim],
                &zeros[..dim],
            );
        }
        let mut base = vec![0.0; NODE_DOF * bodies.len()];
        if !island.loads.is_empty() {
            system.open_load();
            trial.wrenches(model, island.loads, bodies, span.end, &mut base);
        }
        coupled = Some(Coupled {
            island,
            state,
            angular,
            bodies,
            node_of,
            trial,
            span,
            base,
        });
    }
    newton.attempts.clear();
    lambda.clear();
    lambda.resize(system.rows(), 0.0);
    u.clear();
    u.resize(NODE_DOF * bodies.len(), 0.0);
    let centres: Vec<DVec3> = bodies.iter().map(|&b| position[b as usize]).collect();
    let nodes = bodies.len() as f64;
    let mean =
        |f: &dyn Fn(usize) -> f64| bodies.iter().map(|&b| f(b as usize)).sum::<f64>() / nodes;
    // Gaps are differences of coordinates: far from the origin rounding, not the radius, sets what can be asked.
    let rounding = f64::EPSILON
        * centres
            .iter()
            .map(|x| x.abs().max_element())
            .fold(0.0, f64::max);
    let groups = members.len() + island.joints.len();
    let share = position_floor(&model.options, groups);
    let floor = mean(&|i| model.mass[i] * (share * model.radius[i]).max(4.0 * rounding));
    let mut options = newton_options(&model.options, groups, floor, true);
    options.rounding = rounding;
    let mut problem = Positions {
        model,
        walls,
        contacts,
        members,
        centres: &centres,
        coupled,
    };
    let (resting, accept_unconverged) = match way {
        Way::Solve { resting, accept } => (resting, accept),
        Way::Hold(resting) => (Some(resting), false),
    };
    let before = resting.map(|_| rest::as_before(state, contacts, members, system, span.h));
    let look = |newton: &mut Newton, system: &mut RowSystem, problem: &mut Positions, spare| {
        let nu = before.as_ref()?.0.clone();
        resting?.hold(newton, (system, problem, &options), nu, spare)
    };
    let first = matches!(way, Way::Hold(_)) || before.as_ref().is_some_and(|b| b.1);
    let mut held = if first {
        look(newton, system, &mut problem, None)
    } else {
        None
    };
    let (mut result, mut rests) = (SolveReport::default(), false);
    if held.is_none() {
        if matches!(way, Way::Hold(_)) {
            for (&m, frame) in members.iter().zip(frames) {
                let c = &mut contacts[m as usize];
                (c.t1, c.t2, c.end_frame) = frame;
            }
            return false;
        }
        result = newton.solve(system, &mut problem, &options, lambda, u);
        let moves = |r: &Resting| !result.converged || r.moves(system, newton.measures());
        rests = resting.is_some_and(|r| !moves(r));
        // Where nothing solves the smallest part of a step, what rests may keep what earlier steps left of its gaps.
        let o = &model.options;
        let share = o.touching_tolerance.max(GAPS_AT_REST * options.tolerance);
        let spare = (!result.converged && span.smallest).then_some(share);
        if (!first || spare.is_some()) && !rests && resting.is_some() {
            let history = std::mem::take(&mut newton.history);
            held = look(newton, system, &mut problem, spare);
            if held.is_none() {
                // What was tried is no part of the step: statuses and residuals are those of the solution again.
                newton.judge(system, &mut problem, &options, lambda, u);
                newton.history = history;
            } else {
                report.fallbacks += u32::from(!result.converged);
            }
        }
    }
    if !result.converged && held.is_none() && span.smallest && !accept_unconverged {
        let less = newton.solve_with_less_friction(
            system,
            &mut problem,
            &options,
            &LESS_FRICTION,
            |_| true,
            [&mut *lambda, &mut *u],
        );
        if let Some(less) = less {
            result = less;
            report.fallbacks += 1;
        }
    }
    // Joints, and loads that depend on the motion, stop slides by themselves.
    if result.converged && held.is_none() && !rests && island.is_free() {
        let ways = bodies.iter().map(|&b| {
            let i = b as usize;
            let way = linear[i].displacement - span.h * state.velocity[i];
            [way.length(), model.mass[i] * way.length()]
        });
        let [way, load] = ways.fold([0.0f64, 0.0], |[w, l], [way, load]| [w.max(way), l + load]);
        let solution = [newton.measures(), &lambda[..]];
        let stopped = wedge::stopped(contacts, members, system, [way, load], solution);
        if stopped.contains(&true) {
            let less = newton.solve_with_less_friction(
                system,
                &mut problem,
                &options,
                &[wedge::NEXT_TO_NONE],
                |slot| stopped.get(slot) == Some(&true),
                [&mut *lambda, &mut *u],
            );
            if let Some(less) = less {
                result = less;
                report.fallbacks += 1;
            }
        }
    }
    let is_held = held.is_some();
    if let Some(held) = held {
        (*lambda, *u, result) = (held.nu, held.correction, held.report);
    }
    report.add_position(&result);
    if newton.history.len() > history[1].values.len() {
        history[1].values.clone_from(&newton.history);
        history[1].contacts = members.len() as u32;
        history[1].problem = 0;
    }
    if !result.converged {
        report.unconverged += u32::from(accept_unconverged);
    }
    if !result.converged || keeper.wants(result.iterations) {
        let worst = worst_group(system, newton.residual_rows());
        let mut z = vec![0.0; system.rows()];
        let (mut multiplier, mut correction) = (lambda.clone(), u.clone());
        if !multiplier.iter().chain(&correction).all(|x| x.is_finite()) {
            // An iterate that ran away says nothing: the problem is stated at its start.
            multiplier.fill(0.0);
            correction.fill(0.0);
        }
        problem.evaluate(system, &correction, &mut z);
        let motion = bodies.iter().flat_map(|&b| {
            let (lin, ang) = (&linear[b as usize], &angular[b as usize]);
            let (d, psi) = (lin.displacement, ang.displacement);
            [d.x, d.y, d.z, psi.x, psi.y, psi.z]
        });
        keeper.keep(&Solve {
            model,
            contacts,
            members,
            spheres: bodies,
            system,
            measures: &z,
            multiplier: &multiplier,
            correction: &correction,
            motion: &motion.collect::<Vec<f64>>(),
            level: Level::Position,
            index: 0,
            report: result,
            attempts: &newton.attempts,
            worst,
        });
    }
    if !result.converged && !accept_unconverged {
        return false;
    }
    for (node, &body) in solve.bodies.iter().enumerate() {
        let v = &solve.u[NODE_DOF * node..NODE_DOF * (node + 1)];
        corrections.set(
            body,
            [DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])],
        );
    }
    for (slot, &m) in members.iter().enumerate() {
        let rc = &solve.system.contacts[slot];
        let c = &mut contacts[m as usize];
        (c.held, c.rested) = (is_held, is_held || rests);
        c.nu = [0.0; 6];
        c.nu[..rc.dim as usize]
            .copy_from_slice(&solve.lambda[rc.row as usize..(rc.row + rc.dim) as usize]);
        if solve.newton.statuses()[slot] == Status::Gap {
            c.nu = [0.0; 6];
        }
    }
    true
}
