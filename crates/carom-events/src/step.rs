//! The loop over events: from one report to the next, each ball as its closed form has it until something happens to it.

use crate::ahead::Ahead;
use crate::curved::Curve;
use crate::foresee::{Foresight, FLIGHT};
use crate::motion::Motion;
use crate::near::Near;
use crate::queue::{Event, Queue, What};
use crate::sums::Sums;
use carom_core::contact::ContactKey;
use carom_core::outcome::Failure;
use carom_core::scratch::Scratch;
use carom_core::stepper::method::{Step, Stepper};
use carom_core::stepper::Span;
use carom_core::timers::Phase;
use carom_core::transition::{Kind, Mode};
use carom_core::{Model, State, StepReport};
use glam::DVec3;

/// Events in a step at most: so many, and so many more for each second of it. Fewer: breaks of many balls are refused; more: it takes long to say that impacts
/// follow one another without end.
const MOST_EVENTS: [f64; 2] = [1e5, 1e6];
/// Method `events`. Nothing here outlives a step but lists of walls, which change no result.
pub struct Events {
    pub motions: Vec<Motion>,
    /// Of the balls whose slides turn.
    pub curves: Vec<Curve>,
    pub near: Vec<Near>,
    pub queue: Queue,
    pub sums: Sums,
    pub group: Vec<usize>,
    pub touching: Vec<ContactKey>,
    /// Whether the table of transitions said nothing of this motion before the step: the run begins, or its state was changed.
    pub is_first: bool,
    /// What `nsga` steps with where bodies press one another.
    pub stepping: Model,
}

impl Events {
    pub fn new(stepping: Model) -> Events {
        Events {
            stepping,
            motions: Vec::new(),
            curves: Vec::new(),
            near: Vec::new(),
            queue: Queue::default(),
            sums: Sums::default(),
            group: Vec::new(),
            touching: Vec::new(),
            is_first: true,
        }
    }
}

impl Stepper for Events {
    fn step(&mut self, on: &mut Step) -> Result<(), Failure> {
        let kept = on.state.clone();
        let told = (on.state.told.len(), on.state.told_of);
        self.is_first = told != (on.model.bodies(), on.state.motion_hash());
        on.scratch.begin_step();
        on.scratch.wall_impulse.fill([DVec3::ZERO; 2]);
        let mut run = Run {
            model: on.model,
            state: on.state,
            scratch: on.scratch,
            report: on.report,
            events: &mut *self,
            span: on.span,
            fastest: 0.0,
            stepped_to: 0.0,
            ahead: None,
            count: 0,
            last: 0.0,
            shortest: on.span.h,
        };
        let made = run.all();
        if made.is_err() {
            *on.state = kept;
        }
        on.state.told_of = on.state.motion_hash();
        on.timers.mark(Phase::Velocity);
        made
    }

    fn divides_steps(&self) -> bool {
        true
    }
}

/// One step.
pub struct Run<'a> {
    pub model: &'a Model,
    pub state: &'a mut State,
    pub scratch: &'a mut Scratch,
    pub report: &'a mut StepReport,
    pub events: &'a mut Events,
    pub span: Span,
    /// Fastest speed so far, m/s: what is nothing beside it is rounding.
    pub fastest: f64,
    /// Up to when what is stepped has come, s since the start of the step, and its next step.
    pub stepped_to: f64,
    pub ahead: Option<Ahead>,
    /// Events so far, the time of the last one, and the shortest between two, s.
    count: u32,
    last: f64,
    shortest: f64,
}

