//! One step of the run's grid in substeps: the counterpart of [`crate::step::step`] for contact forces.
//!
//! A substep of size `dt` is a symmetric composition, second order:
//!
//! ```text
//! dissipate dt/2    damping and friction, contact after contact in the order of keys, each by its exact flow
//! kick      dt/2    v += dt/2 M^-1 (elastic forces + loads)
//! drift     dt      x += dt v, R = exp(dt w) R; contacts open and close
//! kick      dt/2    with the forces of the new positions
//! dissipate dt/2    in the opposite order
//! ```
//!
//! Without damping and friction this is velocity Verlet. Dissipation cannot make energy, however large the substep.

use super::elastic::Elastic;
use super::workspace::Workspace;
use crate::candidates::CANDIDATE_MARGIN;
use crate::force::total::weight_potential;
use crate::force::LoadError;
use crate::model::Model;
use crate::outcome::{within_bounds, BlowUp, Failure, History, Level};
use crate::report::StepReport;
use crate::rotation;
use crate::scratch::Scratch;
use crate::state::State;
use crate::step::Attempt;
use crate::stepper::Span;
use crate::timers::{Phase, Timers};
use carom_geom::NeighbourList;
use glam::DVec3;

/// Substeps of a step at most: no input may make a step endless.
pub const MAX_SUBSTEPS: u32 = 1_000_000;

/// Makes one step.
pub fn step(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    timers: &mut Timers,
    attempt: &Attempt,
    report: &mut StepReport,
) -> Result<(), Failure> {
    scratch.impacts.clear();
    for history in &mut scratch.history {
        *history = History::default();
    }
    scratch.keeper.failed = None;
    let mut work = std::mem::take(&mut scratch.penalty);
    let made = match work.elastic {
        Some(elastic) => advance(
            model, state, scratch, &mut work, &elastic, timers, attempt, report,
        ),
        None => unreachable!("the workspace is made for the method of the run"),
    };
    if made.is_ok() {
        write_state(state, &work);
    }
    scratch.penalty = work;
    made
}

#[allow(clippy::too_many_arguments)] // those of a step, and what it is made of
fn advance(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    work: &mut Workspace,
    elastic: &Elastic,
    timers: &mut Timers,
    attempt: &Attempt,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let h = attempt.coefficients.h;
    let span = Span::new(attempt.time, h);
    scratch.wall_impulse.fill([DVec3::ZERO; 2]);
    if let Err(error) = work.bodies.walls.begin(model, span) {
        return evaluated(scratch, Err(error));
    }
    work.bodies.walls.place(model, span.start);
    let begun = work.begin(model, state, elastic, attempt.time);
    evaluated(scratch, begun)?;
    work.set_needs(model, |_, _| 0.0);
    refresh(model, work, elastic, &mut scratch.neighbours)?;
    work.take_pairs(model, elastic, scratch.neighbours.pairs());
    check_laws(work)?;
    work.load_limit = load_limit(model, state, attempt.time);
    timers.mark(Phase::Predict);
    let mut left = h;
    work.accelerate();
    loop {
        let (dt, last) = choose(model, work, elastic, &mut scratch.neighbours, left)?;
        timers.mark(Phase::Broad);
        report.substeps += 1;
        if report.substeps > MAX_SUBSTEPS {
            return Err(Failure::TooManySubsteps);
        }
        report.substep_min = if report.substeps == 1 {
            dt
        } else {
            report.substep_min.min(dt)
        };
        left = if last { 0.0 } else { left - dt };
        let power = work.power;
        substep(
            model,
            scratch,
            work,
            elastic,
            timers,
            attempt.time + (h - left),
            dt,
        )?;
        report.energy_work += 0.5 * dt * (power + work.power);
        observe(work, report);
        if last {
            break;
        }
    }
    finish(model, scratch, work, elastic, report)?;
    if model.record_walls {
        let out = &mut scratch.wall_impulse;
        let walls = &work.bodies.walls;
        walls.collect(model, state, &work.bodies.position, &scratch.contacts, out);
        report.energy_work += work.pairs.iter().map(|p| p.driven_work).sum::<f64>();
    }
    timers.mark(Phase::Finish);
    Ok(())
}

