//! One step of the run's grid in substeps: the counterpart of [`carom_core::step::step`] for contact forces.
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

use crate::limit::load_limit;
use crate::method::Penalty;
use carom_core::contact::CANDIDATE_MARGIN;
use carom_core::force::evaluated;
use carom_core::force::total::weight_potential;
use carom_core::outcome::{within_bounds, BlowUp, Failure, Level};
use carom_core::rotation;
use carom_core::scratch::Scratch;
use carom_core::stepper::method::{Step, Stepper};
use carom_core::stepper::Span;
use carom_core::timers::{Phase, Timers};
use carom_core::{Model, State, StepReport};
use carom_geom::NeighbourList;
use glam::DVec3;

/// Substeps of a step at most: no input may make a step endless. A tenth would refuse stiff contacts in long steps; with ten
/// times more such a step of a few balls takes tens of seconds, and no callback or time limit is looked at in it.
const MAX_SUBSTEPS: u32 = 1_000_000;

impl Stepper for Penalty {
    fn step(&mut self, on: &mut Step) -> Result<(), Failure> {
        let (model, span) = (on.model, on.span);
        let (scratch, timers, report) = (&mut *on.scratch, &mut *on.timers, &mut *on.report);
        scratch.begin_step();
        self.begin(model, on.state, scratch, report, span)?;
        timers.mark(Phase::Predict);
        self.accelerate();
        let mut left = span.h;
        while left > 0.0 {
            let (dt, last) = self.choose(model, &mut scratch.neighbours, left)?;
            timers.mark(Phase::Broad);
            report.take_substeps(1, dt);
            if report.substeps > MAX_SUBSTEPS {
                return Err(Failure::TooManySubsteps);
            }
            left = if last { 0.0 } else { left - dt };
            let power = self.power;
            let end = span.start + (span.h - left);
            self.substep(model, scratch, timers, end, dt)?;
            report.energy_work += 0.5 * dt * (power + self.power);
            // The deepest penetration of the step, not only that at its end: collisions are over by then.
            for pair in self.pairs.iter().filter(|p| p.closed) {
                report.penetration = report.penetration.max(-pair.gap);
                report.penetration_relative =
                    report.penetration_relative.max(-pair.gap / pair.length);
            }
        }
        self.finish(model, scratch, report)?;
        self.write_state(on.state);
        timers.mark(Phase::Finish);
        Ok(())
    }

    fn divides_steps(&self) -> bool {
        true
    }

    fn stored(&mut self, model: &Model, state: &State, scratch: &mut Scratch, time: f64) -> f64 {
        match self.begin_contacts(model, state, scratch, Span::new(time, 0.0)) {
            Ok(taken) => {
                let pairs = self.pairs.iter();
                taken + (pairs.map(|pair| pair.energy(&self.laws.elastic))).sum::<f64>()
            }
            Err(_) => 0.0,
        }
    }
}

impl Penalty {
    /// Takes over the state, and what walls and loads are at its time.
    fn begin(
        &mut self,
        model: &Model,
        state: &State,
        scratch: &mut Scratch,
        report: &mut StepReport,
        span: Span,
    ) -> Result<(), Failure> {
        scratch.wall_impulse.fill([DVec3::ZERO; 2]);
        report.energy_out += self.begin_contacts(model, state, scratch, span)?;
        let loads = self.load(model, span.start, 0.0);
        evaluated(loads, &mut scratch.load_error)?;
        self.load_limit = load_limit(model, state, span.start);
        Ok(())
    }

