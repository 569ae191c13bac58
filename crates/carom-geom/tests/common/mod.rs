//! The checker of all pairs of shapes, and strategies.

#![allow(dead_code)] // each test file uses its part

use carom_geom::{
    Ball, Cone, Cylinder, DVec3, Disc, Line, Proximity, Rectangle, Shape, Sheet, Triangle,
};
use proptest::prelude::*;

const TOLERANCE: f64 = 1e-7;

/// Checks `meet(x)`, a function of the relative position of A, at `x`:
/// `d gap = n . dx` (eq. 39) and `d n = curvature (I - n n^T - f f^T) dx` (eq. 42), and that `n` is a unit vector.
///
/// Central differences of step `h = 1e-5 scale`: truncation about `h^2/scale^2`, rounding about `1e-16 scale/h`.
pub fn check_derivatives(meet: impl Fn(DVec3) -> Proximity, x: DVec3, scale: f64) {
    let h = 1e-5 * scale;
    let at = meet(x);
    assert!((at.normal.length() - 1.0).abs() < 1e-14, "{at:?}");
    assert!(
        at.normal.dot(at.flat).abs() < 1e-14 * (1.0 + at.flat.length()),
        "{at:?}"
    );
    for axis in DVec3::AXES {
        let (plus, minus) = (meet(x + h * axis), meet(x - h * axis));
        let gap_x = (plus.gap - minus.gap) / (2.0 * h);
        assert!(
            (gap_x - at.normal.dot(axis)).abs() < TOLERANCE,
            "gap along {axis}: {gap_x} {at:?}"
        );
        let normal_x = (plus.normal - minus.normal) / (2.0 * h);
        let expected =
            at.curvature * (axis - at.normal * at.normal.dot(axis) - at.flat * at.flat.dot(axis));
        let error = (normal_x - expected).length() * scale;
        assert!(
            error < TOLERANCE,
            "normal along {axis}: {normal_x} {expected} {at:?}"
        );
    }
}

pub fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

pub fn unit() -> impl Strategy<Value = DVec3> {
    vector(1.0)
        .prop_filter("too short to normalise", |v| v.length() > 0.1)
        .prop_map(DVec3::normalize)
}

/// Every kind of wall, of a size of about 1 m, near the origin.
pub fn wall() -> impl Strategy<Value = Shape> {
    let size = || 0.3..1.2f64;
    let placed = || (vector(0.3), unit());
    prop_oneof![
        placed().prop_map(|(point, normal)| Shape::HalfSpace { point, normal }),
        (placed(), size(), size()).prop_map(|((centre, normal), a, b)| {
            let side = normal.any_orthonormal_vector();
            let half = [0.5 * a, 0.5 * b];
            Shape::Rectangle(Rectangle {
                centre,
                normal,
                side,
                half,
            })
        }),
        (placed(), size(), 0.0..0.9f64).prop_map(|((centre, normal), radius, hole)| {
            let hole = if hole < 0.3 { 0.0 } else { hole * radius };
            Shape::Disc(Disc {
                centre,
                normal,
                radius,
                hole,
            })
        }),
        (placed(), size(), size(), any::<bool>(), any::<bool>()).prop_map(
            |((centre, axis), radius, half, finite, inside)| {
                let half = if finite { half } else { f64::INFINITY };
                Shape::Cylinder(Cylinder {
                    centre,
                    axis,
                    radius,
                    half,
                    inside,
                })
            }
        ),
        (vector(0.3), size(), any::<bool>()).prop_map(|(centre, radius, inside)| Shape::Ball(
            Ball {
                centre,
                radius,
                inside
            }
        )),
        (
            placed(),
            0.0..1.2f64,
            size(),
            size(),
            any::<bool>(),
            any::<bool>()
        )
            .prop_map(|((point, axis), a, b, length, inside, turned)| {
                let (a, b) = if a < 0.2 { (0.0, b) } else { (a, b) };
                let (radius, radius_end) = if turned { (b, a) } else { (a, b) };
                Shape::Cone(Cone {
                    point,
                    axis,
                    radius,
                    radius_end,
                    length,
                    inside,
                })
            }),
        (placed(), vector(1.0), vector(1.0)).prop_filter_map("thin", |((corner, _), a, b)| {
            let across = a.cross(b);
            let corners = [corner, corner + a, corner + b];
            (across.length() > 0.1).then(|| Shape::Triangle(Triangle::new(corners)))
        }),
        placed().prop_map(|(point, normal)| Shape::Sheet(Sheet { point, normal })),
        placed().prop_map(|(point, along)| Shape::Line(Line { point, along })),
    ]
}
