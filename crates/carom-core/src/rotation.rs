//! Finite rotations: R_{n+1} = exp(psi) R_n with a spatial increment psi (departure from eq. 30, erratum E1).

use glam::{DQuat, DVec3};

/// Squared half-angle (rad^2) below which the series of sine and cosine are exact to rounding. Larger: orientations lose digits. Smaller: speed alone.
const SERIES: f64 = 0.0625;

/// Coefficients of sin(t)/t and cos(t) in powers of t^2, lowest first. As constants: divisions would cost more than all the rest.
const SINC: [f64; 6] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
];
const COS: [f64; 6] = [
    1.0,
    -0.5,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
];

/// Horner's scheme.
#[inline]
fn polynomial(x: f64, c: &[f64; 6]) -> f64 {
    c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))))
}

/// `exp(psi) q`, normalised.
#[inline(always)]
pub fn advance(rot_incr_world: DVec3, q: DQuat) -> DQuat {
    let half = 0.5 * rot_incr_world;
    let x = half.length_squared();
    // sin(t)/t and cos(t) over x = t^2.
    let (sinc, cos) = if x < SERIES {
        (polynomial(x, &SINC), polynomial(x, &COS))
    } else {
        let t = x.sqrt();
        let (s, c) = t.sin_cos();
        (s / t, c)
    };
    let v = sinc * half;
    let (qv, qw) = (DVec3::new(q.x, q.y, q.z), q.w);
    let w = cos * qw - v.dot(qv);
    let u = cos * qv + qw * v + v.cross(qv);
    let square = w * w + u.length_squared();
    // Of a unit quaternion only rounding is left: one Newton step of 1/sqrt, exact there, instead of root and division.
    let scale = if (square - 1.0).abs() < 1e-8 {
        1.5 - 0.5 * square
    } else {
        1.0 / square.sqrt()
    };
    DQuat::from_xyzw(scale * u.x, scale * u.y, scale * u.z, scale * w)
}

/// The increment `psi` of a rotation `exp(psi)`, the shorter way.
pub fn increment(q: DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let v = DVec3::new(q.x, q.y, q.z);
    let sine = v.length();
    // Of small turns the ratio is 2, however small they are.
    let ratio = if sine > 1e-6 {
        2.0 * sine.atan2(q.w) / sine
    } else {
        2.0 / q.w
    };
    ratio * v
}

/// `T(psi)^T w` with the left Jacobian `T` of the exponential map: `d exp(psi) exp(psi)^T = (T dpsi)~`.
pub fn transposed_left_jacobian(psi: DVec3, w: DVec3) -> DVec3 {
    let x = psi.length_squared();
    // (1 - cos t)/t^2 and (t - sin t)/t^3; the series where the difference would cancel.
    let (a, b) = if x < 1e-2 {
        (
            0.5 - x * (1.0 / 24.0 - x * (1.0 / 720.0 - x / 40_320.0)),
            1.0 / 6.0 - x * (1.0 / 120.0 - x * (1.0 / 5040.0 - x / 362_880.0)),
        )
    } else {
        let t = x.sqrt();
        ((1.0 - t.cos()) / x, (t - t.sin()) / (x * t))
    };
    let turn = psi.cross(w);
    w - a * turn + b * psi.cross(turn)
}
