//! The time step: Algorithm 1 of the paper, phase by phase. Start reading here.
//!
//! predict and smooth -> broad -> meet -> position -> velocity -> finish. The state is written in `finish` alone: a
//! step that fails leaves it as it was. `docs/theory/algorithm.md` states each phase.

use crate::blow_up::{self, BlowUp, Watch};
use crate::candidates::{complete, meet, relist, CANDIDATE_MARGIN};
use crate::contact::Contact;
use crate::force::{self, Motion};
use crate::level::{position, smooth};
use crate::model::Model;
use crate::options::Method;
use crate::report::{Level, StepReport};
use crate::rotation;
use crate::scratch::Scratch;
use crate::share::{self, Task};
use crate::state::State;
use crate::stepper::{Coefficients, Span};
use crate::timers::{Phase, Timers};
use crate::travel;
use carom_solve::team;
use glam::DVec3;

/// Rounds of listing new overlaps after the position solve.
pub(crate) const MAX_RELIST: u32 = 20;

/// Why a step could not be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    NotConverged(Level),
    /// A velocity or position is no finite number, or grew beyond [`crate::blow_up::FASTEST`].
    BlowUp(BlowUp),
    MissingLaw(u32, u32),
    /// More pairs may meet within the step than the list holds: the step is far too long for the speeds.
    TooManyPairs,
    /// Method `penalty` would need more substeps than it may take.
    TooManySubsteps,
    /// A pair would meet after a relative travel (m) of the radius `length` (m) of one or more.
    TooFar {
        bodies: (u32, u32),
        travel: f64,
        length: f64,
    },
    /// A load could not be evaluated.
    Load,
    /// A friction law gave `mu` at a slip speed, m/s: no coefficient.
    Friction {
        bodies: (u32, u32),
        mu: f64,
        slip: f64,
    },
}

/// What is asked of one step.
#[derive(Clone, Copy, Debug)]
pub struct Attempt {
    /// Of the size of this step.
    pub coefficients: Coefficients,
    /// Time at its start, s.
    pub time: f64,
    /// It is halved no more if it fails.
    pub smallest: bool,
    /// Take an unconverged iterate, and count it.
    pub accept_unconverged: bool,
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
    let span = Span {
        smallest: *smallest,
        ..Span::new(*time, coefficients.h)
    };
    predict_and_smooth(model, state, scratch, coefficients, span, report)?;
    timers.mark(Phase::Predict);
    let fastest = list_pairs(model, state, scratch, span.h)?;
    travel::check(model, state, scratch, fastest)?;
    timers.mark(Phase::Broad);
    meet(model, state, scratch)?;
    timers.mark(Phase::Meet);
    correct_positions(model, state, scratch, span, report, *accept_unconverged)?;
    timers.mark(Phase::Position);
    correct_velocities(model, state, scratch, span, report, *accept_unconverged)?;
    timers.mark(Phase::Velocity);
    finish(model, state, scratch, coefficients, span, report)?;
    timers.mark(Phase::Finish);
    Ok(())
}

/// Lines 5-20 for every sphere, and a clean slate for what the step collects.
pub(crate) fn predict_and_smooth(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
    span: Span,
    report: &mut StepReport,
) -> Result<(), Failure> {
    scratch.shift.fill([DVec3::ZERO; 2]);
    scratch.jump.fill([DVec3::ZERO; 2]);
    scratch.impacts.clear();
    scratch.warm.clear();
    for history in &mut scratch.history {
        history.clear();
    }
    scratch.keeper.failed = None;
    scratch.joint_reaction.fill([DVec3::ZERO; 2]);
    if !model.loads.is_empty() {
        scratch.power = power(model, &motion_of(state, span.start));
    }
    scratch.wall_impulse.fill([DVec3::ZERO; 2]);
    if let Err(error) = scratch.walls.begin(model, span) {
        scratch.load_error = Some(error);
        return Err(Failure::Load);
    }
    smooth::solve(model, state, scratch, coefficients, span.start, report)
}

