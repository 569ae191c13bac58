//! The loop over events: from one report to the next, each ball as its closed form has it until something happens to it.

use crate::check::is_level;
use crate::foresee::{Foresight, FLIGHT};
use crate::motion::{Motion, Support};
use crate::queue::{Event, Queue, What};
use crate::sums::Sums;
use carom_core::contact::ContactKey;
use carom_core::flow::exchange::take_out;
use carom_core::force::total::weight_potential;
use carom_core::moment::impact;
use carom_core::outcome::{within_bounds, BlowUp, Failure, Level, Open};
use carom_core::rotation;
use carom_core::scratch::Scratch;
use carom_core::step::{Attempt, Stepper};
use carom_core::stepper::Span;
use carom_core::timers::{Phase, Timers};
use carom_core::{Model, State, StepReport};
use glam::DVec3;

/// Gap over the smaller radius (1) up to which contacts join the group of an impact.
const JOINS: f64 = 1e-9;
/// Events in a step at most: so many, and so many more for each second of it. Fewer: breaks of many balls are refused; more: it takes long to say that impacts
/// follow one another without end.
const MOST_EVENTS: [f64; 2] = [1e5, 1e6];
/// Steps (1) of the place at which a surface is asked for: a share of the radius ahead, so that a ball at its edge has left it.
const AHEAD: f64 = 1e-9;

/// Method `events`. Nothing here outlives a step.
#[derive(Default)]
pub struct Events {
    motions: Vec<Motion>,
    queue: Queue,
    sums: Sums,
    group: Vec<usize>,
    touching: Vec<ContactKey>,
}

impl Stepper for Events {
    fn step(
        &mut self,
        model: &Model,
        state: &mut State,
        scratch: &mut Scratch,
        timers: &mut Timers,
        attempt: &Attempt,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        let kept = state.clone();
        scratch.begin_step();
        scratch.wall_impulse.fill([DVec3::ZERO; 2]);
        let span = Span::new(attempt.time, attempt.coefficients.h);
        let mut run = Run {
            model,
            state,
            scratch,
            report,
            events: self,
            span,
            fastest: 0.0,
        };
        let made = run.all();
        if made.is_err() {
            *state = kept;
        }
        timers.mark(Phase::Velocity);
        made
    }

    fn divides_steps(&self) -> bool {
        true
    }
}

/// One step.
struct Run<'a> {
    model: &'a Model,
    state: &'a mut State,
    scratch: &'a mut Scratch,
    report: &'a mut StepReport,
    events: &'a mut Events,
    span: Span,
    /// Fastest speed at the start, m/s.
    fastest: f64,
}

