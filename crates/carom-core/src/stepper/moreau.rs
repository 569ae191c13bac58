//! Moreau-Jean time stepping: contacts at velocity level only. `docs/theory/algorithm.md` section 9.
//!
//! predict -> broad -> meet -> velocity -> advance (-> position, if `position_projection`) -> finish. Contacts are the
//! pairs whose gap at the predicted midpoint `x_n + (h/2) v_n` is closed; `v_{n+1}` follows from the impact law of the
//! run, and `x_{n+1} = x_n + h (theta v_{n+1} + (1 - theta) v_n)`. Nothing makes the gap itself vanish: what overlaps
//! stays so unless the projection removes it. Joints are held at velocity level in the same way.

use super::method::Step;
use super::{Coefficients, Span};
use crate::cohesion;
use crate::contact::{Contact, CANDIDATE_MARGIN};
use crate::force::evaluated;
use crate::force::total::{add_loads, motion_of, own_acceleration};
use crate::level::Demand;
use crate::model::Model;
use crate::outcome::{BlowUp, Failure, Level};
use crate::scratch::Scratch;
use crate::state::State;
use crate::step;
use crate::timers::Phase;
use crate::wall::places::proximity_at;
use crate::{candidates, finish, loads_once, travel};
use carom_solve::Bounds;
use glam::DVec3;

impl Coefficients {
    /// The theta rule, as an update in the form of lines 5-9 and 16-18: with the acceleration `f/m`,
    /// `v-check = v_n + h ((1 - theta) a_n + theta a_{n+1})`, `q-check = q_n + h (theta v-check + (1 - theta) v_n)`.
    pub fn theta_rule(theta: f64, h: f64) -> Self {
        Coefficients {
            h,
            from_acceleration: 0.0,
            from_pseudo: 0.0,
            velocity_old: h * (1.0 - theta),
            velocity_new: h * theta,
            displacement_old: h * h * theta * (1.0 - theta),
            displacement_new: h * h * theta * theta,
            acceleration_per_velocity: 1.0 / (theta * h),
            displacement_per_velocity: theta * h,
            finish: 1.0,
        }
    }
}

/// Makes one step.
pub fn step(on: &mut Step) -> Result<(), Failure> {
    let (model, whole, coefficients) = (on.model, on.span, on.coefficients);
    if !model.is_free() {
        weigh_loads(model, on.state, on.scratch, whole.start)?;
    }
    step::predict_and_smooth(on)?;
    move_to_middle(model, on.state, on.scratch, whole);
    if model.cohesive_reach() > 0.0 {
        list_pairs(model, on.state, on.scratch)?;
        cohesion::pull(on, whole)?;
        move_to_middle(model, on.state, on.scratch, whole);
    }
    on.timers.mark(Phase::Predict);
    let fastest = list_pairs(model, on.state, on.scratch)?;
    travel::check(model, on.state, on.scratch, fastest)?;
    on.timers.mark(Phase::Broad);
    meet(model, on.state, on.scratch, whole.h)?;
    on.report.candidates = on.scratch.contacts.len() as u32;
    on.timers.mark(Phase::Meet);
    // Joints and loads are taken at q-check, where the smooth motion has them already.
    move_by_predictions(on.state, on.scratch);
    let weight = coefficients.displacement_per_velocity();
    let weighted = if model.is_free() { whole.h } else { weight };
    let span = Span {
        start: whole.end - weighted,
        h: weighted,
        ..whole
    };
    let demand = Demand::or_accepted(on.accept_unconverged);
    let corrected = step::correct_velocities(model, on.state, on.scratch, span, demand, on.report);
    // Before an error is passed on: its time is that of its own phase.
    on.timers.mark(Phase::Velocity);
    corrected?;
    advance(model, on.state, on.scratch, weight);
    on.scratch.walls.place(model, whole.end);
    on.span.smallest = false;
    let closed = close(on, demand);
    on.timers.mark(Phase::Position);
    closed?;
    // The smooth reactions of joints act with the weight of the new values.
    for lambda in &mut on.scratch.smooth.lambda {
        *lambda *= weight / whole.h;
    }
    finish::finish(on)?;
    on.timers.mark(Phase::Finish);
    Ok(())
}

