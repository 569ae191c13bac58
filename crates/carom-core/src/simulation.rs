//! A run: model, state, scratch and records together; halving of steps that fail, monitors, outcome.

mod failed;

use crate::cohesion;
use crate::deformation;
use crate::energy;
use crate::flow::exchange::exchange;
use crate::flow::Exchange;
use crate::force::total::own_force;
use crate::force::{Dependence, Load};
use crate::model::{InitialState, Model};
use crate::options::{Method, OnNonconvergence};
use crate::outcome::Failure;
use crate::problem::{Keeper, KeptProblem};
use crate::record::{Block, Recorder};
use crate::report::{Monitors, Outcome, StepReport};
use crate::scratch::Scratch;
use crate::state::State;
use crate::step::step;
use crate::stepper::method::{Step, Stepper};
use crate::stepper::{moreau, Coefficients, Span};
use crate::timers::{Phase, Timers};
use crate::wall::places::Walls;
use carom_geom::Overlap;
use carom_solve::team;
use glam::DVec3;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Fewest spheres of a system that is timed and checked against the clock in every step. More: a run of large steps overruns its time limit; fewer: the
/// clock costs small systems speed.
const LARGE: usize = 1000;
/// Rows of the step table that one call makes room for in advance. Memory and speed alone.
const ROWS: u64 = 8192;

/// What is recorded while advancing.
#[derive(Clone, Copy, Debug)]
pub struct Recording {
    /// Steps between frames; 0: none.
    pub frame_every: u64,
    pub contacts: bool,
}

pub struct Simulation {
    pub model: Model,
    pub state: State,
    pub recorder: Recorder,
    pub monitors: Monitors,
    pub timers: Timers,
    /// The problem that could not be solved.
    pub failed: Option<KeptProblem>,
    scratch: Scratch,
    stepper: Box<dyn Stepper>,
    /// Coefficients of h, h/2, h/4, ...
    coefficients: Vec<Coefficients>,
    /// `sum m |g| r`, J.
    static_scale: f64,
    /// Whether a load is a function of the user: it takes any time, and may fail anywhere in a step.
    opaque: bool,
}

impl Simulation {
    /// A run by a method of this crate.
    ///
    /// # Panics
    /// With methods `penalty` and `events`, which crates of their own have: `carom_penalty::simulation`, `carom_events::simulation`.
    pub fn new(model: Model, initial: InitialState) -> Simulation {
        let stepper: Box<dyn Stepper> = match model.options.method {
            Method::Nsga => Box::new(step),
            Method::MoreauJean => Box::new(moreau::step),
            Method::Penalty | Method::Events => panic!("this method is in a crate of its own"),
        };
        Simulation::with_stepper(model, initial, stepper)
    }

    /// A run by the given method.
    pub fn with_stepper(
        model: Model,
        initial: InitialState,
        stepper: Box<dyn Stepper>,
    ) -> Simulation {
        let state = State::new(&model, initial);
        let o = &model.options;
        let coefficients = (0..=o.deepest())
            .map(|depth| o.step / f64::from(1u32 << depth))
            .map(|h| match o.method {
                // What has no step of this kind needs h alone.
                Method::Nsga | Method::Penalty | Method::Events => {
                    Coefficients::new(o.spectral_radius, h)
                }
                Method::MoreauJean => Coefficients::theta_rule(o.theta, h),
            })
            .collect();
        let mut scratch = Scratch::new(&model);
        let mut recorder = Recorder::new(&model);
        let (mut first, mut state) = (Exchange::default(), state);
        if !model.flow.is_none() {
            scratch.walls.place(&model, 0.0);
            first = exchange(&model, &mut state, &scratch.walls, (0, 0.0));
            recorder.block.events.append(&mut first.events);
        }
        let mut static_scale = 0.0;
        let displaced = &state.position[model.first_wall()..];
        for i in 0..model.bodies() {
            let pull = match model.free_wall(i) {
                Some(_) => own_force(&model, displaced, i, 0.0).length(),
                None => model.mass[i] * model.gravity.length(),
            };
            static_scale += pull * model.radius[i];
        }
        let calls = |load: &Arc<dyn Load>| load.dependence() == Dependence::Opaque;
        let mut made = Simulation {
            opaque: model.loads.iter().any(calls),
            scratch,
            stepper,
            monitors: Monitors::default(),
            recorder,
            timers: Timers::default(),
            failed: None,
            coefficients,
            static_scale,
            state,
            model,
        };
        made.begin_totals();
        made.monitors.entered = u64::from(first.entered);
        made.monitors.removed = u64::from(first.removed);
        made
    }

    /// Begins all totals anew, with the energy of the present state.
    pub fn begin_totals(&mut self) {
        let time = self.time();
        let [kinetic, weight] = energy::total(&self.model, &self.state, time);
        let (model, scratch) = (&self.model, &mut self.scratch);
        let cohesive = cohesion::first_potential(model, &self.state, scratch, time);
        let stored = self.stepper.stored(model, &self.state, scratch, time);
        let potential = weight + cohesive + stored;
        self.monitors = Monitors::new(kinetic, potential, self.static_scale);
    }

