//! Sphere and a ball that is a wall, from outside or from inside.
//!
//! From outside two spheres; from inside, with `d = |x - c|` and `R` the radius of the wall:
//!
//! ```text
//! n = -(x - c)/d,   gap = R - d - r,   d n = -(1/d) (I - n n^T) dx
//! ```

use super::{sphere_sphere, Proximity};
use glam::DVec3;

/// A ball in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre.
    pub centre: DVec3,
    /// Radius, positive.
    pub radius: f64,
    /// Spheres live within.
    pub inside: bool,
}

/// Sphere with centre `x` (m) and radius `r` (m) at a ball. At its very centre the inside has no normal: `-z` and curvature 0.
#[inline]
pub fn sphere_ball(x: DVec3, r: f64, wall: &Ball) -> Proximity {
    if !wall.inside {
        return sphere_sphere(x, r, wall.centre, wall.radius);
    }
    let to = sphere_sphere(x, 0.0, wall.centre, 0.0);
    Proximity {
        gap: wall.radius - to.gap - r,
        normal: -to.normal,
        curvature: -to.curvature,
        flat: DVec3::ZERO,
    }
}
