//! Sphere and frustum of a cone, from outside or from inside, open at both ends.
//!
//! In the half-plane of the axis (height `s`) and the centre (distance `rho`) the wall is the segment from `(radius, 0)` to
//! `(radius_end, length)`. With `(m_rho, m_s)` its unit normal away from the axis, `g` the direction of the segment and `o` as
//! at the cylinder:
//!
//! ```text
//! n = o (m_rho e_rho + m_s z),   d n = (o m_rho/rho) (I - n n^T - g g^T) dx
//! ```
//!
//! Beyond the ends of the segment the sphere meets the circles there (`ring.rs`); the other side has no surface (`ring::face`).

use super::ring::{face, sphere_ring, Polar};
use super::Proximity;
use glam::DVec3;

/// A frustum in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Centre of its first ring.
    pub point: DVec3,
    /// Unit vector from there to the centre of the other.
    pub axis: DVec3,
    /// Radii of the first ring and of the other; one of them may be 0.
    pub radius: f64,
    /// See `radius`.
    pub radius_end: f64,
    /// Distance of the rings along the axis, positive.
    pub length: f64,
    /// Spheres live within.
    pub inside: bool,
}

impl Cone {
    /// Place of a centre along the segment, as a share of it, and its height above it away from the axis (m); cosine and sine
    /// of the segment against the axis.
    #[inline]
    fn along(&self, at: &Polar) -> (f64, f64, [f64; 2]) {
        let (widens, u) = (self.radius_end - self.radius, at.distance - self.radius);
        let slant = widens.hypot(self.length);
        let (cos, sin) = (self.length / slant, widens / slant);
        let share = (u * sin + at.height * cos) / slant;
        (share, u * cos - at.height * sin, [cos, sin])
    }

    /// The ring that a centre beyond the ends meets: its radius and its height.
    #[inline]
    fn end(&self, share: f64) -> (f64, f64) {
        if share < 0.0 {
            (self.radius, 0.0)
        } else {
            (self.radius_end, self.length)
        }
    }
}

/// Sphere with centre `x` (m) and radius `r` (m) at a cone. On the axis the normal is any of those around it, with curvature 0.
#[inline]
pub fn sphere_cone(x: DVec3, r: f64, wall: &Cone) -> Proximity {
    let at = Polar::new(x, wall.point, wall.axis);
    let (share, height, [cos, sin]) = wall.along(&at);
    if !(0.0..=1.0).contains(&share) {
        let (radius, level) = wall.end(share);
        let beyond = Polar {
            height: at.height - level,
            ..at
        };
        return sphere_ring(beyond, r, radius, wall.axis);
    }
    let o = if wall.inside { -1.0 } else { 1.0 };
    let side = Proximity {
        gap: o * height - r,
        normal: o * (cos * at.outward - sin * wall.axis),
        curvature: if at.distance > 0.0 {
            o * cos / at.distance
        } else {
            0.0
        },
        flat: sin * at.outward + cos * wall.axis,
    };
    face(o * height, r, side)
}

/// Distance from a cone (m), on either side.
#[inline]
pub(crate) fn distance(x: DVec3, wall: &Cone) -> f64 {
    let at = Polar::new(x, wall.point, wall.axis);
    let (share, height, _) = wall.along(&at);
    if (0.0..=1.0).contains(&share) {
        return height.abs();
    }
    let (radius, level) = wall.end(share);
    (at.distance - radius).hypot(at.height - level)
}
