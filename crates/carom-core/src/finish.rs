//! The end of a step: line 41 of Algorithm 1, the new state, energies and penetration. Nothing of the state was written before.

use crate::blow_up::{self, Watch};
use crate::clump;
use crate::cohesion;
use crate::contact::Contact;
use crate::deformation;
use crate::force::evaluated;
use crate::force::total::{motion_of, power, wall_work, weight_potential};
use crate::model::Model;
use crate::options::Method;
use crate::outcome::Failure;
use crate::rotation;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::method::Step;
use crate::stepper::{Coefficients, Prediction, Span};
use carom_solve::team;
use glam::{DQuat, DVec3};

/// Of some spheres.
#[derive(Default)]
struct Sums {
    /// J.
    kinetic: f64,
    potential: f64,
    watch: Watch,
}

impl Sums {
    fn join(mut self, other: Sums) -> Sums {
        self.kinetic += other.kinetic;
        self.potential += other.potential;
        self.watch.join(&other.watch);
        self
    }
}

/// Ends a step, or finds that its motion left the numbers.
pub(crate) fn finish(on: &mut Step) -> Result<(), Failure> {
    let (model, span) = (on.model, on.span);
    clump::give_jumps(model, on.scratch);
    let mut sums = end_motion(on);
    let (state, scratch, report) = (&mut *on.state, &mut *on.scratch, &mut *on.report);
    sums.kinetic += clump::kinetic_beyond(model, scratch);
    let mut potential = sums.potential;
    if !(sums.watch.is_calm(span.h) && (sums.kinetic + potential).is_finite()) {
        blow_up::find(model, state, scratch, span.h)?;
    }
    if model.record_walls {
        let (position, contacts) = (&scratch.position, &scratch.contacts);
        let impulses = &mut scratch.wall_impulse;
        report.energy_work = (scratch.walls).collect(model, state, position, contacts, impulses);
    }
    if model.cohesive_reach() > 0.0 {
        report.energy_work += cohesion::of_driven(
            model,
            (state, &scratch.position),
            &scratch.walls,
            &scratch.driven_pulls,
            &mut scratch.wall_impulse,
        );
        scratch.attraction = cohesion::potential(model, state, scratch, &scratch.position)?;
        potential += scratch.attraction;
    }
    if scratch.walls.periodic.deforms {
        report.energy_work += deformation::work(model, &scratch.walls.periodic, &scratch.contacts);
    }
    for (wall, i) in model.free_walls.iter().zip(model.first_wall()..) {
        let way = scratch.position[i] - state.position[i];
        report.energy_work += wall_work(model, wall, state, span, way);
    }
    write(model, state, scratch);
    if !model.is_free() {
        let at = motion_of(state, span.end);
        potential += model.loads.iter().map(|l| l.potential(&at)).sum::<f64>();
        let at_end = evaluated(power(model, &at), &mut scratch.load_error)?;
        let mean = 0.5 * (scratch.power + at_end);
        add_smooth_reactions(model, state, scratch, on.coefficients);
        report.energy_work += span.h * mean + joint_work(model, scratch, span);
    }
    std::mem::swap(&mut state.warm, &mut scratch.warm);
    // Stable, for islands one after the other are few sorted runs.
    state.warm.sort_by_key(|w| w.key);
    state.warm_step = on.coefficients.h;
    report.energy_kinetic = sums.kinetic;
    report.energy_potential = potential;
    type Two = (f64, f64);
    let larger = |a: Two, b: Two| (team::larger(a.0, b.0), team::larger(a.1, b.1));
    let deepest = |_, contacts: &[Contact]| {
        contacts.iter().fold((0.0f64, 0.0f64), |most, c| {
            larger(most, (-c.gap, -c.gap / c.length))
        })
    };
    let (threads, contacts) = (model.options.threads as usize, &scratch.contacts[..]);
    (report.penetration, report.penetration_relative) =
        team::reduce(threads, contacts.len(), contacts, deepest, larger);
    Ok(())
}

