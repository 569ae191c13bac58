//! How spheres meet: one file for each thing that they meet.

mod ring;
pub(crate) mod sphere_ball;
pub(crate) mod sphere_cone;
pub(crate) mod sphere_cylinder;
pub(crate) mod sphere_disc;
mod sphere_plane;
pub(crate) mod sphere_rectangle;
mod sphere_sphere;
pub(crate) mod sphere_triangle;

pub use sphere_ball::{sphere_ball, Ball};
pub use sphere_cone::{sphere_cone, Cone};
pub use sphere_cylinder::{sphere_cylinder, Cylinder};
pub use sphere_disc::{sphere_disc, Disc};
pub use sphere_plane::sphere_plane;
pub use sphere_rectangle::{sphere_rectangle, Rectangle};
pub use sphere_sphere::sphere_sphere;
pub(crate) use sphere_triangle::{slack, Nearest, SLACK};
pub use sphere_triangle::{
    sphere_line, sphere_sheet, sphere_triangle, Line, Sheet, Triangle, ROUNDING,
};

use glam::DVec3;

/// What a meeting tells: everything the contact rows of eqs. 31-43 need from geometry.
///
/// With `x = x_A - x_B` the relative position of the centres (of the reference point, for a plane):
///
/// ```text
/// d gap / d x    = n^T                              (eq. 39)
/// d n   / d x    = curvature (I - n n^T - f f^T)    (the block of eq. 42)
/// ```
///
/// so two numbers and two vectors hold the gap, its gradient and its Hessian. `f`, at right angles to `n`, is zero where
/// the contact is alike in all directions, as between spheres. Else it points in the other principal direction, in which
/// the normal turns by `curvature (1 - |f|^2)`: by nothing along the axis of a cylinder, where it is a unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proximity {
    /// Signed distance of the surfaces (m); negative where they overlap.
    pub gap: f64,
    /// Unit normal, pointing from B to A.
    pub normal: DVec3,
    /// How fast the normal turns with the relative position (1/m): `1/distance of centres` for two spheres,
    /// 0 at a plane, negative on the inside of a curved wall.
    pub curvature: f64,
    /// Other principal direction `f`, zero: none.
    pub flat: DVec3,
}
