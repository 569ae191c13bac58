//! Shape x shape: which pairs are known, and to which file each belongs.
//!
//! | A \ B | sphere | half-space | rectangle, disc | cylinder | mesh |
//! |---|---|---|---|---|---|
//! | sphere | `sphere_sphere` | `sphere_plane` | later | later | later |
//! | half-space | `sphere_plane`, roles exchanged | never: neither moves | - | - | - |
//!
//! A finite plane, a cylinder or a mesh is a variant of [`Shape`]; the `match` below then does not compile until
//! its cells are filled or declared empty. A mesh will meet a sphere in several places at once: that cell needs
//! a list of [`Proximity`], and with it this function gets a sibling that takes a sink.

use super::{sphere_plane, sphere_sphere, Proximity};
use crate::shape::Shape;
use glam::DVec3;

/// How shape `a` at centre `xa` (m) meets shape `b` at centre `xb` (m); `None` for an empty cell of the table.
///
/// A half-space is placed by its own `point`, its centre is ignored. For loops over many contacts of one kind
/// call the function of the pair itself.
#[inline]
pub fn proximity(a: &Shape, xa: DVec3, b: &Shape, xb: DVec3) -> Option<Proximity> {
    use Shape::{HalfSpace, Sphere};
    match (*a, *b) {
        (Sphere { radius: ra }, Sphere { radius: rb }) => Some(sphere_sphere(xa, ra, xb, rb)),
        (Sphere { radius }, HalfSpace { point, normal }) => {
            Some(sphere_plane(xa, radius, point, normal))
        }
        (HalfSpace { point, normal }, Sphere { radius }) => {
            Some(sphere_plane(xb, radius, point, normal).mirrored())
        }
        (HalfSpace { .. }, HalfSpace { .. }) => None,
    }
}
