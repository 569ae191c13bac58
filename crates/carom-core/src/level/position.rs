//! Position sub-problem (eqs. 1c-e, 14, 21): removes penetration, along normals alone or as printed.
//!
//! Along normals spheres are corrected from where their loads have brought them ([`super::loads`]), or Moreau-Jean's step. As printed
//! `M U = G^T lambda` has the normal row at the current iterate (its derivative, eq. 42, is in the Hessian) and all other rows in the frame
//! of t_n, acting on the increments over the whole step (eq. 37). Joints stand beside the contacts, and loads that depend on positions act
//! through their change, `(h^2/2) f_p` (eq. 3).

use super::{closed_form, loads, position_newton, single, Task};
use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::pile;
use crate::pile::limits::{fits, may_fall_back};
use crate::workspace::On;
use carom_solve::SolveReport;
use glam::DVec3;

/// Nothing overlaps and nothing is held: U = 0 satisfies every condition.
#[inline]
pub(crate) fn is_separated(model: &Model, contacts: &[Contact], island: Island) -> bool {
    if !model.options.is_printed() {
        return loads::are_enough(model, contacts, island);
    }
    let apart = |&m: &u32| contacts[m as usize].gap_check >= 0.0;
    island.joints.is_empty() && island.contacts.iter().all(apart)
}

/// Solves one island; writes the corrections U of its bodies and `nu` of its contacts. False: not converged.
pub fn solve_island(on: &mut On) -> bool {
    let (task, island) = (on.task, on.island);
    let printed = task.model.options.is_printed();
    if is_separated(task.model, on.scratch.contacts, island) {
        for &m in island.contacts.iter().filter(|_| !printed) {
            let c = &mut on.scratch.contacts[m as usize];
            c.nu[0] = c.of_load(task.span.h);
        }
        return true;
    }
    if let ([m], true) = (island.contacts, island.is_free()) {
        if closed_form(task.model, &on.scratch.contacts[*m as usize]) {
            if printed {
                solve_single(on, *m);
            } else {
                correct_single(on, *m);
            }
            return true;
        }
    }
    if fits(task.model, island) {
        let others = may_fall_back(island);
        let demand = if others {
            task.demand.unless_accepted()
        } else {
            task.demand
        };
        let solved = pile::solve_positions(on, demand);
        if solved || !others {
            return solved;
        }
        on.report.fallbacks += 1;
    }
    position_newton::solve(on)
}

/// A lone contact of a sphere with a plane along its normal, from where its load has brought it.
fn correct_single(on: &mut On, m: u32) {
    let Task { model, span, .. } = *on.task;
    let scratch = &mut *on.scratch;
    let c = &mut scratch.contacts[m as usize];
    let i = c.a as usize;
    let of_load = c.of_load(span.h);
    c.nu[0] = (of_load - model.mass[i] * c.gap).max(0.0);
    let way = model.inv_mass[i] * (c.nu[0] - of_load) * c.n1;
    let nu = c.nu;
    scratch.corrections.set(c.a, [way, DVec3::ZERO]);
    on.report.add_position(&SolveReport::CLOSED_FORM);
    if scratch.keeper.wants(1) {
        let z = single::ContactMeasures {
            normal: c.gap + model.inv_mass[i] * -of_load,
            ..single::ContactMeasures::default()
        };
        let per_load = model.inv_mass[i] * c.n1;
        let [way, turn] = scratch.moved(i);
        let motion = [way - of_load * per_load, turn];
        let shift = [nu[0] * per_load, DVec3::ZERO];
        single::keep(on, m, 0, &z, nu, motion, shift);
    }
}

/// A lone contact of a sphere with a plane, in closed form.
#[inline(always)]
fn solve_single(on: &mut On, m: u32) {
    let Task { model, state, .. } = *on.task;
    let scratch = &mut *on.scratch;
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
    on.report.add_position(&SolveReport::CLOSED_FORM);
    if scratch.keeper.wants(1) {
        single::keep(on, m, 0, &z, nu, [linear, angular], shift);
    }
}
