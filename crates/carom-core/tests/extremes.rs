//! Finite numbers whose squares or products are none: refused, or the run stops with a state that can be saved.

mod common;

use carom_core::force::{applied::Applied, drag::Drag, spring::Spring, Load};
use carom_core::joint::{Joint, JointRow, RowKind, GROUND};
use carom_core::options::Method;
use carom_core::wall::{Ball, Shape, WallMotion, WallRotation};
use carom_core::{Options, Recording, Simulation};
use carom_laws::Scalar;
use common::{compile, on_floor, refusal};
use glam::DVec3;
use std::sync::Arc;
use std::time::Duration;

#[test]
fn steps_and_walls_whose_squares_are_no_numbers_are_refused() {
    // Found by fuzzing: a step of 1e-323 s made accelerations that were no numbers, and nobody said so.
    for step in [1e-323, 1e-150, 1e150] {
        let options = Options {
            step,
            ..Options::default()
        };
        let error = compile(&on_floor([0.2, 0.5, 0.0, 0.0, 0.0]), options).expect_err("refused");
        assert!(error.to_string().contains("option step is"), "{error}");
    }
    let text = refusal(|m| {
        let centre = DVec3::ZERO;
        let (radius, inside) = (1e200, false);
        let wall = Shape::Ball(Ball {
            centre,
            radius,
            inside,
        });
        m.walls.push((wall, 1));
    });
    assert!(text.contains("radius of wall 0: is 1e200"), "{text}");
}

#[test]
fn points_of_loads_and_joints_are_places() {
    let spring = Spring {
        a: 0,
        b: GROUND,
        arm_a: DVec3::ZERO,
        arm_b: DVec3::Z,
        stiffness: 1.0,
        damping: 0.0,
        rest_length: 1.0,
    };
    let row = JointRow {
        kind: RowKind::Point,
        direction: DVec3::Z,
        arm_a: DVec3::ZERO,
        arm_b: DVec3::Z,
        law: Scalar::zero(),
    };
    let turning = WallRotation {
        axis: DVec3::Z,
        point: DVec3::ZERO,
        angle: Scalar::zero(),
    };
    // Found by fuzzing: an end of a spring at 7.8e273 m made accelerations that were no numbers.
    for x in [1e76, -7.8e273, f64::MAX, f64::INFINITY, f64::NAN] {
        let far = DVec3::new(0.0, x, 0.0);
        for (name, changed) in [
            (
                "points",
                Spring {
                    arm_a: far,
                    ..spring
                },
            ),
            (
                "points",
                Spring {
                    arm_b: far,
                    ..spring
                },
            ),
            (
                "rest_length",
                Spring {
                    rest_length: x.abs(),
                    ..spring
                },
            ),
        ] {
            let text = refusal(|m| m.loads = vec![Arc::new(changed)]);
            let said = x.is_finite() || name == "points";
            assert!(text.starts_with(&format!("{name} of load 0: is")), "{text}");
            assert!(!said || text.contains("not above 1e75 m"), "{text}");
            assert!(text.len() < 100, "{text}");
        }
        for (name, arm_a, arm_b, length) in [
            ("arms", far, DVec3::Z, 1.0),
            ("arms", DVec3::ZERO, far, 1.0),
            ("length", DVec3::ZERO, DVec3::Z, x),
        ] {
            let text = refusal(|m| {
                m.joints = vec![Joint {
                    a: 0,
                    b: GROUND,
                    rows: vec![JointRow {
                        arm_a,
                        arm_b,
                        ..row.clone()
                    }],
                    translational: 1,
                    length,
                }]
            });
            assert!(
                text.starts_with(&format!("{name} of joint 0: is")),
                "{text}"
            );
            assert!(text.contains("1e75 m"), "{text}");
        }
        let rotation = WallRotation {
            point: far,
            ..turning.clone()
        };
        for (name, motion) in [
            (
                "rotation",
                WallMotion {
                    rotation: Some(rotation),
                    ..Default::default()
                },
            ),
            (
                "surface_rotation",
                WallMotion {
                    surface_rotation: Some((DVec3::Z, far, 1.0)),
                    ..Default::default()
                },
            ),
        ] {
            let text = refusal(|m| m.wall_motion = vec![(0, motion.clone())]);
            assert!(
                text.starts_with(&format!("{name} of wall motion 0: is")),
                "{text}"
            );
            assert!(text.contains("not above 1e75 m"), "{text}");
        }
    }
}

#[test]
fn a_load_without_numbers_leaves_a_state_that_is_one() {
    // A force that is the largest number, over a mass or an inertia below 1.
    let most = f64::MAX;
    let spring = Spring {
        a: 0,
        b: GROUND,
        arm_a: DVec3::X * 0.01,
        arm_b: DVec3::Y,
        stiffness: most,
        damping: most,
        rest_length: 0.0,
    };
    let drag = Drag {
        body: 0,
        arm: DVec3::ZERO,
        translation: most,
        rotation: most,
    };
    let force = [Scalar::Constant(most), Scalar::zero(), Scalar::zero()];
    let torque = [Scalar::zero(), Scalar::zero(), Scalar::zero()];
    let applied = Applied {
        body: 0,
        arm: DVec3::ZERO,
        force,
        torque,
    };
    let loads: [Arc<dyn Load>; 3] = [Arc::new(spring), Arc::new(drag), Arc::new(applied)];
    for load in loads {
        for method in [Method::Nsga, Method::MoreauJean] {
            let mut input = on_floor([0.2, 0.5, 0.0, 0.0, 0.0]);
            input.velocity[0] = [1.0, 2.0, 3.0];
            input.angular_velocity[0] = [1.0, 2.0, 3.0];
            input.loads = vec![load.clone()];
            let options = Options {
                method,
                ..Options::default()
            };
            let (model, initial) = compile(&input, options).expect("valid");
            let mut s = Simulation::new(model, initial);
            let recording = Recording {
                frame_every: 1,
                contacts: false,
            };
            let outcome = s.advance(1, recording, Duration::MAX);
            let kind = outcome.as_ref().map(|o| o.kind());
            assert_eq!(kind, Some("not_finite"), "{load:?} {method:?}");
            assert_eq!(s.state.step, 0);
            assert_eq!(s.state.check(&s.model), Ok(()), "{load:?} {method:?}");
        }
    }
}
