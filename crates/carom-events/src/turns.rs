//! How a ball turns along its motion.

use crate::motion::Motion;
use glam::DVec3;

/// Angle (rad) of a part of a rotation whose axis turns: its error is about the seventh power of that, times how far the axis turns.
const MOST_TURN: f64 = 0.25;
/// Parts of such a rotation between two events or frames: bounds the time that one takes.
const MOST_PARTS: f64 = 1e5;

impl Motion {
    /// The rotation between two times, in parts of which each is exact to the sixth order: spatial increments (rad), in their order.
    pub fn turns(&self, from: f64, to: f64) -> impl Iterator<Item = DVec3> + '_ {
        let (t0, t1) = (from - self.start, to - self.start);
        let whole = t1 - t0;
        let at = move |t: f64| self.turning(t);
        let turning = self.terms > 3 || self.w[0].cross(self.w[1]) != DVec3::ZERO;
        // About one line it is exact; else the error of a part is of seventh order.
        let parts = if turning {
            let rate = at(t0).length().max(at(t1).length());
            (whole * rate / MOST_TURN).ceil().clamp(1.0, MOST_PARTS)
        } else {
            1.0
        };
        let dt = whole / parts;
        let node = 0.15f64.sqrt() * dt;
        (0..parts as u32).map(move |k| {
            let middle = t0 + (f64::from(k) + 0.5) * dt;
            let [first, mean, last] = [middle - node, middle, middle + node].map(at);
            // Magnus, with the three nodes of Gauss (S. Blanes, F. Casas, J. A. Oteo and J. Ros, Physics Reports 470, 2009, sec. 5.4).
            let a = dt * mean;
            let b = dt * 15.0f64.sqrt() / 3.0 * (last - first);
            let c = dt * 10.0 / 3.0 * (last - 2.0 * mean + first);
            let ab = a.cross(b);
            let rest = a.cross(2.0 * c + ab) / -60.0;
            a + c / 12.0 + (ab - 20.0 * a - c).cross(b + rest) / 240.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// Against many small rotations at the rate of their middle.
    #[test]
    fn orientations_follow_an_axis_that_turns() {
        let mut motion = Motion::plain([DVec3::ZERO; 3], DVec3::new(30.0, -10.0, 80.0));
        motion.w[1] = DVec3::new(-90.0, 40.0, -20.0);
        let advance = |q: DQuat, psi: DVec3| carom_core::rotation::advance(psi, q);
        let found = motion.turns(0.0, 0.4).fold(DQuat::IDENTITY, advance);
        let many = 2_000_000;
        let dt = 0.4 / f64::from(many);
        let exact = (0..many).fold(DQuat::IDENTITY, |q, k| {
            let t = (f64::from(k) + 0.5) * dt;
            advance(q, dt * (motion.w[0] + t * motion.w[1]))
        });
        let apart = 2.0 * (found * exact.inverse()).xyz().length();
        assert!(apart < 1e-9, "{apart}");
    }
}
