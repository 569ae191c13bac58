//! How two shapes meet: one file per pair, and the table that says which pairs exist.

mod sphere_plane;
mod sphere_sphere;
pub mod table;

pub use sphere_plane::sphere_plane;
pub use sphere_sphere::sphere_sphere;
pub use table::proximity;

use glam::DVec3;

/// What a meeting of two shapes tells: everything the contact rows of eqs. 31-43 need from geometry.
///
/// With `x = x_A - x_B` the relative position of the centres (of the reference point, for a plane):
///
/// ```text
/// d gap / d x    = n^T                              (eq. 39)
/// d n   / d x    = curvature (I - n n^T)            (the block of eq. 42)
/// ```
///
/// so two numbers and a vector hold the gap, its gradient and its Hessian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proximity {
    /// Signed distance of the surfaces (m); negative where they overlap.
    pub gap: f64,
    /// Unit normal, pointing from B to A.
    pub normal: DVec3,
    /// How fast the normal turns with the relative position (1/m): `1/distance of centres` for two spheres,
    /// 0 at a plane.
    pub curvature: f64,
}

impl Proximity {
    /// The same meeting with the roles of A and B exchanged.
    #[inline]
    pub fn mirrored(self) -> Self {
        Self {
            normal: -self.normal,
            ..self
        }
    }
}
