//! Free walls: planes with a mass that move along their normals, by what presses them. `docs/theory/algorithm.md` section 14.
//!
//! A free wall is a body like a ball: it has a place (its displacement from where it was given), a velocity, and a share in every contact
//! problem. Its guide takes what acts across the normal, and all moments.

use super::{checked, Wall};
use crate::force::{Dependence, Load, LoadError, Motion};
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
#[derive(Clone, Copy, Debug)]
pub struct FreeWall {
    pub normal: DVec3,
    /// Along the normal, m/s^2.
    pub gravity: DVec3,
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
        checked(&wall.shape)?;
        let along = if input.weighs {
            gravity.dot(normal)
        } else {
            0.0
        };
        Ok(FreeWall {
            normal,
            gravity: along * normal,
        })
    }
}

/// The force on a free wall along its normal.
#[derive(Clone, Debug)]
pub struct Press {
    pub body: u32,
    pub normal: DVec3,
    /// N, a law of time.
    pub force: Scalar,
}

impl Press {
    /// Displacement of the wall along its normal, m.
    fn along(&self, at: &Motion) -> f64 {
        self.normal.dot(at.position[self.body as usize])
    }
}

impl Load for Press {
    fn dependence(&self) -> Dependence {
        Dependence::Time
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        [Some(self.body), None]
    }

    fn check(&self) -> Result<(), (&'static str, String)> {
        let law = &self.force;
        law.check_slope_at_start().map_err(|text| ("force", text))
    }

    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        let force = self.force.value(at.time);
        if !force.is_finite() {
            let text = format!("force {force} N at t = {} s", at.time);
            return Err(LoadError::on(self.body, text));
        }
        wrench[self.body as usize][0] += force * self.normal;
        Ok(())
    }

    /// `-F(t) s`: where impacts change the velocity within a step, places tell the work of the force and velocities do not.
    fn potential(&self, at: &Motion) -> f64 {
        -self.force.value(at.time) * self.along(at)
    }

    fn power(&self, at: &Motion) -> f64 {
        -self.force.slope(at.time) * self.along(at)
    }
}
