//! Shots whose outcome is known in closed form.

use crate::common::{balls, on_floor, G, MASS, R};
use crate::{near, run};
use carom_core::ModelInput;
use glam::DVec3;

const MU: f64 = 0.2;

/// Slides of all kinds end in `v - (v + r n x w)/(1 + 1/kappa)`: with kappa = 2/5 two sevenths of the slip go, from follow and draw, side and masse.
#[test]
fn a_slide_ends_in_a_roll() {
    let (v, n) = (DVec3::new(2.0, -0.5, 0.0), DVec3::Z);
    for w in [
        [0.0; 3],
        [0.0, 150.0, 0.0],
        [0.0, -180.0, 30.0],
        [90.0, -40.0, -20.0],
    ] {
        let mut input = on_floor([MU, 0.5, 0.0, 0.0, 0.0]);
        input.velocity[0] = v.to_array();
        input.angular_velocity[0] = w;
        let w = DVec3::from(w);
        let slip = v + R * n.cross(w);
        let ends = slip.length() / (3.5 * MU * G);
        let rolls = v - slip * (2.0 / 7.0);
        let there = DVec3::new(0.0, 0.0, R) + ends * 0.5 * (v + rolls);
        for (until, reports) in [(3.0, 1), (3.0, 700)] {
            let s = run(&input, until, reports);
            let state = &s.state;
            near(state.velocity[0], rolls, 2e-15 + 1e-16 * reports as f64);
            near(
                state.position[0],
                there + (until - ends) * rolls,
                4e-15 * reports as f64,
            );
            near(
                state.angular_velocity[0],
                n.cross(rolls) / R + n * w.z,
                1e-12,
            );
        }
    }
}

/// Rolling resistance takes `rho g/(r (1 + kappa))`, spinning resistance `delta g/(kappa r^2)`, until nothing moves.
#[test]
fn a_roll_ends_at_rest() {
    let (rho, delta, v) = (1e-3, 2e-4, 0.7);
    let mut input = on_floor([MU, 0.5, 0.0, rho, delta]);
    input.velocity[0] = [v, 0.0, 0.0];
    input.angular_velocity[0] = [0.0, v / R, 40.0];
    let slows = rho * G / (R * 1.4);
    let s = run(&input, 30.0, 3);
    near(
        s.state.position[0],
        DVec3::new(v * v / (2.0 * slows), 0.0, R),
        1e-13,
    );
    assert_eq!(s.state.velocity[0], DVec3::ZERO);
    assert_eq!(s.state.angular_velocity[0], DVec3::ZERO);
    let spins = 40.0 / (delta * G / (0.4 * R * R));
    let before = run(&input, 0.5 * spins, 1);
    near(
        before.state.angular_velocity[0] * DVec3::Z,
        DVec3::Z * 20.0,
        1e-12,
    );
}

/// A slide with rolling resistance in one line: its slip ends at `u/(mu g (1 + 1/kappa) -+ rho g/(r kappa))`.
#[test]
fn a_slide_with_resistance() {
    let (rho, v) = (1e-3, 2.0);
    let mut input = on_floor([MU, 0.5, 0.0, rho, 0.0]);
    input.velocity[0] = [v, 0.0, 0.0];
    let rate = 3.5 * MU * G - 2.5 * rho * G / R;
    let ends = v / rate;
    let s = run(&input, ends, 1);
    near(s.state.velocity[0], DVec3::X * (v - MU * G * ends), 1e-13);
    // Backspin: the resistance helps friction until it turns no more.
    let back = 30.0;
    input.angular_velocity[0] = [0.0, -back, 0.0];
    let stops = back * R / (2.5 * MU * G + 2.5 * rho * G / R);
    let slip = v + R * back - stops * (3.5 * MU * G + 2.5 * rho * G / R);
    let ends = stops + slip / rate;
    let s = run(&input, ends, 1);
    near(s.state.velocity[0], DVec3::X * (v - MU * G * ends), 1e-13);
    near(
        s.state.angular_velocity[0],
        DVec3::Y * ((v - MU * G * ends) / R),
        1e-11,
    );
}

/// A ball that bounces ever lower has come to rest after `(v/g)(1 + e)/(1 - e)`, and goes on rolling.
#[test]
fn bounces_end_in_contact() {
    let (e, height): (f64, f64) = (0.6, 0.3);
    let mut input = on_floor([0.0, e, 0.0, 0.0, 0.0]);
    input.position[0][2] = R + height;
    input.velocity[0] = [0.25, 0.0, 0.0];
    let first = (2.0 * height / G).sqrt();
    let rests = first * (1.0 + 2.0 * e / (1.0 - e));
    let mut s = run(&input, rests + 1e-8, 1);
    near(
        s.state.position[0],
        DVec3::new(0.25 * (rests + 1e-8), 0.0, R),
        1e-14,
    );
    assert_eq!(s.state.velocity[0], DVec3::X * 0.25);
    let times: Vec<f64> = s.take_block().impacts.iter().map(|i| i.time).collect();
    // Impact k at first (1 + 2 (e + ... + e^k)); the last flight is below a nanosecond.
    for (k, time) in times.iter().enumerate() {
        let exact = first * (1.0 + 2.0 * e * (1.0 - e.powi(k as i32)) / (1.0 - e));
        assert!((time - exact).abs() < 1e-14, "{k}: {time} {exact}");
    }
    let last = first * 2.0 * e.powi(times.len() as i32);
    assert!(last < 1e-9 && last > e * 1e-9, "{last:e}");
}