/// `a_n = M^-1 f(q_n, v_n, t_n)` of the theta rule: loads alone, at the state itself. Reactions of joints are wholly
/// implicit, for the mean of old and new ones would keep any error in them for ever.
fn weigh_loads(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    time: f64,
) -> Result<(), Failure> {
    let mut wrench = vec![[DVec3::ZERO; 2]; model.bodies()];
    let added = add_loads(model, &motion_of(state, time), &mut wrench);
    evaluated(added, &mut scratch.load_error)?;
    let displaced = state.position[model.first_wall()..].to_vec();
    for (i, [force, moment]) in wrench.into_iter().enumerate() {
        let pair = [
            own_acceleration(model, &displaced, i, time) + model.inv_mass[i] * force,
            model.inv_inertia[i] * moment,
        ];
        // The state is saved where a run stops, and read again only if it holds nothing but numbers.
        if !pair.iter().all(|x| x.is_finite()) {
            return Err(Failure::BlowUp(BlowUp::alone(Level::Smooth, i as u32)));
        }
        state.pseudo[i] = pair;
    }
    Ok(())
}

/// Spheres and walls at the predicted midpoint.
fn move_to_middle(model: &Model, state: &State, scratch: &mut Scratch, whole: Span) {
    for i in 0..model.bodies() {
        scratch.position[i] = state.position[i] + 0.5 * whole.h * state.velocity[i];
    }
    scratch.walls.place(model, whole.start + 0.5 * whole.h);
}

/// Spheres where their predictions lead.
fn move_by_predictions(state: &State, scratch: &mut Scratch) {
    for (i, p) in scratch.linear.iter().enumerate() {
        scratch.position[i] = state.position[i] + p.displacement;
    }
}

/// Lists every pair that may overlap at `scratch.position`. The largest way of a sphere in its smooth motion, m.
fn list_pairs(model: &Model, state: &State, scratch: &mut Scratch) -> Result<f64, Failure> {
    let way_of_walls = |i: usize| {
        let way = (scratch.position[i] - state.position[i]).length();
        way.max(scratch.linear[i].displacement.length())
    };
    let of_walls = (model.first_wall()..model.bodies()).map(way_of_walls);
    let reach = model.cohesive_reach() + of_walls.fold(0.0, f64::max);
    let mut fastest = 0.0f64;
    for i in 0..model.bodies() {
        // The whole way of the smooth step too: what lies on it must be known.
        let (course, x) = (&scratch.walls.periodic, state.position[i]);
        let smooth = course.own_way(x, scratch.linear[i].displacement).length();
        let way = course.own_way_now(x, scratch.position[i] - x).length();
        let need = way.max(smooth) + CANDIDATE_MARGIN * model.radius[i] + reach;
        let need = need + scratch.walls.swept(x, model.radius[i]);
        let of_box = course.change(model.radius[i] + need);
        fastest = fastest.max(smooth + of_box);
        scratch.need[i] = state.need(model, i, need + of_box);
    }
    candidates::list(model, state, scratch)?;
    Ok(fastest)
}

/// The closed contacts: gap at the midpoint within the touching tolerance, or what loads may close in the step, with the frame of the midpoint.
fn meet(model: &Model, state: &State, scratch: &mut Scratch, h: f64) -> Result<(), Failure> {
    let (contacts, walls, position) = (&mut scratch.contacts, &scratch.walls, &scratch.position);
    contacts.clear();
    let (pairs, margin) = (scratch.neighbours.pairs(), CANDIDATE_MARGIN);
    let mut found = Vec::new();
    candidates::near_pairs(model, state, walls, position, pairs, margin, &mut found)?;
    for near in &found {
        let mut c = candidates::contact(model, state, walls, near)?;
        let touching = model.options.touching_tolerance * c.length;
        let linear = &scratch.linear;
        // Nothing closes later what they bring near: no further than what presses one body to the other.
        let pressed = [(c.a as usize, -1.0), (c.b as usize, 1.0)].map(|(i, sign)| match i {
            i if i < model.bodies() => sign * c.n0.dot(linear[i].velocity - state.velocity[i]),
            _ => 0.0,
        });
        let reach = touching + 0.5 * h * pressed[0].max(pressed[1]);
        let is_brought = || {
            loads_once::brought(model, state, walls, linear, &c, h)
                && (model.options.position_projection || near.gap <= reach)
        };
        if near.gap > touching && !is_brought() {
            continue;
        }
        c.closed = true;
        if !(c.is_wall(model) && model.wall(c.b).is_fixed_plane()) {
            let n = proximity_at(model, walls, &c, position).normal;
            let (t1, t2) = carom_geom::tangent_frame(n);
            (c.n0, c.n1, c.t1, c.t2) = (n, n, t1, t2);
        }
        contacts.push(c);
    }
    Ok(())
}

