//! Joints and loads against closed forms: order two in smooth motion, no drift, impacts against held spheres.

mod common;

use carom_core::force::applied::Applied;
use carom_core::force::spring::Spring;
use carom_core::joint::{Joint, JointRow, RowKind, GROUND};
use carom_core::options::Method;
use carom_core::outcome::Failure;
use carom_core::{Model, ModelInput, Options, Recording, Simulation};
use carom_laws::{Expression, Scalar};
use common::{balls, G, MASS, R};
use glam::{DQuat, DVec3};
use std::sync::Arc;
use std::time::Duration;

fn run(input: &ModelInput, h: f64, until: f64) -> Simulation {
    let options = Options {
        step: h,
        ..Options::default()
    };
    let (model, initial) = Model::new(input, options).expect("a model");
    let mut s = Simulation::new(model, initial);
    let recording = Recording {
        frame_every: 0,
        contacts: false,
    };
    let steps = (until / h).round() as u64;
    let outcome = s.advance(steps, recording, Duration::MAX);
    assert!(outcome.is_none(), "{outcome:?}");
    s
}

fn row(kind: RowKind, direction: DVec3, arm_a: DVec3, arm_b: DVec3, law: Scalar) -> JointRow {
    JointRow {
        kind,
        direction,
        arm_a,
        arm_b,
        law,
    }
}

fn joint(a: u32, b: u32, rows: Vec<JointRow>) -> Joint {
    let translational = rows.iter().filter(|r| r.kind != RowKind::Rotation).count();
    Joint {
        a,
        b,
        rows,
        translational,
        length: R,
    }
}

/// A point `arm` of sphere `a` held at `point`, or shared with sphere `b`.
fn pin(a: u32, b: u32, arm_a: DVec3, arm_b: DVec3) -> Joint {
    let point = |d| row(RowKind::Point, d, arm_a, arm_b, Scalar::zero());
    joint(a, b, DVec3::AXES.into_iter().map(point).collect())
}

fn order(errors: [f64; 2]) -> f64 {
    (errors[0] / errors[1]).log2()
}

/// Angle of a pendulum of length `l` and gyration `k^2 = I/m`, released at `angle`, by Runge-Kutta.
fn pendulum(angle: f64, l: f64, k2: f64, until: f64) -> f64 {
    let n = 20_000;
    let h = until / f64::from(n);
    let f = |a: f64| -G * l / (l * l + k2) * a.sin();
    let (mut a, mut w) = (angle, 0.0);
    for _ in 0..n {
        let (k1, l1) = (w, f(a));
        let (k2, l2) = (w + 0.5 * h * l1, f(a + 0.5 * h * k1));
        let (k3, l3) = (w + 0.5 * h * l2, f(a + 0.5 * h * k2));
        let (k4, l4) = (w + h * l3, f(a + h * k3));
        a += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        w += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
    }
    a
}

/// A ball on a rod (its spin does not matter) and one fixed to its arm (it turns with it), both released at 60 degrees.
fn swing(rod: bool, h: f64, until: f64) -> (f64, Simulation) {
    let (l, angle) = (0.5, std::f64::consts::FRAC_PI_3);
    let x = DVec3::new(l * angle.sin(), 0.0, -l * angle.cos());
    let mut input = balls(&[x.to_array()], &[]);
    input.gravity = [0.0, 0.0, -G];
    input.joints = vec![if rod {
        let law = Scalar::Constant(l);
        let distance = row(RowKind::Distance, DVec3::Z, DVec3::ZERO, DVec3::ZERO, law);
        joint(0, GROUND, vec![distance])
    } else {
        pin(0, GROUND, -x, DVec3::ZERO)
    }];
    let s = run(&input, h, until);
    let x = s.state.position[0];
    let reached = x.x.atan2(-x.z);
    let k2 = if rod { 0.0 } else { 0.4 * R * R };
    ((reached - pendulum(angle, l, k2, until)).abs(), s)
}

#[test]
fn pendulums_converge_with_second_order_and_do_not_drift() {
    for rod in [true, false] {
        let (coarse, _) = swing(rod, 4e-3, 1.2);
        let (fine, s) = swing(rod, 2e-3, 1.2);
        let found = order([coarse, fine]);
        assert!(
            (1.85..2.2).contains(&found),
            "rod {rod}: {found} {coarse:e} {fine:e}"
        );
        let x = s.state.position[0];
        assert!(
            (x.length() - 0.5).abs() < 1e-11,
            "drift {:e}",
            x.length() - 0.5
        );
        let v = s.state.velocity[0];
        let radial = v.dot(x.normalize());
        assert!(radial.abs() < 1e-9, "radial velocity {radial:e}");
    }
}

