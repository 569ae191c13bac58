//! Sphere and rectangle: two faces, four edges, four corners.
//!
//! With the centre at `(p, q, s)` in the axes of the rectangle the closest point is `(p, q)` held within the outline.
//! Over a face as at a plane (`ring::face`); at an edge the normal turns across it and is flat along it; at a corner as at a
//! point.

use super::ring::face;
use super::{sphere_plane, Proximity};
use glam::DVec3;

/// A rectangle in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Centre.
    pub centre: DVec3,
    /// Unit normal, into the free space.
    pub normal: DVec3,
    /// Unit vector in the plane, direction of the first length.
    pub side: DVec3,
    /// Half of the lengths along `side` and across it.
    pub half: [f64; 2],
}

impl Rectangle {
    /// What is left of the centre's place in the plane beyond the outline, along `side` and across it, and its height.
    #[inline]
    fn beyond(&self, x: DVec3) -> ([f64; 2], f64, DVec3) {
        let d = x - self.centre;
        let across = self.normal.cross(self.side);
        let rest = |value: f64, half: f64| value - value.clamp(-half, half);
        let beyond = [
            rest(d.dot(self.side), self.half[0]),
            rest(d.dot(across), self.half[1]),
        ];
        (beyond, d.dot(self.normal), across)
    }
}

/// Sphere with centre `x` (m) and radius `r` (m) at a rectangle.
#[inline]
pub fn sphere_rectangle(x: DVec3, r: f64, wall: &Rectangle) -> Proximity {
    let ([p, q], height, across) = wall.beyond(x);
    if p == 0.0 && q == 0.0 {
        return face(height, r, sphere_plane(x, r, wall.centre, wall.normal));
    }
    let away = p * wall.side + q * across + height * wall.normal;
    let distance = away.length();
    let flat = if p == 0.0 {
        wall.side
    } else if q == 0.0 {
        across
    } else {
        DVec3::ZERO
    };
    Proximity {
        gap: distance - r,
        normal: away / distance,
        curvature: 1.0 / distance,
        flat,
    }
}

/// Distance from a rectangle (m), on either side.
#[inline]
pub(crate) fn distance(x: DVec3, wall: &Rectangle) -> f64 {
    let ([p, q], height, _) = wall.beyond(x);
    DVec3::new(p, q, height).length()
}
