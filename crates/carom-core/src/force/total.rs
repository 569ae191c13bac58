//! All loads of a model together: forces, potential energy and power at a motion.

use crate::force::{Dependence, LoadError, Motion};
use crate::model::Model;
use crate::state::State;
use glam::DVec3;

/// Adds all loads at a motion to `wrench (N)`. A law that leaves its domain, or a function of the user that gives no
/// number, is an error: nothing that follows would see it. Loads that depend on the motion are closed forms, and are
/// not finite only where the motion runs away.
pub fn add_loads(model: &Model, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
    for (index, load) in model.loads.iter().enumerate() {
        load.add(at, wrench)?;
        let bodies = match (load.dependence(), load.bodies()[0]) {
            (Dependence::Motion(..), _) => continue,
            (_, Some(body)) => body as usize..body as usize + 1,
            (_, None) => 0..wrench.len(),
        };
        for i in bodies {
            let [force, moment] = wrench[i];
            if !(force.is_finite() && moment.is_finite()) {
                let text = format!(
                    "load {} gives {force} N and {moment} N m at t = {} s; they must be finite",
                    index + 1,
                    at.time
                );
                return Err(LoadError::on(i as u32, text));
            }
        }
    }
    Ok(())
}

/// Weight of body `i`, N.
#[inline]
pub fn weight(model: &Model, i: usize) -> DVec3 {
    model.mass[i] * model.gravity_of(i)
}

/// Weight of body `i`, and the given force if it is a free wall, at a time, N.
#[inline]
pub fn own_force(model: &Model, i: usize, time: f64) -> DVec3 {
    match model.free_wall(i) {
        Some(wall) => weight(model, i) + wall.force(time),
        None => weight(model, i),
    }
}

/// Potential energy of the weight of body `i` at `x`, J, with its zero at the origin (of a free wall: where it was given).
#[inline]
pub fn weight_potential(model: &Model, i: usize, x: DVec3) -> f64 {
    -weight(model, i).dot(x)
}

/// The motion of a state, as loads see it.
pub fn motion_of(state: &State, time: f64) -> Motion<'_> {
    Motion {
        time,
        position: &state.position,
        orientation: &state.orientation,
        velocity: &state.velocity,
        angular_velocity: &state.angular_velocity,
    }
}

/// Power of the loads that have no potential, W.
pub(crate) fn power(model: &Model, at: &Motion) -> f64 {
    model.loads.iter().map(|load| load.power(at)).sum()
}
