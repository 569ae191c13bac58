//! Bodies that press one another have no closed form: the default scheme makes steps of them, and of them alone, until they do not.
//!
//! A step is made ahead, and how these balls move in it is taken for a parabola: what others do in the meantime is foreseen against that, and happens at its
//! exact time. One that meets a ball that is stepped is stepped from then on too, as loads and impacts of what presses belong together.

use crate::ahead::{Ahead, Kept};
use crate::foresee::FLIGHT;
use crate::motion::{Motion, Support};
use crate::step::Run;
use carom_core::contact::Contact;
use carom_core::flow::exchange::is_out;
use carom_core::outcome::Failure;
use carom_core::rotation;
use carom_core::step::step;
use carom_core::stepper::method::Step;
use carom_core::stepper::{Coefficients, Span};
use carom_core::timers::Timers;
use carom_core::transition::{Kind, Mode};
use carom_core::StepReport;
use carom_solve::clusters::{apart, Forest};
use glam::DVec3;
use std::collections::BTreeMap;
use std::mem::take;

/// Share (1) of the weight of a ball in a step below which what a contact gives is none. Larger: balls that still press are tried too early, which
/// costs a prediction; smaller: what rests beside one another seems to press.
const LOADED: f64 = 1e-6;

impl Run<'_> {
    pub fn is_stepped(&self, i: usize) -> bool {
        self.state.told[i] == Mode::Stepped
    }

    /// Balls that are stepped, in the order of their numbers.
    pub fn stepped(&self) -> Vec<usize> {
        let all = 0..self.model.bodies();
        all.filter(|&i| self.state.present[i] && self.is_stepped(i))
            .collect()
    }

    /// Balls that press something, or meet what is stepped, are stepped from now on. With each, what it touches.
    pub fn join(&mut self, balls: &[(usize, u32)], t: f64) -> Result<(), Failure> {
        // After the state was changed it is not known what has pressed before: that goes on.
        let is_new = !self.events.is_first || t > FLIGHT || self.state.step == 0;
        if self.stepped().is_empty() {
            self.stepped_to = t;
            self.report.handovers += u32::from(is_new);
        }
        let begun = |&(i, _): &(usize, u32)| self.events.motions[i].start;
        let begun = balls.iter().map(begun).fold(self.stepped_to, f64::max);
        let t = match self.ahead.take() {
            Some(ahead) => self.cut(ahead, t, begun)?,
            None => begun,
        };
        for i in self.stepped() {
            self.stand(i, t);
        }
        for &(i, other) in balls {
            self.bring(i, t);
            if is_new {
                self.note(t, Kind::Press, i, Some(other), Mode::Stepped);
            } else {
                self.state.told[i] = Mode::Stepped;
            }
            self.stand(i, t);
        }
        Ok(())
    }

    /// What of a step is done at a time within it. A step in which bodies hit one another has no such share: it is made anew with those that were met, from
    /// when these have `begun` to move as they do. Returns the time.
    fn cut(&mut self, mut ahead: Ahead, t: f64, begun: f64) -> Result<f64, Failure> {
        let is_whole = t == ahead.until;
        let t = if is_whole || ahead.impacts.is_empty() {
            t
        } else {
            begun
        };
        if t == self.stepped_to {
            return Ok(t);
        }
        if !is_whole && ahead.impacts.is_empty() {
            self.take_share(&mut ahead, t);
        } else if !is_whole {
            ahead = self.make(self.stepped_to, t)?;
        }
        self.commit(ahead);
        Ok(t)
    }

    /// What of a step is done at a time, of places that are known then.
    fn take_share(&self, ahead: &mut Ahead, t: f64) {
        let share = (t - self.stepped_to) / (ahead.until - self.stepped_to);
        (ahead.until, ahead.share) = (t, share);
        let (before, made) = (&*self.state, &mut ahead.state);
        for i in self.stepped() {
            let lerp = |from: &[DVec3], to: &[DVec3]| from[i].lerp(to[i], share);
            made.position[i] = self.events.motions[i].place(t);
            made.velocity[i] = lerp(&before.velocity, &made.velocity);
            made.angular_velocity[i] = lerp(&before.angular_velocity, &made.angular_velocity);
            let mean = 0.5 * (before.angular_velocity[i] + made.angular_velocity[i]);
            let turn = (t - self.stepped_to) * mean;
            made.orientation[i] = rotation::advance(turn, before.orientation[i]);
        }
    }

    /// A stepped ball is where it is: how it goes on the next step says.
    pub fn stand(&mut self, i: usize, t: f64) {
        let state = &*self.state;
        let (v, w) = (state.velocity[i], state.angular_velocity[i]);
        self.events.queue.forget(i);
        self.events.motions[i] = Motion {
            start: t,
            ends: t,
            mode: Mode::Stepped,
            ..Motion::plain([state.position[i], v, DVec3::ZERO], w)
        };
    }

    /// Makes the next step of what is stepped, and foresees what it meets. Returns its end.
    pub fn look_ahead(&mut self) -> Result<f64, Failure> {
        let (from, h) = (self.stepped_to, self.span.h);
        let left = h - from;
        let steps = (left / self.model.options.pressing_step).ceil().max(1.0);
        let until = if steps > 1.0 { from + left / steps } else { h };
        let ahead = self.make(from, until)?;
        let group = self.stepped();
        let dt = until - from;
        for &i in &group {
            self.stand(i, from);
            let gap = self.nothing(self.model.radius[i]).gap;
            let motion = &mut self.events.motions[i];
            let [x, v, _] = motion.x;
            let (place, velocity) = (ahead.state.position[i], ahead.state.velocity[i]);
            // By its velocities, which round less, where it is not hit in the step.
            let curved = place - x - dt * v;
            let even = 0.5 * dt * (velocity - v);
            let way = if (curved - even).length() <= gap {
                even
            } else {
                curved
            };
            motion.x[2] = way / (dt * dt);
            motion.most = 2.0 * motion.x[2].length();
            motion.ends = until;
        }
        self.ahead = Some(ahead);
        self.foresee_stepped(&group, from);
        Ok(until)
    }

    /// The step that was made is one of the run. What presses nothing any more is free.
    pub fn go_to(&mut self, t: f64) -> Result<(), Failure> {
        let Some(mut ahead) = self.ahead.take() else {
            return Ok(());
        };
        let (contacts, h) = (take(&mut ahead.contacts), ahead.h);
        self.commit(ahead);
        let loaded = self.loaded(&contacts, h);
        for group in self.touching(&contacts) {
            if group.iter().any(|&i| loaded[i]) {
                continue;
            }
            let kept = (self.events.sums.clone(), self.scratch.wall_impulse.clone());
            for &i in &group {
                self.events.queue.forget(i);
                let on = self.support(i);
                self.set_off(i, t, on, false);
            }
            self.foresee(&group, t);
            let has = |body: u32| group.binary_search(&(body as usize)).is_ok();
            let presses = |(a, b)| has(a) || has(b);
            if self.events.queue.pressing().any(presses) {
                (self.events.sums, self.scratch.wall_impulse) = kept;
                for &i in &group {
                    self.stand(i, t);
                }
                continue;
            }
            for &i in &group {
                let after = self.events.motions[i].mode;
                self.note(t, Kind::Release, i, None, after);
            }
        }
        Ok(())
    }

    /// A step of all that is stepped, made beside the state.
    fn make(&mut self, from: f64, until: f64) -> Result<Ahead, Failure> {
        let mut state = self.state.clone();
        for i in 0..self.model.bodies() {
            if !self.is_stepped(i) {
                state.set_absent(i);
            }
        }
        if self.events.stepping.options.loads_once() {
            let n = self.model.bodies();
            self.scratch.load_shift.resize(n, [DVec3::ZERO; 2]);
        }
        let report = StepReport::new(self.report.step, self.report.time);
        let walls = self.scratch.wall_impulse.len();
        let mut ahead = Ahead::new(state, until, report, walls);
        self.steps(&mut ahead, from, until - from, 0)?;
        Ok(ahead)
    }

    /// Takes a step over.
    fn commit(&mut self, mut ahead: Ahead) {
        for i in self.stepped() {
            let (state, made) = (&mut *self.state, &ahead.state);
            state.position[i] = made.position[i];
            state.orientation[i] = made.orientation[i];
            state.velocity[i] = made.velocity[i];
            state.angular_velocity[i] = made.angular_velocity[i];
            state.pseudo[i] = made.pseudo[i];
            state.acceleration[i] = made.acceleration[i];
        }
        (self.state.warm, self.state.warm_step) = (ahead.state.warm, ahead.state.warm_step);
        self.events.sums.join(&ahead.sums, ahead.share);
        self.scratch.impacts.append(&mut ahead.impacts);
        self.scratch.impact_times.append(&mut ahead.times);
        for (sum, given) in self.scratch.wall_impulse.iter_mut().zip(&ahead.walls) {
            sum[0] += ahead.share * given[0];
            sum[1] += ahead.share * given[1];
        }
        self.report.merge(&ahead.report);
        self.report.stepped += ahead.until - self.stepped_to;
        self.stepped_to = ahead.until;
        for i in self.stepped() {
            self.has_speed(i);
            if is_out(self.model, self.state, i) {
                self.leave(i, ahead.until);
            }
        }
    }

    /// One step of `nsga`; where it fails two of half the size, as in a run.
    fn steps(&mut self, ahead: &mut Ahead, now: f64, h: f64, depth: u32) -> Result<(), Failure> {
        let model = &self.events.stepping;
        let mut part = StepReport::new(self.report.step, self.report.time);
        let kept = Kept::take(self.scratch);
        let made = step(&mut Step {
            model,
            state: &mut ahead.state,
            scratch: self.scratch,
            timers: &mut Timers::default(),
            report: &mut part,
            coefficients: &Coefficients::new(model.options.spectral_radius, h),
            span: Span {
                smallest: depth >= model.options.max_halvings,
                ..Span::new(self.span.start + now, h)
            },
            accept_unconverged: false,
        });
        if made.is_ok() {
            ahead.sums.add(&self.scratch.contacts);
            ahead.impacts.append(&mut self.scratch.impacts);
            let end = self.span.start + now + h;
            ahead.times.resize(ahead.impacts.len(), end);
            for (sum, given) in ahead.walls.iter_mut().zip(&self.scratch.wall_impulse) {
                sum[0] += given[0];
                sum[1] += given[1];
            }
            ahead.contacts.clone_from(&self.scratch.contacts);
            ahead.h = h;
        }
        kept.put_back(self.scratch);
        match made {
            Ok(()) => {
                ahead.report.merge(&part);
                ahead.report.take_substeps(1, h);
                Ok(())
            }
            Err(Failure::NotConverged(_) | Failure::TooFar { .. } | Failure::TooManyPairs)
                if depth < model.options.deepest() =>
            {
                ahead.report.halvings += 1;
                self.steps(ahead, now, 0.5 * h, depth + 1)?;
                self.steps(ahead, now + 0.5 * h, 0.5 * h, depth + 1)
            }
            Err(other) => Err(other),
        }
    }

    /// Stepped balls in groups of those that touch.
    fn touching(&self, contacts: &[Contact]) -> Vec<Vec<usize>> {
        let (n, touching) = (self.model.bodies(), self.model.options.touching_tolerance);
        let mut forest = apart(n);
        let touches = |c: &&Contact| c.lambda[0] > 0.0 || c.gap <= touching * c.length;
        for c in contacts.iter().filter(touches) {
            if (c.b as usize) < n {
                forest.join(c.a, c.b);
            }
        }
        let mut groups: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for i in self.stepped() {
            groups.entry(forest.root(i as u32)).or_default().push(i);
        }
        groups.into_values().collect()
    }

    /// Balls with a contact that carried a load in the last step and is no level surface under a ball. What lies on such needs none, whatever rolling
    /// resistance may hold between two of them.
    fn loaded(&mut self, contacts: &[Contact], h: f64) -> Vec<bool> {
        let (n, g) = (self.model.bodies(), self.model.gravity.length());
        let (mut on, mut loaded) = (vec![None; n], vec![false; n]);
        for i in self.stepped() {
            on[i] = self.support(i);
        }
        let lies = |body: u32| {
            let i = body as usize;
            let (v, w) = (&self.state.velocity, &self.state.angular_velocity);
            i >= n || {
                let r = self.model.radius[i];
                let still = v[i].length() + r * w[i].length() <= self.nothing(r).speed;
                still && on[i].is_some()
            }
        };
        for c in contacts {
            let i = c.a as usize;
            let is_carried = |s: &Support| (c.b as usize) >= n && c.n1 == s.normal;
            let presses = c.lambda[0] > LOADED * self.model.mass[i] * g * h
                && !on[i].is_some_and(|(s, _)| is_carried(&s));
            if presses && !(lies(c.a) && lies(c.b)) {
                let both = [i, c.b as usize].into_iter();
                both.filter(|&i| i < n).for_each(|i| loaded[i] = true);
            }
        }
        loaded
    }
}