/// New velocities into `scratch.jump`, `a_{n+1}` into the predictions.
fn end_motion(on: &mut Step) -> Sums {
    let (model, state, coefficients) = (on.model, &*on.state, on.coefficients);
    let scratch = &mut *on.scratch;
    let (threads, n) = (model.options.threads as usize, model.bodies());
    let whole = (
        &mut scratch.linear[..n],
        &mut scratch.angular[..n],
        &mut scratch.jump[..n],
    );
    type Slices<'a> = (
        &'a mut [Prediction],
        &'a mut [Prediction],
        &'a mut [[DVec3; 2]],
    );
    // Of one length, which is checked here and not for every sphere.
    let (mass, inertia, present) = (&model.mass[..n], &model.inertia[..n], &state.present[..n]);
    let (from, to) = (&state.position[..n], &scratch.position[..n]);
    let end = |first: usize, (linear, angular, jump): Slices| {
        let mut sums = Sums::default();
        for (k, i) in (first..first + linear.len()).enumerate() {
            let (linear, angular) = (&mut linear[k], &mut angular[k]);
            let v = linear.velocity + jump[k][0];
            let w = angular.velocity + jump[k][1];
            let (v2, w2) = (v.length_squared(), w.length_squared());
            sums.kinetic += 0.5 * (mass[i] * v2 + inertia[i] * w2);
            if present[i] {
                sums.potential += weight_potential(model, i, to[i]);
            }
            linear.pseudo = coefficients.finish(linear);
            angular.pseudo = coefficients.finish(angular);
            sums.watch.look(v2 + w2, to[i] - from[i], [linear, angular]);
            jump[k] = [v, w];
        }
        sums
    };
    team::reduce(threads, n, whole, end, Sums::join)
}

/// The new state of all spheres.
fn write(model: &Model, state: &mut State, scratch: &Scratch) {
    let (threads, n) = (model.options.threads as usize, model.bodies());
    let motion = (
        &mut state.position[..n],
        &mut state.orientation[..n],
        (&mut state.velocity[..n], &mut state.angular_velocity[..n]),
    );
    let accelerations = (&mut state.pseudo[..n], &mut state.acceleration[..n]);
    type Two<'a, A, B> = (&'a mut [A], &'a mut [B]);
    type Moved<'a> = (&'a mut [DVec3], &'a mut [DQuat], Two<'a, DVec3, DVec3>);
    let (linear, angular) = (&scratch.linear[..n], &scratch.angular[..n]);
    let (position, shift, jump) = (
        &scratch.position[..n],
        &scratch.shift[..n],
        &scratch.jump[..n],
    );
    let each = |first: usize, (to, then): (Moved, Two<[DVec3; 2], [DVec3; 2]>)| {
        let ((x, q, (v, w)), (pseudo, acceleration)) = (to, then);
        for (k, i) in (first..first + x.len()).enumerate() {
            let (linear, angular) = (&linear[i], &angular[i]);
            [v[k], w[k]] = jump[i];
            x[k] = position[i];
            q[k] = rotation::advance(angular.displacement + shift[i][1], q[k]);
            pseudo[k] = [linear.pseudo, angular.pseudo];
            acceleration[k] = [linear.acceleration, angular.acceleration];
        }
    };
    team::reduce(threads, n, (motion, accelerations), each, |(), ()| ());
}

/// Adds the impulses of the smooth reactions to the joints' totals. In the nonsmooth generalized-alpha scheme they are
/// those of the filtered reactions (eq. 6), as velocities are of filtered accelerations.
fn add_smooth_reactions(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    coefficients: &Coefficients,
) {
    let (smooth, total) = (&scratch.smooth, &mut scratch.joint_reaction);
    if model.options.method != Method::Nsga {
        smooth.add_reactions(model, coefficients.h, total);
        return;
    }
    let mut reactions = vec![[DVec3::ZERO; 2]; model.joints.len()];
    smooth.add_reactions(model, 1.0, &mut reactions);
    let per_velocity = 1.0 / coefficients.acceleration_per_velocity();
    for ((now, kept), total) in reactions.iter().zip(&mut state.reaction).zip(total) {
        let [last, pseudo] = *kept;
        for k in 0..2 {
            // Reactions instead of accelerations: the "velocity" is the impulse.
            let mut p = coefficients.predict(DVec3::ZERO, pseudo[k], last[k]);
            coefficients.correct(&mut p, per_velocity * now[k]);
            total[k] += p.velocity;
            kept[0][k] = now[k];
            kept[1][k] = coefficients.finish(&p);
        }
    }
}

/// Work of joints with a prescribed motion: the impulse along each such row times the mean of its rates at both ends. Of
/// second order in smooth motion, and right where a law has a kink. (A joint prescribes one row, or rows at right angles.)
fn joint_work(model: &Model, scratch: &Scratch, span: Span) -> f64 {
    let mut work = 0.0;
    for (index, joint) in model.joints.iter().enumerate() {
        for (r, row) in joint.rows.iter().enumerate() {
            if !joint.prescribes(r) {
                continue;
            }
            let rate = 0.5 * (row.law.slope(span.start) + row.law.slope(span.end));
            work += rate
                * scratch
                    .smooth
                    .along(joint, index, r, &scratch.joint_reaction[index]);
        }
    }
    work
}