/// The next substep, and whether it ends the step: what is left in equal parts, none longer than any pair admits.
///
/// Pairs that are not listed admit it too: after `refresh` they are farther apart than their bodies travel in it. So it is
/// a function of the state alone, and a resumed run with a fresh list takes the same.
fn choose(
    model: &Model,
    work: &mut Workspace,
    elastic: &Elastic,
    list: &mut NeighbourList,
    left: f64,
) -> Result<(f64, bool), Failure> {
    let mut limit = longest(model, work, elastic, left);
    work.set_needs(model, |bodies, i| {
        let travel = bodies.motion[i][0].length() + bodies.acceleration[i].length() * limit;
        (travel + bodies.walls.speed_at(bodies.position[i])) * limit
    });
    if refresh(model, work, elastic, list)? {
        limit = longest(model, work, elastic, left);
    }
    let parts = (left / limit).ceil();
    if parts <= 1.0 {
        return Ok((left, true));
    }
    Ok((left / parts, false))
}

/// Longest substep that the loads admit: the scheme is explicit in them, and has to resolve their springs and dampers. From
/// the tangents at the start of the step.
fn load_limit(model: &Model, state: &State, time: f64) -> f64 {
    /// Share of the time scales 1/omega and m/c in a substep.
    const SHARE: f64 = 0.1;
    let mut tangents = Vec::new();
    let at = crate::force::total::motion_of(state, time);
    for load in &model.loads {
        load.tangent(&at, &mut tangents);
    }
    // Several loads on one sphere add up: sums per degree of freedom.
    let mut sums = vec![
        [[0.0f64; 6]; 2];
        if tangents.is_empty() {
            0
        } else {
            model.spheres()
        }
    ];
    for t in tangents.iter().filter(|t| t.of == t.over) {
        let i = t.of as usize;
        for k in 0..6 {
            let inverse = if k < 3 {
                model.inv_mass[i]
            } else {
                model.inv_inertia[i]
            };
            let row = |block: &[[f64; 6]; 6]| block[k].iter().map(|x| x.abs()).fold(0.0, f64::max);
            sums[i][0][k] += inverse * row(&t.position);
            sums[i][1][k] += inverse * row(&t.velocity);
        }
    }
    let mut limit = f64::INFINITY;
    for [stiffness, damping] in sums {
        for k in 0..6 {
            // Two spheres on one spring swing against each other: twice the square of the frequency.
            limit = limit.min(SHARE / (2.0 * stiffness[k]).sqrt());
            limit = limit.min(SHARE / (2.0 * damping[k]));
        }
    }
    limit
}

fn longest(model: &Model, work: &Workspace, elastic: &Elastic, left: f64) -> f64 {
    let resolution = f64::from(model.options.penalty_resolution);
    let start = left.min(work.load_limit);
    work.pairs.iter().fold(start, |shortest, pair| {
        shortest.min(pair.longest_substep(elastic, &work.bodies, resolution, shortest))
    })
}

/// Brings the list up to the needs, and the pairs up to the list. True: they changed.
fn refresh(
    model: &Model,
    work: &mut Workspace,
    elastic: &Elastic,
    list: &mut NeighbourList,
) -> Result<bool, Failure> {
    let x = &work.bodies.position;
    let walls = &work.bodies.walls.now;
    let rebuilt = list.refresh(x, &model.radius, walls, &work.need);
    if list.is_truncated() {
        return Err(Failure::TooManyPairs);
    }
    if rebuilt {
        work.take_pairs(model, elastic, list.pairs());
        check_laws(work)?;
    }
    Ok(rebuilt)
}

/// Keeps what a load said that could not be evaluated.
fn evaluated(scratch: &mut Scratch, loads: Result<(), LoadError>) -> Result<(), Failure> {
    loads.map_err(|error| {
        scratch.load_error = Some(error);
        Failure::Load
    })
}

fn check_laws(work: &Workspace) -> Result<(), Failure> {
    match work.pairs.iter().find(|p| p.closed && p.law.is_none()) {
        Some(pair) => Err(Failure::MissingLaw(pair.a, pair.b)),
        None => Ok(()),
    }
}