/// A ball held by a point off its centre under a constant torque-free spin: steady precession of a top. With A the moment about
/// the point across the axis and C along it (isotropic ball: C = I, A = I + m l^2), `(C - A) cos(a) P^2 + C n P - m g l = 0`.
#[test]
fn a_spinning_top_precesses_steadily() {
    let (l, angle, spin) = (2.0 * R, 0.5f64, 400.0);
    let inertia = 0.4 * MASS * R * R;
    let across = inertia + MASS * l * l;
    let axis = DVec3::new(angle.sin(), 0.0, angle.cos());
    // Total angular velocity w = P z + s axis with C (P cos a + s) = C n.
    let precession = |s: f64| {
        // across P^2 cos - inertia (P cos + s) P + m g l = 0, slow root.
        let (a, b, c) = ((across - inertia) * angle.cos(), -inertia * s, MASS * G * l);
        2.0 * c / (-b + (b * b - 4.0 * a * c).sqrt())
    };
    let p = precession(spin);
    let error = |h: f64| {
        let mut input = balls(&[(l * axis).to_array()], &[]);
        input.gravity = [0.0, 0.0, -G];
        input.joints = vec![pin(0, GROUND, -l * axis, DVec3::ZERO)];
        let w = p * DVec3::Z + spin * axis;
        input.angular_velocity = vec![w.to_array()];
        input.velocity = vec![w.cross(l * axis).to_array()];
        let until = 0.5;
        let s = run(&input, h, until);
        let expected = DQuat::from_rotation_z(p * until) * (l * axis);
        (s.state.position[0] - expected).length()
    };
    let errors = [error(4e-4), error(2e-4)];
    let found = order(errors);
    assert!((1.8..2.3).contains(&found), "{found}: {errors:?}");
    assert!(errors[1] < 1e-3 * l, "{errors:?}");
}

/// Spring chain: the lowest mode of `n` equal masses between two walls oscillates with `2 sqrt(k/m) sin(pi/(2(n+1)))`.
#[test]
fn a_spring_chain_keeps_its_lowest_mode() {
    for n in [3usize, 30] {
        let (spacing, k, small) = (4.0 * R, 500.0, 1e-3);
        let shape = |i: usize| (std::f64::consts::PI * (i + 1) as f64 / (n + 1) as f64).sin();
        let rest = |i: usize| (i + 1) as f64 * spacing;
        let positions: Vec<[f64; 3]> = (0..n)
            .map(|i| [rest(i) + small * shape(i), 0.0, 0.0])
            .collect();
        let mut input = balls(&positions, &[]);
        input.laws = vec![(0, 0, [0.0; 5])];
        let spring = |a: u32, b: u32, arm_b: DVec3| -> Arc<dyn carom_core::force::Load> {
            Arc::new(Spring {
                a,
                b,
                arm_a: DVec3::ZERO,
                arm_b,
                stiffness: k,
                damping: 0.0,
                rest_length: spacing,
            })
        };
        input.loads = (1..n as u32)
            .map(|i| spring(i, i - 1, DVec3::ZERO))
            .collect();
        input.loads.push(spring(0, GROUND, DVec3::ZERO));
        let wall = DVec3::new((n + 1) as f64 * spacing, 0.0, 0.0);
        input.loads.push(spring(n as u32 - 1, GROUND, wall));
        let half = std::f64::consts::FRAC_PI_2 / (n + 1) as f64;
        let omega = 2.0 * (k / MASS).sqrt() * half.sin();
        let until = 0.4;
        let error = |h: f64| {
            let s = run(&input, h, until);
            let off = |i: usize| {
                s.state.position[i].x - rest(i) - small * shape(i) * (omega * until).cos()
            };
            (0..n).map(|i| off(i).abs()).fold(0.0, f64::max)
        };
        let errors = [error(2e-3), error(1e-3)];
        let found = order(errors);
        assert!((1.85..2.15).contains(&found), "{n}: {found} {errors:?}");
    }
}

