//! Sphere and circle: the rim of a disc, the open end of a cylinder or a cone.
//!
//! With `a` the radius of the circle about the axis `z`, `s` the height of the centre above its plane and `rho e_rho` its place
//! in it, the closest point is `a e_rho` and
//!
//! ```text
//! d   = ((rho - a)^2 + s^2)^(1/2),   n = ((rho - a) e_rho + s z)/d,   gap = d - r
//! d n = (1/d) in the plane of e_rho and z across n,   (rho - a)/(rho d) along the circle
//! ```

use super::Proximity;
use glam::DVec3;

/// A distance from the axis below this share of the height along it is rounding, without a direction: the centre is on the axis.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Below this share of the radius a centre counts as on the axis: it has no nearest point, any will do.
const ON_AXIS: f64 = 1e-12;

/// Place of a centre about an axis: height along it, distance from it and the direction of that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polar {
    pub height: f64,
    pub distance: f64,
    pub outward: DVec3,
}

impl Polar {
    /// Of the point `x` (m) about the unit `axis` through `point` (m). On the axis the direction is arbitrary.
    #[inline]
    pub(super) fn new(x: DVec3, point: DVec3, axis: DVec3) -> Polar {
        let d = x - point;
        let height = axis.dot(d);
        let across = d - height * axis;
        let mut distance = across.length();
        let outward = if distance > ROUNDING * height.abs() && distance.is_finite() {
            // Once more: the difference above leaves rounding of the size of the height.
            let unit = across / distance;
            (unit - axis * axis.dot(unit)).normalize()
        } else {
            distance = if distance.is_finite() { 0.0 } else { distance };
            axis.any_orthonormal_vector()
        };
        Polar {
            height,
            distance,
            outward,
        }
    }
}

/// Sphere of radius `r` (m) at the circle of radius `a` (m) in the plane `height = 0`.
pub(super) fn sphere_ring(at: Polar, r: f64, a: f64, axis: DVec3) -> Proximity {
    let (u, s) = (at.distance - a, at.height);
    let d = u.hypot(s);
    if d == 0.0 {
        return Proximity {
            gap: -r,
            normal: axis,
            curvature: 0.0,
            flat: DVec3::ZERO,
        };
    }
    let normal = (u / d) * at.outward + (s / d) * axis;
    let flat = if at.distance > ON_AXIS * a {
        (a / at.distance).sqrt() * axis.cross(at.outward)
    } else {
        DVec3::ZERO
    };
    Proximity {
        gap: d - r,
        normal: normal.normalize(),
        curvature: if at.distance > ON_AXIS * a {
            1.0 / d
        } else {
            0.0
        },
        flat,
    }
}

/// What a sphere meets at a sheet: `height` (m) of its centre above the front. A sheet has two faces; the centre is on the side of the one that
/// is met (steps that would take it through the sheet are made in parts).
#[inline]
pub(super) fn face(height: f64, r: f64, front: Proximity) -> Proximity {
    if height >= 0.0 {
        return front;
    }
    Proximity {
        gap: -height - r,
        normal: -front.normal,
        curvature: -front.curvature,
        flat: front.flat,
    }
}
