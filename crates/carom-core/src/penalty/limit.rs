//! The longest substep that a pair admits.

use super::elastic::Elastic;
use super::pair::Pair;
use crate::penalty::bodies::Bodies;
use glam::DVec3;

/// Substep over the time constant of the damping at the default resolution of 50: with 0.1 a rebound has e to 1e-3.
const DAMPING_SHARE: f64 = 50.0 * 0.1;

impl Pair {
    /// The longest substep that this pair admits: a share of its contact time once it touches, and before that the time in
    /// which it cannot touch. `shortest` is what others ask for already.
    #[inline]
    pub fn longest_substep(
        &self,
        elastic: &Elastic,
        bodies: &Bodies,
        resolution: f64,
        shortest: f64,
    ) -> f64 {
        let s = if self.closed {
            self.closing_speed(bodies)
        } else {
            self.fastest_closing(bodies)
        };
        let (speed, free) = if self.closed {
            (s, 0.0)
        } else {
            // The distance of centres is convex in time for straight motion: gap(t) >= gap - s t - a t^2/2.
            let (a, b) = (self.a as usize, self.b as usize);
            let between = bodies.acceleration[a] - bodies.acceleration[b];
            let accel = if b < bodies.position.len() {
                between.length()
            } else {
                (-self.normal.dot(between)).max(0.0)
            };
            let hit = (s * s + 2.0 * accel * self.gap).sqrt();
            let free = if s > 0.0 {
                2.0 * self.gap / (s + hit)
            } else if accel > 0.0 {
                (hit - s) / accel
            } else {
                f64::INFINITY
            };
            if free >= shortest {
                return free;
            }
            (hit, free)
        };
        // The energy of the collision, which stays the same over an elastic one; a contact at rest has that of its load.
        let mut pressed = self.elastic * -self.gap;
        let load = self.pressing(&bodies.smooth) / self.inv_mass;
        if load > self.elastic {
            pressed = load * elastic.indentation(self.stiffness, load);
        }
        let energy = 0.5 * speed * speed / self.inv_mass + elastic.energy(pressed, 1.0);
        let reference = self.touch.approach.max(speed);
        let damped = if self.closed && reference > 0.0 {
            1.0 + self.values.damping * speed.max(0.0) / reference
        } else {
            1.0 + self.values.damping
        };
        let v = (2.0 * energy * self.inv_mass).sqrt();
        let time = elastic.contact_time(self.stiffness, self.inv_mass, v, damped);
        let mut contact = time / resolution;
        // A damping that outruns the motion has a time of its own; not where the load holds the contact at rest.
        if self.closed && self.elastic > 2.0 * load && reference > 0.0 {
            let rate = self.values.damping * self.elastic * self.inv_mass / reference;
            let share = (self.values.damping * speed.abs() / reference).min(1.0);
            contact = contact.min(DAMPING_SHARE / (resolution * rate * share));
        }
        free.max(contact)
    }

    /// Acceleration by which loads press the pair together, m/s^2; 0 if they pull it apart.
    #[inline]
    pub(super) fn pressing(&self, smooth: &[[DVec3; 2]]) -> f64 {
        let (a, b) = (self.a as usize, self.b as usize);
        self.normal.dot(smooth[b][0] - smooth[a][0]).max(0.0)
    }
}
