//! A periodic box that changes its size or shears, as prescribed (Lees-Edwards). `docs/theory/algorithm.md` section 16.
//!
//! Lengths `H(t) = F(t) H(0)` with the deformation gradient `F = diag(stretch) + shear e_flow (x) e_gradient`. The image `n` lengths
//! away is displaced by `H n` and faster by `dH/dt n`: it drives a contact as a moving wall does. Every body has the mean flow
//! `v = dF/dt F^-1 x` on top of the velocity that it is given. The rate is constant in a step, and bodies get their part of its change
//! between two steps; so nothing but the motion against the flow depends on where the border is.

pub mod course;
pub mod law;

use self::course::BoxCourse;
use self::law::Strain;
use crate::contact::Contact;
use crate::model::Model;
use crate::state::State;
use glam::{DVec3, IVec3};

/// Bodies that move by themselves: balls and clumps, not the balls of these. Free walls move across what deforms.
fn movers(model: &Model) -> impl Iterator<Item = usize> + '_ {
    (0..model.first_wall()).filter(|&i| model.mass[i] > 0.0)
}

/// Adds the mean flow to the velocities at the start of a run.
pub(crate) fn join_flow(model: &Model, state: &mut State) {
    let Some(law) = &model.deformation else {
        return;
    };
    for i in movers(model) {
        let flow = law.flow_at(&model.periodic, state.position[i], 0.0, model.options.step);
        add(model, state, i, flow);
    }
}

/// Adds to the velocity of a body, and of the balls that follow it.
fn add(model: &Model, state: &mut State, i: usize, dv: DVec3) {
    state.velocity[i] += dv;
    let clump = model.as_clump(i as u32).map(|k| &model.clumps[k]);
    for ball in clump.map_or(0..0, |clump| clump.balls.clone()) {
        state.velocity[ball] += dv;
    }
}

/// Work of the box in a step, J: what images do to contacts.
pub(crate) fn work(model: &Model, course: &BoxCourse, contacts: &[Contact]) -> f64 {
    let images = contacts.iter().filter(|c| c.image != IVec3::ZERO);
    let of = |c: &Contact| {
        let velocity = course.velocity(model, c.image.as_dvec3());
        c.impulse().0.impulse.dot(velocity)
    };
    images.map(of).sum()
}

/// Gives all bodies the change of the mean flow from step `number` to the next one, at the end of that; returns the work of it, J.
pub(crate) fn turn_flow(model: &Model, state: &mut State, number: u64) -> f64 {
    let mut work = 0.0;
    let Some(law) = &model.deformation else {
        return work;
    };
    let h = model.options.step;
    let change = law.rate(number, h).minus(law.rate(number - 1, h));
    if change == Strain::default() {
        return work;
    }
    let now = law.periodic(&model.periodic, number as f64 * h, h);
    for i in movers(model) {
        let share = now.share(state.position[i]);
        let dv = law.velocity(&model.periodic, &change, share);
        work += model.mass[i] * dv.dot(state.velocity[i] + 0.5 * dv);
        add(model, state, i, dv);
    }
    work
}