impl Run<'_> {
    fn all(&mut self) -> Result<(), Failure> {
        self.begin()?;
        let h = self.span.h;
        let most = (MOST_EVENTS[0] + MOST_EVENTS[1] * h) as u32;
        let (mut events, mut last, mut shortest) = (0, 0.0, h);
        while let Some(event) = self.events.queue.next(h) {
            if events == most {
                return Err(Failure::TooManyEvents(event.bodies.0, event.bodies.1));
            }
            events += 1;
            shortest = f64::min(shortest, event.time - last);
            last = event.time;
            self.happens(&event)?;
        }
        if events > 0 {
            let parts = events + 1;
            self.report.take_substeps(parts, shortest.min(h - last));
        }
        self.end()
    }

    fn begin(&mut self) -> Result<(), Failure> {
        let n = self.model.spheres();
        let speed = |i: usize| {
            self.state.velocity[i].length()
                + self.model.radius[i] * self.state.angular_velocity[i].length()
        };
        self.fastest = (0..n).map(speed).fold(0.0, f64::max);
        self.events.sums.clear();
        self.events.queue.begin(n);
        self.events.motions.clear();
        self.events.motions.resize(n, Motion::default());
        for i in 0..n {
            self.set_off(i, 0.0, self.support(i))?;
        }
        for i in 0..n {
            if self.state.present[i] {
                self.foresee(i, 0.0, |j| j > i);
            }
        }
        Ok(())
    }

    fn foresee(&mut self, i: usize, now: f64, with: impl Fn(usize) -> bool) {
        let foresight = Foresight {
            model: self.model,
            state: self.state,
            motions: &self.events.motions,
            now,
            end: self.span.h,
            fastest: self.fastest,
        };
        foresight.ball(i, with, &mut self.events.queue);
    }

    /// The motion of ball `i` from its state at `now` on: on a surface with a gap (m) to it, or through the air.
    fn set_off(&mut self, i: usize, now: f64, on: Option<(Support, f64)>) -> Result<(), Failure> {
        let (x, [v, w]) = (
            self.state.position[i],
            [self.state.velocity[i], self.state.angular_velocity[i]],
        );
        let g = match self.state.present[i] {
            true => self.model.gravity,
            false => DVec3::ZERO,
        };
        let mut motion = Motion::flight(now, x, [v, w], g);
        if let Some((support, gap)) = on {
            let x = x - gap * support.normal;
            let rises = support.normal.dot(v);
            if rises != 0.0 {
                let impulse = -self.model.mass[i] * rises;
                self.events.sums.add_rest(i, &support, impulse);
            }
            let supported = Motion::supported(self.model, i, support, now, x, [v, w]);
            motion = supported.map_err(|why| Failure::NoClosedForm {
                bodies: (i as u32, support.wall),
                why,
            })?;
        }
        self.events.motions[i] = motion;
        Ok(())
    }

    /// The level surface that carries ball `i` in its present state, and the gap (m) to it.
    fn support(&self, i: usize) -> Option<(Support, f64)> {
        let (model, x, v) = (self.model, self.state.position[i], self.state.velocity[i]);
        let r = model.radius[i];
        if !self.state.present[i] {
            return None;
        }
        let ahead = x + AHEAD * r * v.normalize_or_zero();
        let walls = model.walls.iter().enumerate();
        walls.into_iter().find_map(|(w, wall)| {
            if wall.shape.clearance(x, r) > JOINS * r {
                return None;
            }
            let met = wall.shape.meet(x, r)?;
            let n = met.normal;
            let g = -model.gravity.dot(n);
            // What comes down meets it first; what has hardly left it has not.
            let rises = v.dot(n);
            let stays = 2.0 * rises <= FLIGHT * g && rises >= -self.nothing(r).speed;
            let flat = wall.shape.meet(ahead, r)?.curvature == 0.0 && met.curvature == 0.0;
            if !(g > 0.0 && is_level(n, model.gravity) && stays && flat) {
                return None;
            }
            let (wall, law) = (
                (model.spheres() + w) as u32,
                model.law_of(i, model.spheres() + w)?,
            );
            let support = Support {
                wall,
                normal: n,
                g,
                law,
            };
            Some((support, met.gap))
        })
    }

    fn nothing(&self, r: f64) -> crate::meet::Nothing {
        crate::foresee::nothing(self.model, self.fastest, r)
    }

    fn happens(&mut self, event: &Event) -> Result<(), Failure> {
        let ((a, b), t) = (event.bodies, event.time);
        let i = a as usize;
        match event.what {
            What::Press => Err(Failure::NoClosedForm {
                bodies: event.bodies,
                why: Open::Presses,
            }),
            What::Change => {
                self.bring(i, t);
                let motion = &self.events.motions[i];
                let ([v, w], on) = (motion.at_end(self.model.radius[i]), motion.support);
                (self.state.velocity[i], self.state.angular_velocity[i]) = (v, w);
                self.events.queue.forget(i);
                self.set_off(i, t, on.map(|support| (support, 0.0)))?;
                self.foresee(i, t, |_| true);
                Ok(())
            }
            What::Edge => {
                self.bring(i, t);
                self.go_on(&[i], t)
            }
            What::Leave => {
                self.bring(i, t);
                let at = (self.state.step + 1, self.span.start + t);
                let left = &mut self.scratch.left;
                let (events, exchange) = (&mut left.events, &mut left.exchange);
                take_out(self.model, self.state, i, at, events, exchange);
                self.events.queue.forget(i);
                self.set_off(i, t, None)
            }
            What::Meet => self.meet((a, b), t),
        }
    }

    /// Balls in a new state set off, and what will happen to them is foreseen anew.
    fn go_on(&mut self, balls: &[usize], t: f64) -> Result<(), Failure> {
        for &i in balls {
            self.events.queue.forget(i);
            self.set_off(i, t, self.support(i))?;
        }
        for (k, &i) in balls.iter().enumerate() {
            self.foresee(i, t, |j| !balls[..k].contains(&j));
        }
        Ok(())
    }

    /// Writes the state of ball `i` at a time, and what carried it until then.
    fn bring(&mut self, i: usize, t: f64) {
        let motion = self.events.motions[i];
        let given = self.events.sums.add_support(self.model, i, &motion, t);
        if let (true, Some(support)) = (self.model.record_walls, motion.support) {
            // Forces that do not vary, along a parabola: Simpson's rule is exact.
            let wall = support.wall as usize - self.model.spheres();
            let lever = |t| {
                motion.place(t)
                    - self.model.walls[wall].shape.place()
                    - self.model.radius[i] * support.normal
            };
            let middle = 0.5 * (motion.start + t);
            let mean = (lever(motion.start) + 4.0 * lever(middle) + lever(t)) / 6.0;
            let out = &mut self.scratch.wall_impulse[wall];
            out[0] -= given.impulse;
            out[1] -= mean.cross(given.impulse) + given.moment;
        }
        let state = &mut *self.state;
        state.position[i] = motion.place(t);
        [state.velocity[i], state.angular_velocity[i]] = motion.velocities(t);
        if motion.w[0] != DVec3::ZERO || motion.w[1] != DVec3::ZERO {
            for turn in motion.turns(motion.start, t) {
                state.orientation[i] = rotation::advance(turn, state.orientation[i]);
            }
        }
    }

    /// An impact: of all bodies that touch, from these two on.
    fn meet(&mut self, pair: ContactKey, t: f64) -> Result<(), Failure> {
        self.gather(pair, t);
        let group = std::mem::take(&mut self.events.group);
        for &i in &group {
            self.bring(i, t);
        }
        let before = self.scratch.impacts.len();
        let motions = &self.events.motions;
        impact(
            self.model,
            self.state,
            self.scratch,
            &self.events.touching,
            self.span.start + t,
            |i| motions[i].support.map(|s| s.wall),
            self.report,
        )?;
        for i in &group {
            let (v, w) = (self.state.velocity[*i], self.state.angular_velocity[*i]);
            if !within_bounds(v, w) {
                let touching = self.events.touching.iter().copied();
                let what = BlowUp::of(Level::Velocity, *i as u32, v, touching);
                return Err(Failure::BlowUp(what));
            }
        }
        let Scratch {
            impacts,
            impact_times,
            contacts,
            walls,
            wall_impulse,
            ..
        } = &mut *self.scratch;
        impact_times.resize(before, self.span.start + t);
        impact_times.resize(impacts.len(), self.span.start + t);
        self.events.sums.add_impact(contacts);
        if self.model.record_walls {
            walls.collect(
                self.model,
                self.state,
                &self.state.position,
                contacts,
                wall_impulse,
            );
        }
        let went_on = self.go_on(&group, t);
        self.events.group = group;
        went_on
    }

    /// Which balls have a part in an impact, and all contacts of theirs, by their keys.
    fn gather(&mut self, (a, b): ContactKey, t: f64) {
        let (model, n) = (self.model, self.model.spheres());
        let Events {
            motions,
            group,
            touching,
            ..
        } = &mut *self.events;
        group.clear();
        touching.clear();
        touching.push((a, b));
        group.push(a as usize);
        if (b as usize) < n {
            group.push(b as usize);
        }
        let mut next = 0;
        while let Some(&i) = group.get(next) {
            next += 1;
            let (x, r) = (motions[i].place(t), model.radius[i]);
            for (w, wall) in model.walls.iter().enumerate() {
                let joins = wall.shape.clearance(x, r) <= JOINS * r
                    && wall.shape.meet(x, r).is_some_and(|p| p.gap <= JOINS * r);
                if joins && model.law_of(i, n + w).is_some() {
                    touching.push((i as u32, (n + w) as u32));
                }
            }
            for j in (0..n).filter(|&j| j != i && self.state.present[j]) {
                let (reach, s) = (r + model.radius[j], model.radius[j]);
                let d = motions[j].place(t) - x;
                let joins = reach + JOINS * r.min(s);
                if d.length_squared() <= joins * joins && model.law_of(i, j).is_some() {
                    touching.push((i.min(j) as u32, i.max(j) as u32));
                    if !group.contains(&j) {
                        group.push(j);
                    }
                }
            }
        }
        touching.sort_unstable();
        touching.dedup();
        group.sort_unstable();
    }

    /// The state at the end of the step, energies and overlaps.
    fn end(&mut self) -> Result<(), Failure> {
        let (model, n, h) = (self.model, self.model.spheres(), self.span.h);
        for i in 0..n {
            if self.state.present[i] {
                self.bring(i, h);
            }
        }
        let impacts = self.scratch.impacts.len();
        self.scratch.impact_times.resize(impacts, self.span.end);
        self.scratch.warm.clear();
        self.state.warm.clear();
        self.events
            .sums
            .hand_over(model, self.state, &mut self.scratch.contacts);
        let Scratch {
            islands, contacts, ..
        } = &mut *self.scratch;
        islands.build(n, contacts, &[], |_| true);
        let (state, report) = (&*self.state, &mut *self.report);
        report.candidates = contacts.len() as u32;
        report.contacts = contacts.len() as u32;
        report.islands = islands.len() as u32;
        report.largest_island = islands.sizes().max().unwrap_or(0);
        let [mut kinetic, mut potential] = self.scratch.left.exchange.energy_out;
        for i in 0..n {
            let (v, w) = (state.velocity[i], state.angular_velocity[i]);
            kinetic +=
                0.5 * (model.mass[i] * v.length_squared() + model.inertia[i] * w.length_squared());
            if state.present[i] {
                potential += weight_potential(model, i, state.position[i]);
            }
            if !within_bounds(v, w) || !state.position[i].is_finite() {
                return Err(Failure::BlowUp(BlowUp::alone(Level::Velocity, i as u32)));
            }
        }
        (report.energy_kinetic, report.energy_potential) = (kinetic, potential);
        let deepest = |gap: f64, length: f64, report: &mut StepReport| {
            report.penetration = report.penetration.max(-gap);
            report.penetration_relative = report.penetration_relative.max(-gap / length);
        };
        for i in (0..n).filter(|&i| state.present[i]) {
            let (x, r) = (state.position[i], model.radius[i]);
            for wall in &model.walls {
                if wall.shape.clearance(x, r) < 0.0 {
                    let gap = wall.shape.meet(x, r).map_or(0.0, |p| p.gap);
                    deepest(gap, r, report);
                }
            }
            for j in (i + 1..n).filter(|&j| state.present[j]) {
                let gap = (x - state.position[j]).length() - r - model.radius[j];
                deepest(gap, r.min(model.radius[j]), report);
            }
        }
        Ok(())
    }
}
