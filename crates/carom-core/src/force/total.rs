//! All loads of a model together: forces, potential energy and power at a motion.

use crate::force::{Dependence, Load, LoadError, Motion};
use crate::model::Model;
use crate::state::State;
use crate::stepper::Span;
use crate::wall::{FreeWall, Side};
use carom_geom::Shape;
use glam::DVec3;
use std::sync::Arc;

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
    // Functions of the user know balls alone.
    for (i, clump) in model.numbered_clumps() {
        for ball in clump.balls.clone() {
            let [force, moment] = std::mem::take(&mut wrench[ball]);
            let lever = at.position[ball] - at.position[i];
            let of_ball = [force, moment + lever.cross(force)];
            wrench[i] = std::array::from_fn(|k| wrench[i][k] + of_ball[k]);
        }
    }
    Ok(())
}

/// `sum F^2/m + M^2/I` of the loads beside the weight, N^2/kg, of those that cancel too: times `h^2/2`, J, it is what they
/// give from rest in a step.
pub fn pushed(model: &Model, at: &Motion, wrench: &[[DVec3; 2]]) -> f64 {
    let of_body = |(i, [f, m]): (usize, &[DVec3; 2])| {
        model.inv_mass[i] * f.length_squared() + model.inv_inertia[i] * m.length_squared()
    };
    let of_parts = |load: &Arc<dyn Load>| {
        let parts = load.magnitude(at).parts;
        let ends = load.bodies().into_iter().flatten();
        ends.map(|body| model.inv_mass[body as usize] * parts * parts)
            .sum::<f64>()
    };
    let together: f64 = wrench.iter().enumerate().map(of_body).sum();
    together + model.loads.iter().map(of_parts).sum::<f64>()
}

/// Weight of body `i`, N.
#[inline]
pub fn weight(model: &Model, i: usize) -> DVec3 {
    model.mass[i] * model.gravity_of(i)
}

/// How long a side of an area is, m, with free walls displaced so, and all others where they are at a time.
fn length(model: &Model, side: Side, displaced: &[DVec3], time: f64) -> f64 {
    let place = |index: u32| {
        let wall = &model.walls[index as usize];
        let moved = match (displaced.get(index as usize), &wall.motion) {
            (Some(by), _) => *by,
            (None, Some(motion)) => motion.at(time).0.shift,
            (None, None) => DVec3::ZERO,
        };
        (wall.shape.place() + moved, wall.shape)
    };
    match side {
        Side::Period(axis) => model.periodic_at(time)[axis],
        Side::Between(a, b) => match place(a) {
            (from, Shape::HalfSpace { normal, .. }) => normal.dot(place(b).0 - from).max(0.0),
            _ => 0.0,
        },
    }
}

/// Displacements of free walls at the end of a step of size `h`, as far as its start tells: what presses a wall must not depend on what is looked for.
pub fn displaced_ahead(model: &Model, state: &State, h: f64) -> Vec<DVec3> {
    let walls = model.first_wall()..model.bodies();
    walls
        .map(|i| state.position[i] + h * state.velocity[i])
        .collect()
}

/// The given force of a free wall at a time, N, with free walls displaced so.
pub fn wall_force(model: &Model, wall: &FreeWall, displaced: &[DVec3], time: f64) -> DVec3 {
    let sides = wall.area.iter().flatten();
    let area: f64 = sides
        .map(|side| length(model, *side, displaced, time))
        .product();
    area * wall.pushed(time)
}

/// Work of the given force of a free wall in a step, J, in which it goes this way. Where impacts change its velocity within the step, places tell that
/// work and velocities do not.
pub fn wall_work(model: &Model, wall: &FreeWall, state: &State, span: Span, way: DVec3) -> f64 {
    let start = wall_force(
        model,
        wall,
        &state.position[model.first_wall()..],
        span.start,
    );
    let ahead = displaced_ahead(model, state, span.h);
    0.5 * (start + wall_force(model, wall, &ahead, span.end)).dot(way)
}

/// Acceleration of a body by its weight, and by the given force of a free wall, at a time, m/s^2.
pub fn own_acceleration(model: &Model, displaced: &[DVec3], body: usize, time: f64) -> DVec3 {
    match model.free_wall(body) {
        Some(wall) => {
            wall.gravity + model.inv_mass[body] * wall_force(model, wall, displaced, time)
        }
        None => model.gravity,
    }
}

/// Weight of body `i`, and the given force if it is a free wall, at a time, N; free walls were `displaced` so.
#[inline]
pub fn own_force(model: &Model, displaced: &[DVec3], i: usize, time: f64) -> DVec3 {
    match model.free_wall(i) {
        Some(wall) => weight(model, i) + wall_force(model, wall, displaced, time),
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
pub fn power(model: &Model, at: &Motion) -> Result<f64, LoadError> {
    model.loads.iter().map(|load| load.power(at)).sum()
}