/// Pairs that may come within the candidate margin during the step. The largest way of a sphere in its smooth motion, m.
fn list_pairs(model: &Model, state: &State, scratch: &mut Scratch, h: f64) -> Result<f64, Failure> {
    let moves = scratch.walls.any_moves();
    let mut fastest = 0.0f64;
    for i in 0..model.spheres() {
        let (x, r) = (state.position[i], model.radius[i]);
        let way = scratch.linear[i].displacement.length();
        fastest = fastest.max(way);
        let mut need = way + CANDIDATE_MARGIN * r;
        if moves {
            // A fast wall may be past a sphere at the end of the step.
            let swept = scratch.walls.speed_at(x) * h;
            need += if swept > 0.5 * r { swept } else { 0.0 };
        }
        scratch.need[i] = state.need(model, i, need);
    }
    scratch.neighbours.refresh(
        &state.position,
        &model.radius,
        &scratch.walls.now,
        &scratch.need,
    );
    complete(&scratch.neighbours)?;
    Ok(fastest)
}

/// Step 2: position corrections island by island; pairs that overlap only now join, and the solve is repeated.
fn correct_positions(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    accept: bool,
) -> Result<(), Failure> {
    for round in 0..=MAX_RELIST {
        let earlier = std::mem::take(&mut report.sweeps_position);
        solve_positions(model, state, scratch, span, report, accept)?;
        report.sweeps_position += earlier;
        place(model, state, scratch);
        if !relist(model, state, scratch)? {
            break;
        }
        if round == MAX_RELIST {
            return Err(Failure::NotConverged(Level::Position));
        }
        report.relisted += 1;
    }
    report.candidates = scratch.contacts.len() as u32;
    Ok(())
}

/// One round of position solves, island by island of candidates.
pub(crate) fn solve_positions(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    accept: bool,
) -> Result<(), Failure> {
    let (spheres, links) = (model.spheres(), &model.links);
    scratch
        .islands
        .build(spheres, &scratch.contacts, links, |_| true);
    scratch.keeper.discard(Some(Level::Position));
    let task = Task {
        model,
        state,
        level: Level::Position,
        span,
        accept_unconverged: accept,
    };
    if share::solve(&task, scratch, report) {
        Ok(())
    } else {
        Err(Failure::NotConverged(Level::Position))
    }
}

/// Corrected positions, gaps, normals and the closed set A.
fn place(model: &Model, state: &State, scratch: &mut Scratch) {
    let Scratch {
        position,
        shift,
        linear,
        contacts,
        walls,
        ..
    } = scratch;
    for i in 0..model.spheres() {
        position[i] = state.position[i] + linear[i].displacement + shift[i][0];
    }
    team::each(
        model.options.threads as usize,
        contacts,
        |c: &mut Contact| {
            let xb = position.get(c.b as usize).copied().unwrap_or(DVec3::ZERO);
            let p = position::proximity(model, walls, c, position[c.a as usize], xb);
            c.gap = p.gap;
            c.n1 = p.normal;
            c.closed = c.nu[0] > 0.0 || p.gap <= model.options.touching_tolerance * c.length;
        },
    );
}

/// Step 3: velocity corrections by the impact law, island by island of closed contacts.
pub(crate) fn correct_velocities(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    accept: bool,
) -> Result<(), Failure> {
    let (spheres, links) = (model.spheres(), &model.links);
    scratch
        .islands
        .build(spheres, &scratch.contacts, links, |c| c.closed);
    for members in scratch.islands.sizes() {
        report.contacts += members;
        report.islands += u32::from(members > 0);
        report.largest_island = report.largest_island.max(members);
    }
    let task = Task {
        model,
        state,
        level: Level::Velocity,
        span,
        accept_unconverged: accept,
    };
    if share::solve(&task, scratch, report) {
        Ok(())
    } else {
        Err(Failure::NotConverged(Level::Velocity))
    }
}

