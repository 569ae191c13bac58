//! The time step: Algorithm 1 of the paper, phase by phase. Start reading here.
//!
//! predict and smooth -> broad -> meet -> (loads ->) position -> velocity -> finish. The state is written in `finish` alone: a
//! step that fails leaves it as it was. `docs/theory/algorithm.md` states each phase.

use crate::all_islands;
use crate::candidates::{complete, meet, relist, start_over};
use crate::contact::CANDIDATE_MARGIN;
use crate::finish::finish;
use crate::force::total::{motion_of, power};
use crate::level::{smooth, Demand, Task};
use crate::loads_once;
use crate::model::Model;
use crate::outcome::{Failure, Level};
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::{Coefficients, Span};
use crate::timers::{Phase, Timers};
use crate::wall::places::proximity;
use crate::{pile, travel};
use carom_solve::team;
use glam::DVec3;

/// Most rounds of listing new overlaps after the position solve. Too few: steps in which pairs keep joining fail, and are halved. Too many: a
/// jam in which pairs come and go holds up its step.
pub(crate) const MAX_RELIST: u32 = 20;

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

/// A method in time: how one step is made. Its own memory can be recomputed: what continues a run is in [`State`].
///
/// [`step`] and Moreau-Jean are functions. Other crates hand theirs to [`crate::Simulation::with_stepper`].
pub trait Stepper: Send + Sync {
    /// Makes one step. One that fails leaves the state as it was.
    fn step(
        &mut self,
        model: &Model,
        state: &mut State,
        scratch: &mut Scratch,
        timers: &mut Timers,
        attempt: &Attempt,
        report: &mut StepReport,
    ) -> Result<(), Failure>;

    /// Whether it divides a step by itself: then a step that fails is not halved, and one may take as long as thousands.
    fn divides_steps(&self) -> bool {
        false
    }
}

/// A function is a method without memory.
impl<F> Stepper for F
where
    F: Fn(
            &Model,
            &mut State,
            &mut Scratch,
            &mut Timers,
            &Attempt,
            &mut StepReport,
        ) -> Result<(), Failure>
        + Send
        + Sync,
{
    fn step(
        &mut self,
        model: &Model,
        state: &mut State,
        scratch: &mut Scratch,
        timers: &mut Timers,
        attempt: &Attempt,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        self(model, state, scratch, timers, attempt, report)
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
    // Marked before an error is passed on: its time is that of its own phase, not of the next attempt's first one.
    let positions = correct_positions(model, state, scratch, span, report, *accept_unconverged);
    timers.mark(Phase::Position);
    positions?;
    let velocities = correct_velocities(model, state, scratch, span, report, *accept_unconverged);
    timers.mark(Phase::Velocity);
    velocities?;
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
    let threads = model.options.threads as usize;
    team::fill(threads, &mut scratch.shift, |_| [DVec3::ZERO; 2]);
    team::fill(threads, &mut scratch.jump, |_| [DVec3::ZERO; 2]);
    scratch.begin_step();
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
    let Scratch {
        linear,
        walls,
        need,
        ..
    } = scratch;
    let (threads, moves) = (model.options.threads as usize, walls.any_moves());
    let each = |first: usize, needs: &mut [f64]| {
        let mut fastest = 0.0f64;
        for (i, need) in (first..).zip(needs) {
            let (r, way) = (model.radius[i], linear[i].displacement.length());
            fastest = team::larger(fastest, way);
            let mut reach = way + CANDIDATE_MARGIN * r;
            if moves {
                // A fast wall may be past a sphere at the end of the step.
                let swept = walls.speed_at(state.position[i]) * h;
                reach += if swept > 0.5 * r { swept } else { 0.0 };
            }
            *need = state.need(model, i, reach);
        }
        fastest
    };
    let fastest = team::reduce(threads, need.len(), &mut need[..], each, team::larger);
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
    let strict = Demand::or_accepted(accept);
    let once = model.options.loads_once();
    if once {
        solve_loads(model, state, scratch, span, report, strict)?;
    }
    let mut demand = if accept { strict } else { Demand::Rough };
    for round in 0..=MAX_RELIST {
        let earlier = std::mem::take(&mut report.sweeps_position);
        if once {
            loads_once::meet(model, scratch);
        }
        solve_positions(model, state, scratch, span, report, demand)?;
        report.sweeps_position += earlier;
        place(model, state, scratch);
        let joined = relist(model, state, scratch)?;
        if !joined {
            // What was solved roughly is done once more, now that all pairs are there.
            let (contacts, islands) = (&scratch.contacts, &scratch.islands);
            if demand != Demand::Rough || !pile::is_left_rough(model, contacts, islands) {
                break;
            }
            demand = strict;
            start_over(model, state, scratch);
        }
        if round == MAX_RELIST {
            return Err(Failure::NotConverged(Level::Position));
        }
        report.relisted += u32::from(joined);
    }
    report.candidates = scratch.contacts.len() as u32;
    scratch.end_level();
    Ok(())
}

/// The loads of the step where they are solved once, before positions.
fn solve_loads(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    demand: Demand,
) -> Result<(), Failure> {
    loads_once::begin(model, state, scratch, span.h);
    let (spheres, links) = (model.spheres(), &model.links);
    scratch
        .islands
        .build(spheres, &scratch.contacts, links, |c| c.resting);
    scratch.load_shift.fill([DVec3::ZERO; 2]);
    let task = Task {
        model,
        state,
        level: Level::Loads,
        span,
        demand,
    };
    if !all_islands::solve(&task, scratch, report) {
        return Err(Failure::NotConverged(Level::Velocity));
    }
    loads_once::advance(model, state, scratch, span.h);
    Ok(())
}

/// One round of position solves, island by island of candidates.
pub(crate) fn solve_positions(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    report: &mut StepReport,
    demand: Demand,
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
        demand,
    };
    if all_islands::solve(&task, scratch, report) {
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
        load_shift,
        linear,
        contacts,
        walls,
        ..
    } = scratch;
    let threads = model.options.threads as usize;
    let once = !load_shift.is_empty();
    if once {
        let by_loads = &*load_shift;
        let corrected = &*shift;
        let total = |i: usize| [0, 1].map(|k| corrected[i][k] + by_loads[i][k]);
        *shift = (0..corrected.len()).map(total).collect();
    }
    team::fill(threads, position, |i| {
        state.position[i] + linear[i].displacement + shift[i][0]
    });
    team::each(threads, contacts, |c| {
        let xb = position.get(c.b as usize).copied().unwrap_or(DVec3::ZERO);
        let p = proximity(model, walls, c, position[c.a as usize], xb);
        c.gap = p.gap;
        c.n1 = p.normal;
        c.closed = c.nu[0] > 0.0 || p.gap <= model.options.touching_tolerance * c.length;
        if once {
            c.closed |= c.load[0] > 0.0;
            c.turn_to(p.normal);
        }
    });
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
        demand: Demand::or_accepted(accept),
    };
    let solved = all_islands::solve(&task, scratch, report);
    scratch.end_level();
    if solved {
        Ok(())
    } else {
        Err(Failure::NotConverged(Level::Velocity))
    }
}
