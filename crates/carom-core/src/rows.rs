//! Jacobian rows over the velocities of two bodies, and their product with a motion.

use carom_solve::rows::NODE_DOF;
use glam::DVec3;

/// Rows over both bodies, at most six.
pub type Rows = [[[f64; NODE_DOF]; 2]; 6];

/// One row on a pair of vectors.
#[inline]
pub(crate) fn along(row: &[f64; NODE_DOF], linear: DVec3, angular: DVec3) -> f64 {
    row[0] * linear.x
        + row[1] * linear.y
        + row[2] * linear.z
        + row[3] * angular.x
        + row[4] * angular.y
        + row[5] * angular.z
}

/// The two vectors that six numbers are.
#[inline]
pub(crate) fn halves(v: &[f64]) -> [DVec3; 2] {
    [DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])]
}

/// The six numbers of two vectors.
#[inline]
pub(crate) fn flat([v, w]: [DVec3; 2]) -> [f64; NODE_DOF] {
    [v.x, v.y, v.z, w.x, w.y, w.z]
}
