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
//! and in all but flight `w_n` falls by `delta g/(kappa r^2)` to 0. With rolling resistance a slide has this form only while slip and turning
//! lie in one line; else their directions turn, and no closed form is known ([`Open::Curved`]).

use carom_core::outcome::Open;
use carom_core::Model;
use glam::DVec3;

/// Slip or speed over that of the ball (1) below which it is rounding. Smaller: what rolls slides on for a moment, event after event.
const ROUNDING: f64 = 1e-13;
/// Share (1) by which slip and turning may leave one line and count as in it.
const IN_LINE: f64 = 1e-12;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    #[default]
    Flight,
    Slide,
    Roll,
    /// In place, about the normal.
    Turn,
    Rest,
}

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

/// The motion of a ball from `start` on: positions `x[0] + x[1] t + x[2] t^2`, angular velocity `w[0] + w[1] t`, `t` since `start`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    pub mode: Mode,
    pub support: Option<Support>,
    /// s, since the start of the step.
    pub start: f64,
    pub x: [DVec3; 3],
    pub w: [DVec3; 2],
    /// How long this form holds, s, and what ends it.
    pub holds: f64,
    pub end: End,
}

impl Motion {
    /// A ball in the air.
    pub fn flight(start: f64, x: DVec3, [v, w]: [DVec3; 2], gravity: DVec3) -> Motion {
        Motion {
            mode: Mode::Flight,
            support: None,
            start,
            x: [x, v, 0.5 * gravity],
            w: [w, DVec3::ZERO],
            holds: f64::INFINITY,
            end: End::Never,
        }
    }

    /// It holds until a time (s since its start) at most.
    fn until(&mut self, time: f64, end: End) {
        if time < self.holds {
            (self.holds, self.end) = (time, end);
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
            End::Never => [v, w],
        }
    }

    /// Ball `i` on a surface, from velocities of which that along the normal is dropped.
    pub fn supported(
        model: &Model,
        i: usize,
        support: Support,
        start: f64,
        x: DVec3,
        [v, w]: [DVec3; 2],
    ) -> Result<Motion, Open> {
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
            x: [x, v, DVec3::ZERO],
            w: [w, DVec3::ZERO],
            holds: f64::INFINITY,
            end: End::Never,
            mode: Mode::Slide,
        };
        let rolling = bounds.rolling * g / (kappa * r * r);
        if slides && bounds.sliding > 0.0 {
            motion.slide(slip, q, bounds.sliding * g, rolling * r, kappa, (r, n))?;
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
        Ok(motion)
    }

    /// `friction` and `resistance`: what sliding and rolling resistance take from `v` and `q` in a second.
    fn slide(
        &mut self,
        slip: DVec3,
        q: DVec3,
        friction: f64,
        resistance: f64,
        kappa: f64,
        (r, n): (f64, DVec3),
    ) -> Result<(), Open> {
        let size = slip.length();
        let along = slip / size;
        // By friction `q` changes against the slip; resistance opposes it.
        let mut rate = friction / kappa;
        if resistance > 0.0 {
            let (in_line, off) = (q.dot(along), q.cross(along).length());
            if off > IN_LINE * (q.length() + size) {
                return Err(Open::Curved);
            }
            let still = in_line.abs() <= ROUNDING * size;
            if still {
                rate = (rate - resistance).max(0.0);
            } else {
                rate += resistance.copysign(in_line);
                if in_line / rate > 0.0 {
                    self.until(in_line / rate, End::Turning);
                }
            }
        }
        self.x[2] = -0.5 * friction * along;
        self.w[1] = rate / r * n.cross(along);
        if friction + rate > 0.0 {
            self.until(size / (friction + rate), End::Slip);
        }
        Ok(())
    }

    fn roll(
        &mut self,
        v: DVec3,
        spin: f64,
        resistance: f64,
        kappa: f64,
        (r, n): (f64, DVec3),
        friction: f64,
    ) -> Result<(), Open> {
        let speed = v.length();
        self.w[0] = n.cross(v) / r + spin * n;
        if speed == 0.0 {
            self.mode = if spin == 0.0 { Mode::Rest } else { Mode::Turn };
            return Ok(());
        }
        self.mode = Mode::Roll;
        if resistance > 0.0 {
            let slowing = resistance / (1.0 + kappa);
            if slowing > friction {
                return Err(Open::Skids);
            }
            self.x[2] = -0.5 * slowing / speed * v;
            self.w[1] = n.cross(2.0 * self.x[2]) / r;
            self.until(speed / slowing, End::Stop);
        }
        Ok(())
    }

    /// Place `t` seconds after the start of the step.
    #[inline]
    pub fn place(&self, t: f64) -> DVec3 {
        let t = t - self.start;
        self.x[0] + t * (self.x[1] + t * self.x[2])
    }

    /// Velocity and angular velocity.
    #[inline]
    pub fn velocities(&self, t: f64) -> [DVec3; 2] {
        let t = t - self.start;
        [self.x[1] + 2.0 * t * self.x[2], self.w[0] + t * self.w[1]]
    }

    /// The rotation between two times, in parts of which each is exact to the fourth order: spatial increments (rad), in their order.
    pub fn turns(&self, from: f64, to: f64) -> impl Iterator<Item = DVec3> {
        let (t0, t1) = (from - self.start, to - self.start);
        let [a, b] = self.w;
        let turning = a.cross(b).length();
        let whole = t1 - t0;
        // Along one line it is exact; else the error of a part is of fifth order.
        let parts = if turning == 0.0 {
            1.0
        } else {
            let rate = (a + t0 * b).length().max((a + t1 * b).length());
            (whole * rate / MOST_TURN).ceil().clamp(1.0, MOST_PARTS)
        };
        let dt = whole / parts;
        (0..parts as u32).map(move |k| {
            let middle = t0 + (f64::from(k) + 0.5) * dt;
            dt * (a + middle * b) - dt * dt * dt / 12.0 * a.cross(b)
        })
    }
}

/// Angle (rad) of a part of a rotation whose axis turns: its error is about the fifth power of that, times how far the axis turns.
const MOST_TURN: f64 = 0.05;
/// Parts of such a rotation between two events or frames: bounds the time that one takes.
const MOST_PARTS: f64 = 1e5;

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// Against many small rotations at the rate of their middle.
    #[test]
    fn orientations_follow_an_axis_that_turns() {
        let motion = Motion {
            w: [
                DVec3::new(30.0, -10.0, 80.0),
                DVec3::new(-90.0, 40.0, -20.0),
            ],
            ..Motion::default()
        };
        let advance = |q: DQuat, psi: DVec3| carom_core::rotation::advance(psi, q);
        let found = motion.turns(0.0, 0.4).fold(DQuat::IDENTITY, advance);
        let many = 2_000_000;
        let dt = 0.4 / f64::from(many);
        let exact = (0..many).fold(DQuat::IDENTITY, |q, k| {
            let t = (f64::from(k) + 0.5) * dt;
            advance(q, dt * (motion.w[0] + t * motion.w[1]))
        });
        let apart = (found * exact.inverse()).to_scaled_axis().length();
        assert!(apart < 1e-7, "{apart}");
    }
}
