//! The smooth sub-problem with a load of the user: its order, and rest under weight.

use carom_core::force::{Dependence, Load, LoadError, Motion};
use carom_core::{Model, ModelInput, Options, Recording, Simulation};
use glam::DVec3;
use std::sync::Arc;
use std::time::Duration;

/// A spring to the origin with a dashpot: f = -k x - c v.
#[derive(Debug)]
struct Anchor {
    k: f64,
    c: f64,
}

/// Without tangents, as a function of the user comes.
impl Load for Anchor {
    fn dependence(&self) -> Dependence {
        Dependence::Opaque
    }
    fn bodies(&self) -> [Option<u32>; 2] {
        [None; 2]
    }
    fn check(&self) -> Result<(), (&'static str, String)> {
        Ok(())
    }
    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        for (i, w) in wrench.iter_mut().enumerate() {
            w[0] -= self.k * at.position[i] + self.c * at.velocity[i];
        }
        Ok(())
    }
    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let v = at.velocity[0];
        Ok(-(self.k * at.position[0] + self.c * v).dot(v))
    }
}

/// Position error at t = 1 s of a damped oscillator of mass 1 that starts at x = 1 at rest.
fn error(h: f64) -> f64 {
    let (k, c) = (25.0, 0.6);
    let input = ModelInput {
        radius: vec![0.1],
        mass: vec![1.0],
        inertia: vec![0.004],
        material: vec![0],
        position: vec![[1.0, 0.0, 0.0]],
        orientation: vec![[1.0, 0.0, 0.0, 0.0]],
        velocity: vec![[0.0; 3]],
        angular_velocity: vec![[0.0; 3]],
        loads: vec![Arc::new(Anchor { k, c })],
        ..ModelInput::default()
    };
    let options = Options {
        step: h,
        ..Options::default()
    };
    let (model, initial) = Model::new(&input, options).expect("valid");
    let mut s = Simulation::new(model, initial);
    let steps = (1.0 / h).round() as u64;
    let outcome = s.advance(
        steps,
        Recording {
            frame_every: 0,
            contacts: false,
        },
        Duration::MAX,
    );
    assert!(outcome.is_none());
    assert!(s.monitors.smooth.max > 1);
    let decay = 0.5 * c;
    let omega = (k - decay * decay).sqrt();
    let exact = (-decay).exp() * (omega.cos() + decay / omega * omega.sin());
    (s.state.position[0].x - exact).abs()
}

/// A load of the user that holds the weight leaves no force: the weight is the measure of what is left, not its difference.
#[test]
fn a_ball_at_rest_on_an_opaque_spring_needs_no_halving() {
    let input = ModelInput {
        radius: vec![0.1],
        mass: vec![1.0],
        inertia: vec![0.004],
        material: vec![0],
        gravity: [0.0, 0.0, -9.8],
        position: vec![[0.3, 0.1, 0.0]],
        orientation: vec![[1.0, 0.0, 0.0, 0.0]],
        velocity: vec![[0.0; 3]],
        angular_velocity: vec![[0.0; 3]],
        loads: vec![Arc::new(Anchor { k: 100.0, c: 20.0 })],
        ..ModelInput::default()
    };
    let options = Options {
        step: 1e-3,
        ..Options::default()
    };
    let (model, initial) = Model::new(&input, options).expect("valid");
    let mut s = Simulation::new(model, initial);
    let recording = Recording {
        frame_every: 0,
        contacts: false,
    };
    assert!(s.advance(8000, recording, Duration::MAX).is_none());
    assert!((s.state.position[0] - DVec3::new(0.0, 0.0, -0.098)).length() < 1e-12);
    assert_eq!(s.monitors.halvings, 0);
}

/// Loads that depend on q and v are integrated with second order (smooth motion).
#[test]
fn a_damped_spring_converges_with_second_order() {
    let (coarse, fine) = (error(1e-2), error(5e-3));
    let order = (coarse / fine).log2();
    assert!(
        (1.9..2.1).contains(&order),
        "order {order}, errors {coarse:e} {fine:e}"
    );
}
