//! Sphere and half-space.
//!
//! With `x_0` a point of the plane and `n` its unit normal, which points from the solid (B) to the sphere (A):
//!
//! ```text
//! gap = n . (x_A - x_0) - r_A
//! d gap / d x_A = n^T,   d n / d x_A = 0
//! ```
//!
//! The limit of eqs. 31, 33, 39, 42 for a sphere B of infinite radius. A centre behind the plane has a gap below
//! `-r_A` and is pushed out on the free side: a half-space has no back.

use super::Proximity;
use glam::DVec3;

/// Sphere with centre `x` (m) and radius `r` (m) at the plane through `point` (m) with unit `normal`.
#[inline]
pub fn sphere_plane(x: DVec3, r: f64, point: DVec3, normal: DVec3) -> Proximity {
    Proximity {
        gap: normal.dot(x - point) - r,
        normal,
        curvature: 0.0,
        flat: DVec3::ZERO,
    }
}
