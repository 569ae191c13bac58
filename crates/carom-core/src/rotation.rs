//! Finite rotations: R_{n+1} = exp(psi) R_n with a spatial increment psi (departure from eq. 30, erratum E1).

use glam::{DQuat, DVec3};

/// Below this squared half-angle the series of sine and cosine are exact to rounding.
const SERIES: f64 = 0.0625;

/// `exp(psi) q`, normalised.
#[inline]
pub fn advance(rot_incr_world: DVec3, q: DQuat) -> DQuat {
    let half = 0.5 * rot_incr_world;
    let x = half.length_squared();
    // sin(t)/t and cos(t) over x = t^2.
    let (sinc, cos) = if x < SERIES {
        (
            1.0 - x / 6.0
                * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0 * (1.0 - x / 110.0)))),
            1.0 - x / 2.0
                * (1.0 - x / 12.0 * (1.0 - x / 30.0 * (1.0 - x / 56.0 * (1.0 - x / 90.0)))),
        )
    } else {
        let t = x.sqrt();
        let (s, c) = t.sin_cos();
        (s / t, c)
    };
    let v = sinc * half;
    let (qv, qw) = (DVec3::new(q.x, q.y, q.z), q.w);
    let w = cos * qw - v.dot(qv);
    let u = cos * qv + qw * v + v.cross(qv);
    // One Newton step of 1/sqrt around 1 would do; the square root keeps it exact for any input.
    let scale = 1.0 / (w * w + u.length_squared()).sqrt();
    DQuat::from_xyzw(scale * u.x, scale * u.y, scale * u.z, scale * w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_axis_angle_rotation_on_both_branches() {
        let q = DQuat::from_xyzw(0.1, -0.5, 0.3, 0.8).normalize();
        for size in [1e-9, 1e-3, 0.1, 0.49, 0.51, 2.0, 6.0] {
            let psi = DVec3::new(0.36, -0.48, 0.8) * size;
            let expected = DQuat::from_scaled_axis(psi) * q;
            let found = advance(psi, q);
            let difference = (found - expected).length();
            assert!(difference < 4e-15, "{size}: {difference:e}");
        }
    }
}
