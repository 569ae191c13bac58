//! What can be touched: a closed set of shapes.
//!
//! An enum and not a trait: the set is known, a `match` is checked for completeness by the compiler, and the
//! loops over contacts must not call through a pointer. A new shape is a variant here, a row and a column in
//! [`crate::pair::table`], and one file per cell it fills.

use crate::pair::{sphere_plane, Proximity};
use glam::{DQuat, DVec3};

/// A shape. A sphere is placed by its body's centre, walls stand where they are. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Ball of the given radius (m) about the body's centre.
    Sphere {
        /// Radius (m), positive.
        radius: f64,
    },
    /// Everything behind an infinite plane: the set `normal . (y - point) <= 0`, in world coordinates.
    HalfSpace {
        /// Any point of the plane (m).
        point: DVec3,
        /// Unit normal, out of the solid and into the free space.
        normal: DVec3,
    },
}

/// A rigid displacement: the point `y` moves to `about + shift + turn (y - about)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Rotation about the point `about` (m).
    pub turn: DQuat,
    /// See `turn`.
    pub about: DVec3,
    /// Translation after it (m).
    pub shift: DVec3,
}

impl Displacement {
    /// Where the point `y` goes.
    #[inline]
    pub fn point(&self, y: DVec3) -> DVec3 {
        self.about + self.shift + self.turn * (y - self.about)
    }

    /// Where a direction goes, kept a unit vector.
    #[inline]
    pub fn direction(&self, d: DVec3) -> DVec3 {
        if self.turn == DQuat::IDENTITY {
            return d;
        }
        (self.turn * d).normalize()
    }
}

impl Shape {
    /// How a sphere with centre `x` (m) and radius `r` (m) meets this wall; `None` for shapes that are none.
    #[inline]
    pub fn meet(&self, x: DVec3, r: f64) -> Option<Proximity> {
        match *self {
            Shape::HalfSpace { point, normal } => Some(sphere_plane(x, r, point, normal)),
            Shape::Sphere { .. } => None,
        }
    }

    /// Lower bound of the gap of a sphere at this wall (m) that changes by no more than the centre moves, and is the gap
    /// itself where the sphere is near and on the free side. Infinite for shapes that are no walls.
    #[inline]
    pub fn clearance(&self, x: DVec3, r: f64) -> f64 {
        match *self {
            Shape::HalfSpace { point, normal } => normal.dot(x - point) - r,
            Shape::Sphere { .. } => f64::INFINITY,
        }
    }

    /// A point that the wall is placed by (m).
    #[inline]
    pub fn place(&self) -> DVec3 {
        match *self {
            Shape::HalfSpace { point, .. } => point,
            Shape::Sphere { .. } => DVec3::ZERO,
        }
    }

    /// The wall after a displacement.
    pub fn moved(&self, by: &Displacement) -> Shape {
        match *self {
            Shape::HalfSpace { point, normal } => Shape::HalfSpace {
                point: by.point(point),
                normal: by.direction(normal),
            },
            sphere @ Shape::Sphere { .. } => sphere,
        }
    }
}
