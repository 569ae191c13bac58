//! The time step: Algorithm 1 of the paper, phase by phase. Start reading here.
//!
//! predict and smooth -> broad -> meet -> (loads ->) position -> velocity -> finish. The state is written in `finish` alone: a
//! step that fails leaves it as it was. `docs/theory/algorithm.md` states each phase.

use crate::all_islands;
use crate::candidates::{list, meet, NearPair};
use crate::clump;
use crate::cohesion;
use crate::contact::{Contact, CANDIDATE_MARGIN};
use crate::finish::finish;
use crate::force::total::{displaced_ahead, motion_of, power, wall_force};
use crate::force::{evaluated, LoadError};
use crate::level::{smooth, Demand, Task};
use crate::loads_once;
use crate::model::Model;
use crate::outcome::{Failure, Level};
use crate::relist::{join, relist, start_over, Relisted};
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::method::Step;
use crate::stepper::Span;
use crate::timers::Phase;
use crate::wall::places::{proximity_at, Walls};
use crate::{pile, travel};
use carom_solve::team;
use glam::DVec3;

/// Most rounds of listing new overlaps after the position solve. Too few: steps in which pairs keep joining fail, and are halved. Too many: a
/// jam in which pairs come and go holds up its step.
pub(crate) const MAX_RELIST: u32 = 20;

/// Makes one step.
pub fn step(on: &mut Step) -> Result<(), Failure> {
    predict_and_smooth(on)?;
    on.timers.mark(Phase::Predict);
    on.scratch.pulled.fill([DVec3::ZERO; 2]);
    let mut fastest = list_pairs(on.model, on.state, on.scratch)?;
    if on.model.cohesive_reach() > 0.0 {
        cohesion::pull(on, on.span)?;
        fastest = list_pairs(on.model, on.state, on.scratch)?;
    }
    travel::check(on.model, on.state, on.scratch, fastest)?;
    on.timers.mark(Phase::Broad);
    meet(on.model, on.state, on.scratch)?;
    on.timers.mark(Phase::Meet);
    // Marked before an error is passed on: its time is that of its own phase, not of the next attempt's first one.
    let positions = correct_positions(on);
    on.timers.mark(Phase::Position);
    positions?;
    clump::turn_velocities(on.model, on.state, on.scratch);
    let demand = Demand::or_accepted(on.accept_unconverged);
    let velocities = correct_velocities(on.model, on.state, on.scratch, on.span, demand, on.report);
    on.timers.mark(Phase::Velocity);
    velocities?;
    finish(on)?;
    on.timers.mark(Phase::Finish);
    Ok(())
}

/// Lines 5-20 for every sphere, and a clean slate for what the step collects.
pub(crate) fn predict_and_smooth(on: &mut Step) -> Result<(), Failure> {
    let (model, span, scratch) = (on.model, on.span, &mut *on.scratch);
    let threads = model.options.threads as usize;
    team::fill(threads, &mut scratch.shift, |_| [DVec3::ZERO; 2]);
    team::fill(threads, &mut scratch.jump, |_| [DVec3::ZERO; 2]);
    scratch.begin_step();
    scratch.joint_reaction.fill([DVec3::ZERO; 2]);
    if !model.loads.is_empty() {
        let at = motion_of(on.state, span.start);
        scratch.power = evaluated(power(model, &at), &mut scratch.load_error)?;
    }
    scratch.wall_impulse.fill([DVec3::ZERO; 2]);
    evaluated(scratch.walls.begin(model, span), &mut scratch.load_error)?;
    let displaced = displaced_ahead(model, on.state, span.h);
    evaluated(
        check_forces(model, &displaced, span),
        &mut scratch.load_error,
    )?;
    smooth::solve(on)
}