/// A stiff damper in one step: `f` is implicit, so nothing overshoots however large `c h/m` is.
#[test]
fn a_stiff_damper_stops_without_overshoot() {
    let mut input = balls(&[[1.0, 0.0, 0.0]], &[]);
    input.velocity = vec![[1.0, 0.0, 0.0]];
    input.loads = vec![Arc::new(Spring {
        a: 0,
        b: GROUND,
        arm_a: DVec3::ZERO,
        arm_b: DVec3::ZERO,
        stiffness: 0.0,
        damping: 1e5 * MASS,
        rest_length: 1.0,
    })];
    let s = run(&input, 1e-3, 0.2);
    assert!(
        s.state.velocity[0].length() < 1e-6,
        "{:?}",
        s.state.velocity[0]
    );
    assert_eq!(s.monitors.unconverged, 0);
}

/// Prescribed motion: position and velocity follow the law exactly at every step, and the work is that of the accelerations.
#[test]
fn a_driven_ball_follows_its_law() {
    let mut input = balls(&[[0.0, 0.0, 0.0]], &[]);
    let law = Scalar::Polynomial(vec![0.0, 0.0, 0.5, -0.2]);
    let drive = row(
        RowKind::Point,
        DVec3::X,
        DVec3::ZERO,
        DVec3::ZERO,
        law.clone(),
    );
    let turn = row(
        RowKind::Rotation,
        DVec3::Z,
        DVec3::ZERO,
        DVec3::ZERO,
        law.clone(),
    );
    input.joints = vec![joint(0, GROUND, vec![drive, turn])];
    let until = 0.7;
    let s = run(&input, 1e-3, until);
    assert!((s.state.position[0].x - law.value(until)).abs() < 1e-12);
    assert!((s.state.velocity[0].x - law.slope(until)).abs() < 1e-9);
    let (_, turned) = s.state.orientation[0].to_axis_angle();
    assert!((turned - law.value(until)).abs() < 1e-9, "{turned}");
    let kinetic = 0.5 * MASS * law.slope(until).powi(2) * (1.0 + 0.4 * R * R);
    assert!((s.monitors.energy_work - kinetic).abs() < 1e-5 * kinetic);
    assert!(
        s.monitors.energy_max_rise < 1e-8 * kinetic.max(1.0),
        "{:e}",
        s.monitors.energy_max_rise
    );
}

/// Eq. 16 with joints: a ball hits one that is pinned at its centre, so that it meets an infinite mass; and one that may only
/// slide across the line of impact.
#[test]
fn impacts_on_held_balls_follow_newtons_law() {
    for (e, guided) in [(1.0, false), (0.6, false), (0.6, true)] {
        let mut input = balls(&[[0.0; 3], [2.5 * R, 0.0, 0.0]], &[]);
        input.laws = vec![(0, 0, [0.0, e, 0.0, 0.0, 0.0])];
        input.velocity[0] = [1.0, 0.0, 0.0];
        let held = DVec3::new(2.5 * R, 0.0, 0.0);
        let axes: &[DVec3] = if guided { &[DVec3::X] } else { &DVec3::AXES };
        let point = |d: &DVec3| row(RowKind::Point, *d, DVec3::ZERO, held, Scalar::zero());
        input.joints = vec![joint(1, GROUND, axes.iter().map(point).collect())];
        let s = run(&input, 1e-3, 0.05);
        assert!(
            (s.state.velocity[0].x + e).abs() < 1e-9,
            "{:?}",
            s.state.velocity
        );
        assert!(s.state.velocity[1].length() < 1e-9);
        assert!((s.state.position[1] - held).length() < 1e-12);
        assert_eq!(s.monitors.unconverged + s.monitors.fallbacks, 0);
    }
}

/// A dumbbell (two balls on a massless rod) dropped on the floor with one end: exact result of the joint impact problem.
#[test]
fn a_dumbbell_takes_the_impact_through_its_rod() {
    let l = 6.0 * R;
    let (x0, dip) = (DVec3::new(0.0, 0.0, 1.2 * R), 0.3f64);
    let x1 = x0 + l * DVec3::new(dip.cos(), 0.0, dip.sin());
    let mut input = balls(
        &[x0.to_array(), x1.to_array()],
        &[([0.0; 3], [0.0, 0.0, 1.0])],
    );
    input.laws = vec![(0, 1, [0.0, 0.5, 0.0, 0.0, 0.0]), (0, 0, [0.0; 5])];
    input.velocity = vec![[0.0, 0.0, -1.0]; 2];
    let law = Scalar::Constant(l);
    let rod = row(RowKind::Distance, DVec3::X, DVec3::ZERO, DVec3::ZERO, law);
    input.joints = vec![joint(0, 1, vec![rod])];
    let s = run(&input, 1e-6, 0.2 * R + 1e-6);
    // Along the rod d: impulse P at ball 0 upwards, reaction Q on both: v0 = (-1 + P/m) z - Q d/m, v1 = -z + Q d/m; (v1 - v0).d = 0,
    // v0.z = 0.5.
    let d = (x1 - x0).normalize();
    let p = MASS * 1.5 / (1.0 - 0.5 * d.z * d.z);
    let q = 0.5 * p * d.z;
    let v0 = DVec3::Z * (p / MASS - 1.0) - d * (q / MASS);
    let v1 = -DVec3::Z + d * (q / MASS);
    assert!(
        (s.state.velocity[0] - v0).length() < 2e-5,
        "{:?} {v0}",
        s.state.velocity
    );
    assert!(
        (s.state.velocity[1] - v1).length() < 2e-5,
        "{:?} {v1}",
        s.state.velocity
    );
    assert_eq!(s.monitors.unconverged, 0);
}

