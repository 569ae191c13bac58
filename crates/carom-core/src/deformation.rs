//! A periodic box that changes its size or shears, as prescribed (Lees-Edwards). `docs/theory/algorithm.md` section 16.
//!
//! Lengths `H(t) = F(t) H(0)` with the deformation gradient `F = diag(stretch) + shear e_flow (x) e_gradient`. The image `n` lengths
//! away is displaced by `H n` and faster by `dH/dt n`: it drives a contact as a moving wall does. Every body has the mean flow
//! `v = dF/dt F^-1 x` on top of the velocity that it is given, and gets its part where the rate changes; so nothing but the motion against
//! the flow depends on where the border is.

pub mod course;
pub mod law;

use self::course::BoxCourse;
use self::law::{Deformation, Strain};
use crate::contact::Contact;
use crate::model::Model;
use crate::state::State;
use crate::stepper::Prediction;
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
        let flow = law.flow_at(&model.periodic, state.position[i], 0.0);
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

/// Gives the smooth motion of the step what the change of the rate makes of it.
pub(crate) fn carry(
    model: &Model,
    course: &BoxCourse,
    state: &State,
    linear: &mut [Prediction],
    position: &mut [DVec3],
) {
    let Some((law, change)) = change(model, course, [0, 1]) else {
        return;
    };
    for i in movers(model) {
        let share = course.start.share(state.position[i]);
        let of = |rate| law.velocity(&model.periodic, rate, share);
        linear[i].velocity += of(&change);
        linear[i].displacement += of(&course.beyond);
        position[i] = state.position[i] + linear[i].displacement;
    }
}

/// The law, and the change of its rate, where it does change.
fn change<'m>(
    model: &'m Model,
    course: &BoxCourse,
    [from, to]: [usize; 2],
) -> Option<(&'m Deformation, Strain)> {
    let law = model.deformation.as_ref()?;
    let change = course.rates[to].minus(course.rates[from]);
    (change != Strain::default()).then_some((law, change))
}

/// Work of the box in a step from the state to `velocity` and `position`, J: by images on contacts, and by the change of its rate.
pub(crate) fn work(
    model: &Model,
    course: &BoxCourse,
    state: &State,
    velocity: &[[DVec3; 2]],
    contacts: &[Contact],
) -> f64 {
    let mut work = 0.0;
    if !course.deforms {
        return work;
    }
    for c in contacts.iter().filter(|c| c.image != IVec3::ZERO) {
        let count = c.image.as_dvec3();
        let [start, end] = [0, 1].map(|end| course.velocity(model, end, count));
        work += c.impulse().0.impulse.dot(0.5 * (start + end));
    }
    if let Some((law, change)) = change(model, course, [0, 1]) {
        for i in movers(model) {
            let share = course.start.share(state.position[i]);
            let dv = law.velocity(&model.periodic, &change, share);
            work += 0.5 * model.mass[i] * dv.dot(state.velocity[i] + velocity[i][0]);
        }
    }
    work
}

/// Gives the new state what a kink in the law makes of it; returns the work of that, J.
pub(crate) fn pass_kink(model: &Model, course: &BoxCourse, state: &mut State) -> f64 {
    let mut work = 0.0;
    if let Some((law, change)) = change(model, course, [1, 2]) {
        for i in movers(model) {
            let share = course.end.share(state.position[i]);
            let dv = law.velocity(&model.periodic, &change, share);
            work += model.mass[i] * dv.dot(state.velocity[i] + 0.5 * dv);
            add(model, state, i, dv);
        }
    }
    work
}
