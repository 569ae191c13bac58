//! Walls: derivatives against finite differences, gaps against the nearest of many points of the surface, the bound that
//! lists rely on, and displacements.

mod common;

use carom_geom::{
    Ball, Cone, Cylinder, DVec3, Disc, Displacement, NeighbourList, Proximity, Rectangle, Shape,
};
use common::{check_derivatives, vector, wall};
use glam::DQuat;
use proptest::prelude::*;

fn meet(wall: &Shape, x: DVec3, r: f64) -> Proximity {
    wall.meet(x, r)
}

/// Whether the closest point stays on the same part of the wall around `x`.
fn on_one_part(wall: &Shape, x: DVec3, r: f64, h: f64) -> bool {
    let at = meet(wall, x, r);
    DVec3::AXES.into_iter().flat_map(|a| [a, -a]).all(|axis| {
        let near = meet(wall, x + h * axis, r);
        // The sign of f says nothing.
        let turned = (near.flat - at.flat)
            .length()
            .min((near.flat + at.flat).length());
        (near.gap - at.gap).abs() <= 1.01 * h
            && (near.curvature - at.curvature).abs() <= 0.01 * at.curvature.abs()
            && turned < 0.01
    })
}

/// Points of a wall, `n` in each direction, from its definition alone; infinite ones as far as 4 m.
fn surface(wall: &Shape, n: usize) -> Vec<DVec3> {
    let share = |i: usize| i as f64 / (n - 1) as f64;
    let grid = move |f: &dyn Fn(f64, f64) -> DVec3| -> Vec<DVec3> {
        (0..n * n).map(|k| f(share(k / n), share(k % n))).collect()
    };
    let around = |axis: DVec3, turn: f64| {
        let (u, v) = axis.any_orthonormal_pair();
        let angle = std::f64::consts::TAU * turn;
        angle.cos() * u + angle.sin() * v
    };
    match *wall {
        Shape::HalfSpace { point, normal } => {
            let (u, v) = normal.any_orthonormal_pair();
            grid(&|a, b| point + (8.0 * a - 4.0) * u + (8.0 * b - 4.0) * v)
        }
        Shape::Rectangle(w) => {
            let across = w.normal.cross(w.side);
            grid(&|a, b| {
                w.centre
                    + (2.0 * a - 1.0) * w.half[0] * w.side
                    + (2.0 * b - 1.0) * w.half[1] * across
            })
        }
        Shape::Disc(w) => {
            grid(&|a, b| w.centre + (w.hole + (w.radius - w.hole) * a) * around(w.normal, b))
        }
        Shape::Cylinder(w) => grid(&|a, b| {
            w.centre + (2.0 * a - 1.0) * w.half.min(4.0) * w.axis + w.radius * around(w.axis, b)
        }),
        Shape::Ball(w) => grid(&|a, b| {
            let angle = std::f64::consts::PI * a;
            let across = angle.sin() * around(DVec3::Z, b);
            w.centre + w.radius * (angle.cos() * DVec3::Z + across)
        }),
        Shape::Cone(w) => grid(&|a, b| {
            let radius = w.radius + (w.radius_end - w.radius) * a;
            w.point + a * w.length * w.axis + radius * around(w.axis, b)
        }),
        Shape::Triangle(w) => grid(&|a, b| {
            let [p, q, s] = w.corners;
            p + a * (q - p) + a * b * (s - q)
        }),
        Shape::Sheet(w) => {
            let (u, v) = w.normal.any_orthonormal_pair();
            grid(&|a, b| w.point + (8.0 * a - 4.0) * u + (8.0 * b - 4.0) * v)
        }
        Shape::Line(w) => grid(&|a, _| w.point + (8.0 * a - 4.0) * w.along),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn derivatives_match_differences(wall in wall(), x in vector(1.5), r in 0.02..0.3f64) {
        let at = meet(&wall, x, r);
        // Not where a centre of curvature is near.
        prop_assume!(at.curvature.abs() < 20.0 && at.flat.length() < 4.0);
        prop_assume!(on_one_part(&wall, x, r, 1e-4));
        check_derivatives(|x| meet(&wall, x, r), x, 0.3);
    }

    /// What lists rely on: the clearance changes by no more than the centre moves and is never above the gap; on the free side
    /// it is the gap.
    #[test]
    fn the_clearance_is_a_lipschitz_bound(wall in wall(), x in vector(1.5), way in vector(0.5), r in 0.02..0.3f64) {
        let (here, there) = (wall.clearance(x, r), wall.clearance(x + way, r));
        prop_assert!((here - there).abs() <= way.length() * (1.0 + 1e-12) + 1e-15);
        let gap = meet(&wall, x, r).gap;
        if gap > 0.0 {
            prop_assert!(here <= gap + 1e-14, "{here} {gap}");
        } else {
            prop_assert!(here <= 1e-14);
        }
        if gap > -r && here > -r {
            // The centre is in front of the surface, or beside it.
            prop_assert!((here - gap).abs() < 1e-12 || gap > r, "{here} {gap}");
        }
    }

    /// The wall and the sphere moved together meet as before.
    #[test]
    fn a_displacement_takes_everything_along(
        wall in wall(), x in vector(1.5), about in vector(1.0), turn in vector(3.0), shift in vector(2.0), r in 0.02..0.3f64,
    ) {
        let by = Displacement { turn: DQuat::from_scaled_axis(turn), about, shift };
        let (here, there) = (meet(&wall, x, r), meet(&wall.moved(&by), by.point(x), r));
        prop_assume!(on_one_part(&wall, x, r, 1e-6));
        prop_assert!((here.gap - there.gap).abs() < 1e-13);
        prop_assert!((by.turn * here.normal - there.normal).length() < 1e-9);
        prop_assert!((here.curvature - there.curvature).abs() < 1e-6 * (1.0 + here.curvature.abs()).powi(2));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    /// The gap is the distance to the nearest point of the surface less the radius, and the normal points away from it.
    #[test]
    fn the_contact_is_the_closest_point(wall in wall(), x in vector(1.2), r in 0.02..0.3f64) {
        let at = meet(&wall, x, r);
        let touches = x - (at.gap + r) * at.normal;
        // Centres behind a surface are another matter.
        prop_assume!(at.gap > -r && (wall.clearance(x, r) - at.gap).abs() < 1e-12);
        let nearest = surface(&wall, 241)
            .into_iter()
            .min_by(|a, b| (x - *a).length().total_cmp(&(x - *b).length()))
            .expect("points");
        let distance = (x - nearest).length();
        prop_assert!(distance >= at.gap + r - 1e-12, "{distance} {at:?}");
        // Spacing of the points: 8 m in 240 at the widest.
        prop_assert!(distance <= (at.gap + r).hypot(0.03) + 1e-3, "{distance} {at:?}");
        prop_assert!(wall.clearance(touches, 0.0).abs() < 1e-12);
    }
}

#[test]
fn a_sheet_has_two_faces() {
    let walls = [
        Shape::Rectangle(Rectangle {
            centre: DVec3::ZERO,
            normal: DVec3::Z,
            side: DVec3::X,
            half: [1.0, 0.5],
        }),
        Shape::Disc(Disc {
            centre: DVec3::ZERO,
            normal: DVec3::Z,
            radius: 1.0,
            hole: 0.0,
        }),
        Shape::Cylinder(Cylinder {
            centre: DVec3::new(0.0, 0.0, 2.0),
            axis: DVec3::Y,
            radius: 2.0,
            half: 1.0,
            inside: true,
        }),
        Shape::Cone(Cone {
            point: DVec3::new(0.0, -1.0, 2.0),
            axis: DVec3::Y,
            radius: 2.0,
            radius_end: 2.0,
            length: 2.0,
            inside: true,
        }),
    ];
    for wall in walls {
        for (z, gap) in [(0.5, 0.4), (0.05, -0.05), (-0.05, -0.05), (-0.5, 0.4)] {
            let at = meet(&wall, DVec3::new(0.1 * z, 0.2, z), 0.1);
            let slack = if matches!(wall, Shape::Cylinder(_) | Shape::Cone(_)) {
                1e-3
            } else {
                1e-15
            };
            assert!((at.gap - gap).abs() < slack, "{wall:?} {z} {at:?}");
            assert!(at.normal.z * z.signum() > 0.99, "{wall:?} {z} {at:?}");
            // Bent away from the centre on one side and towards it on the other.
            let other = meet(&wall, DVec3::new(0.1 * z, 0.2, -z), 0.1);
            assert!(at.curvature * other.curvature <= 0.0);
        }
    }
}

#[test]
fn centres_on_an_axis_have_a_finite_answer() {
    let (centre, axis) = (DVec3::new(0.3, 0.2, 0.1), DVec3::Z);
    let walls = [
        Shape::Cylinder(Cylinder {
            centre,
            axis,
            radius: 1.0,
            half: 0.5,
            inside: true,
        }),
        Shape::Cylinder(Cylinder {
            centre,
            axis,
            radius: 1.0,
            half: f64::INFINITY,
            inside: true,
        }),
        Shape::Ball(Ball {
            centre,
            radius: 1.0,
            inside: true,
        }),
        Shape::Cone(Cone {
            point: centre,
            axis,
            radius: 1.0,
            radius_end: 0.5,
            length: 1.0,
            inside: true,
        }),
        Shape::Cone(Cone {
            point: centre,
            axis,
            radius: 0.0,
            radius_end: 0.5,
            length: 1.0,
            inside: false,
        }),
        Shape::Disc(Disc {
            centre,
            normal: axis,
            radius: 1.0,
            hole: 0.5,
        }),
    ];
    for wall in walls {
        for z in [-3.0, -0.5, 0.0, 0.5, 3.0] {
            let at = meet(&wall, centre + z * axis, 0.1);
            assert!(
                (at.normal.length() - 1.0).abs() < 1e-14,
                "{wall:?} {z} {at:?}"
            );
            assert!(at.gap.is_finite() && at.curvature.is_finite() && at.flat.is_finite());
        }
    }
}

/// A drum that turns and a plate that shakes under balls that stay: the list lasts.
#[test]
fn walls_that_move_do_not_cost_a_rebuild_each_step() {
    let r = 0.02;
    let x: Vec<DVec3> = (0..300)
        .map(|k| {
            DVec3::new(
                0.05 * f64::from(k % 10) - 0.2,
                0.05 * f64::from(k / 10 % 6),
                0.05 * f64::from(k / 60),
            )
        })
        .collect();
    let drum = Shape::Cylinder(Cylinder {
        centre: DVec3::new(0.0, 0.0, 0.2),
        axis: DVec3::Y,
        radius: 0.5,
        half: 0.6,
        inside: true,
    });
    let plate = Shape::Rectangle(Rectangle {
        centre: DVec3::new(0.0, 0.0, -0.021),
        normal: DVec3::Z,
        side: DVec3::X,
        half: [0.5, 0.5],
    });
    let plane = Shape::HalfSpace {
        point: DVec3::new(0.0, -0.03, 0.0),
        normal: DVec3::Y,
    };
    let (radius, need) = (vec![r; 300], vec![1e-3; 300]);
    let mut list = NeighbourList::new();
    for step in 0..500 {
        let t = f64::from(step);
        let turn = |axis: DVec3, angle: f64, shift: DVec3| Displacement {
            turn: DQuat::from_axis_angle(axis, angle),
            about: DVec3::new(0.0, 0.0, 0.2),
            shift,
        };
        let shake = 0.4 * r * (0.1 * t).sin();
        let walls = [
            drum.moved(&turn(DVec3::Y, 0.05 * t, DVec3::ZERO)),
            plate.moved(&turn(DVec3::Y, 0.0, -shake.abs() * DVec3::Z)),
            plane.moved(&turn(DVec3::Z, 0.02 * (0.1 * t).sin(), shake * DVec3::Y)),
        ];
        list.refresh(&x, &radius, &walls, &need);
        for (w, wall) in walls.iter().enumerate() {
            for (i, x) in x.iter().enumerate() {
                let near = meet(wall, *x, r).gap <= need[i];
                let key = (i as u32, (300 + w) as u32);
                assert!(!near || list.pairs().binary_search(&key).is_ok());
            }
        }
    }
    assert!(list.rebuilds() < 5, "{}", list.rebuilds());
}

#[test]
fn on_an_oblique_axis_the_normal_is_a_unit_vector_all_the_same() {
    // Found by fuzzing: a distance from the axis that was nothing but rounding, along the axis itself, made the normal.
    let axis = DVec3::ONE.normalize();
    for k in 1..200 {
        let x = DVec3::splat(-0.01 * f64::from(k));
        for inside in [false, true] {
            let cone = Shape::Cone(Cone {
                point: DVec3::splat(-1.0),
                axis: -axis,
                radius: 0.1,
                radius_end: 1.8,
                length: 1.8,
                inside,
            });
            let cylinder = Shape::Cylinder(Cylinder {
                centre: DVec3::splat(0.3),
                axis,
                radius: 0.1,
                half: f64::INFINITY,
                inside,
            });
            for wall in [cone, cylinder] {
                let p = meet(&wall, x, 0.01);
                assert!(
                    (p.normal.length() - 1.0).abs() < 1e-12,
                    "{wall:?} {x} {p:?}"
                );
                assert!(p.curvature.abs() < 1e6, "{wall:?} {x} {p:?}");
            }
        }
    }
}