/// Refuses forces on free walls that are no numbers.
fn check_forces(model: &Model, displaced: &[DVec3], span: Span) -> Result<(), LoadError> {
    for (wall, body) in model.free_walls.iter().zip(model.first_wall()..) {
        let force = wall_force(model, wall, displaced, span.end);
        if !force.is_finite() {
            let text = format!("force {force} N at t = {} s", span.end);
            return Err(LoadError::on(body as u32, text));
        }
    }
    Ok(())
}

/// Pairs that may come within the candidate margin during the step. The largest way of a sphere in its smooth motion, m.
fn list_pairs(model: &Model, state: &State, scratch: &mut Scratch) -> Result<f64, Failure> {
    let (walls, linear, pulled) = (&scratch.walls, &scratch.linear, &scratch.pulled);
    let (threads, moves) = (model.options.threads as usize, walls.any_moves());
    let reach = model.cohesive_reach() + way_of_free_walls(model, scratch);
    let each = |first: usize, needs: &mut [f64]| {
        let mut fastest = 0.0f64;
        for (i, need) in (first..).zip(needs) {
            let (r, smooth) = (model.radius[i], linear[i].displacement);
            let way = pulled.get(i).map_or(smooth, |by| smooth + by[0]);
            let way = walls.periodic.own_way(state.position[i], way).length();
            let mut reach = way + CANDIDATE_MARGIN * r + reach;
            let of_box = walls.periodic.change(r + reach);
            fastest = team::larger(fastest, way + of_box);
            reach += of_box;
            if moves {
                reach += walls.swept(state.position[i], r);
            }
            *need = state.need(model, i, reach);
        }
        fastest
    };
    let need = &mut scratch.need[..];
    let fastest = team::reduce(threads, need.len(), need, each, team::larger);
    list(model, state, scratch)?;
    Ok(fastest)
}

/// The largest way of a free wall in its smooth motion, m.
fn way_of_free_walls(model: &Model, scratch: &Scratch) -> f64 {
    let way = |i: usize| scratch.way(i).length();
    (model.first_wall()..model.bodies())
        .map(way)
        .fold(0.0, f64::max)
}

/// Step 2: position corrections island by island; pairs that overlap only now join, and the solve is repeated.
fn correct_positions(on: &mut Step) -> Result<(), Failure> {
    let model = on.model;
    let once = model.options.loads_once();
    let strict = Demand::or_accepted(on.accept_unconverged);
    if once {
        solve_loads(on, strict)?;
    }
    let mut demand = match strict {
        Demand::Accepted => strict,
        _ => Demand::Rough,
    };
    for round in 0..=MAX_RELIST {
        let earlier = std::mem::take(&mut on.report.sweeps_position);
        if once {
            loads_once::meet(model, on.scratch);
        }
        solve_positions(on, demand)?;
        on.report.sweeps_position += earlier;
        place(model, on.state, on.scratch);
        let relisted = relist(on)?;
        on.report.relisted += u32::from(matches!(relisted, Relisted::Joined));
        if let Relisted::Touching(pairs) = relisted {
            // What was solved roughly is done once more, now that all pairs are there.
            let (contacts, islands) = (&on.scratch.contacts, &on.scratch.islands);
            if demand != Demand::Rough || !pile::is_left_rough(model, contacts, islands) {
                on.report.candidates = contacts.len() as u32;
                join_touching(on, &pairs)?;
                break;
            }
            demand = strict;
            start_over(on);
        }
        if round == MAX_RELIST {
            return Err(Failure::NotConverged(Level::Position));
        }
    }
    on.scratch.end_level();
    Ok(())
}

/// The loads of the step where they are solved once, before positions.
fn solve_loads(on: &mut Step, demand: Demand) -> Result<(), Failure> {
    loads_once::begin(on.model, on.state, on.scratch, on.span.h);
    on.scratch.load_shift.fill([DVec3::ZERO; 2]);
    let task = Task {
        model: on.model,
        state: on.state,
        level: Level::Loads,
        span: on.span,
        demand,
    };
    // To whoever asks these are velocities.
    solve_level(&task, on.scratch, on.report, |c| c.resting)
        .map_err(|_| Failure::NotConverged(Level::Velocity))?;
    loads_once::advance(on.model, on.state, on.scratch, on.span.h);
    clump::follow(on.model, on.state, on.scratch, true);
    Ok(())
}

