//! Derivatives against differences: joints, tangents of loads, rotations; and steps of both methods in time that are exact.

use carom_core::force::drag::Drag;
use carom_core::force::spring::Spring;
use carom_core::force::{Load, Motion};
use carom_core::joint::{Joint, JointRow, Pose, RowKind, Twist, GROUND};
use carom_core::rotation::{advance, transposed_left_jacobian};
use carom_core::rows::Rows;
use carom_core::stepper::Coefficients;
use carom_laws::Scalar;
use glam::{DQuat, DVec3};
use proptest::prelude::*;

fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0f64..1.0).prop_map(DVec3::from)
}

fn joint(b: u32, arms: (DVec3, DVec3), direction: DVec3) -> Joint {
    let row = |kind| JointRow {
        kind,
        direction: direction.normalize(),
        arm_a: arms.0,
        arm_b: arms.1,
        law: Scalar::Polynomial(vec![0.3, -0.2, 0.1]),
    };
    Joint {
        a: 0,
        b,
        rows: vec![
            row(RowKind::Point),
            row(RowKind::Distance),
            row(RowKind::Rotation),
        ],
        translational: 2,
        length: 1.0,
    }
}

fn moved(p: &Pose, side: &[f64]) -> Pose {
    Pose {
        position: p.position + DVec3::new(side[0], side[1], side[2]),
        orientation: advance(DVec3::new(side[3], side[4], side[5]), p.orientation),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Gradient, G^s and geometric stiffness against central differences; ground and two bodies.
    #[test]
    fn derivatives_match_differences(x in prop::array::uniform2(vector()), arms in prop::array::uniform2(vector()),
                                     d in vector(), psi in prop::array::uniform2(vector()),
                                     v in prop::array::uniform4(vector()), ground in any::<bool>(),
                                     lambda in prop::array::uniform3(-1.0f64..1.0)) {
        prop_assume!(d.length() > 0.1);
        let j = joint(if ground { GROUND } else { 1 }, (arms[0], arms[1]), d);
        let poses = [
            Pose { position: x[0] + DVec3::X * 4.0, orientation: DQuat::from_scaled_axis(psi[0]) },
            Pose { position: x[1], orientation: DQuat::from_scaled_axis(psi[1]) },
        ];
        let twist = [Twist { velocity: v[0], angular_velocity: v[1] },
                     Twist { velocity: v[2], angular_velocity: v[3] }];
        let twist = if ground { [twist[0], Twist::default()] } else { twist };
        let mut g: Rows = Default::default();
        j.gradient(&poses[0], &poses[1], &mut g);
        let mut rate: Rows = Default::default();
        j.gradient_rate((&poses[0], &twist[0]), (&poses[1], &twist[1]), &mut rate);
        let mut stiffness = [[[[0.0; 6]; 6]; 2]; 2];
        j.gradient_stiffness(&poses[0], &poses[1], &lambda, &mut stiffness);
        let step = 1e-6;
        for side in 0..2 {
            for k in 0..6 {
                let at = |sign: f64| {
                    let mut delta = [0.0; 6];
                    delta[k] = sign * step;
                    let mut p = poses;
                    p[side] = moved(&p[side], &delta);
                    let (mut z, mut g): ([f64; 3], Rows) = ([0.0; 3], Default::default());
                    j.position_measures(&p[0], &p[1], 0.7, &mut z);
                    j.gradient(&p[0], &p[1], &mut g);
                    (z, g)
                };
                let ((zp, gp), (zm, gm)) = (at(1.0), at(-1.0));
                for r in 0..2 {
                    let fd = (zp[r] - zm[r]) / (2.0 * step);
                    prop_assert!((fd - g[r][side][k]).abs() < 1e-8, "gradient {r} {side} {k}: {fd}");
                }
                let speed = |g: &Rows, r: usize| (0..2).map(|s| {
                    let t = [twist[s].velocity.to_array(), twist[s].angular_velocity.to_array()].concat();
                    g[r][s].iter().zip(&t).map(|(a, b)| a * b).sum::<f64>()
                }).sum::<f64>();
                for r in 0..3 {
                    let fd = (speed(&gp, r) - speed(&gm, r)) / (2.0 * step);
                    prop_assert!((fd - rate[r][side][k]).abs() < 1e-7, "rate {r} {side} {k}: {fd} {}", rate[r][side][k]);
                }
                for of in 0..2 {
                    for i in 0..6 {
                        let force = |g: &Rows| (0..3).map(|r| lambda[r] * g[r][of][i]).sum::<f64>();
                        let fd = (force(&gp) - force(&gm)) / (2.0 * step);
                        prop_assert!((fd - stiffness[of][side][i][k]).abs() < 1e-7,
                                     "stiffness {of}{side} {i}{k}: {fd} {}", stiffness[of][side][i][k]);
                    }
                }
            }
        }
    }
}

/// A load's tangents against central differences at a motion of two spheres.
fn tangents_match_differences(load: &dyn Load, base: [(Pose, Twist); 2]) {
    let wrench = |s: &[(Pose, Twist); 2]| {
        let motion = arrays(s);
        let mut out = [[DVec3::ZERO; 2]; 2];
        load.add(&as_motion(&motion), &mut out).expect("a load");
        out
    };
    let motion = arrays(&base);
    let mut tangents = Vec::new();
    load.tangent(&as_motion(&motion), &mut tangents);
    let step = 1e-6;
    for over in 0..2 {
        for k in 0..12 {
            let at = |sign: f64| {
                let mut delta = [0.0; 12];
                delta[k] = sign * step;
                let vec = |i: usize| DVec3::new(delta[i], delta[i + 1], delta[i + 2]);
                let mut s = base;
                let (pose, twist) = &mut s[over];
                pose.position += vec(0);
                pose.orientation = advance(vec(3), pose.orientation);
                twist.velocity += vec(6);
                twist.angular_velocity += vec(9);
                wrench(&s)
            };
            let (plus, minus) = (at(1.0), at(-1.0));
            for of in 0..2 {
                for i in 0..6 {
                    let fd = (plus[of][i / 3][i % 3] - minus[of][i / 3][i % 3]) / (2.0 * step);
                    let found: f64 = tangents
                        .iter()
                        .filter(|t| t.of == of as u32 && t.over == over as u32)
                        .map(|t| {
                            if k < 6 {
                                t.position[i][k]
                            } else {
                                t.velocity[i][k - 6]
                            }
                        })
                        .sum();
                    assert!(
                        (fd - found).abs() < 1e-6 * (1.0 + fd.abs()),
                        "of {of} over {over} row {i} column {k}: {fd} {found}"
                    );
                }
            }
        }
    }
}

type Arrays = (Vec<DVec3>, Vec<DQuat>, Vec<DVec3>, Vec<DVec3>);

fn arrays(s: &[(Pose, Twist); 2]) -> Arrays {
    (
        s.iter().map(|x| x.0.position).collect(),
        s.iter().map(|x| x.0.orientation).collect(),
        s.iter().map(|x| x.1.velocity).collect(),
        s.iter().map(|x| x.1.angular_velocity).collect(),
    )
}

fn as_motion(a: &Arrays) -> Motion<'_> {
    Motion {
        time: 0.3,
        position: &a.0,
        orientation: &a.1,
        velocity: &a.2,
        angular_velocity: &a.3,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn tangents_of_springs_match_differences(x in prop::array::uniform8(vector()), arms in prop::array::uniform2(vector()),
                                          ground in any::<bool>()) {
        let spring = Spring { a: 0, b: if ground { GROUND } else { 1 }, arm_a: arms[0], arm_b: arms[1],
                              stiffness: 3.0, damping: 0.8, rest_length: 1.1 };
        let state = |k: usize, shift: DVec3| (
            Pose { position: x[k] + shift, orientation: DQuat::from_scaled_axis(x[k + 1]) },
            Twist { velocity: x[k + 2], angular_velocity: x[k + 3] },
        );
        let base = [state(0, DVec3::X * 4.0), state(4, DVec3::ZERO)];
        tangents_match_differences(&spring, base);
    }
}

#[test]
fn tangents_of_drag_match_differences() {
    let drag = Drag {
        body: 1,
        arm: DVec3::new(0.3, -0.2, 0.5),
        translation: 0.7,
        rotation: 0.02,
    };
    let twist = Twist {
        velocity: DVec3::new(1.0, -2.0, 0.5),
        angular_velocity: DVec3::new(3.0, 0.1, -4.0),
    };
    tangents_match_differences(&drag, [(Pose::GROUND, twist); 2]);
}

#[test]
fn agrees_with_the_axis_angle_rotation_on_both_branches() {
    let q = DQuat::from_xyzw(0.1, -0.5, 0.3, 0.8).normalize();
    for size in [1e-9, 1e-3, 0.1, 0.49, 0.51, 2.0, 6.0] {
        let psi = DVec3::new(0.36, -0.48, 0.8) * size;
        let expected = DQuat::from_scaled_axis(psi) * q;
        let found = advance(psi, q);
        let difference = (found - expected).length();
        assert!(difference < 4e-15, "{size}: {difference:e}");
    }
}

#[test]
fn the_left_jacobian_is_the_derivative_of_the_exponential() {
    let w = DVec3::new(0.3, -0.7, 0.2);
    for size in [1e-4, 0.05, 0.2, 1.0, 2.5] {
        let psi = DVec3::new(0.36, -0.48, 0.8) * size;
        let found = transposed_left_jacobian(psi, w);
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let step = 1e-6;
            let at = |s: f64| DQuat::from_scaled_axis(psi + s * step * axis);
            let turned = (at(1.0) * at(-1.0).inverse()).to_scaled_axis() / (2.0 * step);
            assert!((turned.dot(w) - found[k]).abs() < 1e-9, "{size} {k}");
        }
    }
}

