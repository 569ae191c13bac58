//! Nothing passes through anything, however long the step.

mod common;

use carom_core::options::Method;
use carom_core::wall::{Cone, Cylinder, Disc, Rectangle, Shape, WallMotion};
use carom_core::{ModelInput, Options};
use carom_laws::Scalar;
use common::{advance, balls, simulation, R};
use glam::DVec3;

const H: f64 = 0.015625;

fn options(method: Method) -> Options {
    Options {
        step: H,
        method,
        ..Options::default()
    }
}

/// Ball 0 flies along x at `travel` radii a step against ball 1 at rest.
fn shot(travel: f64, law: [f64; 5]) -> ModelInput {
    let mut input = ModelInput {
        laws: vec![(0, 0, law)],
        ..balls(&[[0.0; 3], [20.0 * R, 0.0, 0.0]], &[])
    };
    input.velocity[0] = [travel * R / H, 0.0, 0.0];
    input
}

#[test]
fn a_bullet_gives_its_speed_to_the_ball_it_hits() {
    for method in [Method::Nsga, Method::MoreauJean] {
        for travel in [0.9, 1.1, 3.1, 7.5, 11.9] {
            let input = shot(travel, [0.0, 1.0, 0.0, 0.0, 0.0]);
            let speed = input.velocity[0][0];
            let mut s = simulation(&input, options(method));
            assert!(advance(&mut s, 40).is_none());
            let v = [s.state.velocity[0].x, s.state.velocity[1].x];
            assert!(
                v[0].abs() < 1e-9 * speed && (v[1] - speed).abs() < 1e-9 * speed,
                "{method:?} {travel}: {v:?}"
            );
            assert!(s.state.position[1].x - s.state.position[0].x > 2.0 * R * (1.0 - 1e-9));
            assert_eq!(s.monitors.steps, 40);
            assert_eq!(s.monitors.halvings, 0);
            // Parts of one step alone, each of a travel below the radius.
            let parts = if travel < 1.0 { 0 } else { s.monitors.substeps };
            assert_eq!(s.monitors.substeps, parts);
            if travel >= 1.0 {
                assert!((2..=32).contains(&parts), "{method:?} {travel}: {parts}");
                assert!(s.monitors.substep_min * speed < R);
                assert!(s.monitors.substep_min * speed >= 0.5 * R);
            }
            assert_eq!(s.recorder.block.frame_step, (1..=40).collect::<Vec<u64>>());
        }
    }
}

#[test]
fn a_wall_is_hit_where_it_stands() {
    let mut input = ModelInput {
        laws: vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])],
        ..balls(&[[10.3 * R, 0.0, 0.0]], &[([0.0; 3], [1.0, 0.0, 0.0])])
    };
    input.velocity[0] = [-5.0 * R / H, 2.0 * R / H, 0.0];
    let mut s = simulation(&input, options(Method::Nsga));
    assert!(advance(&mut s, 4).is_none());
    // Free to 9.3 R, back again: the path is known to the travel of one part, 5/8 R, twice.
    let x = s.state.position[0].x;
    let exact = (20.0 - 9.3 + 1.0) * R;
    assert!((x - exact).abs() < 1.25 * R, "{x} {exact}");
    // Halves without a meeting stay whole: 1/2 + 1/4 + 1/8 + 1/8.
    assert_eq!(s.monitors.substeps, 4);
    assert_eq!(s.monitors.substep_min, H / 8.0);
    // Along the wall it may go as far as it likes.
    input.position[0][0] = R;
    input.velocity[0][0] = 0.0;
    let mut s = simulation(&input, options(Method::Nsga));
    assert!(advance(&mut s, 4).is_none());
    assert_eq!(s.monitors.substeps, 0);
}

#[test]
fn what_meets_nothing_is_left_alone() {
    // Two that fly together, one that crosses behind them, one far away.
    let mut input = ModelInput {
        laws: vec![(0, 0, [0.2, 0.5, 0.0, 0.0, 0.0])],
        ..balls(
            &[
                [0.0; 3],
                [2.5 * R, 0.0, 0.0],
                [0.0, -9.0 * R, 0.0],
                [0.0, 0.0, 50.0 * R],
            ],
            &[],
        )
    };
    let fast = 6.0 * R / H;
    input.velocity = vec![
        [fast, 0.0, 0.0],
        [fast, 0.0, 0.0],
        [0.0, fast, 0.0],
        [0.0, fast, 0.0],
    ];
    let mut s = simulation(&input, options(Method::Nsga));
    assert!(advance(&mut s, 10).is_none());
    assert_eq!(s.monitors.substeps, 0);
    assert!((s.state.position[1].x - (2.5 + 60.0) * R).abs() < 1e-12);
}

