//! A slide out of line, with rolling resistance: slip `u` and the part `q = r n x w` of it that turning makes change by
//!
//! ```text
//! v' = -a u/|u|,   q' = -c u/|u| - b q/|q|,   u = v + q
//! ```
//!
//! and turn. There is no closed form. But with `s = |u|`, `p = |q|`, the angle `theta` from `u` to `q`, and a time `T` of their own, `dt = s p/(s + p) dT`,
//! the share `f = s/(s + p)` and the angle have equations without poles, whatever comes to nothing:
//!
//! ```text
//! (ln s)' = -(a + c + b cos theta) (1 - f),   (ln p)' = -(b + c cos theta) f
//! f' = f (1 - f) ((ln s)' - (ln p)'),   theta' = sin theta (c f + b (1 - f)),   phi' = -b sin theta (1 - f)
//! ```
//!
//! with the direction `phi` of `u`. Their power series follow term by term, and so do those of all that is asked for. A whole slide is some ten of them.

use crate::series::{Part, Rates, Values, TIME};
use crate::turns::{parts_of, turned};
use glam::{DQuat, DVec2, DVec3};
use std::collections::VecDeque;

/// Parts that are known ahead, and the time (over theirs) below which all the rest of a slide is. More: fewer looks ahead, and more of them in vain where
/// an impact ends the slide.
const AHEAD: usize = 3;
const SHORT: f64 = 0.2;
/// Parts (1) known ahead at most.
const MOST_PARTS: usize = 64;
/// Time of its own (1) of a part of a rotation: sizes change little in it.
const EVEN: f64 = 1.2;

/// A slide that turns: what of it is known ahead, and the state where that ends.
#[derive(Clone, Default)]
pub struct Curve {
    rates: Rates,
    normal: DVec3,
    axes: [DVec3; 2],
    parts: VecDeque<Part>,
    next: Values,
    /// To which errors are compared, m/s.
    speed: f64,
}

/// What a slide did in some time: way, change of the velocity, the way summed over time, the ways of slip and turning, all in SI units; and what turning
/// is then, m/s.
#[derive(Default)]
pub struct Slid {
    pub way: DVec3,
    pub change: DVec3,
    pub sum: DVec3,
    pub slipped: f64,
    pub turned: f64,
    pub turning: DVec3,
}

impl Curve {
    /// From velocity and turning on a surface with normal `n` on.
    pub fn begin(&mut self, v: DVec3, q: DVec3, n: DVec3, rates: Rates) {
        let slip = v + q;
        let along = slip.normalize();
        // Turning is on the side of the second axis.
        let left = n.cross(along);
        let across = if q.dot(left) < 0.0 { -left } else { left };
        self.rates = rates;
        self.normal = n;
        self.axes = [along, across];
        self.parts.clear();
        self.speed = v.length() + q.length();
        let flat = |d: DVec3| DVec2::new(d.dot(along), d.dot(across));
        let (angle, v) = (flat(q).normalize(), flat(v));
        self.next = [0.0; 16];
        self.next[2..10].copy_from_slice(&[
            angle.x,
            angle.y,
            slip.length(),
            q.length(),
            1.0,
            0.0,
            v.x,
            v.y,
        ]);
    }

    /// Knows some parts ahead, while slip and turning are above a size each. Returns for how long, s, and a rate (1/s) faster than which the slip does not turn from now on.
    pub fn look_ahead(&mut self, last: [f64; 2]) -> (f64, f64) {
        let Rates { a, b, c } = self.rates;
        let mut time: f64 = self.parts.iter().map(|p| p.dt).sum();
        let is_short = |time: f64, slip: f64| slip < SHORT * time * (a + c);
        let goes_on = |at: &Values| at[4] > last[0] && at[5] > last[1];
        while self.parts.is_empty()
            || goes_on(&self.next)
                && self.parts.len() < MOST_PARTS
                && (self.parts.len() < AHEAD || is_short(time, slip(&self.next)))
        {
            let part = Part::new(self.next, self.speed, self.rates);
            self.next = part.at(part.end);
            for k in [2, 6] {
                let unit = DVec2::new(self.next[k], self.next[k + 1]).normalize();
                [self.next[k], self.next[k + 1]] = unit.to_array();
            }
            self.next[TIME] = 0.0;
            self.next[10..].fill(0.0);
            time += part.dt;
            self.parts.push_back(part);
        }
        // The angle between slip and turning grows; so the direction of the slip turns to one side. In a part its rate has a bound, and what it has
        // turned by the end of a part bounds it before.
        let first = self.parts[0].at(self.parts[0].begin);
        let across = if first[2] > 0.0 { 1.0 } else { first[3] };
        let begins = self.parts.iter().skip(1).map(|part| part.at(part.begin));
        let ends = begins.chain([self.next]);
        let (mut rate, mut least, mut begin) = (0.0, slip(&first), 0.0);
        for (part, end) in self.parts.iter().zip(ends) {
            // Resistance that is more than friction turns a falling slip into a rising one, within a part too.
            let within = if b > a + c {
                (part.begin - part.end).exp()
            } else {
                1.0
            };
            least = f64::min(least * within, slip(&end));
            let turned = along(&first).angle_to(along(&end)).abs();
            rate = f64::max(rate, (turned / begin).min(b * across / least));
            begin += part.dt;
        }
        (time, rate)
    }