fn substep(
    model: &Model,
    scratch: &mut Scratch,
    work: &mut Workspace,
    elastic: &Elastic,
    timers: &mut Timers,
    end: f64,
    dt: f64,
) -> Result<(), Failure> {
    let tau = 0.5 * dt;
    let loaded = !model.loads.is_empty();
    for pair in work.pairs.iter_mut().filter(|p| p.closed) {
        pair.dissipate_before(&mut work.bodies, model, elastic, tau);
    }
    if loaded {
        evaluated(scratch, work.load(model, end - dt, 0.0))?;
    }
    // The elastic and the loads' half of a kick commute; their mirrored order gives each its exact work.
    for pair in work.pairs.iter_mut().filter(|p| p.closed) {
        pair.push(&mut work.bodies, tau);
    }
    accelerate(model, work, tau);
    timers.mark(Phase::Velocity);

    let b = &mut work.bodies;
    for i in 0..model.spheres() {
        let [v, w] = b.motion[i];
        b.position[i] += dt * v;
        b.orientation[i] = rotation::advance(dt * w, b.orientation[i]);
    }
    b.walls.place(model, end);
    timers.mark(Phase::Position);
    let mut closed = false;
    for pair in &mut work.pairs {
        let before = pair.closed;
        scratch
            .impacts
            .extend(pair.follow(model, elastic, &work.bodies, dt));
        closed |= pair.closed && !before;
    }
    if closed {
        check_laws(work)?;
        work.join_collisions(model, elastic, dt);
    }
    timers.mark(Phase::Meet);

    if loaded {
        // The second half is the mirror of the first: loads at the velocities after it, by two rounds of iteration.
        evaluated(scratch, work.load(model, end, 0.0))?;
        work.accelerate();
        evaluated(scratch, work.load(model, end, tau))?;
    }
    work.accelerate();
    accelerate(model, work, tau);
    for pair in work.pairs.iter_mut().filter(|p| p.closed) {
        pair.push(&mut work.bodies, tau);
    }
    for pair in work.pairs.iter_mut().rev().filter(|p| p.closed) {
        pair.dissipate_after(&mut work.bodies, model, elastic, tau);
    }
    timers.mark(Phase::Velocity);
    Ok(())
}

/// The loads' half of a kick.
fn accelerate(model: &Model, work: &mut Workspace, tau: f64) {
    let b = &mut work.bodies;
    for i in 0..model.spheres() {
        b.motion[i][0] += tau * b.smooth[i][0];
        b.motion[i][1] += tau * b.smooth[i][1];
    }
}

/// The deepest penetration of the step, not only that at its end: collisions are over by then.
fn observe(work: &Workspace, report: &mut StepReport) {
    for pair in work.pairs.iter().filter(|p| p.closed) {
        report.penetration = report.penetration.max(-pair.gap);
        report.penetration_relative = report.penetration_relative.max(-pair.gap / pair.length);
    }
}

/// Energies, and the step's impulses as contacts.
fn finish(
    model: &Model,
    scratch: &mut Scratch,
    work: &mut Workspace,
    elastic: &Elastic,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let (mut kinetic, mut potential) = (0.0, 0.0);
    for i in 0..model.spheres() {
        let [v, w] = work.bodies.motion[i];
        kinetic +=
            0.5 * (model.mass[i] * v.length_squared() + model.inertia[i] * w.length_squared());
        if work.present[i] {
            potential += weight_potential(model, i, work.bodies.position[i]);
        }
        let numbers = kinetic.is_finite() && potential.is_finite();
        if !(numbers && within_bounds(v, w)) {
            let touching = work.pairs.iter().filter(|p| p.closed).map(|p| (p.a, p.b));
            return Err(Failure::BlowUp(BlowUp::of(
                Level::Velocity,
                i as u32,
                v,
                touching,
            )));
        }
    }
    potential += work.potential;
    scratch.contacts.clear();
    for pair in &mut work.pairs {
        pair.end_step();
        potential += pair.energy(elastic);
        report.candidates += u32::from(pair.gap < CANDIDATE_MARGIN * pair.length);
        if let (true, Some(law)) = (pair.has_record(), pair.law) {
            scratch.contacts.push(pair.contact(law));
        }
    }
    report.energy_kinetic = kinetic;
    report.energy_potential = potential;
    report.contacts = scratch.contacts.len() as u32;
    let islands = &mut scratch.islands;
    islands.build(model.spheres(), &scratch.contacts, &[], |_| true);
    report.islands = islands.len() as u32;
    for island in 0..islands.len() {
        report.largest_island = report
            .largest_island
            .max(islands.island(island).contacts.len() as u32);
    }
    Ok(())
}

fn write_state(state: &mut State, work: &Workspace) {
    let b = &work.bodies;
    state.position.clone_from(&b.position);
    state.orientation.clone_from(&b.orientation);
    for (i, [v, w]) in b.motion[..state.position.len()].iter().enumerate() {
        state.velocity[i] = *v;
        state.angular_velocity[i] = *w;
    }
    state.touches.clear();
    state.touches.extend(work.touches());
}