/// A constant acceleration is integrated exactly for every spectral radius (theory 1.3).
#[test]
fn constant_acceleration_is_exact() {
    let (g, h) = (DVec3::new(0.0, 0.0, -9.8), 1e-3);
    for rho in [0.0, 0.3, 0.8, 0.99] {
        let c = Coefficients::new(rho, h);
        let v = DVec3::new(1.0, 2.0, 3.0);
        let mut p = c.predict(v, g, g);
        let dv = g / c.acceleration_per_velocity();
        c.correct(&mut p, dv);
        assert!((p.velocity - (v + h * g)).length() < 1e-15);
        assert!((p.displacement - (h * v + 0.5 * h * h * g)).length() < 1e-17);
        assert!((c.finish(&p) - g).length() < 1e-13);
    }
}

/// Under a constant acceleration the velocity is exact, and the place too for theta = 1/2; else it is off by
/// `h^2 (theta - 1/2) g` per step.
#[test]
fn free_fall_by_the_theta_rule() {
    let (g, h, v) = (DVec3::new(0.0, 0.0, -9.8), 1e-2, DVec3::new(1.0, 2.0, 3.0));
    for theta in [0.5, 0.7, 1.0] {
        let c = Coefficients::theta_rule(theta, h);
        let mut p = c.predict(v, g, g);
        c.correct(&mut p, g / c.acceleration_per_velocity());
        assert!((p.velocity - (v + h * g)).length() < 1e-15);
        let exact = h * v + 0.5 * h * h * g;
        let off = h * h * (theta - 0.5) * g;
        assert!((p.displacement - exact - off).length() < 1e-17);
        assert!((c.finish(&p) - g).length() < 1e-13);
    }
}
