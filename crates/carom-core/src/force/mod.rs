//! Applied loads: the seam of eq. 1a's `f(q, v, t)`.
//!
//! A load returns force and moment on one sphere. Those of today are independent of q and v, so the smooth tangent is
//! the mass and the smooth Newton ends after one iteration; a load with tangents adds them in `level/smooth.rs`.

use crate::model::Model;
use glam::DVec3;

/// Force (N) and moment (N m, spatial) on sphere `i` at time `t` (s).
#[inline]
pub fn load(model: &Model, i: usize, _t: f64) -> [DVec3; 2] {
    [model.mass[i] * model.gravity, DVec3::ZERO]
}

/// Potential energy of the loads that have one, J: gravity, with its zero at the origin.
#[inline]
pub fn potential(model: &Model, i: usize, x: DVec3) -> f64 {
    -model.mass[i] * model.gravity.dot(x)
}
