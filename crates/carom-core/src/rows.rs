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
