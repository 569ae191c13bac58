//! What spheres can touch besides spheres: a closed set of walls.
//!
//! An enum and not a trait: the set is known, a `match` is checked for completeness by the compiler, and the
//! loops over contacts must not call through a pointer. A new one is a variant here and a file
//! in [`crate::pair`]; the `match`es then do not compile until they are told how. A mesh is many walls: [`crate::mesh`].

use crate::pair;
use crate::pair::{
    sphere_ball, sphere_cone, sphere_cylinder, sphere_disc, sphere_line, sphere_plane,
    sphere_rectangle, sphere_sheet, sphere_triangle,
};
use crate::pair::{Ball, Cone, Cylinder, Disc, Line, Proximity, Rectangle, Sheet, Triangle};
use glam::{DQuat, DVec3};

/// A wall. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Everything behind an infinite plane: the set `normal . (y - point) <= 0`, in world coordinates.
    HalfSpace {
        /// Any point of the plane (m).
        point: DVec3,
        /// Unit normal, out of the solid and into the free space.
        normal: DVec3,
    },
    /// A sheet with edges and corners.
    Rectangle(Rectangle),
    /// A sheet with a rim, and a hole if it is a ring.
    Disc(Disc),
    /// The inside or the outside of a cylinder.
    Cylinder(Cylinder),
    /// The inside or the outside of a ball.
    Ball(Ball),
    /// The inside or the outside of a frustum.
    Cone(Cone),
    /// A triangle of a mesh, the plane of a flat piece of it, the line of an edge.
    Triangle(Triangle),
    Sheet(Sheet),
    Line(Line),
}

/// A rigid displacement: the point `y` moves to `about + shift + turn (y - about)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    /// Rotation about the point `about` (m).
    pub turn: DQuat,
    /// See `turn`.
    pub about: DVec3,
    /// Translation after it (m).
    pub shift: DVec3,
}

impl Displacement {
    /// Where the point `y` goes.
    #[inline]
    pub fn point(&self, y: DVec3) -> DVec3 {
        self.about + self.shift + self.turn * (y - self.about)
    }

    /// Where a direction goes, kept a unit vector.
    #[inline]
    pub fn direction(&self, d: DVec3) -> DVec3 {
        if self.turn == DQuat::IDENTITY {
            return d;
        }
        (self.turn * d).normalize()
    }
}

impl Shape {
    /// Whether it is a piece of a surface, met from both sides.
    pub fn is_sheet(&self) -> bool {
        match self {
            Shape::Rectangle(_) | Shape::Disc(_) | Shape::Cone(_) | Shape::Triangle(_) => true,
            Shape::Sheet(_) | Shape::Line(_) => true,
            Shape::Cylinder(cylinder) => cylinder.half.is_finite(),
            _ => false,
        }
    }

    /// How a sphere with centre `x` (m) and radius `r` (m) meets this wall.
    #[inline]
    pub fn meet(&self, x: DVec3, r: f64) -> Proximity {
        // Planes are in every scene and cost nothing: the others stay out of the way.
        if let Shape::HalfSpace { point, normal } = *self {
            return sphere_plane(x, r, point, normal);
        }
        self.meet_other(x, r)
    }

    #[inline(never)]
    fn meet_other(&self, x: DVec3, r: f64) -> Proximity {
        match *self {
            Shape::HalfSpace { point, normal } => sphere_plane(x, r, point, normal),
            Shape::Rectangle(ref wall) => sphere_rectangle(x, r, wall),
            Shape::Disc(ref wall) => sphere_disc(x, r, wall),
            Shape::Cylinder(ref wall) => sphere_cylinder(x, r, wall),
            Shape::Ball(ref wall) => sphere_ball(x, r, wall),
            Shape::Cone(ref wall) => sphere_cone(x, r, wall),
            Shape::Triangle(ref wall) => sphere_triangle(x, r, wall),
            Shape::Sheet(ref wall) => sphere_sheet(x, r, wall),
            Shape::Line(ref wall) => sphere_line(x, r, wall),
        }
    }