    /// What happens in `dt` seconds from the begin of what is known on, and how the ball turns, whose turning over that of an angular velocity is `radius`;
    /// `spin` is the rest of the latter, of time.
    pub fn slides(
        &self,
        dt: f64,
        radius: f64,
        orientation: Option<(&mut DQuat, &dyn Fn(f64) -> DVec3)>,
    ) -> Slid {
        let mut found = Slid::default();
        let mut orientation = orientation;
        let [first, second] = self.axes;
        let world = |x: f64, y: f64| x * first + y * second;
        let turning = |at: &[f64; 8]| {
            let [_, _, cos, sin, _, p, ux, uy] = *at;
            p * world(ux * cos - uy * sin, ux * sin + uy * cos)
        };
        let mut done = 0.0;
        for part in &self.parts {
            let left = dt - done;
            let end = part.moment(left);
            let (first, last) = (part.at(part.begin), part.at(end));
            let d: Values = std::array::from_fn(|i| last[i] - first[i]);
            // Ways and their sums are from the start of the part on.
            let before = found.way - world(first[10], first[11]);
            found.sum += d[TIME] * before + world(d[12], d[13]);
            found.way += world(d[10], d[11]);
            found.change += world(d[8], d[9]);
            found.slipped += d[14];
            found.turned += d[15];
            if let Some((orientation, spin)) = &mut orientation {
                let w = |at: &[f64; 8]| {
                    -self.normal.cross(turning(at)) / radius + spin(done + at[TIME] - first[TIME])
                };
                let unit = 1.0 / (self.rates.a + self.rates.b + self.rates.c);
                let own = end - part.begin;
                let rate = |t: f64| {
                    let at = part.first_at(part.begin + t);
                    unit * at[4] * at[5] / (at[4] + at[5]) * w(&at)
                };
                let angle = own * rate(0.0).length().max(rate(own).length());
                let parts = parts_of(angle).max((own / EVEN).ceil());
                **orientation = turned(**orientation, own, parts, rate);
            }
            found.turning = turning(&part.first_at(end));
            done += part.dt;
            if done >= dt {
                break;
            }
        }
        found
    }

    /// Forgets the first `dt` seconds of what is known, and what of a part is then left that is no more than the rounding of times (s).
    pub fn pass(&mut self, mut dt: f64, rounding: f64) {
        while self
            .parts
            .front()
            .is_some_and(|part| part.dt <= dt + rounding)
        {
            dt = (dt - self.parts[0].dt).max(0.0);
            self.parts.pop_front();
        }
        if let Some(part) = self.parts.front_mut() {
            part.begin = part.moment(dt);
            part.dt -= dt;
        }
    }
}

fn slip(at: &Values) -> f64 {
    at[4]
}

fn along(at: &Values) -> DVec2 {
    DVec2::new(at[6], at[7])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vectors() -> impl Strategy<Value = [f64; 4]> {
        // Sizes from nothing to fast, in all directions.
        let size = || (-6.0..1.0f64).prop_map(|k| 10f64.powf(k));
        let angle = || 0.0..std::f64::consts::TAU;
        (size(), angle(), size(), angle()).prop_map(|(u, a, q, b)| [u, a, q, b])
    }

    proptest! {
        /// Energy, which nothing here is made from; the same in one way as in many; and the bound about the parabola.
        #[test]
        fn a_slide_that_turns([u, a, q, b] in vectors(), friction in 0.05..1.0f64, rolling in 0.001..0.3f64, share in 0.1..0.9f64) {
            let at = |size: f64, angle: f64| size * DVec3::new(angle.cos(), angle.sin(), 0.0);
            let (u, q) = (at(u, a), at(q, b));
            let kappa = 0.4;
            let rates = Rates { a: friction, b: rolling * friction / kappa, c: friction / kappa };
            let v = u - q;
            let last = 1e-7 * (v.length() + q.length());
            prop_assume!(u.length() > last && u.normalize().cross(q.normalize()).length() > 1e-9);
            let (mut whole, mut pieces) = (Curve::default(), Curve::default());
            whole.begin(v, q, DVec3::Z, rates);
            pieces.begin(v, q, DVec3::Z, rates);
            let (time, rate) = whole.look_ahead([last, 0.0]);
            pieces.look_ahead([last, 0.0]);
            let all = whole.slides(time, 1.0, None);
            let energy = |v: DVec3, q: DVec3| 0.5 * (v.length_squared() + kappa * q.length_squared());
            let works = rates.a * all.slipped + kappa * rates.b * all.turned;
            let lost = energy(v, q) - energy(v + all.change, all.turning);
            prop_assert!((works - lost).abs() <= 1e-11 * energy(v, q), "{works} {lost}");
            let (mut done, mut way, mut change) = (0.0, DVec3::ZERO, DVec3::ZERO);
            for k in 1..=5 {
                let t = time * share.powi(5 - k);
                let off = whole.slides(t, 1.0, None).way - (t * v - 0.5 * t * t * rates.a * u.normalize());
                let bound = rates.a * rate * t * t * t / 6.0;
                let speed = v.length() + q.length();
                let rounding = 1e-14 * speed * (t + speed / rates.c);
                prop_assert!(off.length() <= bound + rounding, "{off} {bound}");
                let next = pieces.slides(t - done, 1.0, None);
                pieces.pass(t - done, 0.0);
                pieces.look_ahead([last, 0.0]);
                (done, way, change) = (t, way + next.way, change + next.change);
            }
            prop_assert!((way - all.way).length() <= 1e-13 * v.length() * time, "{way} {}", all.way);
            prop_assert!((change - all.change).length() <= 1e-13 * v.length().max(q.length()));
        }
    }
}