    /// The bodies and their pairs. Returns what contacts stored whose walls have just been taken away, J.
    fn begin_contacts(
        &mut self,
        model: &Model,
        state: &State,
        scratch: &mut Scratch,
        span: Span,
    ) -> Result<f64, Failure> {
        let walls = self.bodies.walls.begin(model, span);
        evaluated(walls, &mut scratch.load_error)?;
        self.bodies.walls.place(model, span.start);
        self.take_state(model, state);
        let (elastic, bodies) = (&self.laws.elastic, &self.bodies);
        let taken = self.pairs.iter().map(|p| p.taken(model, elastic, bodies));
        let taken = taken.sum();
        self.set_needs(model, |_, _| 0.0);
        self.refresh(model, &mut scratch.neighbours)?;
        self.take_pairs(model, scratch.neighbours.pairs());
        self.check_laws(model)?;
        Ok(taken)
    }

    /// The next substep, and whether it ends the step: what is left in equal parts, none longer than any pair admits.
    ///
    /// Pairs that are not listed admit it too: after `refresh` they are farther apart than their bodies travel in it. So it
    /// is a function of the state alone, and a resumed run with a fresh list takes the same.
    fn choose(
        &mut self,
        model: &Model,
        list: &mut NeighbourList,
        left: f64,
    ) -> Result<(f64, bool), Failure> {
        let mut limit = self.longest(model, left);
        self.set_needs(model, |bodies, i| {
            let travel = bodies.motion[i][0].length() + bodies.acceleration[i].length() * limit;
            (travel + bodies.walls.speed_at(bodies.position[i])) * limit
        });
        if self.refresh(model, list)? {
            limit = self.longest(model, left);
        }
        let parts = (left / limit).ceil();
        if parts <= 1.0 {
            return Ok((left, true));
        }
        Ok((left / parts, false))
    }

    fn longest(&self, model: &Model, left: f64) -> f64 {
        let start = left.min(self.load_limit);
        self.pairs.iter().fold(start, |shortest, pair| {
            shortest.min(pair.longest_substep(&self.laws, &self.bodies, model, shortest, start))
        })
    }

    /// Brings the list up to the needs, and the pairs up to the list. True: they changed.
    fn refresh(&mut self, model: &Model, list: &mut NeighbourList) -> Result<bool, Failure> {
        let x = &self.bodies.position;
        let walls = &self.bodies.walls.now;
        let rebuilt = list.refresh(x, &model.radius, walls, &self.need);
        if list.is_truncated() {
            return Err(Failure::TooManyPairs);
        }
        if rebuilt {
            self.take_pairs(model, list.pairs());
            self.check_laws(model)?;
        }
        Ok(rebuilt)
    }

    /// What is closed has a law, whose restitution is one.
    fn check_laws(&self, model: &Model) -> Result<(), Failure> {
        for pair in self.pairs.iter().filter(|p| p.closed) {
            let Some(law) = pair.law else {
                return Err(Failure::MissingLaw(pair.a, pair.b));
            };
            if pair.constants.varies {
                model.laws[law as usize].check_restitution(pair.key(), pair.damped_at)?;
            }
        }
        Ok(())
    }

    fn substep(
        &mut self,
        model: &Model,
        scratch: &mut Scratch,
        timers: &mut Timers,
        end: f64,
        dt: f64,
    ) -> Result<(), Failure> {
        let tau = 0.5 * dt;
        let loaded = !model.loads.is_empty();
        let elastic = self.laws.elastic;
        for pair in self.pairs.iter_mut().filter(|p| p.closed) {
            pair.dissipate(&mut self.bodies, model, &elastic, tau, true)?;
        }
        if loaded {
            evaluated(self.load(model, end - dt, 0.0), &mut scratch.load_error)?;
        }
        // The elastic and the loads' half of a kick commute; their mirrored order gives each its exact work.
        self.kick_by_contacts(tau);
        self.kick_by_loads(model, tau);
        timers.mark(Phase::Velocity);

        self.drift(model, end, dt);
        timers.mark(Phase::Position);
        let mut closed = false;
        for pair in &mut self.pairs {
            pair.follow(model, &elastic, &self.bodies, dt);
        }
        self.cover(model);
        for pair in &mut self.pairs {
            let before = pair.closed;
            let collision = pair.open_or_close(model, &elastic, &self.bodies, dt);
            scratch.impacts.extend(collision);
            closed |= pair.closed && !before;
        }
        if closed {
            self.check_laws(model)?;
            self.join_collisions(model, dt);
        }
        timers.mark(Phase::Meet);

        if loaded {
            // The second half is the mirror of the first: loads at the velocities after it, by two rounds of iteration.
            let said = &mut scratch.load_error;
            evaluated(self.load(model, end, 0.0), said)?;
            self.accelerate();
            evaluated(self.load(model, end, tau), said)?;
        }
        self.accelerate();
        self.kick_by_loads(model, tau);
        self.kick_by_contacts(tau);
        for pair in self.pairs.iter_mut().rev().filter(|p| p.closed) {
            pair.dissipate(&mut self.bodies, model, &elastic, tau, false)?;
        }
        timers.mark(Phase::Velocity);
        Ok(())
    }

