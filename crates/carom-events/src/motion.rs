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
//! they lie in one line; else the motion goes on in pieces (`curved.rs`).

use crate::curved::{series, Rates, TERMS};
use carom_core::transition::{Kind, Mode};
use carom_core::Model;
use glam::DVec3;

/// Slip or speed over that of the ball (1) below which it is rounding. Smaller: what rolls slides on for a moment, event after event.
const ROUNDING: f64 = 1e-13;
/// Share (1) by which slip and turning may leave one line and count as in it.
const IN_LINE: f64 = 1e-12;
/// Slip over the speeds (1) below which its direction turns no more: the last moment of a slide.
const LAST_SLIP: f64 = 1e-11;
/// A bound is more by this (1): of its rounding.
const MORE: f64 = 1.0 + 1e-9;
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
    /// A piece of a curve.
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

/// The motion of a ball from `start` on: position `x[0] + x[1] t + x[2] t^2 ...`, angular velocity `w[0] + w[1] t ...`, `t` since `start`. Terms from
/// `terms` on are 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    pub mode: Mode,
    pub support: Option<Support>,
    /// s, since the start of the step.
    pub start: f64,
    pub x: [DVec3; TERMS],
    pub w: [DVec3; TERMS],
    pub terms: usize,
    /// Bound of the acceleration of the centre, m/s^2.
    pub most: f64,
    /// How long this form holds, s, and what ends it.
    pub holds: f64,
    /// How long the mode lasts at most, s: of slides in pieces more than one piece.
    pub lasts: f64,
    /// When something ends this motion at the latest, s since the start of the step.
    pub ends: f64,
    pub end: End,
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
        let mut motion = Motion {
            holds: f64::INFINITY,
            lasts: f64::INFINITY,
            terms: 3,
            most: 2.0 * course[2].length(),
            ..Motion::default()
        };
        motion.x[..3].copy_from_slice(&course);
        motion.w[0] = w;
        motion
    }

    /// It holds until a time (s since its start) at most.
    fn until(&mut self, time: f64, end: End) {
        if time < self.holds {
            (self.holds, self.end) = (time, end);
            if end != End::Piece {
                self.lasts = time;
            }
        }
    }

    /// Velocities at the end of its form, without the rounding of what has come to its end.
    pub fn at_end(&self, radius: f64) -> [DVec3; 2] {
        let [v, w] = self.velocities(self.start + self.holds);
        let n = self.support.map_or(DVec3::ZERO, |s| s.normal);
        let spin = n * n.dot(w);
        match self.end {
            End::Slip => [v, n.cross(v) / radius + spin],
            End::Turning => [v, spin],
            End::Stop => [DVec3::ZERO, spin],
            End::Spin => [v, w - spin],
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
        let v = v - n * n.dot(v);
        let spin = n.dot(w);
        let turn = w - spin * n;
        // The part of the slip that turning makes, m/s.
        let q = r * n.cross(turn);
        let slip = v + q;
        let speed = v.length() + q.length();
        let slides = slip.length() > ROUNDING * speed;
        let mut motion = Motion {
            support: Some(support),
            start,
            mode: Mode::Slide,
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
        // By friction `q` changes against the slip; resistance opposes it.
        let mut rate = c;
        if b > 0.0 {
            let (in_line, off) = (q.dot(along), q.cross(along).length());
            let last = (LAST_SLIP * speed).max(LAST_TIME * (a + b + c));
            // Turning so slow is over before a time is: what grows from it lies in the line of the slip.
            let turns = q.length() > (ROUNDING * size).max(LAST_TIME * (b + c));
            if turns && off > IN_LINE * (q.length() + size) && size > last {
                return self.curve(v, q, rates, (r, n));
            }
            if !turns {
                rate = (rate - b).max(0.0);
            } else {
                rate += b.copysign(in_line);
                if in_line / rate > 0.0 {
                    self.until(in_line / rate, End::Turning);
                }
            }
        }
        self.x[2] = -0.5 * a * along;
        self.most = a;
        self.w[1] = rate / r * n.cross(along);
        if a + rate > 0.0 {
            self.until(size / (a + rate), End::Slip);
        }
    }

    /// A piece of a slide out of line.
    fn curve(&mut self, v: DVec3, q: DVec3, rates: Rates, (r, n): (f64, DVec3)) {
        // The slip loses this at least.
        let loses = rates.a + rates.c - rates.b;
        if loses > 0.0 {
            self.lasts = MORE * (v + q).length() / loses;
        }
        let (v, q, holds) = series(v, q, n, rates);
        for k in 1..TERMS - 1 {
            self.x[k + 1] = v[k] / (k + 1) as f64;
            self.w[k] = -n.cross(q[k]) / r;
        }
        self.terms = TERMS;
        self.most = rates.a;
        self.until(holds, End::Piece);
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

    /// Value of a series of `terms` terms.
    #[inline]
    fn value(c: &[DVec3; TERMS], terms: usize, t: f64) -> DVec3 {
        let rest = c[..terms].iter().rev();
        rest.fold(DVec3::ZERO, |sum, c| sum * t + *c)
    }

    /// Place `t` seconds after the start of the step.
    #[inline]
    pub fn place(&self, t: f64) -> DVec3 {
        Self::value(&self.x, self.terms, t - self.start)
    }

    /// Velocity and angular velocity.
    #[inline]
    pub fn velocities(&self, t: f64) -> [DVec3; 2] {
        let t = t - self.start;
        let terms = (1..self.terms).rev();
        let v = terms.fold(DVec3::ZERO, |sum, k| sum * t + k as f64 * self.x[k]);
        [v, self.turning(t)]
    }

    /// Angular velocity `t` seconds after its own start.
    #[inline]
    pub fn turning(&self, t: f64) -> DVec3 {
        Self::value(&self.w, self.terms - 1, t)
    }

    /// By how much both velocities change in `dt` seconds from its start on: not as differences, which round.
    pub fn changes(&self, dt: f64) -> [DVec3; 2] {
        let terms = (2..self.terms).rev();
        let v = terms.fold(DVec3::ZERO, |sum, k| sum * dt + k as f64 * self.x[k]);
        let terms = (1..self.terms - 1).rev();
        let w = terms.fold(DVec3::ZERO, |sum, k| sum * dt + self.w[k]);
        [dt * v, dt * w]
    }

    /// The course from a time on, of which `K` terms are not 0.
    pub fn course<const K: usize>(&self, now: f64) -> [DVec3; K] {
        let mut c = [DVec3::ZERO; K];
        c.copy_from_slice(&self.x[..K]);
        let by = now - self.start;
        if by != 0.0 {
            for k in 0..K {
                for i in (k..K - 1).rev() {
                    let above = c[i + 1];
                    c[i] += by * above;
                }
            }
        }
        c
    }
}
