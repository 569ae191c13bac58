//! How a ball turns along its motion.

use carom_core::rotation;
use glam::{DQuat, DVec3};

/// Angle (rad) of a part of a rotation whose axis turns: its error is about the seventh power of that, times how far the axis turns.
const MOST_TURN: f64 = 0.25;
/// Parts of such a rotation between two events or frames: bounds the time that one takes.
const MOST_PARTS: f64 = 1e5;

/// Into how many parts a rotation about an axis that turns is cut, of an angle (rad): the error of each is of seventh order.
pub fn parts_of(angle: f64) -> f64 {
    (angle / MOST_TURN).ceil().clamp(1.0, MOST_PARTS)
}

/// An orientation after a rotation at the rate `at` of something that goes from 0 to `whole`, in equal parts, each exact to the sixth order.
pub fn turned(orientation: DQuat, whole: f64, parts: f64, at: impl Fn(f64) -> DVec3) -> DQuat {
    let dt = whole / parts;
    let node = 0.15f64.sqrt() * dt;
    (0..parts as u32).fold(orientation, |orientation, k| {
        let middle = (f64::from(k) + 0.5) * dt;
        let [first, mean, last] = [middle - node, middle, middle + node].map(&at);
        // Magnus, with the three nodes of Gauss (S. Blanes, F. Casas, J. A. Oteo and J. Ros, Physics Reports 470, 2009, sec. 5.4).
        let a = dt * mean;
        let b = dt * 15.0f64.sqrt() / 3.0 * (last - first);
        let c = dt * 10.0 / 3.0 * (last - 2.0 * mean + first);
        let ab = a.cross(b);
        let rest = a.cross(2.0 * c + ab) / -60.0;
        let turn = a + c / 12.0 + (ab - 20.0 * a - c).cross(b + rest) / 240.0;
        rotation::advance(turn, orientation)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against many small rotations at the rate of their middle.
    #[test]
    fn orientations_follow_an_axis_that_turns() {
        let (w, rate) = (
            DVec3::new(30.0, -10.0, 80.0),
            DVec3::new(-90.0, 40.0, -20.0),
        );
        let found = turned(DQuat::IDENTITY, 0.4, parts_of(0.4 * w.length()), |t| {
            w + t * rate
        });
        let many = 2_000_000;
        let dt = 0.4 / f64::from(many);
        let exact = (0..many).fold(DQuat::IDENTITY, |q, k| {
            let t = (f64::from(k) + 0.5) * dt;
            rotation::advance(dt * (w + t * rate), q)
        });
        let apart = 2.0 * (found * exact.inverse()).xyz().length();
        assert!(apart < 1e-9, "{apart}");
    }
}