    fn kick_by_contacts(&mut self, tau: f64) {
        for pair in self.pairs.iter_mut().filter(|p| p.closed) {
            pair.push(&mut self.bodies, tau);
        }
    }

    fn kick_by_loads(&mut self, model: &Model, tau: f64) {
        let b = &mut self.bodies;
        for i in 0..model.bodies() {
            b.motion[i][0] += tau * b.smooth[i][0];
            b.motion[i][1] += tau * b.smooth[i][1];
        }
    }

    /// Moves spheres over `dt`, and walls to its `end`.
    fn drift(&mut self, model: &Model, end: f64, dt: f64) {
        let b = &mut self.bodies;
        for i in 0..model.bodies() {
            let [v, w] = b.motion[i];
            b.position[i] += dt * v;
            b.orientation[i] = rotation::advance(dt * w, b.orientation[i]);
        }
        b.walls.place(model, end);
    }

    /// Energies, and the step's impulses as contacts.
    fn finish(
        &mut self,
        model: &Model,
        scratch: &mut Scratch,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        let (kinetic, mut potential) = self.energies(model)?;
        potential += self.potential;
        scratch.smooth.pushed = self.pushed;
        scratch.contacts.clear();
        scratch.elastic.clear();
        for pair in &mut self.pairs {
            pair.end_step();
            if pair.closed {
                let elastic = pair.energy(&self.laws.elastic);
                potential += elastic;
                scratch.elastic.push((pair.key(), elastic));
            }
            report.candidates += u32::from(pair.gap < CANDIDATE_MARGIN * pair.length);
            if let (true, Some(law)) = (pair.has_record(), pair.law) {
                scratch.contacts.push(pair.contact(law));
            }
        }
        report.energy_kinetic = kinetic;
        report.energy_potential = potential;
        let (islands, contacts) = (&mut scratch.islands, &scratch.contacts);
        islands.build(model, contacts, &[], |_| true);
        report.count(islands);
        if model.record_walls {
            for pair in &self.pairs {
                if pair.b as usize >= model.bodies() {
                    let on_wall = &mut scratch.wall_impulse[model.wall(pair.b).given as usize];
                    on_wall[0] -= pair.step.impulse;
                    on_wall[1] += pair.wall_moment;
                }
                report.energy_work += pair.driven_work;
            }
        }
        Ok(())
    }

    /// Kinetic energy and that of the weights, J.
    fn energies(&self, model: &Model) -> Result<(f64, f64), Failure> {
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for i in 0..model.bodies() {
            let [v, w] = self.bodies.motion[i];
            kinetic += model.kinetic(i, v, w);
            if self.present[i] {
                potential += weight_potential(model, i, self.bodies.position[i]);
            }
            let numbers = kinetic.is_finite() && potential.is_finite();
            if !(numbers && within_bounds(v, w)) {
                let touching = self.pairs.iter().filter(|p| p.closed).map(|p| (p.a, p.b));
                let what = BlowUp::of(Level::Velocity, i as u32, v, touching);
                return Err(Failure::BlowUp(what));
            }
        }
        Ok((kinetic, potential))
    }
}
