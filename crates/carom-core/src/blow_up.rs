//! Motions that leave the numbers: noticed before the state is written, and told with sphere, contact and level.

use crate::contact::Contact;
use crate::report::Level;
use crate::scratch::Scratch;
use glam::DVec3;

/// Speeds (m/s, rad/s) beyond which a motion has blown up: a thousand times what a scenario may begin with. At 1e150 their
/// squares leave the range of numbers, and nothing that is computed between here and there means anything.
pub(crate) const FASTEST: f64 = 1e12;

/// Where a motion left the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlowUp {
    /// Of the sub-problem.
    pub level: Level,
    /// The sphere, and the body of the contact at which it happened; the sphere itself where it touches nothing.
    pub bodies: (u32, u32),
    /// m/s; not a number or infinite where the velocity is neither.
    pub speed: f64,
}

impl BlowUp {
    /// Of a sphere that touches nothing; its speed is no number.
    pub fn alone(level: Level, body: u32) -> BlowUp {
        BlowUp {
            level,
            bodies: (body, body),
            speed: f64::NAN,
        }
    }

    /// Of a sphere of velocity `v`; the contact is the first of `touching` that it has a part in.
    pub fn of(
        level: Level,
        body: u32,
        v: DVec3,
        mut touching: impl Iterator<Item = (u32, u32)>,
    ) -> BlowUp {
        BlowUp {
            level,
            bodies: touching
                .find(|&(a, b)| a == body || b == body)
                .unwrap_or((body, body)),
            speed: v.length(),
        }
    }
}

/// Whether velocities are numbers, and of a size at which numbers still mean something.
#[inline]
pub(crate) fn within_bounds(v: DVec3, w: DVec3) -> bool {
    // Written so that what is not a number is not within.
    v.length_squared() <= FASTEST * FASTEST && w.length_squared() <= FASTEST * FASTEST
}

/// Where the motion of sphere `i`, of velocity `v` after a step of `h` in which it went `way` (a mean velocity), left the numbers:
/// at which level, and at which contact.
#[cold]
pub(crate) fn locate(scratch: &Scratch, i: usize, (v, way): (DVec3, DVec3), h: f64) -> BlowUp {
    let (linear, angular) = (&scratch.linear[i], &scratch.angular[i]);
    let body = i as u32;
    let smooth = within_bounds(linear.velocity, angular.velocity)
        && within_bounds(linear.displacement / h, angular.displacement / h);
    if !smooth {
        return BlowUp::of(Level::Smooth, body, linear.velocity, [].into_iter());
    }
    let [shift, turn] = scratch.shift[i];
    let (level, speed) = if within_bounds(way, DVec3::ZERO) && within_bounds(shift / h, turn / h) {
        (Level::Velocity, v)
    } else {
        (Level::Position, way)
    };
    let contacts = scratch
        .contacts
        .iter()
        .filter(|c| c.a == body || c.b == body);
    // The largest multiplier first; one that is no number counts as the largest.
    let size = |c: &Contact| {
        let values = if level == Level::Position {
            c.nu
        } else {
            c.lambda
        };
        values.iter().fold(0.0f64, |m, x| {
            if x.is_finite() {
                m.max(x.abs())
            } else {
                f64::INFINITY
            }
        })
    };
    let mut touching: Vec<&Contact> = contacts.collect();
    touching.sort_by(|a, b| size(b).total_cmp(&size(a)));
    BlowUp::of(level, body, speed, touching.into_iter().map(|c| (c.a, c.b)))
}
