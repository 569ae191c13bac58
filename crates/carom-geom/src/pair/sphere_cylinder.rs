//! Sphere and cylinder, from outside or from inside, infinite or open at both ends.
//!
//! With `rho e_rho` the place of the centre across the axis, `a` the radius of the wall and `o = 1` outside, `-1` inside:
//!
//! ```text
//! n = o e_rho,   gap = o (rho - a) - r,   d n = (o/rho) (I - n n^T - z z^T) dx
//! ```
//!
//! Beyond the ends of a finite one the sphere meets the circle there (`ring.rs`). A finite one is a sheet with two
//! faces (`ring::face`); an infinite one fills the space behind.

use super::ring::{face, sphere_ring, Polar};
use super::Proximity;
use glam::DVec3;

/// A cylinder in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Centre of its axis.
    pub centre: DVec3,
    /// Unit vector along it.
    pub axis: DVec3,
    /// Radius, positive.
    pub radius: f64,
    /// Half of its length, infinite for one without ends.
    pub half: f64,
    /// Spheres live within.
    pub inside: bool,
}

/// Sphere with centre `x` (m) and radius `r` (m) at a cylinder. On the axis the inside has any normal across it, and curvature 0.
#[inline]
pub fn sphere_cylinder(x: DVec3, r: f64, wall: &Cylinder) -> Proximity {
    let at = Polar::new(x, wall.centre, wall.axis);
    if at.height.abs() > wall.half {
        let beyond = Polar {
            height: at.height - wall.half.copysign(at.height),
            ..at
        };
        return sphere_ring(beyond, r, wall.radius, wall.axis);
    }
    let o = if wall.inside { -1.0 } else { 1.0 };
    let height = o * (at.distance - wall.radius);
    let side = Proximity {
        gap: height - r,
        normal: o * at.outward,
        curvature: if at.distance > 0.0 {
            o / at.distance
        } else {
            0.0
        },
        flat: wall.axis,
    };
    if wall.half == f64::INFINITY {
        side
    } else {
        face(height, r, side)
    }
}

/// Distance that a sphere's surface is compared with (m): signed at an infinite cylinder, on either side of a finite one.
#[inline]
pub(crate) fn distance(x: DVec3, wall: &Cylinder) -> f64 {
    let at = Polar::new(x, wall.centre, wall.axis);
    let height = at.distance - wall.radius;
    if wall.half == f64::INFINITY {
        return if wall.inside { -height } else { height };
    }
    height.hypot((at.height.abs() - wall.half).max(0.0))
}
