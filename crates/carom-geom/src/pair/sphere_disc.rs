//! Sphere and disc, or ring: two faces and its rims.
//!
//! Over the face (`hole <= rho <= radius`) as at a plane, beyond it as at a circle (`ring.rs`). The face has no back, see
//! `ring::face`; a rim is met from all sides.

use super::ring::{face, sphere_ring, Polar};
use super::{sphere_plane, Proximity};
use glam::DVec3;

/// A disc in space, with a hole if it is a ring. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Centre.
    pub centre: DVec3,
    /// Unit normal, into the free space.
    pub normal: DVec3,
    /// Outer radius, positive.
    pub radius: f64,
    /// Inner radius, 0 for a full disc.
    pub hole: f64,
}

/// Sphere with centre `x` (m) and radius `r` (m) at a disc.
#[inline]
pub fn sphere_disc(x: DVec3, r: f64, disc: &Disc) -> Proximity {
    let at = Polar::new(x, disc.centre, disc.normal);
    if at.distance > disc.radius {
        return sphere_ring(at, r, disc.radius, disc.normal);
    }
    if at.distance < disc.hole {
        return sphere_ring(at, r, disc.hole, disc.normal);
    }
    face(at.height, r, sphere_plane(x, r, disc.centre, disc.normal))
}

/// Distance from a disc (m), on either side.
#[inline]
pub(crate) fn distance(x: DVec3, disc: &Disc) -> f64 {
    let at = Polar::new(x, disc.centre, disc.normal);
    let beyond = (at.distance - disc.radius)
        .max(disc.hole - at.distance)
        .max(0.0);
    beyond.hypot(at.height)
}
