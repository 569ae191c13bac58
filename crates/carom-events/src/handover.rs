//! Bodies that press one another have no closed form: from then on the default scheme makes steps, of all bodies, until none do.

use crate::foresee::FLIGHT;
use crate::queue::Event;
use crate::step::Run;
use carom_core::contact::Contact;
use carom_core::flow::Exchange;
use carom_core::outcome::{Failure, ImpactRecord};
use carom_core::scratch::Scratch;
use carom_core::step::step;
use carom_core::stepper::method::Step;
use carom_core::stepper::{Coefficients, Span};
use carom_core::timers::Timers;
use carom_core::transition::{Kind, Mode, Transition};
use carom_core::StepReport;
use glam::DVec3;
use std::mem::take;

/// Share (1) of the weight of a ball in a step below which what a contact gives is none. Larger: balls that still press are tried too early, which
/// costs a prediction; smaller: what rests beside one another seems to press.
const LOADED: f64 = 1e-6;

impl Run<'_> {
    /// Steps of `nsga` from the time of an event on, until nothing presses. Returns that time, or the end of the step.
    pub fn hand_over(&mut self, event: &Event) -> Result<f64, Failure> {
        let (n, start, end) = (self.model.bodies(), event.time, self.span.h);
        if start >= end {
            return Ok(start);
        }
        let mut pressing: Vec<_> = self.events.queue.pressing().chain([event.bodies]).collect();
        pressing.sort_unstable();
        for i in 0..n {
            if self.state.present[i] {
                self.bring(i, start);
            }
        }
        // What presses at the start of a later step did so at the end of the one before, and goes on.
        let is_new = start > FLIGHT || self.state.step == 0;
        for (i, other) in each(&pressing, n) {
            if self.events.is_first && !is_new {
                self.state.told[i] = Mode::Stepped;
            } else if self.state.told[i] != Mode::Stepped {
                self.note(start, Kind::Press, i, Some(other), Mode::Stepped);
            }
        }
        if self.events.stepping.options.loads_once() {
            self.scratch.load_shift.resize(n, [DVec3::ZERO; 2]);
        }
        let steps = ((end - start) / self.model.options.pressing_step)
            .ceil()
            .max(1.0);
        let (mut now, mut number) = (start, 0.0);
        while now < end {
            number += 1.0;
            let next = if number < steps {
                start + (end - start) * (number / steps)
            } else {
                end
            };
            self.steps(now, next - now, 0)?;
            now = next;
            self.take_out_all(now);
            if now < end && self.is_loaded((next - start) / number) {
                continue;
            }
            let sums = self.events.sums.clone();
            self.begin(now);
            if now == end {
                // Whatever is due is for the next step.
                self.events.queue.begin(n);
                break;
            }
            if self.events.queue.pressing().next().is_none() {
                break;
            }
            self.events.sums = sums;
        }
        self.report.handovers += u32::from(is_new);
        self.report.stepped += now - start;
        if now < end {
            self.tell_all(now, true);
        }
        Ok(now)
    }

    /// One step of `nsga`; where it fails two of half the size, as in a run.
    fn steps(&mut self, now: f64, h: f64, depth: u32) -> Result<(), Failure> {
        let model = &self.events.stepping;
        let mut part = StepReport::new(self.report.step, self.report.time);
        let kept = Kept::take(self.scratch);
        let made = step(&mut Step {
            model,
            state: self.state,
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
            self.events.sums.add(&self.scratch.contacts);
        }
        kept.put_back(self.scratch, self.span.start + now + h, made.is_ok());
        match made {
            Ok(()) => {
                self.report.merge(&part);
                self.report.take_substeps(1, h);
                Ok(())
            }
            Err(Failure::NotConverged(_) | Failure::TooFar { .. } | Failure::TooManyPairs)
                if depth < model.options.deepest() =>
            {
                self.report.halvings += 1;
                self.steps(now, 0.5 * h, depth + 1)?;
                self.steps(now + 0.5 * h, 0.5 * h, depth + 1)
            }
            Err(other) => Err(other),
        }
    }

    /// Whether some contact carried a load in the last step that is no level surface under its ball. What lies on such needs none, whatever rolling
    /// resistance may hold between two of them.
    fn is_loaded(&mut self, h: f64) -> bool {
        let (n, g) = (self.model.bodies(), self.model.gravity.length());
        let on: Vec<_> = (0..n).map(|i| self.support(i)).collect();
        let lies = |body: u32| {
            let i = body as usize;
            let (v, w) = (&self.state.velocity, &self.state.angular_velocity);
            i >= n || {
                let r = self.model.radius[i];
                let still = v[i].length() + r * w[i].length() <= self.nothing(r).speed;
                still && on[i].is_some()
            }
        };
        let presses = |c: &Contact| {
            let i = c.a as usize;
            c.lambda[0] > LOADED * self.model.mass[i] * g * h
                && on[i].is_none_or(|(s, _)| (c.b as usize) < n || c.n1 != s.normal)
                && !(lies(c.a) && lies(c.b))
        };
        self.scratch.contacts.iter().any(presses)
    }
}

/// Each ball of some pairs, with the other one.
fn each(pairs: &[(u32, u32)], n: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
    let both = pairs
        .iter()
        .flat_map(|&(a, b)| [(a as usize, b), (b as usize, a)]);
    both.filter(move |&(i, _)| i < n)
}

/// What the step has collected so far, out of the way of a step within it.
struct Kept {
    impacts: Vec<ImpactRecord>,
    times: Vec<f64>,
    left: Exchange,
    transitions: Vec<Transition>,
    walls: Vec<[DVec3; 2]>,
}

impl Kept {
    fn take(scratch: &mut Scratch) -> Kept {
        Kept {
            impacts: take(&mut scratch.impacts),
            times: take(&mut scratch.impact_times),
            left: take(&mut scratch.left),
            transitions: take(&mut scratch.transitions),
            walls: scratch.wall_impulse.clone(),
        }
    }

    /// Back into `scratch`, with what a step that ended at a time (s) and was made has added.
    fn put_back(mut self, scratch: &mut Scratch, time: f64, made: bool) {
        if made {
            self.impacts.append(&mut scratch.impacts);
            self.times.resize(self.impacts.len(), time);
            for (sum, given) in self.walls.iter_mut().zip(&scratch.wall_impulse) {
                sum[0] += given[0];
                sum[1] += given[1];
            }
        }
        scratch.impacts = self.impacts;
        scratch.impact_times = self.times;
        scratch.left = self.left;
        scratch.transitions = self.transitions;
        scratch.wall_impulse = self.walls;
    }
}