    /// Time of the present state, s: step number times h, free of drift.
    pub fn time(&self) -> f64 {
        self.state.step as f64 * self.model.options.step
    }

    /// Advances by up to `steps` steps, or until `wall_limit` has passed.
    pub fn advance(
        &mut self,
        steps: u64,
        recording: Recording,
        wall_limit: Duration,
    ) -> Option<Outcome> {
        // Small scenes have no team often enough to be worth a change of threads.
        let threads = if self.model.bodies() >= LARGE {
            self.model.options.threads as usize
        } else {
            1
        };
        team::within(threads, || self.advance_here(steps, recording, wall_limit))
    }

    fn advance_here(
        &mut self,
        steps: u64,
        recording: Recording,
        wall_limit: Duration,
    ) -> Option<Outcome> {
        let begin = Instant::now();
        let large = self.model.bodies() >= LARGE;
        // A step in hundreds of substeps takes as long as hundreds of others, and one that calls the user as long as it likes.
        let long_steps = self.stepper.divides_steps() || self.opaque;
        let check_every = if large || long_steps {
            1
        } else {
            (LARGE / self.model.bodies()).max(1) as u64
        };
        // The rows of short calls at once, of long ones by doubling.
        self.recorder.block.steps.reserve(steps.min(ROWS) as usize);
        for done in 1..=steps {
            self.timers.start(large);
            if let Err(failure) = self.one_step(recording) {
                return Some(self.outcome(failure));
            }
            self.timers.mark(Phase::Record);
            // A step that needed its fallbacks may have taken as long as thousands of others.
            let slow = self
                .recorder
                .block
                .steps
                .last()
                .is_some_and(|r| r.fallbacks + r.halvings + r.substeps > 0);
            if (slow || done % check_every == 0) && begin.elapsed() >= wall_limit {
                break;
            }
        }
        None
    }

    /// At most `cap` of the pairs that overlap by more than `tolerance r_c` in the present state, walls where they are now.
    pub fn overlaps(&self, tolerance: f64, cap: usize) -> Vec<Overlap> {
        let mut walls = Walls::new(&self.model);
        walls.place(&self.model, self.time());
        let state = &self.state;
        let radius = &self.model.radius[..self.model.balls()];
        // What is not there overlaps nothing.
        let balls = self.model.balls();
        walls.place_free(
            &self.model,
            Some(&state.position[self.model.first_wall()..]),
        );
        let places: Vec<DVec3> = (0..balls).map(|i| state.seen(i)).collect();
        let periodic = &walls.periodic.now;
        let meshes = self.model.mesh_spans();
        let mut found = carom_geom::overlaps(
            &places, radius, &walls.now, meshes, periodic, tolerance, cap,
        );
        // Balls of one clump may lie in one another.
        let clump = |body: u32| self.model.clump_of(body);
        found.retain(|o| clump(o.a).is_none() || clump(o.a) != clump(o.b));
        for wall in found.iter_mut().filter(|o| o.b as usize >= balls) {
            wall.b += self.model.clumps.len() as u32;
        }
        found
    }

    /// Which contact problems are kept, and those that were.
    pub fn keeper(&mut self) -> &mut Keeper {
        &mut self.scratch.keeper
    }

    /// Takes the records collected so far.
    pub fn take_block(&mut self) -> Block {
        std::mem::take(&mut self.recorder.block)
    }

    /// A frame of the present state, alone in a block.
    pub fn frame(&self) -> Block {
        let mut alone = Recorder::default();
        alone.add_frame(&self.model, &self.state, self.time());
        alone.block
    }

    fn one_step(&mut self, recording: Recording) -> Result<(), Failure> {
        let number = self.state.step + 1;
        let time = number as f64 * self.model.options.step;
        let mut report = StepReport::new(number, time);
        self.scratch.keeper.begin_step(number, time);
        let before = self.opaque.then(|| self.state.clone());
        if let Err(failure) = self.attempt(0, self.time(), recording, &mut report) {
            if let Some(before) = before {
                self.state = before;
            }
            if let Failure::BlowUp(what) = failure {
                self.keep_blow_up(what, recording);
            }
            return Err(failure);
        }
        // A problem that was solved in another way, or by the halves of the step, is no failure.
        if report.unconverged == 0 {
            (self.failed, self.scratch.keeper.failed) = (None, None);
        }
        self.state.step = number;
        let of_box = deformation::turn_flow(&self.model, &mut self.state, number);
        report.energy_work += of_box;
        report.energy_kinetic += of_box;
        let left = std::mem::take(&mut self.scratch.left);
        if !self.model.flow.is_none() {
            let walls = &mut self.scratch.walls;
            walls.place(&self.model, time);
            let mut at_end = exchange(&self.model, &mut self.state, walls, (number, time));
            at_end.follow(left);
            if at_end.removed + at_end.entered > 0 {
                self.sum_anew(&mut report, &mut at_end)?;
            }
            self.recorder.block.events.append(&mut at_end.events);
            report.add_exchange(&at_end);
        }
        let (velocity, radius) = (&self.state.velocity[..], &self.model.radius[..]);
        let fastest = |_, (v, r): (&[DVec3], &[f64])| {
            v.iter()
                .zip(r)
                .map(|(v, r)| v.length_squared() / (r * r))
                .fold(0.0, team::larger)
        };
        let threads = self.model.options.threads as usize;
        let whole = (velocity, radius);
        let travel = team::reduce(threads, velocity.len(), whole, fastest, team::larger).sqrt();
        let h = self.model.options.step;
        let floor = self.static_scale + 0.5 * h * h * self.scratch.smooth.pushed;
        self.monitors.add(&report, floor, travel * h);
        self.recorder.block.steps.push(report);
        if recording.frame_every > 0 && number % recording.frame_every == 0 {
            self.recorder.add_frame(&self.model, &self.state, time);
        }
        Ok(())
    }

