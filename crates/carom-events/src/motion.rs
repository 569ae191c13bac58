//! Motion between two events: modes, and the closed form of each.
//!
//! A ball on a level surface presses it with `m g`, `g` the weight along the normal `n`. With `u = v + r n x w` the slip, `kappa = I/(m r^2)`, friction
//! `mu`, rolling radius `rho` and spinning radius `delta`:
//!
//! ```text
//! flight  x'' = g, w constant
//! slide   v' = -mu g u/|u|,  w' = (mu g/(kappa r)) n x u/|u| - (rho g/(kappa r^2)) w_t/|w_t|
//! roll    v' = -(rho g/r)/(1 + kappa) v/|v|,  w_t = n x v/r
//! turn    v = 0, w_t = 0
//! ```
//!
//! and in all but flight `w_n` falls by `delta g/(kappa r^2)` to 0. With rolling resistance slip and turning keep their directions only while
//! they lie in one line; else the slide turns (`curved.rs`), and the closed form is what it follows within a bound.

use crate::curved::Curve;
use crate::series::Rates;
use crate::turns::{parts_of, turned};
use carom_core::transition::{Kind, Mode};
use carom_core::Model;
use glam::{DQuat, DVec3};

/// Slip over the speeds that make it, or spin over the rest of the turning (1), below which it is rounding. Larger: momentum is lost that no contact took.
/// Smaller: what rolls slides on for a moment, event after event.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Share (1) by which slip and turning may leave one line and count as in it.
const IN_LINE: f64 = 1e-12;
/// Slip over the speeds (1) below which only that turns: the last moment of a slide. Larger: the resistance has not kept its direction, and places are off a
/// parabola by more than their rounding. Smaller: slides that turn have more parts.
const LAST_SLIP: f64 = 1e-7;
/// The same as a time, s, that is left: less is lost in the rounding of times.
const LAST_TIME: f64 = 1e-12;

/// What ends a closed form.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum End {
    #[default]
    Never,
    /// The slip: it rolls from then on.
    Slip,
    /// The turning about an axis in the surface, within a slide.
    Turning,
    /// All motion of the centre.
    Stop,
    Spin,
    /// What is known well enough of a slide that turns.
    Piece,
}

impl End {
    /// What it is called in the table of transitions, if it is told there.
    pub fn kind(self) -> Option<Kind> {
        match self {
            End::Slip => Some(Kind::SlipEnd),
            End::Stop => Some(Kind::RollEnd),
            End::Spin => Some(Kind::SpinEnd),
            End::Never | End::Turning | End::Piece => None,
        }
    }
}

/// A level surface that carries a ball.
#[derive(Clone, Copy, Debug)]
pub struct Support {
    /// Body index of the wall.
    pub wall: u32,
    pub normal: DVec3,
    /// Weight over mass, m/s^2.
    pub g: f64,
    pub law: u32,
}

/// The motion of a ball from `start` on: position `x[0] + x[1] t + x[2] t^2`, angular velocity `w[0] + w[1] t`, `t` since `start`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    pub mode: Mode,
    pub support: Option<Support>,
    /// s, since the start of the step.
    pub start: f64,
    pub x: [DVec3; 3],
    pub w: [DVec3; 2],
    /// Whether it spins about the normal of its surface. Else what `w` has along that is rounding.
    pub spins: bool,
    /// A slide that turns, with slip and turning below which it does no more, m/s. It is off its position by `drift t^3` at most (m/s^3), and of its angular
    /// velocity `w[1]` has the spin alone.
    pub turns: Option<(Rates, [f64; 2])>,
    pub drift: f64,
    /// Bound of the acceleration of the centre, m/s^2.
    pub most: f64,
    /// How long this form holds, s, and what ends it.
    pub holds: f64,
    /// When something ends this motion at the latest, s since the start of the step.
    pub ends: f64,
    pub end: End,
}