/// Newton's cradle: the law of the sequence passes the blow on through balls that touch.
#[test]
fn a_cradle() {
    let mut input = ModelInput {
        laws: vec![(0, 0, [0.0, 1.0, 0.0, 0.0, 0.0])],
        ..balls(&[0.0, 3.0, 5.0, 7.0, 9.0].map(|x| [x * R, 0.0, 0.0]), &[])
    };
    input.velocity[0] = [1.5, 0.0, 0.0];
    let s = run(&input, 0.5, 1);
    let hit = R / 1.5;
    for i in 0..4 {
        near(s.state.velocity[i], DVec3::ZERO, 1e-14);
    }
    near(s.state.velocity[4], DVec3::X * 1.5, 1e-14);
    near(
        s.state.position[4],
        DVec3::X * (9.0 * R + 1.5 * (0.5 - hit)),
        1e-14,
    );
}

/// A cut without friction: the object ball leaves along the line of centres, the other at a right angle; thirty degrees of a half-ball hit when it rolls.
#[test]
fn a_cut_ball() {
    let offset = R; // half-ball: sin(cut) = 1/2
    let mut input = ModelInput {
        gravity: [0.0, 0.0, -G],
        laws: vec![
            (0, 0, [0.0, 1.0, 0.0, 0.0, 0.0]),
            (0, 1, [MU, 0.5, 0.0, 0.0, 0.0]),
        ],
        ..balls(
            &[[-10.0 * R, offset, R], [0.0, 0.0, R]],
            &[([0.0; 3], [0.0, 0.0, 1.0])],
        )
    };
    let v = 1.2;
    input.velocity[0] = [v, 0.0, 0.0];
    input.angular_velocity[0] = [0.0, v / R, 0.0];
    let s = run(&input, 4.0, 1);
    // Along the normal, (cos 30, -sin 30), all speed goes over; the roll is kept, and friction ends the slides.
    let (sin, cos) = (0.5, 0.75f64.sqrt());
    let normal = DVec3::new(cos, -sin, 0.0);
    let object = v * cos * normal * (5.0 / 7.0);
    let left = DVec3::X * v - v * cos * normal;
    let cue = left * (5.0 / 7.0) + DVec3::X * v * (2.0 / 7.0);
    near(s.state.velocity[1], object, 1e-12);
    near(s.state.velocity[0], cue, 1e-12);
    let angle = cue.y.atan2(cue.x).to_degrees();
    assert!((angle - 33.67).abs() < 0.01, "{angle}");
    let energy = 0.5 * MASS * (1.0 + 0.4) * (object.length_squared() + cue.length_squared());
    let mut s = s;
    let found = s.take_block().steps[0].energy_kinetic;
    assert!((found - energy).abs() < 1e-12);
}

/// A slide out of line with rolling resistance turns: against Runge-Kutta's method in steps of a five-hundredth of what is left of it.
#[test]
fn a_slide_that_turns() {
    let (rho, delta) = (2e-3, 3e-4);
    let mut input = on_floor([MU, 0.5, 0.0, rho, delta]);
    input.velocity[0] = [1.5, 0.2, 0.0];
    input.angular_velocity[0] = [60.0, -35.0, 25.0];
    let n = DVec3::Z;
    let (a, b, c) = (MU * G, rho * G / (0.4 * R), MU * G / 0.4);
    // Of v and q.
    let rate = |[v, q]: [DVec3; 2]| {
        let u = (v + q).normalize();
        [-a * u, -c * u - b * q.normalize()]
    };
    let ahead = |s: [DVec3; 2], d: [DVec3; 2], h: f64| [s[0] + h * d[0], s[1] + h * d[1]];
    let mut state = [
        DVec3::from(input.velocity[0]),
        R * n.cross(DVec3::from(input.angular_velocity[0])),
    ];
    let (mut x, mut t) = (DVec3::new(0.0, 0.0, R), 0.0);
    while (state[0] + state[1]).length() > 1e-11 {
        let h = 2e-3 * (state[0] + state[1]).length() / (a + c);
        let k1 = rate(state);
        let k2 = rate(ahead(state, k1, 0.5 * h));
        let k3 = rate(ahead(state, k2, 0.5 * h));
        let k4 = rate(ahead(state, k3, h));
        x += h * state[0] + h * h / 6.0 * (k1[0] + k2[0] + k3[0]);
        for k in 0..2 {
            state[k] += h / 6.0 * (k1[k] + 2.0 * (k2[k] + k3[k]) + k4[k]);
        }
        t += h;
    }
    for reports in [1, 37] {
        let mut s = run(&input, t, reports);
        near(s.state.position[0], x, 1e-12);
        near(s.state.velocity[0], state[0], 1e-11);
        let w = s.state.angular_velocity[0];
        near(R * n.cross(w), state[1], 1e-11);
        assert!((w.z - (25.0 - delta * G / (0.4 * R * R) * t)).abs() < 1e-12);
        // It has turned, and nothing was gained.
        assert!(
            state[0]
                .normalize()
                .dot(DVec3::from(input.velocity[0]).normalize())
                < 0.9999
        );
        let energies = s.take_block().steps;
        assert!(energies
            .windows(2)
            .all(|e| e[1].energy_kinetic < e[0].energy_kinetic));
    }
}
