//! Smooth sub-problem (eqs. 1a-b; Algorithm 1, lines 5-20): the motion without contacts.
//!
//! Residuals `M v-dot-check - f(q-check, v-check, t_{n+1}) - G^T lambda` and `G v-check - c'`. Weight alone is constant: one
//! iteration, in closed form. Joints and other loads go to Newton's method (`smooth_newton.rs`).

use super::smooth_newton::{place, Weights};
use crate::clump;
use crate::force::evaluated;
use crate::force::total::{displaced_ahead, own_force};
use crate::outcome::{BlowUp, Failure, Level};
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::generalized_alpha::Prediction;
use crate::stepper::method::Step;
use carom_solve::team;

/// Largest residual over its terms (1) with which the smooth sub-problem counts as solved; `tolerance` may ask for less. Too large: what it
/// leaves is an error of the loads, and joints drift by it. Too small costs nothing: what rounding leaves counts as solved.
const TOLERANCE: f64 = 1e-10;

/// Predicts every sphere and solves for the smooth accelerations and reactions of joints.
pub fn solve(on: &mut Step) -> Result<(), Failure> {
    predict(on);
    on.report.iterations_smooth = 1;
    if !on.model.clumps.is_empty() {
        clump::predict(on)?;
    }
    if !on.model.is_free() {
        iterate(on)?;
    }
    if !on.model.flow.is_none() {
        hold_absent(on.state, on.scratch);
    }
    Ok(())
}

/// The motion under the weight, and of free walls under their forces, alone.
fn predict(on: &mut Step) {
    let (model, state, coefficients, end) = (on.model, &*on.state, on.coefficients, on.span.end);
    let displaced = displaced_ahead(model, state, on.span.h);
    let scratch = &mut *on.scratch;
    let per_velocity = 1.0 / coefficients.acceleration_per_velocity();
    let (threads, n) = (model.options.threads as usize, model.bodies());
    let out = (
        &mut scratch.linear[..n],
        &mut scratch.angular[..n],
        &mut scratch.position[..n],
    );
    let each = |first: usize, (linear, angular, position): (&mut [_], &mut [_], &mut [_])| {
        for (k, i) in (first..first + linear.len()).enumerate() {
            let ([a, alpha], [acc, ang]) = (state.pseudo[i], state.acceleration[i]);
            let mut p = coefficients.predict(state.velocity[i], a, acc);
            let f = own_force(model, &displaced, i, end);
            coefficients.correct(&mut p, per_velocity * model.inv_mass[i] * f);
            position[k] = state.position[i] + p.displacement;
            linear[k] = p;
            angular[k] = coefficients.predict(state.angular_velocity[i], alpha, ang);
        }
    };
    team::reduce(threads, n, out, each, |(), ()| ());
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
fn iterate(on: &mut Step) -> Result<(), Failure> {
    let (model, coefficients) = (on.model, on.coefficients);
    let weights = Weights {
        acceleration: coefficients.acceleration_per_velocity(),
        displacement: coefficients.displacement_per_velocity(),
        velocity: 1.0,
        time: on.span.end,
    };
    let tolerance = model.options.tolerance.min(TOLERANCE);
    let displaced = displaced_ahead(model, on.state, on.span.h);
    let begun = on.scratch.smooth.begin(model, displaced, weights.time);
    evaluated(begun, &mut on.scratch.load_error)?;
    let mut least = false;
    for iteration in 0..=model.options.max_iterations {
        let (scratch, report) = (&mut *on.scratch, &mut *on.report);
        let (linear, angular) = (&mut scratch.linear, &mut scratch.angular);
        let (smooth, trial) = (&mut scratch.smooth, &mut scratch.trial);
        place(on.state, linear, angular, trial);
        let acceleration = |i: usize| [linear[i].acceleration, angular[i].acceleration];
        let present = &on.state.present;
        let found = smooth.evaluate(model, (trial, present), acceleration, &weights);
        let relative = evaluated(found, &mut scratch.load_error)?;
        scratch.history[0].values.push(relative);
        report.residual_smooth = relative;
        if relative <= tolerance {
            scratch.position.copy_from_slice(&trial.position);
            if !smooth.least_reactions(model, least) || least {
                return Ok(());
            }
            // The motion is known to the rounding of the reactions that it was found with: once more, with the least.
            least = true;
        }
        if !relative.is_finite() || iteration == model.options.max_iterations {
            break;
        }
        let clumps = &mut scratch.clumps;
        let solved = smooth.correct(model, trial, weights, |i, [dv, dw]| {
            coefficients.correct(&mut linear[i], dv);
            clumps.correct(model, (i, &mut angular[i]), coefficients, dw);
        });
        if !solved {
            break;
        }
        report.iterations_smooth = report.iterations_smooth.max(iteration + 1);
        clump::turn_by_moments(on)?;
    }
    if !on.report.residual_smooth.is_finite() {
        let body = on.scratch.smooth.worst(model).0;
        return Err(Failure::BlowUp(BlowUp::alone(Level::Smooth, body)));
    }
    Err(Failure::NotConverged(Level::Smooth))
}
