//! Every pair of shapes against finite differences, by one checker.
//!
//! A new cell of the table adds one call of `check_derivatives`.

use carom_geom::{proximity, sphere_plane, sphere_sphere, DVec3, Proximity, Shape};
use proptest::prelude::*;

const TOLERANCE: f64 = 1e-7;

/// Checks `meet(x)`, a function of the relative position of A, at `x`:
/// `d gap = n . dx` (eq. 39) and `d n = curvature (I - n n^T) dx` (eq. 42), and that `n` is a unit vector.
///
/// Central differences of step `h = 1e-5 scale`: truncation about `h^2/scale^2`, rounding about `1e-16 scale/h`.
fn check_derivatives(meet: impl Fn(DVec3) -> Proximity, x: DVec3, scale: f64) {
    let h = 1e-5 * scale;
    let at = meet(x);
    assert!((at.normal.length() - 1.0).abs() < 1e-14, "{at:?}");
    for axis in DVec3::AXES {
        let (plus, minus) = (meet(x + h * axis), meet(x - h * axis));
        let gap_x = (plus.gap - minus.gap) / (2.0 * h);
        assert!(
            (gap_x - at.normal.dot(axis)).abs() < TOLERANCE,
            "gap along {axis}: {gap_x} {at:?}"
        );
        let normal_x = (plus.normal - minus.normal) / (2.0 * h);
        let expected = at.curvature * (axis - at.normal * at.normal.dot(axis));
        let error = (normal_x - expected).length() * scale;
        assert!(
            error < TOLERANCE,
            "normal along {axis}: {normal_x} {expected} {at:?}"
        );
    }
}

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn unit() -> impl Strategy<Value = DVec3> {
    vector(1.0)
        .prop_filter("too short to normalise", |v| v.length() > 0.1)
        .prop_map(DVec3::normalize)
}

proptest! {
    #[test]
    fn sphere_sphere_derivatives(b in vector(1.0), n in unit(), d in 0.01..3.0f64, ra in 0.01..1.0f64, rb in 0.01..1.0f64) {
        check_derivatives(|x| sphere_sphere(x, ra, b, rb), b + d * n, d);
        // A moves relative to B: moving B is the opposite.
        check_derivatives(|x| sphere_sphere(b, ra, b - x, rb), d * n, d);
    }

    #[test]
    fn sphere_plane_derivatives(x in vector(1.0), point in vector(1.0), n in unit(), r in 0.01..1.0f64) {
        check_derivatives(|x| sphere_plane(x, r, point, n), x, 1.0);
    }

    #[test]
    fn a_plane_is_a_sphere_of_infinite_radius(x in vector(1.0), point in vector(1.0), n in unit()) {
        let big = 1e7;
        let sphere = sphere_sphere(x, 0.1, point - big * n, big);
        let plane = sphere_plane(x, 0.1, point, n);
        prop_assert!((sphere.gap - plane.gap).abs() < 1e-6);
        prop_assert!((sphere.normal - plane.normal).length() < 1e-6);
        prop_assert!((sphere.curvature - plane.curvature).abs() < 1e-6);
    }

    #[test]
    fn the_table_is_the_functions_and_its_mirror(a in vector(1.0), b in vector(1.0), point in vector(1.0), n in unit()) {
        let (small, large) = (Shape::Sphere { radius: 0.2 }, Shape::Sphere { radius: 0.7 });
        let wall = Shape::HalfSpace { point, normal: n };
        prop_assert_eq!(proximity(&small, a, &large, b), Some(sphere_sphere(a, 0.2, b, 0.7)));
        prop_assert_eq!(proximity(&small, a, &wall, b), Some(sphere_plane(a, 0.2, point, n)));
        prop_assert_eq!(proximity(&wall, b, &small, a), Some(sphere_plane(a, 0.2, point, n).mirrored()));
        prop_assert_eq!(proximity(&wall, a, &wall, b), None);
    }
}
