//! Sphere and sphere.
//!
//! ```text
//! n   = (x_A - x_B)/|x_A - x_B|                     (eq. 31)
//! gap = |x_A - x_B| - (r_A + r_B)                   (eq. 33)
//! d n / d x_A = (I - n n^T)/|x_A - x_B|             (the block of eq. 42)
//! ```

use super::Proximity;
use glam::DVec3;

/// Below this distance (m) its square loses digits, above the inverse so does the square of large distances.
const SMALL: f64 = 1e-150;

/// Two spheres with centres `xa`, `xb` (m) and radii `ra`, `rb` (m).
///
/// Concentric spheres have no normal. They get `+z` and curvature 0: a wrong direction for one iterate is
/// repaired by the next, a NaN by none.
#[inline]
pub fn sphere_sphere(xa: DVec3, ra: f64, xb: DVec3, rb: f64) -> Proximity {
    let d = xa - xb;
    let distance = d.length();
    if distance < SMALL || distance == f64::INFINITY {
        return extreme(d, ra + rb);
    }
    // One division serves both; the normal is then unit to 1.5 ulp, like any normalised vector.
    let curvature = 1.0 / distance;
    Proximity {
        gap: distance - (ra + rb),
        normal: d * curvature,
        curvature,
        flat: DVec3::ZERO,
    }
}

/// The square of the distance under- or overflowed: scale first.
#[cold]
fn extreme(d: DVec3, radii: f64) -> Proximity {
    let scale = d.abs().max_element();
    if scale == 0.0 {
        return Proximity {
            gap: -radii,
            normal: DVec3::Z,
            curvature: 0.0,
            flat: DVec3::ZERO,
        };
    }
    if scale == f64::INFINITY {
        return Proximity {
            gap: f64::INFINITY,
            normal: DVec3::Z,
            curvature: 0.0,
            flat: DVec3::ZERO,
        };
    }
    // Two steps, because 1/scale may overflow for a subnormal scale.
    let unit = d / scale;
    let length = unit.length();
    let distance = scale * length;
    Proximity {
        gap: distance - radii,
        normal: unit / length,
        curvature: (1.0 / distance).min(f64::MAX),
        flat: DVec3::ZERO,
    }
}
