//! The contact plane: two tangents for a normal.
//!
//! The solution of a contact problem does not depend on the choice (friction cones are round), but its rounding
//! does, so the choice is smooth almost everywhere and commutes with mirrors:
//! for the mirror `M` of any coordinate axis, the frame of `M n` is `(M t1, M t2)` up to signs, *exactly*.
//! A mirrored scene therefore runs bit for bit as the mirror image.

use glam::DVec3;

/// Orthonormal `(t1, t2)` with `n x t1 = t2`, for a unit vector `n`.
///
/// With `s = 1` for `n_z >= 0` and `-1` otherwise, reflect at the plane half way between `s z` and `n`
/// (a Householder reflection: no branch on the smallest component, no square root, never a division by
/// less than 1):
///
/// ```text
/// k  = -1/(s + n_z)
/// t1 = (1 + s k n_x^2,  s k n_x n_y,  -s n_x)
/// t2 = (k n_x n_y,      s + k n_y^2,  -n_y)
/// ```
///
/// `n_z = -0` counts as `+0`. For `n = z` the frame is `(x, y)`.
#[inline]
pub fn tangent_frame(n: DVec3) -> (DVec3, DVec3) {
    let s = if n.z < 0.0 { -1.0 } else { 1.0 };
    let k = -1.0 / (s + n.z);
    let b = n.x * n.y * k;
    let t1 = DVec3::new(1.0 + s * (n.x * n.x * k), s * b, -s * n.x);
    let t2 = DVec3::new(b, s + n.y * n.y * k, -n.y);
    (t1, t2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn assert_frame(n: DVec3) {
        let (t1, t2) = tangent_frame(n);
        // The worst of 2e7 random normals, themselves unit to 4.4e-16, was 7.9e-16.
        assert!((n.cross(t1) - t2).length() < 1e-15, "{n} {t1} {t2}");
        for e in [
            t1.length() - 1.0,
            t2.length() - 1.0,
            t1.dot(n),
            t2.dot(n),
            t1.dot(t2),
        ] {
            assert!(e.abs() < 1e-15, "{n} {t1} {t2} {e:e}");
        }
    }

    #[test]
    fn axes_and_the_seam() {
        for n in [DVec3::X, DVec3::Y, DVec3::Z] {
            assert_frame(n);
            assert_frame(-n);
        }
        for tiny in [0.0, -0.0, 1e-300, -1e-300, 1e-17, -1e-17] {
            assert_frame(DVec3::new(0.6, 0.8, tiny));
            assert_frame(DVec3::new(tiny, tiny, -1.0));
        }
        assert_eq!(tangent_frame(DVec3::Z), (DVec3::X, DVec3::Y));
    }

    proptest! {
        #[test]
        fn orthonormal_and_right_handed(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64) {
            let v = DVec3::new(x, y, z);
            prop_assume!(v.length() > 1e-3);
            assert_frame(v.normalize());
        }

        #[test]
        fn mirrors_commute_exactly(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64) {
            let v = DVec3::new(x, y, z);
            prop_assume!(v.length() > 1e-3 && z != 0.0);
            let n = v.normalize();
            let (t1, t2) = tangent_frame(n);
            for (mirror, s1, s2) in [
                (DVec3::new(-1.0, 1.0, 1.0), -1.0, 1.0),
                (DVec3::new(1.0, -1.0, 1.0), 1.0, -1.0),
                (DVec3::new(1.0, 1.0, -1.0), 1.0, -1.0),
            ] {
                prop_assert_eq!(tangent_frame(mirror * n), (s1 * mirror * t1, s2 * mirror * t2));
            }
        }
    }
}
