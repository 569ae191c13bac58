//! Smooth sub-problem (eqs. 1a-b; Algorithm 1, lines 5-20): the motion without contacts.
//!
//! Residuals `M v-dot-check - f(q-check, v-check, t_{n+1}) - G^T lambda` and `G v-check - c'`. Weight alone is constant: one
//! iteration, in closed form. Joints and other loads go to Newton's method (`smooth_newton.rs`).

use super::smooth_newton::{place, Weights};
use crate::force::total::weight;
use crate::force::LoadError;
use crate::model::Model;
use crate::outcome::{BlowUp, Failure, Level};
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::generalized_alpha::Prediction;
use crate::stepper::Coefficients;
use carom_solve::team;

pub use super::smooth_newton::SmoothScratch;

/// Largest residual over its terms (1) with which the smooth sub-problem counts as solved; `tolerance` may ask for less. Too large: what it
/// leaves is an error of the loads, and joints drift by it. Too small costs nothing: what rounding leaves counts as solved.
const TOLERANCE: f64 = 1e-10;

/// Predicts every sphere and solves for the smooth accelerations and reactions of joints.
pub fn solve(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
    time: f64,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let per_velocity = 1.0 / coefficients.acceleration_per_velocity();
    let (threads, n) = (model.options.threads as usize, model.spheres());
    let Scratch {
        linear,
        angular,
        position,
        ..
    } = scratch;
    let out = (&mut linear[..n], &mut angular[..n], &mut position[..n]);
    let predict = |first: usize, (linear, angular, position): (&mut [_], &mut [_], &mut [_])| {
        for (k, i) in (first..first + linear.len()).enumerate() {
            let ([a, alpha], [acc, ang]) = (state.pseudo[i], state.acceleration[i]);
            let mut p = coefficients.predict(state.velocity[i], a, acc);
            let f = weight(model, i);
            coefficients.correct(&mut p, per_velocity * model.inv_mass[i] * f);
            position[k] = state.position[i] + p.displacement;
            linear[k] = p;
            angular[k] = coefficients.predict(state.angular_velocity[i], alpha, ang);
        }
    };
    team::reduce(threads, n, out, predict, |(), ()| ());
    report.iterations_smooth = 1;
    if !model.is_free() {
        iterate(model, state, scratch, coefficients, time, report)?;
    }
    if !model.flow.is_none() {
        hold_absent(state, scratch);
    }
    Ok(())
}

/// Absent spheres stand still, whatever loads on all spheres would do to them.
fn hold_absent(state: &State, scratch: &mut Scratch) {
    for (i, _) in state.present.iter().enumerate().filter(|(_, p)| !**p) {
        scratch.linear[i] = Prediction::default();
        scratch.angular[i] = Prediction::default();
        scratch.position[i] = state.position[i];
    }
}

/// Newton's method from the motion under the weight.
fn iterate(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
    time: f64,
    report: &mut StepReport,
) -> Result<(), Failure> {
    let weights = Weights {
        acceleration: coefficients.acceleration_per_velocity(),
        displacement: coefficients.displacement_per_velocity(),
        velocity: 1.0,
        time: time + coefficients.h,
    };
    let tolerance = model.options.tolerance.min(TOLERANCE);
    let Scratch {
        smooth,
        trial,
        linear,
        angular,
        position,
        history,
        load_error,
        ..
    } = scratch;
    let mut failed = |error: LoadError| {
        *load_error = Some(error);
        Failure::Load
    };
    smooth.begin(model, weights.time).map_err(&mut failed)?;
    for iteration in 0..=model.options.max_iterations {
        place(state, linear, angular, trial);
        let acceleration = |i: usize| [linear[i].acceleration, angular[i].acceleration];
        let relative = smooth
            .evaluate(model, trial, acceleration, &weights)
            .map_err(&mut failed)?;
        history[0].values.push(relative);
        report.residual_smooth = relative;
        if relative <= tolerance {
            for (x, p) in position.iter_mut().zip(&trial.position) {
                *x = *p;
            }
            return Ok(());
        }
        if !relative.is_finite() || iteration == model.options.max_iterations {
            break;
        }
        let solved = smooth.correct(model, trial, weights, |i, [dv, dw]| {
            coefficients.correct(&mut linear[i], dv);
            coefficients.correct(&mut angular[i], dw);
        });
        if !solved {
            break;
        }
        report.iterations_smooth = report.iterations_smooth.max(iteration + 1);
    }
    if !report.residual_smooth.is_finite() {
        let body = smooth.worst(model).0;
        return Err(Failure::BlowUp(BlowUp::alone(Level::Smooth, body)));
    }
    Err(Failure::NotConverged(Level::Smooth))
}

#[cfg(test)]
mod tests {
    use crate::force::{Dependence, Load, LoadError, Motion};
    use crate::{Model, ModelInput, Options, Recording, Simulation};
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
        fn power(&self, at: &Motion) -> f64 {
            let v = at.velocity[0];
            -(self.k * at.position[0] + self.c * v).dot(v)
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
}
