//! The impact law of the run at one moment: what the velocity level makes of bodies that touch, in a step without a length.
//!
//! Methods that know the time of an impact have no step in which it lies. The same code as in the step decides it here, with the weight as a load
//! that is too small to move anything: it says which contacts are loaded, and so are solved together with those that close (rule R2).

use crate::candidates::push_candidate;
use crate::contact::ContactKey;
use crate::level::Demand;
use crate::model::Model;
use crate::outcome::{Failure, ImpactRecord};
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::step::correct_velocities;
use crate::stepper::{Prediction, Span};
use glam::DVec3;

/// Change of velocity that the weight makes at such a moment, over the speed of the group (1). Smaller: it drowns in rounding, and balls on a table
/// are not loaded. Larger: impacts are not exact.
const LOAD: f64 = 1e-12;

/// Impulse over that of the loads (1) up to which a row of the table of impacts is no impact.
const NO_IMPACT: f64 = 1e3;

/// Gives the spheres of `pairs`, which touch, the velocities after their impact: `state` has places and velocities of before. The contacts with
/// their impulses are in `scratch.contacts`, in the order of their keys, and the table of impacts grows. `carrier`: the wall (body index) whose level surface
/// carries a sphere.
///
/// # Errors
/// Those of the velocity level; and [`Failure::MissingLaw`].
pub fn impact(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    pairs: &[ContactKey],
    time: f64,
    carrier: impl Fn(usize) -> Option<u32>,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let both = pairs.iter().flat_map(|&(a, b)| [a as usize, b as usize]);
    let mut spheres: Vec<usize> = both.filter(|&i| i < model.bodies()).collect();
    spheres.sort_unstable();
    spheres.dedup();
    let fastest = spheres.iter().fold(0.0f64, |most, &i| {
        let turning = model.radius[i] * state.angular_velocity[i].length();
        most.max(state.velocity[i].length() + turning)
    });
    let g = model.gravity.length();
    let h = if g > 0.0 { LOAD * fastest / g } else { 0.0 };
    close(model, state, scratch, pairs)?;
    let loads: Vec<DVec3> = (spheres.iter())
        .map(|&i| match carrier(i) {
            Some(_) => h * model.gravity,
            None => DVec3::ZERO,
        })
        .collect();
    for (&i, load) in spheres.iter().zip(&loads) {
        scratch.position[i] = state.position[i];
        scratch.shift[i] = [DVec3::ZERO; 2];
        scratch.jump[i] = [DVec3::ZERO; 2];
        scratch.linear[i] = Prediction {
            velocity: state.velocity[i] + *load,
            ..Prediction::default()
        };
        scratch.angular[i] = Prediction {
            velocity: state.angular_velocity[i],
            ..Prediction::default()
        };
    }
    let span = Span::moment(time, h);
    let before = scratch.impacts.len();
    correct_velocities(model, state, scratch, span, Demand::Converged, report)?;
    // What the loads alone gave has no size: it is no impact. Rows of impacts before are none of this one's business.
    let least = |body: u32| NO_IMPACT * LOAD * fastest * model.mass[body as usize];
    let rows = scratch.impacts.split_off(before).into_iter();
    let acts = |row: &ImpactRecord| row.impulse.length() > least(row.a);
    scratch.impacts.extend(rows.filter(acts));
    for (&i, load) in spheres.iter().zip(&loads) {
        let [v, w] = scratch.jump[i];
        state.velocity[i] += v;
        state.angular_velocity[i] += w;
        // The load goes, with what held it.
        let weight = model.mass[i] * load.length();
        let key = carrier(i).map(|wall| (i as u32, wall));
        let held = scratch
            .contacts
            .iter_mut()
            .find(|c| Some((c.a, c.b)) == key);
        if let Some(held) = held.filter(|c| weight > 0.0 && c.lambda[0] >= weight) {
            held.lambda[0] -= weight;
            state.velocity[i] += *load;
            if held.n1.dot(state.velocity[i]) > NO_IMPACT * load.length() {
                // It leaves its surface: friction goes with the load. What stays rolls on by what friction gave.
                let share = weight / (held.lambda[0] + weight);
                let mut gone = held.lambda.map(|of| share * of);
                gone[0] = 0.0;
                for (kept, gone) in held.lambda.iter_mut().zip(gone) {
                    *kept -= gone;
                }
                let (gone, arm) = (held.to_world(held.n1, &gone), -model.radius[i] * held.n1);
                state.velocity[i] -= model.inv_mass[i] * gone.impulse;
                let moment = gone.moment + arm.cross(gone.impulse);
                state.angular_velocity[i] -= model.inv_inertia[i] * moment;
            }
        }
    }
    Ok(())
}

/// The contacts of an impact, all closed.
fn close(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    pairs: &[ContactKey],
) -> Result<(), Failure> {
    let (walls, contacts) = (&scratch.walls, &mut scratch.contacts);
    let (position, anywhere) = (&state.position, f64::INFINITY);
    contacts.clear();
    for &(a, b) in pairs {
        if model.law_of(a as usize, b as usize).is_none() {
            return Err(Failure::MissingLaw(a, b));
        }
        push_candidate(model, state, walls, position, (a, b), anywhere, contacts)?;
    }
    contacts.iter_mut().for_each(|c| c.closed = true);
    Ok(())
}
