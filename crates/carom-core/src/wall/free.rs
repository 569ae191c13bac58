//! Free walls: planes with a mass that move along their normals, by what presses them. `docs/theory/algorithm.md` section 14.
//!
//! A free wall is a body like a ball: it has a place (its displacement from where it was given), a velocity, and a share in every contact
//! problem. Its guide takes what acts across the normal, and all moments.

use super::Wall;
use crate::stepper::Span;
use carom_geom::Shape;
use carom_laws::Scalar;
use glam::DVec3;

/// Moment of inertia of a free wall, kg m^2: its guide lets nothing turn it. Smaller: moments of rolling friction turn it by what numbers can tell.
pub const HELD_INERTIA: f64 = 1e30;

/// A free wall as it is given.
#[derive(Clone, Debug)]
pub struct FreeWallInput {
    /// Index among the walls: the first ones are free.
    pub wall: u32,
    /// kg.
    pub mass: f64,
    /// Along its normal at the start, m/s.
    pub velocity: f64,
    /// Whether gravity pulls it along its normal.
    pub weighs: bool,
    /// What pushes it along its normal, N, a law of time.
    pub force: Scalar,
}

/// A free wall of a model.
#[derive(Clone, Debug)]
pub struct FreeWall {
    pub normal: DVec3,
    /// Along the normal, m/s^2.
    pub gravity: DVec3,
    /// Along the normal, N, a law of time.
    force: Scalar,
}

impl FreeWall {
    /// Of a plane under gravity; quantity and what is wrong where it is none.
    pub fn new(
        wall: &Wall,
        input: &FreeWallInput,
        gravity: DVec3,
    ) -> Result<FreeWall, (&'static str, String)> {
        let Shape::HalfSpace { normal, .. } = wall.shape else {
            return Err(("shape", "must be a plane without end".to_owned()));
        };
        if wall.motion.is_some() {
            let text = "is prescribed; a free wall moves by what presses it".to_owned();
            return Err(("motion", text));
        }
        if !input.velocity.is_finite() {
            let text = format!("is {}; it must be finite", input.velocity);
            return Err(("velocity", text));
        }
        let law = &input.force;
        law.check_at_start().map_err(|text| ("force", text))?;
        let along = if input.weighs {
            gravity.dot(normal)
        } else {
            0.0
        };
        Ok(FreeWall {
            normal,
            gravity: along * normal,
            force: input.force.clone(),
        })
    }

    /// The given force at a time, N.
    pub fn force(&self, time: f64) -> DVec3 {
        self.force.value(time) * self.normal
    }

    /// Work of the force in a step, J, in which the wall moves from one place to another. Where impacts change its velocity within the step,
    /// places tell that work and velocities do not.
    pub fn work(&self, span: Span, [from, to]: [DVec3; 2]) -> f64 {
        0.5 * (self.force(span.start) + self.force(span.end)).dot(to - from)
    }
}