/// What a ball did from the start of its motion until some time.
pub struct Passage {
    pub place: DVec3,
    pub velocities: [DVec3; 2],
    pub orientation: DQuat,
    /// Of both velocities: not as differences, which round.
    pub changes: [DVec3; 2],
    /// The mean place, m.
    pub mean: DVec3,
    /// Sums over time of slip (m), turning and spin (rad).
    pub ways: [f64; 3],
}

impl Motion {
    /// A ball in the air.
    pub fn flight(start: f64, x: DVec3, [v, w]: [DVec3; 2], gravity: DVec3) -> Motion {
        Motion {
            mode: Mode::Flight,
            support: None,
            start,
            ..Motion::plain([x, v, 0.5 * gravity], w)
        }
    }

    /// A parabola with a constant angular velocity.
    pub fn plain(course: [DVec3; 3], w: DVec3) -> Motion {
        Motion {
            x: course,
            w: [w, DVec3::ZERO],
            holds: f64::INFINITY,
            most: 2.0 * course[2].length(),
            ..Motion::default()
        }
    }

    /// It holds until a time (s since its start) at most.
    fn until(&mut self, time: f64, end: End) {
        if time < self.holds {
            (self.holds, self.end) = (time, end);
        }
    }

    /// The part of an angular velocity about the normal of the surface, without rounding.
    fn spin(&self, w: DVec3) -> DVec3 {
        match self.support {
            Some(Support { normal, .. }) if self.spins => normal * normal.dot(w),
            _ => DVec3::ZERO,
        }
    }

    /// Velocities at the end of its form, without the rounding of what has come to its end.
    pub fn at_end(&self, [v, w]: [DVec3; 2], radius: f64) -> [DVec3; 2] {
        let n = self.support.map_or(DVec3::ZERO, |s| s.normal);
        let spin = self.spin(w);
        match self.end {
            End::Slip => [v, n.cross(v) / radius + spin],
            End::Turning => {
                // What turns off the line of the slip goes on.
                let axis = (self.w[1] - n * n.dot(self.w[1])).normalize_or_zero();
                [v, w - axis * axis.dot(w)]
            }
            End::Stop => [DVec3::ZERO, spin],
            End::Spin if self.mode == Mode::Slide => [v, w - spin],
            End::Spin => [v, n.cross(v) / radius],
            End::Never | End::Piece => [v, w],
        }
    }

    /// Ball `i` on a surface, from velocities of which that along the normal is dropped. None where rolling resistance is more than friction can
    /// balance: there is no closed form.
    pub fn supported(
        model: &Model,
        i: usize,
        support: Support,
        start: f64,
        x: DVec3,
        [v, w]: [DVec3; 2],
    ) -> Option<Motion> {
        let (n, g, r) = (support.normal, support.g, model.radius[i]);
        let law = &model.laws[support.law as usize];
        let bounds = law.bounds;
        let kappa = model.inertia[i] / (model.mass[i] * r * r);
        let (v, mut spin) = (v - n * n.dot(v), n.dot(w));
        let turn = w - spin * n;
        // The part of the slip that turning makes, m/s.
        let q = r * n.cross(turn);
        // Where a normal lies along no axis what has ended is never quite 0.
        if spin.abs() <= ROUNDING * turn.length() {
            spin = 0.0;
        }
        let slip = v + q;
        let speed = v.length() + q.length();
        let slides = slip.length() > ROUNDING * (speed + r * spin.abs());
        let mut motion = Motion {
            support: Some(support),
            start,
            mode: Mode::Slide,
            spins: spin != 0.0,
            ..Motion::plain([x, v, DVec3::ZERO], w)
        };
        let rolling = bounds.rolling * g / (kappa * r * r);
        if slides && bounds.sliding > 0.0 {
            let rates = Rates {
                a: bounds.sliding * g,
                b: rolling * r,
                c: bounds.sliding * g / kappa,
            };
            motion.slide(v, q, rates, (r, n), speed);
        } else if slides {
            // Without friction rolling resistance acts on turning alone.
            let rate = turn.length();
            if rolling > 0.0 && rate > 0.0 {
                motion.w[1] = -(rolling / rate) * turn;
                motion.until(rate / rolling, End::Turning);
            }
        } else {
            motion.roll(
                v,
                spin,
                bounds.rolling * g / r,
                kappa,
                (r, n),
                bounds.sliding * g,
            )?;
        }
        let spinning = bounds.spinning * g / (kappa * r * r);
        if spin != 0.0 && spinning > 0.0 {
            motion.w[1] -= spinning * spin.signum() * n;
            motion.until(spin.abs() / spinning, End::Spin);
        }
        Some(motion)
    }

