//! Moreau-Jean time stepping: contacts at velocity level only. `docs/theory/algorithm.md` section 9.
//!
//! predict -> broad -> meet -> velocity -> advance (-> position, if `position_projection`) -> finish. Contacts are the
//! pairs whose gap at the predicted midpoint `x_n + (h/2) v_n` is closed; `v_{n+1}` follows from the impact law of the
//! run, and `x_{n+1} = x_n + h (theta v_{n+1} + (1 - theta) v_n)`. Nothing makes the gap itself vanish: what overlaps
//! stays so unless the projection removes it. Joints are held at velocity level in the same way.

use super::{Coefficients, Span};
use crate::contact::{Contact, CANDIDATE_MARGIN};
use crate::force::total::{add_loads, motion_of};
use crate::level::Demand;
use crate::model::Model;
use crate::outcome::{BlowUp, Failure, Level};
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::step::{self, Attempt};
use crate::timers::{Phase, Timers};
use crate::wall::places::proximity;
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
pub fn step(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    timers: &mut Timers,
    attempt: &Attempt,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let Attempt {
        coefficients,
        time,
        smallest,
        accept_unconverged,
    } = attempt;
    let (h, end) = (coefficients.h, *time + coefficients.h);
    if !model.is_free() {
        weigh_loads(model, state, scratch, *time)?;
    }
    let whole = Span::new(*time, h);
    step::predict_and_smooth(model, state, scratch, coefficients, whole, report)?;
    for i in 0..model.spheres() {
        scratch.position[i] = state.position[i] + 0.5 * h * state.velocity[i];
    }
    timers.mark(Phase::Predict);
    scratch.walls.place(model, *time + 0.5 * h);
    let fastest = list_pairs(model, state, scratch)?;
    travel::check(model, state, scratch, fastest)?;
    timers.mark(Phase::Broad);
    meet(model, state, scratch)?;
    report.candidates = scratch.contacts.len() as u32;
    timers.mark(Phase::Meet);
    // Joints and loads are taken at q-check, where the smooth motion has them already.
    for i in 0..model.spheres() {
        scratch.position[i] = state.position[i] + scratch.linear[i].displacement;
    }
    let weight = coefficients.displacement_per_velocity;
    let weighted = if model.is_free() { h } else { weight };
    let span = Span {
        smallest: *smallest,
        start: end - weighted,
        end,
        h: weighted,
    };
    let corrected =
        step::correct_velocities(model, state, scratch, span, report, *accept_unconverged);
    // Before an error is passed on: its time is that of its own phase.
    timers.mark(Phase::Velocity);
    corrected?;
    advance(model, state, scratch, weight);
    scratch.walls.place(model, end);
    let span = whole;
    let closed = close(model, state, scratch, span, report, *accept_unconverged);
    timers.mark(Phase::Position);
    closed?;
    // The smooth reactions of joints act with the weight of the new values.
    for lambda in &mut scratch.smooth.lambda {
        *lambda *= weight / h;
    }
    finish::finish(model, state, scratch, coefficients, span, report)?;
    timers.mark(Phase::Finish);
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
    let mut wrench = vec![[DVec3::ZERO; 2]; model.spheres()];
    let at = motion_of(state, time);
    if let Err(error) = add_loads(model, &at, &mut wrench) {
        scratch.load_error = Some(error);
        return Err(Failure::Load);
    }
    for (i, [force, moment]) in wrench.into_iter().enumerate() {
        let pair = [
            model.gravity + model.inv_mass[i] * force,
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

/// Lists every pair that may overlap at `scratch.position`. The largest way of a sphere in its smooth motion, m.
fn list_pairs(model: &Model, state: &State, scratch: &mut Scratch) -> Result<f64, Failure> {
    let mut fastest = 0.0f64;
    for i in 0..model.spheres() {
        // The whole way of the smooth step too: what lies on it must be known.
        let smooth = scratch.linear[i].displacement.length();
        fastest = fastest.max(smooth);
        let way = (scratch.position[i] - state.position[i]).length();
        let way = way.max(smooth);
        let need = way + CANDIDATE_MARGIN * model.radius[i];
        scratch.need[i] = state.need(model, i, need);
    }
    scratch.neighbours.refresh(
        &state.position,
        &model.radius,
        &scratch.walls.now,
        &scratch.need,
    );
    candidates::complete(&scratch.neighbours)?;
    Ok(fastest)
}

/// The closed contacts: gap at the midpoint within the touching tolerance, with the frame of the midpoint.
fn meet(model: &Model, state: &State, scratch: &mut Scratch) -> Result<(), Failure> {
    let Scratch {
        contacts,
        neighbours,
        position,
        walls,
        ..
    } = scratch;
    contacts.clear();
    for &pair in neighbours.pairs() {
        let margin = model.options.touching_tolerance;
        if !candidates::push_candidate(model, state, walls, position, pair, margin, contacts)? {
            continue;
        }
        let last = contacts.len() - 1;
        let c = &mut contacts[last];
        c.closed = true;
        if !(c.is_wall(model) && model.wall(c.b).is_fixed_plane()) {
            let a = position[c.a as usize];
            let b = position.get(c.b as usize).copied().unwrap_or(a);
            let n = proximity(model, walls, c, a, b).normal;
            let (t1, t2) = carom_geom::tangent_frame(n);
            (c.n0, c.n1, c.t1, c.t2) = (n, n, t1, t2);
        }
    }
    Ok(())
}

/// `x_{n+1}` and the increment of rotation from `v_{n+1} = v-check + W`.
fn advance(model: &Model, state: &State, scratch: &mut Scratch, theta_h: f64) {
    for i in 0..model.spheres() {
        let [linear, angular] = scratch.jump[i];
        scratch.linear[i].displacement += theta_h * linear;
        scratch.angular[i].displacement += theta_h * angular;
        scratch.position[i] = state.position[i] + scratch.linear[i].displacement;
    }
}

/// Gaps at `x_{n+1}`: of the step's contacts and of all pairs that overlap, so that penetration is reported; with
/// `position_projection` it is removed.
fn close(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    accept: bool,
) -> Result<(), Failure> {
    std::mem::swap(&mut scratch.contacts, &mut scratch.overlaps);
    scratch.contacts.clear();
    let closed = if model.options.position_projection {
        project(model, state, scratch, span, report, accept)
    } else {
        overlapping(model, state, scratch, 0.0).map(|_| ())
    };
    std::mem::swap(&mut scratch.contacts, &mut scratch.overlaps);
    closed?;
    merge(model, scratch);
    Ok(())
}

/// Makes `scratch.contacts` the pairs whose gap at `scratch.position` is below `margin r_c`, kept to gaps alone;
/// returns whether there are pairs that it had not.
fn overlapping(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    margin: f64,
) -> Result<bool, Failure> {
    list_pairs(model, state, scratch)?;
    let Scratch {
        contacts,
        neighbours,
        position,
        walls,
        ..
    } = scratch;
    let known = contacts.len();
    for &pair in neighbours.pairs() {
        let listed = contacts[..known]
            .binary_search_by_key(&pair, |c| (c.a, c.b))
            .is_ok();
        if !listed
            && candidates::push_candidate(model, state, walls, position, pair, margin, contacts)?
        {
            let last = contacts.len() - 1;
            contacts[last].bounds = Bounds::default();
        }
    }
    contacts.sort_unstable_by_key(|c| (c.a, c.b));
    Ok(contacts.len() > known)
}

/// The position sub-problem (eqs. 1c-e) at `x_{n+1}`, without friction: the nearest positions, measured by mass, at
/// which nothing overlaps and joints hold. Velocities stay as they are.
fn project(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    accept: bool,
) -> Result<(), Failure> {
    overlapping(model, state, scratch, CANDIDATE_MARGIN)?;
    for round in 0..=step::MAX_RELIST {
        for i in 0..model.spheres() {
            scratch.position[i] = state.position[i] + scratch.linear[i].displacement;
            scratch.shift[i] = [DVec3::ZERO; 2];
        }
        scratch.contacts.iter_mut().for_each(|c| c.nu = [0.0; 6]);
        loads_once::meet(model, scratch);
        let demand = Demand::or_accepted(accept);
        step::solve_positions(model, state, scratch, span, report, demand)?;
        for i in 0..model.spheres() {
            scratch.position[i] += scratch.shift[i][0];
        }
        gaps(model, scratch, |c, gap| c.gap = gap);
        if !overlapping(model, state, scratch, -model.options.gap_tolerance)? {
            return Ok(());
        }
        report.relisted += u32::from(round < step::MAX_RELIST);
    }
    Err(Failure::NotConverged(Level::Position))
}

/// Hands every contact its gap at `scratch.position`.
fn gaps(model: &Model, scratch: &mut Scratch, mut take: impl FnMut(&mut Contact, f64)) {
    let Scratch {
        contacts,
        position,
        walls,
        ..
    } = scratch;
    for c in contacts.iter_mut() {
        let xb = position.get(c.b as usize).copied().unwrap_or(DVec3::ZERO);
        let gap = proximity(model, walls, c, position[c.a as usize], xb).gap;
        take(c, gap);
    }
}

/// Final gaps and position multipliers of the step's contacts; pairs that are none and overlap, or were pushed, join.
fn merge(model: &Model, scratch: &mut Scratch) {
    gaps(model, scratch, |c, gap| c.gap = gap);
    let Scratch {
        contacts, overlaps, ..
    } = scratch;
    let settled = contacts.len();
    for o in overlaps.iter() {
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
