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