    fn slide(&mut self, v: DVec3, q: DVec3, rates: Rates, (r, n): (f64, DVec3), speed: f64) {
        let Rates { a, b, c } = rates;
        let slip = v + q;
        let size = slip.length();
        let along = slip / size;
        // Turning so slow is over before a time is: what grows from it lies in the line of the slip.
        let least = (ROUNDING * size).max(LAST_TIME * (b + c));
        let (turns, opposes) = (q.length() > least, q.dot(along));
        let in_line = q.cross(along).length() <= IN_LINE * (q.length() + size);
        // Direction of the resistance, and its size. In line it has that of the slip, whose direction is known better.
        let (against, b) = match (turns, in_line) {
            (true, false) => (q.normalize(), b),
            (true, true) => (along * opposes.signum(), b),
            (false, _) => (-along, b.min(c)),
        };
        if turns && b > 0.0 {
            let last = (LAST_SLIP * speed).max(LAST_TIME * (a + b + c));
            let rate = c + b.copysign(opposes);
            // Resistance that is more than friction turns the slip until both are in line.
            if !in_line && (size > last || b >= a + c) {
                self.turns = Some((rates, [last, least]));
            } else if in_line && opposes / rate > 0.0 {
                self.until(opposes / rate, End::Turning);
            }
        }
        self.most = a;
        self.x[2] = -0.5 * a * along;
        if self.turns.is_some() {
            return;
        }
        // What the slip loses until it ends, and its mean direction: with a resistance that keeps its direction `|u| (a + c - b cos)` falls evenly.
        let (mut loses, mut mean) = (a + c, along);
        if b > 0.0 {
            loses = (loses * loses - b * b) / (loses - b * against.dot(along));
            mean = (loses * along - b * against) / (a + c);
        }
        self.x[2] = -0.5 * a * mean;
        self.w[1] = n.cross(c * mean + b * against) / r;
        if loses > 0.0 {
            self.until(size / loses, End::Slip);
        }
    }

    /// A slide that turns, as long as it is known ahead; one that goes on, or a new one.
    pub fn follow(&mut self, curve: &mut Curve, radius: f64, goes_on: bool) {
        let (Some((rates, last)), Some(support)) = (self.turns, self.support) else {
            return;
        };
        if !goes_on {
            let q = radius * support.normal.cross(self.w[0]);
            curve.begin(self.x[1], q, support.normal, rates);
        }
        let (time, rate) = curve.look_ahead(last);
        self.drift = rates.a * rate / 6.0;
        self.until(time, End::Piece);
    }

    fn roll(
        &mut self,
        v: DVec3,
        spin: f64,
        resistance: f64,
        kappa: f64,
        (r, n): (f64, DVec3),
        friction: f64,
    ) -> Option<()> {
        let speed = v.length();
        self.w[0] = n.cross(v) / r + spin * n;
        if speed == 0.0 {
            self.mode = if spin == 0.0 { Mode::Rest } else { Mode::Spin };
            return Some(());
        }
        self.mode = Mode::Roll;
        if resistance > 0.0 {
            let slowing = resistance / (1.0 + kappa);
            if slowing > friction {
                return None;
            }
            self.x[2] = -0.5 * slowing / speed * v;
            self.most = slowing;
            self.w[1] = n.cross(2.0 * self.x[2]) / r;
            self.until(speed / slowing, End::Stop);
        }
        Some(())
    }

