//! Position sub-problem (eqs. 1c-e, 14, 21): removes penetration and the slip that friction does not allow.
//!
//! `M U = G^T lambda` with the normal row at the current iterate (its derivative, eq. 42, is in the Hessian) and all
//! other rows in the frame of t_n, acting on the increments over the whole step (eq. 37). Joints stand beside the
//! contacts, and loads that depend on positions act through their change, `(h^2/2) f_p` (eq. 3).

use super::less_friction::with_less_friction;
use super::position_newton::{self, Way};
use super::rest::Resting;
use super::{closed_form, loads, single, Demand, Task};
use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::outcome::Level;
use crate::pile;
use crate::pile::limits::{fits, may_fall_back};
use crate::report::StepReport;
use crate::workspace::IslandScratch;
use carom_solve::SolveReport;
use glam::DVec3;

/// Nothing overlaps and nothing is held: U = 0 satisfies every condition.
#[inline]
pub(crate) fn is_separated(model: &Model, contacts: &[Contact], island: Island) -> bool {
    if model.options.loads_once() {
        return loads::are_enough(model, contacts, island);
    }
    let apart = |&m: &u32| contacts[m as usize].gap_check >= 0.0;
    island.joints.is_empty() && island.contacts.iter().all(apart)
}

/// Solves one island; writes the corrections U of its bodies and `nu` of its contacts. False: not converged.
pub fn solve_island(
    task: &Task,
    scratch: &mut IslandScratch,
    island: Island,
    report: &mut StepReport,
) -> bool {
    let once = task.model.options.loads_once();
    if is_separated(task.model, scratch.contacts, island) {
        for &m in island.contacts.iter().filter(|_| once) {
            let c = &mut scratch.contacts[m as usize];
            c.nu[0] = c.of_load(task.span.h);
        }
        return true;
    }
    if let ([m], true) = (island.contacts, island.is_free()) {
        if closed_form(task.model, &scratch.contacts[*m as usize]) {
            if once {
                correct_single(task, scratch, *m, report);
            } else {
                solve_single(task, scratch, *m, report);
            }
            return true;
        }
    }
    let Task {
        model,
        state,
        span,
        demand,
        ..
    } = *task;
    let accept = task.demand == Demand::Accepted;
    if once {
        if fits(model, island) {
            let others = may_fall_back(island);
            let asked = if others {
                demand.unless_accepted()
            } else {
                demand
            };
            let solved =
                pile::solve_positions(model, state, scratch, island, span, report, asked, None);
            if solved || !others {
                return solved;
            }
            report.fallbacks += 1;
        }
        let way = Way::Normals { accept };
        return position_newton::solve(model, state, scratch, island, span, report, way);
    }
    let resting = Resting::find(model, state, scratch, island, span.h);
    let resting = resting.as_ref();
    if fits(model, island) {
        if let Some(solved) = solve_pile(task, scratch, island, resting, report) {
            return solved;
        }
        report.fallbacks += 1;
    }
    let way = Way::Solve { resting, accept };
    position_newton::solve(model, state, scratch, island, span, report, way)
}

/// Sweeps; nothing where Newton's method takes over. What was at rest is held first, by sweeps or by Newton's method.
fn solve_pile(
    task: &Task,
    scratch: &mut IslandScratch,
    island: Island,
    resting: Option<&Resting>,
    report: &mut StepReport,
) -> Option<bool> {
    let Task {
        model,
        state,
        span,
        demand,
        ..
    } = *task;
    let sweep = |scratch: &mut IslandScratch, report: &mut StepReport, asked, resting| {
        pile::solve_positions(model, state, scratch, island, span, report, asked, resting)
    };
    if let Some(rests) = resting {
        let before = *report;
        let failed = scratch.keeper.failed.take();
        if sweep(scratch, report, demand.unless_accepted(), resting) {
            return Some(true);
        }
        // What it moved by is no part of the step.
        *report = before;
        let way = Way::Hold(rests);
        let unsolved = scratch.keeper.failed.is_some();
        let held = position_newton::solve(model, state, scratch, island, span, report, way);
        if held || !unsolved {
            scratch.keeper.failed = failed;
        }
        if held {
            report.fallbacks += u32::from(unsolved);
            return Some(true);
        }
    }
    if may_fall_back(island) {
        return sweep(scratch, report, demand.unless_accepted(), None).then_some(true);
    }
    let less = |scratch: &mut IslandScratch, report: &mut StepReport| {
        sweep(scratch, report, Demand::Converged, None)
    };
    let last = span.smallest && demand != Demand::Accepted;
    let solved = sweep(scratch, report, demand, None)
        || (last && with_less_friction(scratch, island, report, less));
    Some(solved)
}

/// A lone contact of a sphere with a plane along its normal, from where its load has brought it.
fn correct_single(task: &Task, scratch: &mut IslandScratch, m: u32, report: &mut StepReport) {
    let Task { model, span, .. } = *task;
    let c = &mut scratch.contacts[m as usize];
    let i = c.a as usize;
    let of_load = c.of_load(span.h);
    c.nu[0] = (of_load - model.mass[i] * c.gap).max(0.0);
    let way = model.inv_mass[i] * (c.nu[0] - of_load) * c.n1;
    let nu = c.nu;
    scratch.corrections.set(c.a, [way, DVec3::ZERO]);
    report.add_position(&SolveReport::CLOSED_FORM);
    if scratch.keeper.wants(1) {
        let z = single::ContactMeasures {
            normal: c.gap + model.inv_mass[i] * -of_load,
            ..single::ContactMeasures::default()
        };
        let motion = [
            scratch.linear[i].displacement,
            scratch.angular[i].displacement,
        ];
        let at = (Level::Position, 0);
        let shift = [model.inv_mass[i] * nu[0] * c.n1, DVec3::ZERO];
        single::keep(model, scratch, m, at, &z, nu, motion, shift);
    }
}

/// A lone contact of a sphere with a plane, in closed form.
#[inline(always)]
fn solve_single(task: &Task, scratch: &mut IslandScratch, m: u32, report: &mut StepReport) {
    let Task { model, state, .. } = *task;
    // By reference: a contact is hundreds of bytes, and this is the whole of a rolling ball's step.
    let c = &scratch.contacts[m as usize];
    let i = c.a as usize;
    let linear = scratch.linear[i].displacement;
    let angular = scratch.angular[i].displacement;
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
}