#[test]
fn what_is_too_fast_is_refused_with_the_step_to_take() {
    let input = shot(40.0, [0.0, 1.0, 0.0, 0.0, 0.0]);
    let mut s = simulation(&input, options(Method::Nsga));
    let before = common::bits(&s);
    let outcome = advance(&mut s, 40).expect("it is too fast");
    let (kind, message) = (outcome.kind(), outcome.message.unwrap_or_default());
    assert_eq!(
        (kind, outcome.step, &outcome.bodies[..]),
        ("too_fast", 1, &[0, 1][..])
    );
    for part in ["80 m/s", "2.5 radii", "of 0.0001953 s or less"] {
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(common::bits(&s), before, "nothing was written");
    // The step of the message works.
    let mut s = simulation(
        &input,
        Options {
            step: 1.9e-4,
            ..Options::default()
        },
    );
    assert!(advance(&mut s, 100).is_none());
    assert!((s.state.velocity[1].x - 80.0).abs() < 1e-9);
}

/// A paddle of 20 radii that flies along x at `travel` radii a step, towards a ball at rest 9.3 radii ahead.
#[test]
fn a_fast_paddle_does_not_pass_through_a_ball() {
    for travel in [0.5, 2.3, 5.1] {
        let mut input = ModelInput {
            laws: vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])],
            walls: vec![(
                Shape::Rectangle(Rectangle {
                    centre: DVec3::ZERO,
                    normal: DVec3::X,
                    side: DVec3::Y,
                    half: [10.0 * R, 10.0 * R],
                }),
                1,
            )],
            ..balls(&[[10.3 * R, 0.0, 0.0]], &[])
        };
        let speed = travel * R / H;
        let along = [
            Scalar::Polynomial(vec![0.0, speed]),
            Scalar::zero(),
            Scalar::zero(),
        ];
        input.wall_motion = vec![(
            0,
            WallMotion {
                translation: Some(along),
                ..WallMotion::default()
            },
        )];
        let mut s = simulation(&input, options(Method::Nsga));
        assert!(advance(&mut s, 25).is_none());
        let v = s.state.velocity[0].x;
        assert!(
            (v - 2.0 * speed).abs() < 1e-9 * speed,
            "{travel}: {v} {speed}"
        );
        assert_eq!(s.monitors.substeps > 0, travel > 1.0, "{travel}");
    }
}

/// A post thinner than the ball, the edge of a disc and the tip of a cone, off the middle: what is inside on the way may be out again at the end.
#[test]
fn nothing_passes_a_thin_wall() {
    let post = Shape::Cylinder(Cylinder {
        centre: DVec3::ZERO,
        axis: DVec3::Z,
        radius: 0.2 * R,
        half: 10.0 * R,
        inside: false,
    });
    let edge = Shape::Disc(Disc {
        centre: DVec3::new(0.0, -10.0 * R, 0.0),
        normal: DVec3::X,
        radius: 10.0 * R,
        hole: 0.0,
    });
    let tip = Shape::Cone(Cone {
        point: DVec3::ZERO,
        axis: -DVec3::Y,
        radius: 0.0,
        radius_end: R,
        length: 5.0 * R,
        inside: false,
    });
    // (Nearer to the rim a ball is inside for less than a radius on its way in: such grazes are counted, not cut.)
    for (shape, aside) in [
        (post, 0.0),
        (post, 0.3),
        (post, 0.6),
        (edge, 0.4),
        (tip, -0.5),
        (tip, 0.4),
    ] {
        for travel in [0.9, 1.2, 1.4, 2.8, 3.5] {
            for phase in 0..12 {
                let start = (8.0 + f64::from(phase) / 12.0 * travel) * R;
                let mut input = ModelInput {
                    laws: vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])],
                    walls: vec![(shape, 1)],
                    ..balls(&[[start, aside * R, 0.0]], &[])
                };
                input.velocity[0] = [-travel * R / H, 0.0, 0.0];
                let mut s = simulation(&input, options(Method::Nsga));
                assert!(advance(&mut s, 30).is_none());
                let v = s.state.velocity[0];
                let speed = travel * R / H;
                assert!((v.length() - speed).abs() < 1e-9 * speed);
                assert!(
                    v.x > -0.99 * speed,
                    "{shape:?} {aside} {travel} {phase}: {v}"
                );
            }
        }
    }
}
