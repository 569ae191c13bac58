//! Frames beside a normal, and how spheres meet spheres and planes at touching, concentric and extreme places.

use carom_geom::{sphere_plane, sphere_sphere, tangent_frame, DVec3, Proximity};
use proptest::prelude::*;

fn assert_frame(n: DVec3) {
    let (t1, t2) = tangent_frame(n);
    // The worst of 2e7 random normals, themselves unit to 4.4e-16, was 7.9e-16.
    assert!((n.cross(t1) - t2).length() < 1e-15, "{n} {t1} {t2}");
    for e in [
        t1.length() - 1.0,
        t2.length() - 1.0,
        t1.dot(n),
        t2.dot(n),
        t1.dot(t2),
    ] {
        assert!(e.abs() < 1e-15, "{n} {t1} {t2} {e:e}");
    }
}

#[test]
fn axes_and_the_seam() {
    for n in [DVec3::X, DVec3::Y, DVec3::Z] {
        assert_frame(n);
        assert_frame(-n);
    }
    for tiny in [0.0, -0.0, 1e-300, -1e-300, 1e-17, -1e-17] {
        assert_frame(DVec3::new(0.6, 0.8, tiny));
        assert_frame(DVec3::new(tiny, tiny, -1.0));
    }
    assert_eq!(tangent_frame(DVec3::Z), (DVec3::X, DVec3::Y));
}

proptest! {
    #[test]
    fn orthonormal_and_right_handed(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64) {
        let v = DVec3::new(x, y, z);
        prop_assume!(v.length() > 1e-3);
        assert_frame(v.normalize());
    }

    #[test]
    fn mirrors_commute_exactly(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64) {
        let v = DVec3::new(x, y, z);
        prop_assume!(v.length() > 1e-3 && z != 0.0);
        let n = v.normalize();
        let (t1, t2) = tangent_frame(n);
        for (mirror, s1, s2) in [
            (DVec3::new(-1.0, 1.0, 1.0), -1.0, 1.0),
            (DVec3::new(1.0, -1.0, 1.0), 1.0, -1.0),
            (DVec3::new(1.0, 1.0, -1.0), 1.0, -1.0),
        ] {
            prop_assert_eq!(tangent_frame(mirror * n), (s1 * mirror * t1, s2 * mirror * t2));
        }
    }
}

#[test]
fn touching_spheres_have_zero_gap_and_the_normal_points_from_b_to_a() {
    let p = sphere_sphere(DVec3::new(3.0, 0.0, 0.0), 1.0, DVec3::ZERO, 2.0);
    assert_eq!(
        p,
        Proximity {
            gap: 0.0,
            normal: DVec3::X,
            curvature: 1.0 / 3.0,
            flat: DVec3::ZERO,
        }
    );
}

#[test]
fn exchanging_roles_mirrors_exactly() {
    let (xa, xb) = (DVec3::new(0.3, -1.7, 0.9), DVec3::new(-0.2, 0.4, 0.11));
    let exchanged = sphere_sphere(xb, 0.5, xa, 0.3);
    let mirrored = carom_geom::Proximity {
        normal: -exchanged.normal,
        ..exchanged
    };
    assert_eq!(sphere_sphere(xa, 0.3, xb, 0.5), mirrored);
}

#[test]
fn extreme_distances_give_a_finite_unit_normal() {
    for d in [0.0, 5e-324, 1e-310, 1e-200, 1e-149, 1e9, 1e160, 1e308] {
        let p = sphere_sphere(DVec3::new(d, -d, 0.0), 0.03, DVec3::ZERO, 0.03);
        assert!((p.normal.length() - 1.0).abs() < 1e-15, "{d} {p:?}");
        assert!(p.curvature.is_finite() && p.curvature >= 0.0, "{d} {p:?}");
        assert!(!p.gap.is_nan(), "{d} {p:?}");
        if d > 0.0 {
            assert!(p.normal.x > 0.0 && p.normal.y < 0.0, "{d} {p:?}");
        }
    }
    let far = sphere_sphere(DVec3::MAX, 1.0, DVec3::MIN, 1.0);
    assert!(far.gap == f64::INFINITY && far.normal.is_normalized());
}

#[test]
fn concentric_spheres_choose_z() {
    let p = sphere_sphere(DVec3::ONE, 1.0, DVec3::ONE, 0.5);
    assert_eq!(
        p,
        Proximity {
            gap: -1.5,
            normal: DVec3::Z,
            curvature: 0.0,
            flat: DVec3::ZERO,
        }
    );
}

#[test]
fn gap_is_the_height_less_the_radius_on_either_side() {
    let point = DVec3::new(7.0, -3.0, 1.0);
    let above = sphere_plane(DVec3::new(0.0, 0.0, 1.5), 0.25, point, DVec3::Z);
    assert_eq!(
        above,
        Proximity {
            gap: 0.25,
            normal: DVec3::Z,
            curvature: 0.0,
            flat: DVec3::ZERO,
        }
    );
    let below = sphere_plane(DVec3::new(0.0, 0.0, 0.5), 0.25, point, DVec3::Z);
    assert_eq!(below.gap, -0.75);
}
