//! Applied loads: `f(q, v, t)` of eq. 1a.
//!
//! Gravity is part of every model. Other loads implement [`Load`] and are kept in [`Model::loads`]; they may depend on
//! positions and velocities of all spheres, and `level/smooth.rs` iterates on them. The terms f^p and f^v of eqs. 3 and 4,
//! which matter only where a contact correction changes such a load, join the contact levels together with the first
//! load that needs them.

use crate::model::Model;
use glam::DVec3;

/// What a load may depend on. One entry per sphere in each array.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// s.
    pub time: f64,
    /// Centres, m.
    pub position: &'a [DVec3],
    /// m/s.
    pub velocity: &'a [DVec3],
    /// Spatial, rad/s.
    pub angular_velocity: &'a [DVec3],
}

/// A load on the spheres of a model.
pub trait Load: std::fmt::Debug + Send + Sync {
    /// Adds force (N) and moment (N m, spatial) on each sphere to `wrench (N)`.
    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]);

    /// Potential energy, J; 0 for loads without one.
    fn potential(&self, _position: &[DVec3]) -> f64 {
        0.0
    }
}

/// Weight of sphere `i`, N.
#[inline]
pub fn weight(model: &Model, i: usize) -> DVec3 {
    model.mass[i] * model.gravity
}

/// Potential energy of the weight of sphere `i` at `x`, J, with its zero at the origin.
#[inline]
pub fn weight_potential(model: &Model, i: usize, x: DVec3) -> f64 {
    -weight(model, i).dot(x)
}