impl Run<'_> {
    fn all(&mut self) -> Result<(), Failure> {
        self.events.sums.clear();
        self.begin();
        let h = self.span.h;
        self.tell_begin();
        self.happen_until(FLIGHT.min(h))?;
        self.tell_all(self.last);
        loop {
            let goes = self.stepped_to < h && !self.stepped().is_empty();
            let next = if goes { self.look_ahead()? } else { h };
            if self.happen_until(next)? {
                continue;
            }
            if !goes {
                break;
            }
            self.go_to(next)?;
        }
        // What is due at the end is of this step: roots are found short of it alone.
        self.foresee(&self.free(), h);
        self.happen_until(h)?;
        if self.count > 0 {
            let shortest = self.shortest.min(h - self.last);
            self.report.take_substeps(self.count + 1, shortest);
        }
        self.end()
    }

    /// All that happens by a time, or until what is stepped has to set off anew: whether that is so.
    fn happen_until(&mut self, until: f64) -> Result<bool, Failure> {
        let most = (MOST_EVENTS[0] + MOST_EVENTS[1] * self.span.h) as u32;
        while let Some(event) = self.events.queue.next(until) {
            if self.count == most {
                return Err(Failure::TooManyEvents(event.bodies.0, event.bodies.1));
            }
            self.count += 1;
            self.shortest = f64::min(self.shortest, event.time - self.last);
            self.last = event.time;
            if self.happens(&event)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// All balls set off from the present state, but those that are stepped.
    fn begin(&mut self) {
        let n = self.model.bodies();
        for i in 0..n {
            self.has_speed(i);
        }
        self.events.queue.begin(n);
        self.events.motions.clear();
        self.events.motions.resize(n, Motion::default());
        self.events.curves.resize(n, Curve::default());
        self.events.near.resize(n, Near::default());
        if self.events.is_first {
            self.state.told.clear();
            self.state.told.resize(n, Mode::default());
        }
        for i in 0..n {
            if self.is_stepped(i) {
                self.stand(i, 0.0);
            } else {
                let on = self.support(i);
                self.set_off(i, 0.0, on, false);
            }
        }
        self.foresee(&self.free(), 0.0);
    }

    /// Balls that are there and not stepped, in the order of their numbers.
    pub fn free(&self) -> Vec<usize> {
        let all = 0..self.model.bodies();
        all.filter(|&i| self.state.present[i] && !self.is_stepped(i))
            .collect()
    }

    /// Counts the present speed of a ball, which may have fallen since the step began.
    pub fn has_speed(&mut self, i: usize) {
        let [v, w] = [self.state.velocity[i], self.state.angular_velocity[i]];
        let speed = v.length() + self.model.radius[i] * w.length();
        self.fastest = self.fastest.max(speed);
    }

    /// What predictions are made with from a time on, and what keeps them.
    fn foresight(&mut self, now: f64) -> (Foresight<'_>, &mut [Near], &mut Queue) {
        let Events {
            motions,
            near,
            queue,
            ..
        } = &mut *self.events;
        let foresight = Foresight {
            model: self.model,
            state: self.state,
            motions,
            now,
            end: self.span.h,
            fastest: self.fastest,
        };
        (foresight, near, queue)
    }

    /// What will happen to some balls that set off, in the order of their numbers.
    pub fn foresee(&mut self, balls: &[usize], now: f64) {
        let (foresight, near, queue) = self.foresight(now);
        for &i in balls {
            let motion = &mut foresight.motions[i];
            motion.ends = motion.start + motion.holds;
            foresight.motions[i].ends = foresight.alone(i, &mut near[i], queue);
        }
        for (k, &i) in balls.iter().enumerate() {
            // Each pair of them once.
            let with = |j| balls[..k].binary_search(&j).is_err();
            foresight.others(i, with, queue);
        }
    }

    /// Which others stepped balls will meet: of those that have set off later, from then on.
    pub fn foresee_stepped(&mut self, stepped: &[usize], now: f64) {
        let free = self.free();
        let (mut foresight, _, queue) = self.foresight(now);
        let mut asked = vec![false; foresight.motions.len()];
        let (late, early): (Vec<usize>, Vec<_>) =
            (free.iter()).partition(|&&i| foresight.motions[i].start > now);
        early.iter().for_each(|&i| asked[i] = true);
        if !early.is_empty() {
            (stepped.iter()).for_each(|&i| foresight.others(i, |j| asked[j], queue));
        }
        for j in late {
            foresight.now = foresight.motions[j].start;
            foresight.others(j, |i| stepped.binary_search(&i).is_ok(), queue);
        }
    }

    /// All that presses now is stepped.
    fn press(&mut self, event: &Event) -> Result<(), Failure> {
        let mut pairs: Vec<_> = self.events.queue.pressing().chain([event.bodies]).collect();
        pairs.sort_unstable();
        let both = pairs
            .iter()
            .flat_map(|&(a, b)| [(a as usize, b), (b as usize, a)]);
        let is_free = |&(i, _): &(usize, u32)| i < self.model.bodies() && !self.is_stepped(i);
        let mut balls: Vec<_> = both.filter(is_free).collect();
        balls.sort_by_key(|&(i, _)| i);
        balls.dedup_by_key(|&mut (i, _)| i);
        self.join(&balls, event.time)
    }

    /// Whether something that is stepped has to set off anew.
    fn happens(&mut self, event: &Event) -> Result<bool, Failure> {
        let ((a, b), t) = (event.bodies, event.time);
        let i = a as usize;
        match event.what {
            What::Meet => return self.meet((a, b), t),
            What::Press => return self.press(event).map(|()| true),
            What::Closer => {
                self.look_closer(event);
                return Ok(false);
            }
            _ => self.bring(i, t),
        }
        let motion = &self.events.motions[i];
        let (end, on) = (motion.end, motion.support);
        match event.what {
            What::Leave => self.leave(i, t),
            What::Edge => {
                self.go_on(&[i], t);
                self.tell(t, Some(Kind::Edge), i, Some(b));
            }
            _ => {
                let moves = [self.state.velocity[i], self.state.angular_velocity[i]];
                let [v, w] = motion.at_end(moves, self.model.radius[i]);
                (self.state.velocity[i], self.state.angular_velocity[i]) = (v, w);
                self.set_off_along(i, t);
                self.foresee(&[i], t);
                self.tell(t, end.kind(), i, on.map(|s| s.wall));
            }
        }
        Ok(false)
    }

    /// Balls that turn and may meet something set off from where they have come to.
    fn look_closer(&mut self, event: &Event) {
        let ((a, b), t) = (event.bodies, event.time);
        let n = self.model.bodies();
        let mut balls: Vec<usize> = [a as usize, b as usize]
            .into_iter()
            .filter(|&i| i < n)
            .collect();
        balls.dedup();
        balls.retain(|&i| self.events.motions[i].turns.is_some());
        self.set_off_again(&balls, t);
        for &i in &balls {
            self.tell(t, None, i, None);
        }
    }

    pub fn set_off_again(&mut self, balls: &[usize], t: f64) {
        for &i in balls {
            self.bring(i, t);
            self.set_off_along(i, t);
        }
        self.foresee(balls, t);
    }

    /// A ball goes on along the surface that carries it.
    fn set_off_along(&mut self, i: usize, t: f64) {
        let motion = &self.events.motions[i];
        let (on, turned) = (motion.support, motion.turns.is_some());
        if turned {
            self.events.curves[i].pass(t - motion.start, f64::EPSILON * t);
        }
        self.events.queue.forget(i);
        self.set_off(i, t, on.map(|support| (support, 0.0)), turned);
    }

    /// Balls in a new state set off, and what will happen to them is foreseen anew.
    pub fn go_on(&mut self, balls: &[usize], t: f64) {
        for &i in balls {
            self.events.queue.forget(i);
            let on = self.support(i);
            self.set_off(i, t, on, false);
        }
        self.foresee(balls, t);
    }
}
