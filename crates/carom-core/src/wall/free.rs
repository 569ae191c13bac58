//! Free walls: planes with a mass that move along their normals, by what presses them. `docs/theory/algorithm.md` section 14.
//!
//! A free wall is a body like a ball: it has a place (its displacement from where it was given), a velocity, and a share in every contact
//! problem. Its guide takes what acts across the normal, and all moments.

use super::Wall;
use carom_geom::Shape;
use carom_laws::Scalar;
use glam::DVec3;

/// Moment of inertia of a free wall, kg m^2: its guide lets nothing turn it. Smaller: moments of rolling friction turn it by what numbers can tell.
pub const HELD_INERTIA: f64 = 1e30;
/// Cosine (1) by which planes may differ from parallel ones that an area lies between: rounding of directions. Larger: lengths between them have no meaning.
const ACROSS: f64 = 1e-9;

/// A length across a free wall, which may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// A periodic box has along this axis.
    Period(usize),
    /// Two parallel planes have between them: indices of walls.
    Between(u32, u32),
}

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
    /// What pushes it along its normal, N, a law of time; with an area a pressure, Pa.
    pub force: Scalar,
    /// Both sides of the area on which a pressure acts.
    pub area: Option<[Side; 2]>,
}

/// A free wall of a model.
#[derive(Clone, Debug)]
pub struct FreeWall {
    pub normal: DVec3,
    /// Along the normal, m/s^2.
    pub gravity: DVec3,
    /// Along the normal, N, a law of time; with an area Pa.
    force: Scalar,
    pub area: Option<[Side; 2]>,
}

impl FreeWall {
    /// Of a plane under gravity; quantity and what is wrong where it is none.
    pub fn new(
        walls: &[Wall],
        input: &FreeWallInput,
        (gravity, periodic): (DVec3, [f64; 3]),
    ) -> Result<FreeWall, (&'static str, String)> {
        let wall = &walls[input.wall as usize];
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
        for side in input.area.iter().flatten() {
            side.check(walls, periodic).map_err(|text| ("area", text))?;
        }
        let along = if input.weighs {
            gravity.dot(normal)
        } else {
            0.0
        };
        Ok(FreeWall {
            normal,
            gravity: along * normal,
            force: input.force.clone(),
            area: input.area,
        })
    }

    /// The given force along the normal at a time, N; with an area the pressure, Pa.
    pub fn pushed(&self, time: f64) -> DVec3 {
        self.force.value(time) * self.normal
    }
}

impl Side {
    /// What is wrong with it, if anything is.
    fn check(self, walls: &[Wall], periodic: [f64; 3]) -> Result<(), String> {
        let fits = match self {
            Side::Period(axis) => periodic.get(axis).is_some_and(|l| *l > 0.0),
            Side::Between(a, b) => {
                let plane = |index: u32| walls.get(index as usize).map(|wall| wall.shape);
                matches!((plane(a), plane(b)),
                    (Some(Shape::HalfSpace { normal: m, .. }), Some(Shape::HalfSpace { normal: n, .. }))
                        if m.dot(n) < ACROSS - 1.0)
            }
        };
        match fits {
            true => Ok(()),
            false => Err("is between no two parallel planes, and no period".to_owned()),
        }
    }
}