    /// Lower bound of the gap of a sphere at this wall (m) that changes by no more than the centre moves, and is the gap
    /// itself where the sphere is near and on the free side.
    #[inline]
    pub fn clearance(&self, x: DVec3, r: f64) -> f64 {
        if let Shape::HalfSpace { point, normal } = *self {
            return normal.dot(x - point) - r;
        }
        self.clearance_other(x, r)
    }

    #[inline(never)]
    fn clearance_other(&self, x: DVec3, r: f64) -> f64 {
        match *self {
            Shape::HalfSpace { point, normal } => normal.dot(x - point) - r,
            Shape::Rectangle(ref wall) => pair::sphere_rectangle::distance(x, wall) - r,
            Shape::Disc(ref wall) => pair::sphere_disc::distance(x, wall) - r,
            Shape::Cylinder(ref wall) => pair::sphere_cylinder::distance(x, wall) - r,
            Shape::Ball(ref wall) => sphere_ball(x, r, wall).gap,
            Shape::Cone(ref wall) => pair::sphere_cone::distance(x, wall) - r,
            Shape::Triangle(ref wall) => sphere_triangle(x, r, wall).gap,
            Shape::Sheet(ref wall) => sphere_sheet(x, r, wall).gap,
            Shape::Line(ref wall) => sphere_line(x, r, wall).gap,
        }
    }

    /// Whether a point `p` (m) of a sphere of radius `r` (m) lies on the surface, within rounding.
    #[inline]
    pub fn holds(&self, p: DVec3, r: f64) -> bool {
        self.clearance(p, 0.0).abs() <= pair::slack(r, p, self.place())
    }

    /// A point that the wall is placed by (m).
    #[inline]
    pub fn place(&self) -> DVec3 {
        match *self {
            Shape::HalfSpace { point, .. } => point,
            Shape::Rectangle(wall) => wall.centre,
            Shape::Disc(wall) => wall.centre,
            Shape::Cylinder(wall) => wall.centre,
            Shape::Ball(wall) => wall.centre,
            Shape::Cone(wall) => wall.point,
            Shape::Triangle(wall) => wall.corners[0],
            Shape::Sheet(wall) => wall.point,
            Shape::Line(wall) => wall.point,
        }
    }

    /// The wall after a displacement.
    pub fn moved(&self, by: &Displacement) -> Shape {
        match *self {
            Shape::HalfSpace { point, normal } => Shape::HalfSpace {
                point: by.point(point),
                normal: by.direction(normal),
            },
            Shape::Rectangle(wall) => Shape::Rectangle(Rectangle {
                centre: by.point(wall.centre),
                normal: by.direction(wall.normal),
                side: by.direction(wall.side),
                ..wall
            }),
            Shape::Disc(wall) => Shape::Disc(Disc {
                centre: by.point(wall.centre),
                normal: by.direction(wall.normal),
                ..wall
            }),
            Shape::Cylinder(wall) => Shape::Cylinder(Cylinder {
                centre: by.point(wall.centre),
                axis: by.direction(wall.axis),
                ..wall
            }),
            Shape::Ball(wall) => Shape::Ball(Ball {
                centre: by.point(wall.centre),
                ..wall
            }),
            Shape::Cone(wall) => Shape::Cone(Cone {
                point: by.point(wall.point),
                axis: by.direction(wall.axis),
                ..wall
            }),
            Shape::Triangle(wall) => Shape::Triangle(Triangle {
                corners: wall.corners.map(|corner| by.point(corner)),
                normal: by.direction(wall.normal),
                ..wall
            }),
            Shape::Sheet(wall) => Shape::Sheet(Sheet {
                point: by.point(wall.point),
                normal: by.direction(wall.normal),
            }),
            Shape::Line(wall) => Shape::Line(Line {
                point: by.point(wall.point),
                along: by.direction(wall.along),
            }),
        }
    }
}