/// A torque that grows with time turns a free ball as its integral says, with second order.
#[test]
fn a_torque_law_turns_a_ball() {
    let mut input = balls(&[[0.0; 3]], &[]);
    let zero = || [Scalar::zero(), Scalar::zero(), Scalar::zero()];
    let law = Scalar::Polynomial(vec![0.0, 2e-3]);
    input.loads = vec![Arc::new(Applied {
        body: 0,
        arm: DVec3::ZERO,
        force: zero(),
        torque: [Scalar::zero(), law, Scalar::zero()],
    })];
    let inertia = 0.4 * MASS * R * R;
    let error = |h: f64| {
        let s = run(&input, h, 0.5);
        (s.state.angular_velocity[0].y - 1e-3 * 0.25 / inertia).abs()
    };
    let errors = [error(1e-2), error(5e-3)];
    assert!(order(errors) > 1.9 || errors[0] < 1e-12, "{errors:?}");
}

/// Redundant joints (a ball pinned twice) stay solvable: rule R10.
#[test]
fn a_joint_given_twice_changes_nothing() {
    let x = DVec3::new(0.3, 0.0, 0.0);
    let mut input = balls(&[x.to_array()], &[]);
    input.gravity = [0.0, 0.0, -G];
    input.joints = vec![pin(0, GROUND, -x, DVec3::ZERO)];
    let once = run(&input, 1e-3, 0.5);
    input.joints.push(pin(0, GROUND, -x, DVec3::ZERO));
    let twice = run(&input, 1e-3, 0.5);
    let difference = (once.state.position[0] - twice.state.position[0]).length();
    assert!(difference < 1e-9, "{difference:e}");
}

/// Where nothing moves and nothing pulls, rounding speeds are no reason to fail.
#[test]
fn a_held_ball_without_gravity_stays() {
    for v in [0.0, 1e-16] {
        let mut input = balls(&[[0.3, 0.1, -0.2]], &[]);
        input.velocity = vec![[v, 0.0, 0.0]];
        input.angular_velocity = vec![[0.0, 0.0, 30.0]];
        let held = DVec3::new(0.3, 0.1, -0.2);
        input.joints = vec![pin(0, GROUND, DVec3::ZERO, held)];
        let s = run(&input, 1e-3, 0.05);
        assert!((s.state.position[0] - held).length() < 1e-15);
        assert_eq!(s.monitors.halvings, 0);
    }
}

/// Recorded impulses are those that the scheme applied: momentum balances to rounding at any step.
#[test]
fn impulses_of_joints_balance_momentum() {
    let x = DVec3::new(0.3, 0.0, 0.0);
    let mut input = balls(&[x.to_array()], &[]);
    input.gravity = [0.0, 0.0, -G];
    input.joints = vec![pin(0, GROUND, -x, DVec3::ZERO)];
    let (h, until) = (4e-3, 0.8);
    let s = run(&input, h, until);
    let given = s.recorder.open_joints[0][0];
    let change = MASS * s.state.velocity[0] + DVec3::Z * MASS * G * until;
    assert!((given - change).length() < 1e-11, "{given} {change}");
}

