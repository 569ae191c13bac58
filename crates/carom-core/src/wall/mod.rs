//! Walls: bodies N.. of a model, fixed or moved by laws of time. `docs/theory/algorithm.md` section 10.
//!
//! A moving wall is a body whose motion is given: gaps use its place at t_{n+1}, sliding and rolling rows its displacement at
//! the contact over the step, velocity rows its velocity there. The *shape* moves by the pose; the *material* may move along
//! it besides (a conveyor, a drum that turns in itself), which sliding, rolling and spinning rows see and the normal row not.

mod check;
mod free;
mod motion;
pub mod places;

pub use carom_geom::{BadTriangle, Ball, Cone, Cylinder, Disc, Mesh, Rectangle, Shape};
pub use check::{checked, finite as place, length, positive as size};
pub use free::{FreeWall, FreeWallInput, Side, HELD_INERTIA};
pub use motion::{WallMotion, WallRotation, WallTwist};

use glam::DVec3;
use std::ops::Range;
use std::sync::Arc;

/// No entry among the moving walls.
const FIXED: u32 = u32::MAX;

/// A wall where it stands before any motion. A mesh is many: its triangles and parts.
#[derive(Clone, Debug)]
pub struct Wall {
    pub shape: Shape,
    /// Number among the walls as they were given, where a mesh is one.
    pub given: u32,
    pub material: u32,
    /// Fixed tangents of a plane, `normal x tangent1 = tangent2`.
    pub tangent1: DVec3,
    pub tangent2: DVec3,
    pub motion: Option<Arc<WallMotion>>,
    /// Place among the moving walls.
    slot: u32,
    fixed_plane: bool,
    steady_plane: bool,
}

/// A mesh among the walls.
#[derive(Clone, Debug)]
pub struct MeshWall {
    pub mesh: Arc<Mesh>,
    /// Point that moments on it are about, m; it moves along.
    pub point: DVec3,
    /// Which of the walls are its own.
    pub walls: Range<usize>,
}

impl Wall {
    pub fn new(shape: Shape, material: u32, given: u32) -> Wall {
        let (tangent1, tangent2) = match shape {
            Shape::HalfSpace { normal, .. } => carom_geom::tangent_frame(normal),
            _ => (DVec3::ZERO, DVec3::ZERO),
        };
        Wall {
            shape,
            given,
            material,
            tangent1,
            tangent2,
            motion: None,
            slot: FIXED,
            fixed_plane: matches!(shape, Shape::HalfSpace { .. }),
            steady_plane: matches!(shape, Shape::HalfSpace { .. } | Shape::Sheet(_)),
        }
    }

    /// The same plane, as a body that moves freely.
    pub(crate) fn set_free(&mut self) {
        self.fixed_plane = false;
    }

    /// The same wall with a motion, at a place among those that have one.
    fn take(&mut self, slot: u32) {
        self.slot = slot;
        self.fixed_plane = false;
        self.steady_plane &= self.motion.as_ref().is_none_or(|m| m.rotation.is_none());
    }

    /// Mean curvature of the surface, 1/m, positive where it bulges towards the spheres. Edges count as the face.
    pub fn curvature(&self) -> f64 {
        let sign = |inside: bool| if inside { -1.0 } else { 1.0 };
        match self.shape {
            Shape::Ball(w) if w.radius > 0.0 => sign(w.inside) / w.radius,
            Shape::Cylinder(w) => 0.5 * sign(w.inside) / w.radius,
            Shape::Cone(w) => sign(w.inside) / (w.radius + w.radius_end),
            Shape::HalfSpace { .. } | Shape::Rectangle(_) | Shape::Disc(_) => 0.0,
            Shape::Triangle(_) | Shape::Sheet(_) | Shape::Line(_) | Shape::Ball(_) => 0.0,
        }
    }

    /// Its place among the moving walls.
    pub fn slot(&self) -> Option<u32> {
        (self.slot != FIXED).then_some(self.slot)
    }

    /// A plane that never moves: normal and frame are the same in all steps.
    #[inline]
    pub fn is_fixed_plane(&self) -> bool {
        self.fixed_plane
    }

    /// Point and normal of a plane that never moves.
    #[inline]
    pub(crate) fn fixed_plane(&self) -> Option<(DVec3, DVec3)> {
        match self.shape {
            Shape::HalfSpace { point, normal } if self.fixed_plane => Some((point, normal)),
            _ => None,
        }
    }

    /// A piece of a surface, with two faces.
    pub fn is_sheet(&self) -> bool {
        self.shape.is_sheet()
    }

    /// A plane whose normal never turns: a lone contact with it has a closed form.
    #[inline]
    pub fn is_steady_plane(&self) -> bool {
        self.steady_plane
    }
}

/// Numbers the moving walls, as they were given.
pub(crate) fn number(walls: &mut [Wall]) {
    let (mut slots, mut last) = (0, None);
    for wall in walls.iter_mut().filter(|w| w.motion.is_some()) {
        if last.replace(wall.given) != Some(wall.given) {
            slots += 1;
        }
        wall.take(slots - 1);
    }
}