/// One round of position solves, island by island of candidates.
pub(crate) fn solve_positions(on: &mut Step, demand: Demand) -> Result<(), Failure> {
    on.scratch.keeper.discard(Some(Level::Position));
    let task = Task {
        model: on.model,
        state: on.state,
        level: Level::Position,
        span: on.span,
        demand,
    };
    solve_level(&task, on.scratch, on.report, |_| true)
}

/// Corrected positions, gaps, normals and the closed set A.
fn place(model: &Model, state: &State, scratch: &mut Scratch) {
    let threads = model.options.threads as usize;
    let once = !scratch.load_shift.is_empty();
    if once {
        let by_loads = &scratch.load_shift;
        let corrected = &scratch.shift;
        let total = |i: usize| [0, 1].map(|k| corrected[i][k] + by_loads[i][k]);
        scratch.shift = (0..corrected.len()).map(total).collect();
    }
    let (linear, shift) = (&scratch.linear, &scratch.shift);
    team::fill(threads, &mut scratch.position, |i| {
        state.position[i] + linear[i].displacement + shift[i][0]
    });
    clump::follow(model, state, scratch, false);
    let (walls, position) = (&scratch.walls, &scratch.position);
    team::each(threads, &mut scratch.contacts, |c| {
        place_contact(model, walls, position, c);
    });
}

/// A contact at the corrected positions, and whether it is in A.
fn place_contact(model: &Model, walls: &Walls, position: &[DVec3], c: &mut Contact) {
    let p = proximity_at(model, walls, c, position);
    let touching = model.options.touching_tolerance * c.length;
    c.closed = c.nu[0] > 0.0 || p.gap <= touching;
    if model.options.loads_once() {
        // Where loads have brought it: what corrects the overlaps of an impact may part two that touched when it began.
        c.closed |= c.load[0] > 0.0 || (c.resting && c.gap <= touching);
        c.turn_to(p.normal);
    }
    (c.gap, c.n1) = (p.gap, p.normal);
}

/// Pairs that positions have brought to touch, and no more: there is nothing to correct, but they are in A. The third ball of a rod is so that two
/// others lay on the floor.
fn join_touching(on: &mut Step, pairs: &[NearPair]) -> Result<(), Failure> {
    if pairs.is_empty() {
        return Ok(());
    }
    join(on, pairs)?;
    let (model, scratch) = (on.model, &mut *on.scratch);
    let (walls, position) = (&scratch.walls, &scratch.position);
    for near in pairs {
        let found = (scratch.contacts).binary_search_by_key(&near.pair, |c| (c.a, c.b));
        if let Ok(slot) = found {
            place_contact(model, walls, position, &mut scratch.contacts[slot]);
        }
    }
    Ok(())
}

/// Step 3: velocity corrections by the impact law, island by island of closed contacts.
pub(crate) fn correct_velocities(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    span: Span,
    demand: Demand,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let task = Task {
        model,
        state,
        level: Level::Velocity,
        span,
        demand,
    };
    let solved = solve_level(&task, scratch, report, |c| c.closed);
    report.count(&scratch.islands);
    scratch.end_level();
    solved
}

/// Solves a level: the islands of those contacts that `select` admits.
fn solve_level(
    task: &Task,
    scratch: &mut Scratch,
    report: &mut StepReport,
    select: impl Fn(&Contact) -> bool + Sync,
) -> Result<(), Failure> {
    let (model, contacts) = (task.model, &scratch.contacts);
    scratch.islands.build(model, contacts, &model.links, select);
    if all_islands::solve(task, scratch, report) {
        return Ok(());
    }
    Err(Failure::NotConverged(task.level))
}
