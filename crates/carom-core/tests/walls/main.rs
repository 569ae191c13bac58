//! Walls, fixed and moving, against closed forms.

#[path = "../common/mod.rs"]
mod common;
mod curved;
mod driven;
mod invariance;
mod meshes;
mod records;
mod sheets;

use carom_core::wall::{Shape, WallMotion, WallRotation};
use carom_core::{ModelInput, Options, Recording, Simulation};
use carom_laws::{Expression, Scalar};
use common::{simulation, R};
use glam::DVec3;
use std::time::Duration;

pub fn options(step: f64) -> Options {
    Options {
        step,
        ..Options::default()
    }
}

/// A law of time from a formula.
pub fn law(text: &str) -> Scalar {
    Scalar::Expression(Expression::parse(text).expect("a formula"))
}

pub fn translation(x: Scalar, y: Scalar, z: Scalar) -> WallMotion {
    WallMotion {
        translation: Some([x, y, z]),
        ..WallMotion::default()
    }
}

pub fn rotation(axis: DVec3, point: DVec3, angle: Scalar) -> WallMotion {
    WallMotion {
        rotation: Some(WallRotation { axis, point, angle }),
        ..WallMotion::default()
    }
}

/// Adds a wall of material 1 to a scene; returns its index among the walls.
pub fn add_wall(input: &mut ModelInput, shape: Shape) -> u32 {
    input.walls.push((shape, 1));
    (input.plane_point.len() + input.walls.len() - 1) as u32
}

/// Runs to a time with frames in every step.
pub fn run(input: &ModelInput, o: Options, until: f64) -> Simulation {
    let mut s = simulation(input, o);
    go_on(&mut s, until);
    s
}

pub fn go_on(s: &mut Simulation, until: f64) {
    let steps = (until / s.model.options.step).round() as u64 - s.state.step;
    let recording = Recording {
        frame_every: 1,
        contacts: true,
    };
    let outcome = s.advance(steps, recording, Duration::from_secs(600));
    assert!(outcome.is_none(), "{outcome:?}");
}

pub fn close(a: f64, b: f64, bound: f64) {
    assert!(
        (a - b).abs() <= bound,
        "{a:e} and {b:e} differ by {:e}",
        a - b
    );
}

/// Order of convergence from the errors at a step and at its half.
pub fn order(errors: [f64; 2]) -> f64 {
    (errors[0] / errors[1]).log2()
}

/// `y(t)` of `y'' = f(y)` by Runge-Kutta.
pub fn integrate(start: [f64; 2], until: f64, f: impl Fn(f64) -> f64) -> [f64; 2] {
    let n = 20_000;
    let h = until / f64::from(n);
    let [mut a, mut w] = start;
    for _ in 0..n {
        let (k1, l1) = (w, f(a));
        let (k2, l2) = (w + 0.5 * h * l1, f(a + 0.5 * h * k1));
        let (k3, l3) = (w + 0.5 * h * l2, f(a + 0.5 * h * k2));
        let (k4, l4) = (w + h * l3, f(a + h * k3));
        a += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        w += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
    }
    [a, w]
}

/// Inertia of a homogeneous ball over m r^2.
pub const SHARE: f64 = 0.4;