/// Spheres that nothing joins are problems of their own: the forces on a heavy one are no measure for those on a light one.
#[test]
fn a_heavy_sphere_elsewhere_changes_nothing() {
    let light = |heavy: f64| {
        let mut input = balls(&[[0.0, 0.0, -1.0], [0.0, 50.0, 0.0]], &[]);
        input.velocity[0] = [2.0, 0.3, 0.0];
        input.mass = vec![1e-3, heavy];
        input.inertia = input.mass.iter().map(|m| 0.4 * m * R * R).collect();
        input.loads = vec![Arc::new(Spring {
            a: 0,
            b: GROUND,
            arm_a: DVec3::ZERO,
            arm_b: DVec3::ZERO,
            stiffness: 5.0,
            damping: 0.0,
            rest_length: 0.9,
        })];
        run(&input, 1e-3, 0.5).state.position[0]
    };
    let difference = (light(1e-3) - light(1e9)).length();
    assert!(difference < 1e-12, "{difference:e}");
}

/// A prescribed motion that has come to an end leaves speeds that are rounding: one iteration is enough for them.
#[test]
fn a_motion_that_ends_costs_no_iterations() {
    let mut input = balls(&[[0.0; 3]], &[]);
    input.gravity = [0.0; 3];
    let ramp = Scalar::Table(vec![[0.0, 0.0], [0.1, 0.0], [0.2, 0.05]]);
    let point = |d, law| row(RowKind::Point, d, DVec3::ZERO, DVec3::ZERO, law);
    input.joints = vec![joint(0, GROUND, vec![point(DVec3::X, ramp)])];
    let s = run(&input, 1e-3, 0.5);
    assert!((s.state.position[0] - DVec3::new(0.05, 0.0, 0.0)).length() < 1e-12);
    assert!(s.monitors.smooth.max <= 2, "{}", s.monitors.smooth.max);
}

/// A law that leaves its domain ends the run with its name, whatever the method; it is not passed over.
#[test]
fn a_law_that_is_no_number_ends_the_run() {
    let root = Scalar::Expression(Expression::parse("sqrt(0.05-t)").expect("an expression"));
    let outcome = |joint_law: bool, method: Method| {
        let mut input = balls(&[[0.0; 3]], &[]);
        if joint_law {
            let point = row(
                RowKind::Point,
                DVec3::X,
                DVec3::ZERO,
                DVec3::ZERO,
                root.clone(),
            );
            input.joints = vec![joint(0, GROUND, vec![point])];
        } else {
            let force = [root.clone(), Scalar::zero(), Scalar::zero()];
            input.loads = vec![Arc::new(Applied {
                body: 0,
                arm: DVec3::ZERO,
                force,
                torque: [Scalar::zero(), Scalar::zero(), Scalar::zero()],
            })];
        }
        let options = Options {
            step: 1e-3,
            method,
            ..Options::default()
        };
        let (model, initial) = Model::new(&input, options).expect("a model");
        let recording = Recording {
            frame_every: 0,
            contacts: false,
        };
        let mut s = carom_penalty::simulation(model, initial).expect("no joints with penalty");
        s.advance(100, recording, Duration::MAX)
    };
    for method in [Method::Nsga, Method::MoreauJean, Method::Penalty] {
        for joint_law in [false, true] {
            if joint_law && method == Method::Penalty {
                continue;
            }
            let outcome = outcome(joint_law, method).expect("the law has no number");
            assert_eq!(outcome.failure, Failure::Load, "{method:?} {joint_law}");
            let (time, message) = (outcome.time, outcome.message.unwrap_or_default());
            assert!((time - 0.051).abs() < 1.5e-3, "{time}");
            assert!(message.contains("t = 0.05"), "{message}");
        }
    }
}

/// The start of a run is a place like any other: a law that has no number there is refused.
#[test]
fn a_law_that_is_no_number_at_the_start_is_refused() {
    for text in ["1/t", "ln(t)"] {
        let law = || Scalar::Expression(Expression::parse(text).expect("an expression"));
        let mut held = balls(&[[0.0; 3]], &[]);
        let point = row(RowKind::Point, DVec3::X, DVec3::ZERO, DVec3::ZERO, law());
        held.joints = vec![joint(0, GROUND, vec![point])];
        let mut pushed = balls(&[[0.0; 3]], &[]);
        pushed.loads = vec![Arc::new(Applied {
            body: 0,
            arm: DVec3::ZERO,
            force: [law(), Scalar::zero(), Scalar::zero()],
            torque: [Scalar::zero(), Scalar::zero(), Scalar::zero()],
        })];
        for input in [held, pushed] {
            let Err(refused) = Model::new(&input, Options::default()) else {
                panic!("{text} is taken");
            };
            assert!(refused.to_string().contains("at t = 0"), "{refused}");
        }
    }
}
