//! Smooth sub-problem (eqs. 1a-b; Algorithm 1, lines 5-20): the motion without contacts.
//!
//! Residual `r = M v-dot-check - f(q-check, v-check, t_{n+1})`. Weight alone is constant: one iteration. Other loads are
//! iterated with the mass part of the tangent (eq. 11 without C_t and K_t), which contracts by the share of the load's
//! own time scale in the step, of the order of `h^2 k/m` for a spring.

use crate::force::{self, Motion};
use crate::model::Model;
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::Coefficients;
use glam::DVec3;

/// Predicts every sphere and solves for the smooth accelerations; false: not converged.
pub fn solve(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
    time: f64,
    report: &mut StepReport,
) -> bool {
    let per_velocity = 1.0 / coefficients.acceleration_per_velocity();
    for i in 0..model.spheres() {
        let ([a, alpha], [acc, ang]) = (state.pseudo[i], state.acceleration[i]);
        let mut linear = coefficients.predict(state.velocity[i], a, acc);
        let angular = coefficients.predict(state.angular_velocity[i], alpha, ang);
        let f = force::weight(model, i);
        coefficients.correct(&mut linear, per_velocity * model.inv_mass[i] * f);
        scratch.position[i] = state.position[i] + linear.displacement;
        scratch.linear[i] = linear;
        scratch.angular[i] = angular;
    }
    report.iterations_smooth = 1;
    model.loads.is_empty() || iterate(model, state, scratch, coefficients, time, report)
}

/// Iterates on loads beyond the weight, from the motion under the weight.
fn iterate(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
    time: f64,
    report: &mut StepReport,
) -> bool {
    let n = model.spheres();
    let per_velocity = 1.0 / coefficients.acceleration_per_velocity();
    let mut wrench = vec![[DVec3::ZERO; 2]; n];
    for _ in 0..model.options.max_iterations {
        let velocity: Vec<DVec3> = scratch.linear.iter().map(|p| p.velocity).collect();
        let angular_velocity: Vec<DVec3> = scratch.angular.iter().map(|p| p.velocity).collect();
        let at = Motion {
            time: time + coefficients.h,
            position: &scratch.position,
            velocity: &velocity,
            angular_velocity: &angular_velocity,
        };
        for (i, w) in wrench.iter_mut().enumerate() {
            *w = [force::weight(model, i), DVec3::ZERO];
        }
        model
            .loads
            .iter()
            .for_each(|load| load.add(&at, &mut wrench));
        let (mut residual, mut terms) = (0.0f64, 0.0f64);
        for i in 0..n {
            let inertia = model.mass[i] * scratch.linear[i].acceleration;
            let turn = model.inertia[i] * scratch.angular[i].acceleration;
            let r = [wrench[i][0] - inertia, wrench[i][1] - turn];
            let arm = 1.0 / model.radius[i];
            residual += r[0].length_squared() + arm * arm * r[1].length_squared();
            terms += wrench[i][0].length_squared() + inertia.length_squared();
            terms += arm * arm * (wrench[i][1].length_squared() + turn.length_squared());
            wrench[i] = r;
        }
        if !residual.is_finite() {
            return false;
        }
        let relative = residual.sqrt() / terms.sqrt().max(f64::MIN_POSITIVE);
        scratch.history[0].values.push(relative);
        report.residual_smooth = relative;
        if relative <= model.options.tolerance.min(1e-10) {
            return true;
        }
        for i in 0..n {
            let [f, moment] = wrench[i];
            coefficients.correct(&mut scratch.linear[i], per_velocity * model.inv_mass[i] * f);
            coefficients.correct(
                &mut scratch.angular[i],
                per_velocity * model.inv_inertia[i] * moment,
            );
            scratch.position[i] = state.position[i] + scratch.linear[i].displacement;
        }
        report.iterations_smooth += 1;
    }
    false
}

#[cfg(test)]
mod tests {
    use crate::force::{Load, Motion};
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

    impl Load for Anchor {
        fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) {
            for (i, w) in wrench.iter_mut().enumerate() {
                w[0] -= self.k * at.position[i] + self.c * at.velocity[i];
            }
        }
        fn potential(&self, position: &[DVec3]) -> f64 {
            position
                .iter()
                .map(|x| 0.5 * self.k * x.length_squared())
                .sum()
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
            ..ModelInput::default()
        };
        let options = Options {
            step: h,
            ..Options::default()
        };
        let (mut model, initial) = Model::new(&input, options).expect("valid");
        model.loads.push(Arc::new(Anchor { k, c }));
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
