//! Motions that leave the numbers: noticed before the state is written, and told with sphere, contact and level.

use crate::contact::Contact;
use crate::force::total::weight_potential;
use crate::model::Model;
use crate::outcome::{within_bounds, BlowUp, Failure, Level, FASTEST};
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::Prediction;
use glam::DVec3;

/// Looks at every sphere of a step without a jump: where it is calm, [`find`] would find nothing.
#[derive(Default)]
pub(crate) struct Watch {
    /// Sums of squares: of all velocities, and of what the spheres went by, m^2.
    speed: f64,
    way: f64,
    carried: DVec3,
}

impl Watch {
    /// A sphere with the sum of the squares of its velocities, that went by `way` in the step, with what the next begins with.
    #[inline]
    pub fn look(&mut self, speed: f64, way: DVec3, next: [&Prediction; 2]) {
        self.speed += speed;
        self.way += way.length_squared();
        self.carried += carried(next);
    }

    pub fn join(&mut self, other: &Watch) {
        self.speed += other.speed;
        self.way += other.way;
        self.carried += other.carried;
    }

    /// After a step of `h`.
    pub fn is_calm(&self, h: f64) -> bool {
        // The way of the whole step: what the position level did counts too.
        self.speed + self.way / (h * h) <= FASTEST * FASTEST && self.carried.is_finite()
    }
}

/// Accelerations are no velocities, but the next step begins with them: the sum of the pseudo accelerations, which hold them, is a
/// number if all of them are.
#[inline]
fn carried([linear, angular]: [&Prediction; 2]) -> DVec3 {
    linear.pseudo + angular.pseudo
}

/// Fails at the first sphere whose motion has left the numbers in a step of `h`; `scratch.jump` holds the new velocities.
#[cold]
pub(crate) fn find(model: &Model, state: &State, scratch: &Scratch, h: f64) -> Result<(), Failure> {
    let mut energy = 0.0;
    for i in 0..model.bodies() {
        let ([v, w], x) = (scratch.jump[i], scratch.position[i]);
        energy += model.mass[i] * v.length_squared() + model.inertia[i] * w.length_squared();
        if state.present[i] {
            energy += weight_potential(model, i, x);
        }
        if !carried([&scratch.linear[i], &scratch.angular[i]]).is_finite() {
            return Err(Failure::BlowUp(BlowUp::alone(
                Level::Smooth,
                model.named(i as u32),
            )));
        }
        let way = (x - state.position[i]) / h;
        let slow = within_bounds(v, w) && within_bounds(way, DVec3::ZERO);
        if !(energy.is_finite() && slow) {
            return Err(Failure::BlowUp(locate(model, scratch, i, (v, way), h)));
        }
    }
    Ok(())
}

/// Where the motion of sphere `i`, of velocity `v` after a step of `h` in which it went `way` (a mean velocity), left the numbers:
/// at which level, and at which contact.
fn locate(model: &Model, scratch: &Scratch, i: usize, (v, way): (DVec3, DVec3), h: f64) -> BlowUp {
    let (linear, angular) = (&scratch.linear[i], &scratch.angular[i]);
    let body = model.named(i as u32);
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