    /// Place `t` seconds after the start of the step; of a slide that turns within its bound.
    #[inline]
    pub fn place(&self, t: f64) -> DVec3 {
        let t = t - self.start;
        (self.x[2] * t + self.x[1]) * t + self.x[0]
    }

    /// Velocity of that place.
    #[inline]
    pub fn velocity(&self, t: f64) -> DVec3 {
        2.0 * (t - self.start) * self.x[2] + self.x[1]
    }

    /// The same as a polynomial of the time from a moment on.
    pub fn course(&self, now: f64) -> [DVec3; 3] {
        if now == self.start {
            return self.x;
        }
        [self.place(now), self.velocity(now), self.x[2]]
    }

    /// How far the ball may be off that, m, as a polynomial too.
    pub fn off(&self, now: f64) -> [f64; 4] {
        let t = now - self.start;
        [t * t * t, 3.0 * t * t, 3.0 * t, 1.0].map(|c| self.drift * c)
    }

    /// Where the ball is, on a slide that turns too.
    pub fn exact_place(&self, radius: f64, curve: &Curve, t: f64) -> DVec3 {
        match self.turns {
            None => self.place(t),
            Some(_) => self.x[0] + curve.slides(t - self.start, radius, None).way,
        }
    }

    /// From its start to a time.
    pub fn passage(&self, radius: f64, curve: &Curve, orientation: DQuat, t: f64) -> Passage {
        let dt = t - self.start;
        let at = |t: f64| self.w[0] + t * self.w[1];
        let n = self.support.map_or(DVec3::ZERO, |s| s.normal);
        // Sizes that change evenly: Simpson's rule is exact.
        let sum = |of: &dyn Fn(f64) -> f64| (of(0.0) + 4.0 * of(0.5 * dt) + of(dt)) / 6.0 * dt;
        let spun = sum(&|t| n.dot(at(t)).abs());
        if self.turns.is_some() {
            let mut orientation = orientation;
            let spin = |t: f64| self.spin(at(t));
            let slid = curve.slides(dt, radius, Some((&mut orientation, &spin)));
            let w = -n.cross(slid.turning) / radius + spin(dt);
            let mean = if dt > 0.0 { slid.sum / dt } else { DVec3::ZERO };
            return Passage {
                place: self.x[0] + slid.way,
                velocities: [self.x[1] + slid.change, w],
                orientation,
                changes: [slid.change, w - self.w[0]],
                mean: self.x[0] + mean,
                ways: [slid.slipped, slid.turned / radius, spun],
            };
        }
        let slip = |t: f64| (self.x[1] + 2.0 * t * self.x[2] + radius * n.cross(at(t))).length();
        let turning = |t: f64| (at(t) - n * n.dot(at(t))).length();
        let mut orientation = orientation;
        if self.w != [DVec3::ZERO; 2] {
            // About one line it is exact.
            let parts = match self.w[0].cross(self.w[1]) == DVec3::ZERO {
                true => 1.0,
                false => parts_of(dt * at(0.0).length().max(at(dt).length())),
            };
            orientation = turned(orientation, dt, parts, at);
        }
        let (v, w) = (self.velocity(t), at(dt));
        // Rounding of what has been larger would count as slip or spin where little is left.
        let w = match (self.mode, self.support) {
            (_, None) => w,
            (Mode::Slide, _) => w - n * n.dot(w) + self.spin(w),
            _ => n.cross(v) / radius + self.spin(w),
        };
        Passage {
            place: self.place(t),
            velocities: [v, w],
            orientation,
            changes: [2.0 * dt * self.x[2], dt * self.w[1]],
            mean: self.x[0] + dt * (0.5 * self.x[1] + dt / 3.0 * self.x[2]),
            ways: [sum(&slip), sum(&turning), spun],
        }
    }
}
