//! Spheres and planes against finite differences, by the checker of all pairs (`common`).

mod common;

use carom_geom::{sphere_plane, sphere_sphere};
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
}
