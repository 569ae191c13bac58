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