    /// Energies of what is there after an exchange: sums, for a difference would have the rounding of all that left.
    fn sum_anew(&mut self, report: &mut StepReport, at_end: &mut Exchange) -> Result<(), Failure> {
        let (model, state, scratch) = (&self.model, &self.state, &mut self.scratch);
        let [kinetic, mut potential] = energy::total(model, state, report.time);
        for &((a, b), elastic) in &scratch.elastic {
            // A contact with what leaves ends, and its energy is gone.
            match [a, b]
                .iter()
                .all(|&i| state.present.get(i as usize) != Some(&false))
            {
                true => potential += elastic,
                false => at_end.energy_out[1] += elastic,
            }
        }
        if model.cohesive_reach() > 0.0 {
            // What leaves takes its attraction along, and what enters brings its own.
            let rest = cohesion::listed_potential(model, state, scratch)?;
            let taken = scratch.attraction - rest;
            match at_end.removed {
                0 => at_end.energy_in[1] -= taken,
                _ => at_end.energy_out[1] += taken,
            }
            potential += rest;
        }
        (report.energy_kinetic, report.energy_potential) = (kinetic, potential);
        Ok(())
    }

    /// One step of size h / 2^depth from `t`; on failure two of half the size, down to the limit. The state is
    /// restored if the halves fail too.
    fn attempt(
        &mut self,
        depth: u32,
        t: f64,
        recording: Recording,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        let options = &self.model.options;
        let smallest = depth >= options.max_halvings;
        let last = depth == options.deepest();
        // Where a smallest part was not solved, whatever is left of the step is made in parts as small: larger ones would be
        // tried in vain, each with all its fallbacks.
        if report.unconverged > 0 && !smallest {
            report.halvings += 1;
            return self.halves(depth + 1, t, recording, report);
        }
        self.scratch.keeper.part += u32::from(depth > 0);
        let (coefficients, accept) = (
            &self.coefficients[depth as usize],
            options.on_nonconvergence,
        );
        let span = Span {
            smallest,
            ..Span::new(t, coefficients.h)
        };
        let (number, time) = (report.step, report.time);
        // A whole step tells of itself, a part of one beside what the others told.
        let mut part = StepReport::new(number, time);
        let made = self.stepper.step(&mut Step {
            model: &self.model,
            state: &mut self.state,
            scratch: &mut self.scratch,
            timers: &mut self.timers,
            report: if depth == 0 { report } else { &mut part },
            coefficients,
            span,
            accept_unconverged: smallest && accept == OnNonconvergence::Warn,
        });
        if depth == 0 && made.is_err() {
            *report = StepReport::new(number, time);
        }
        match made {
            Ok(()) => {
                if depth > 0 {
                    report.add_part(part);
                }
                self.recorder
                    .add_step(&self.scratch, number, time, recording.contacts);
                Ok(())
            }
            Err(Failure::NotConverged(level)) => {
                self.failed = self.scratch.keeper.failed.take();
                self.scratch.keeper.discard(None);
                if last {
                    return Err(Failure::NotConverged(level));
                }
                report.halvings += 1;
                // The run would stop here if whoever runs it had asked for so many halvings and no more.
                report.fallbacks += u32::from(smallest);
                self.halves(depth + 1, t, recording, report)
            }
            // A list that is too long for its needs: those of a shorter step are less.
            Err(Failure::TooFar { .. } | Failure::TooManyPairs)
                if !smallest && !self.stepper.divides_steps() =>
            {
                let half = self.coefficients[depth as usize + 1].h;
                // One part becomes two.
                let parts = if report.substeps == 0 { 2 } else { 1 };
                report.take_substeps(parts, half);
                self.halves(depth + 1, t, recording, report)
            }
            Err(other) => Err(other),
        }
    }

    /// Two steps of size h / 2^depth from `t`.
    fn halves(
        &mut self,
        depth: u32,
        t: f64,
        recording: Recording,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        let (state, mark) = (self.state.clone(), self.recorder.mark());
        let half = self.coefficients[depth as usize].h;
        let made = self
            .attempt(depth, t, recording, report)
            .and_then(|()| self.attempt(depth, t + half, recording, report));
        if made.is_err() {
            self.state = state;
            self.recorder.rewind(mark);
        }
        made
    }
}
