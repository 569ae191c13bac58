//! What can be touched: a closed set of shapes.
//!
//! An enum and not a trait: the set is known, a `match` is checked for completeness by the compiler, and the
//! loops over contacts must not call through a pointer. A new shape is a variant here, a row and a column in
//! [`crate::pair::table`], and one file per cell it fills.

use glam::DVec3;

/// A shape, without its pose. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Ball of the given radius (m) about the body's centre.
    Sphere {
        /// Radius (m), positive.
        radius: f64,
    },
    /// Everything behind an infinite plane: the set `normal . (y - point) <= 0`, in world coordinates.
    /// It has no pose of its own, so a moving wall is a new `point`.
    HalfSpace {
        /// Any point of the plane (m).
        point: DVec3,
        /// Unit normal, out of the solid and into the free space.
        normal: DVec3,
    },
}