/// Line 41 and the new state, energies and penetration.
pub(crate) fn finish(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
    span: Span,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let (mut kinetic, mut potential) = (0.0, 0.0);
    let mut watch = Watch::default();
    let n = model.spheres();
    let (linear, angular) = (&mut scratch.linear[..n], &mut scratch.angular[..n]);
    let (jump, position) = (&mut scratch.jump[..n], &scratch.position[..n]);
    for i in 0..n {
        let (linear, angular) = (&mut linear[i], &mut angular[i]);
        let v = linear.velocity + jump[i][0];
        let w = angular.velocity + jump[i][1];
        let (v2, w2) = (v.length_squared(), w.length_squared());
        kinetic += 0.5 * (model.mass[i] * v2 + model.inertia[i] * w2);
        if state.present[i] {
            potential += force::weight_potential(model, i, position[i]);
        }
        linear.pseudo = coefficients.finish(linear);
        angular.pseudo = coefficients.finish(angular);
        let way = position[i] - state.position[i];
        watch.look(v2 + w2, way, [linear, angular]);
        jump[i] = [v, w];
    }
    if !(watch.is_calm(span.h) && (kinetic + potential).is_finite()) {
        blow_up::find(model, state, scratch, span.h)?;
    }
    if model.record_walls {
        let Scratch {
            walls,
            position,
            contacts,
            wall_impulse,
            ..
        } = scratch;
        report.energy_work = walls.collect(model, state, position, contacts, wall_impulse);
    }
    for i in 0..model.spheres() {
        [state.velocity[i], state.angular_velocity[i]] = scratch.jump[i];
        state.position[i] = scratch.position[i];
        let rot_incr_world = scratch.angular[i].displacement + scratch.shift[i][1];
        state.orientation[i] = rotation::advance(rot_incr_world, state.orientation[i]);
        state.pseudo[i] = [scratch.linear[i].pseudo, scratch.angular[i].pseudo];
        state.acceleration[i] = [
            scratch.linear[i].acceleration,
            scratch.angular[i].acceleration,
        ];
    }
    if !model.is_free() {
        let at = motion_of(state, span.end);
        potential += model.loads.iter().map(|l| l.potential(&at)).sum::<f64>();
        let mean = 0.5 * (scratch.power + power(model, &at));
        add_smooth_reactions(model, state, scratch, coefficients);
        report.energy_work += span.h * mean + joint_work(model, scratch, span);
    }
    std::mem::swap(&mut state.warm, &mut scratch.warm);
    state.warm.sort_unstable_by_key(|w| w.key);
    state.warm_step = coefficients.h;
    report.energy_kinetic = kinetic;
    report.energy_potential = potential;
    for c in &scratch.contacts {
        report.penetration = report.penetration.max(-c.gap);
        report.penetration_relative = report.penetration_relative.max(-c.gap / c.length);
    }
    Ok(())
}

/// Adds the impulses of the smooth reactions to the joints' totals. In the nonsmooth generalized-alpha scheme they are
/// those of the filtered reactions (eq. 6), as velocities are of filtered accelerations.
fn add_smooth_reactions(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
) {
    let Scratch {
        smooth,
        joint_reaction,
        ..
    } = scratch;
    if model.options.method != Method::Nsga {
        smooth.add_reactions(model, coefficients.h, joint_reaction);
        return;
    }
    let mut reactions = vec![[DVec3::ZERO; 2]; model.joints.len()];
    smooth.add_reactions(model, 1.0, &mut reactions);
    let per_velocity = 1.0 / coefficients.acceleration_per_velocity();
    for ((now, kept), total) in reactions
        .iter()
        .zip(&mut state.reaction)
        .zip(joint_reaction)
    {
        let [last, pseudo] = *kept;
        for k in 0..2 {
            // Reactions instead of accelerations: the "velocity" is the impulse.
            let mut p = coefficients.predict(DVec3::ZERO, pseudo[k], last[k]);
            coefficients.correct(&mut p, per_velocity * now[k]);
            total[k] += p.velocity;
            kept[0][k] = now[k];
            kept[1][k] = coefficients.finish(&p);
        }
    }
}

/// The motion of a state, as loads see it.
pub(crate) fn motion_of(state: &State, time: f64) -> Motion<'_> {
    Motion {
        time,
        position: &state.position,
        orientation: &state.orientation,
        velocity: &state.velocity,
        angular_velocity: &state.angular_velocity,
    }
}

/// Power of the loads that have no potential, W.
fn power(model: &Model, at: &Motion) -> f64 {
    model.loads.iter().map(|load| load.power(at)).sum()
}

/// Work of joints with a prescribed motion: the impulse along each such row times the mean of its rates at both ends. Of
/// second order in smooth motion, and right where a law has a kink. (A joint prescribes one row, or rows at right angles.)
fn joint_work(model: &Model, scratch: &Scratch, span: Span) -> f64 {
    let mut work = 0.0;
    for (index, joint) in model.joints.iter().enumerate() {
        for (r, row) in joint.rows.iter().enumerate() {
            if !joint.prescribes(r) {
                continue;
            }
            let rate = 0.5 * (row.law.slope(span.start) + row.law.slope(span.end));
            work += rate
                * scratch
                    .smooth
                    .along(joint, index, r, &scratch.joint_reaction[index]);
        }
    }
    work
}
