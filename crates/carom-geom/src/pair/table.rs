//! Shape x shape: which pairs are known, and to which file each belongs.
//!
//! | A \ B | sphere | half-space | rectangle | disc, ring | cylinder | ball | cone | triangle, sheet, line |
//! |---|---|---|---|---|---|---|---|---|
//! | sphere | `sphere_sphere` | `sphere_plane` | `sphere_rectangle` | `sphere_disc` | `sphere_cylinder` | `sphere_ball` | `sphere_cone` | `sphere_triangle` |
//! | wall | the same, roles exchanged | never | never | never | never | never | never | never |
//!
//! Walls meet spheres alone. A new wall is a variant of [`Shape`]; its `match`es then do not compile until it is told how.
//! A mesh is many walls: [`crate::mesh`] says which of them a sphere meets.

use super::{sphere_sphere, Proximity};
use crate::shape::Shape;
use glam::DVec3;

/// How shape `a` at centre `xa` (m) meets shape `b` at centre `xb` (m); `None` for an empty cell of the table.
///
/// Walls stand where they are, their centre is ignored. For loops over many contacts of one kind call the function of
/// the pair itself.
#[inline]
pub fn proximity(a: &Shape, xa: DVec3, b: &Shape, xb: DVec3) -> Option<Proximity> {
    use Shape::Sphere;
    match (*a, *b) {
        (Sphere { radius: ra }, Sphere { radius: rb }) => Some(sphere_sphere(xa, ra, xb, rb)),
        (Sphere { radius }, _) => b.meet(xa, radius),
        (_, Sphere { radius }) => a.meet(xb, radius).map(Proximity::mirrored),
        _ => None,
    }
}
