//! Spheres and planes against finite differences, by the checker of all pairs (`common`).
//!
//! A new cell of the table adds one call of `check_derivatives`.

mod common;

use carom_geom::{proximity, sphere_plane, sphere_sphere, Shape};
use common::{check_derivatives, unit, vector};
use proptest::prelude::*;

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
