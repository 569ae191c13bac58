//! Sphere and triangle, and the parts of meshes: planes with two sides, lines. A corner is a ball of radius 0.
//!
//! Triangles are there to be found. What is touched is a part of the mesh ([`crate::mesh`]), chosen once a step, which goes on
//! beyond its ends: so nothing jumps within a step.

use super::ring::face;
use super::{sphere_plane, sphere_sphere, Proximity};
use glam::DVec3;

/// Over the radius (1): how far triangles are met beyond their edges, so that rounding leaves no slits between them. Larger, and
/// balls overlap edges by half its square.
pub(crate) const SLACK: f64 = 1e-7;
/// Rounding over the coordinates (1) by which points may be beyond an edge.
pub const ROUNDING: f64 = 1e-14;

/// How far from a wall at `y` (m) a point `x` (m) of a sphere of radius `r` (m) may be and count as on it, m.
#[inline]
pub(crate) fn slack(r: f64, x: DVec3, y: DVec3) -> f64 {
    SLACK * r + ROUNDING * (x.abs() + y.abs()).max_element()
}

/// A triangle in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners, counterclockwise seen from the front.
    pub corners: [DVec3; 3],
    /// Unit normal, to the front.
    pub normal: DVec3,
    /// Lengths of the edges, from corner `k` to the next.
    pub length: [f64; 3],
}

/// A plane with two sides, of a flat piece of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// A point of it, m.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
}

/// A line, of an edge of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// A point of it, m.
    pub point: DVec3,
    /// Unit vector along it.
    pub along: DVec3,
}

/// What of a triangle is nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Nearest {
    Face,
    /// From corner `k` to the next.
    Edge(usize),
    Corner(usize),
}

impl Triangle {
    /// A triangle of three corners; one without an area has no normal.
    pub fn new(corners: [DVec3; 3]) -> Triangle {
        let [a, b, c] = corners;
        Triangle {
            corners,
            normal: (b - a).cross(c - a).normalize(),
            length: [b - a, c - b, a - c].map(DVec3::length),
        }
    }

    /// Across its plane, twice as long as its area (m^2).
    pub fn across(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// Along edge `k`, m.
    #[inline]
    pub(crate) fn along(&self, k: usize) -> DVec3 {
        self.corners[(k + 1) % 3] - self.corners[k]
    }

    /// How far inside of edge `k` a point is, measured in the plane, m.
    #[inline]
    pub(crate) fn inside(&self, k: usize, x: DVec3) -> f64 {
        let across = self.normal.cross(self.along(k));
        across.dot(x - self.corners[k]) / self.length[k]
    }

    /// What is nearest to a point; over the face up to `slack` (m) beyond it.
    pub(crate) fn nearest(&self, x: DVec3, slack: f64) -> Nearest {
        let mut outside = false;
        for k in 0..3 {
            if self.inside(k, x) >= -slack {
                continue;
            }
            outside = true;
            let way = self.along(k).dot(x - self.corners[k]);
            if (0.0..=self.length[k] * self.length[k]).contains(&way) {
                return Nearest::Edge(k);
            }
        }
        if !outside {
            return Nearest::Face;
        }
        let away = self.corners.map(|corner| (x - corner).length_squared());
        let first = if away[1] < away[0] { 1 } else { 0 };
        Nearest::Corner(if away[2] < away[first] { 2 } else { first })
    }
}

/// Sphere with centre `x` (m) and radius `r` (m) at a triangle.
pub fn sphere_triangle(x: DVec3, r: f64, wall: &Triangle) -> Proximity {
    match wall.nearest(x, 0.0) {
        Nearest::Face => sphere_sheet(
            x,
            r,
            &Sheet {
                point: wall.corners[0],
                normal: wall.normal,
            },
        ),
        Nearest::Edge(k) => {
            let point = wall.corners[k];
            let along = wall.along(k) / wall.length[k];
            sphere_line(x, r, &Line { point, along })
        }
        Nearest::Corner(k) => sphere_sphere(x, r, wall.corners[k], 0.0),
    }
}

/// Sphere at a plane with two sides.
#[inline]
pub fn sphere_sheet(x: DVec3, r: f64, wall: &Sheet) -> Proximity {
    let height = wall.normal.dot(x - wall.point);
    face(height, r, sphere_plane(x, r, wall.point, wall.normal))
}

/// Sphere at a line. On the line any normal across it will do.
#[inline]
pub fn sphere_line(x: DVec3, r: f64, wall: &Line) -> Proximity {
    let from = x - wall.point;
    let away = from - wall.along * wall.along.dot(from);
    let distance = away.length();
    let touching = distance == 0.0;
    Proximity {
        gap: distance - r,
        normal: if touching {
            wall.along.any_orthonormal_vector()
        } else {
            away / distance
        },
        curvature: if touching { 0.0 } else { 1.0 / distance },
        flat: wall.along,
    }
}
