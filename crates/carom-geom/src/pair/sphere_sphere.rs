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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_spheres_have_zero_gap_and_the_normal_points_from_b_to_a() {
        let p = sphere_sphere(DVec3::new(3.0, 0.0, 0.0), 1.0, DVec3::ZERO, 2.0);
        assert_eq!(
            p,
            Proximity {
                gap: 0.0,
                normal: DVec3::X,
                curvature: 1.0 / 3.0,
                flat: DVec3::ZERO,
            }
        );
    }

    #[test]
    fn exchanging_roles_mirrors_exactly() {
        let (xa, xb) = (DVec3::new(0.3, -1.7, 0.9), DVec3::new(-0.2, 0.4, 0.11));
        assert_eq!(
            sphere_sphere(xa, 0.3, xb, 0.5),
            sphere_sphere(xb, 0.5, xa, 0.3).mirrored()
        );
    }

    #[test]
    fn extreme_distances_give_a_finite_unit_normal() {
        for d in [0.0, 5e-324, 1e-310, 1e-200, 1e-149, 1e9, 1e160, 1e308] {
            let p = sphere_sphere(DVec3::new(d, -d, 0.0), 0.03, DVec3::ZERO, 0.03);
            assert!((p.normal.length() - 1.0).abs() < 1e-15, "{d} {p:?}");
            assert!(p.curvature.is_finite() && p.curvature >= 0.0, "{d} {p:?}");
            assert!(!p.gap.is_nan(), "{d} {p:?}");
            if d > 0.0 {
                assert!(p.normal.x > 0.0 && p.normal.y < 0.0, "{d} {p:?}");
            }
        }
        let far = sphere_sphere(DVec3::MAX, 1.0, DVec3::MIN, 1.0);
        assert!(far.gap == f64::INFINITY && far.normal.is_normalized());
    }

    #[test]
    fn concentric_spheres_choose_z() {
        let p = sphere_sphere(DVec3::ONE, 1.0, DVec3::ONE, 0.5);
        assert_eq!(
            p,
            Proximity {
                gap: -1.5,
                normal: DVec3::Z,
                curvature: 0.0,
                flat: DVec3::ZERO,
            }
        );
    }
}