/// `x_{n+1}` and the increment of rotation from `v_{n+1} = v-check + W`.
fn advance(model: &Model, state: &State, scratch: &mut Scratch, theta_h: f64) {
    for i in 0..model.bodies() {
        let [linear, angular] = scratch.jump[i];
        scratch.linear[i].displacement += theta_h * linear;
        scratch.angular[i].displacement += theta_h * angular;
    }
    move_by_predictions(state, scratch);
}

/// Gaps at `x_{n+1}`: of the step's contacts and of all pairs that overlap, so that penetration is reported; with
/// `position_projection` it is removed.
fn close(on: &mut Step, demand: Demand) -> Result<(), Failure> {
    std::mem::swap(&mut on.scratch.contacts, &mut on.scratch.overlaps);
    on.scratch.contacts.clear();
    let closed = if on.model.options.position_projection {
        project(on, demand)
    } else {
        overlapping(on, 0.0).map(|_| ())
    };
    std::mem::swap(&mut on.scratch.contacts, &mut on.scratch.overlaps);
    closed?;
    merge(on.model, on.scratch);
    Ok(())
}

/// Makes `scratch.contacts` the pairs whose gap at `scratch.position` is below `margin r_c`, kept to gaps alone;
/// returns whether there are pairs that it had not.
fn overlapping(on: &mut Step, margin: f64) -> Result<bool, Failure> {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    list_pairs(model, state, scratch)?;
    let (contacts, walls, position) = (&mut scratch.contacts, &scratch.walls, &scratch.position);
    let known = contacts.len();
    let (pairs, mut found) = (scratch.neighbours.pairs(), Vec::new());
    candidates::near_pairs(model, state, walls, position, pairs, margin, &mut found)?;
    for near in &found {
        let listed = contacts[..known].binary_search_by_key(&near.pair, |c| (c.a, c.b));
        if listed.is_err() {
            contacts.push(Contact {
                bounds: Bounds::default(),
                ..candidates::contact(model, state, walls, near)?
            });
        }
    }
    contacts.sort_unstable_by_key(|c| (c.a, c.b));
    Ok(contacts.len() > known)
}

/// The position sub-problem (eqs. 1c-e) at `x_{n+1}`, without friction: the nearest positions, measured by mass, at
/// which nothing overlaps and joints hold. Velocities stay as they are.
fn project(on: &mut Step, demand: Demand) -> Result<(), Failure> {
    let model = on.model;
    overlapping(on, CANDIDATE_MARGIN)?;
    for round in 0..=step::MAX_RELIST {
        move_by_predictions(on.state, on.scratch);
        on.scratch.shift.fill([DVec3::ZERO; 2]);
        on.scratch.contacts.iter_mut().for_each(|c| c.nu = [0.0; 6]);
        loads_once::meet(model, on.scratch);
        step::solve_positions(on, demand)?;
        for (x, shift) in on.scratch.position.iter_mut().zip(&on.scratch.shift) {
            *x += shift[0];
        }
        take_gaps(model, on.scratch);
        let margin = -model.options.gap_tolerance;
        if !overlapping(on, margin)? {
            return Ok(());
        }
        on.report.relisted += u32::from(round < step::MAX_RELIST);
    }
    Err(Failure::NotConverged(Level::Position))
}

/// Hands every contact its gap at `scratch.position`.
fn take_gaps(model: &Model, scratch: &mut Scratch) {
    for c in &mut scratch.contacts {
        c.gap = proximity_at(model, &scratch.walls, c, &scratch.position).gap;
    }
}

/// Final gaps and position multipliers of the step's contacts; pairs that are none and overlap, or were pushed, join.
fn merge(model: &Model, scratch: &mut Scratch) {
    take_gaps(model, scratch);
    let contacts = &mut scratch.contacts;
    let settled = contacts.len();
    for o in &scratch.overlaps {
        match contacts[..settled].binary_search_by_key(&(o.a, o.b), |c| (c.a, c.b)) {
            Ok(at) => contacts[at].nu = o.nu,
            Err(_) if o.nu[0] > 0.0 || o.gap < 0.0 => contacts.push(*o),
            Err(_) => {}
        }
    }
    if contacts.len() > settled {
        contacts.sort_unstable_by_key(|c| (c.a, c.b));
    }
}
