//! Velocity sub-problem (eqs. 1f-h): one island of closed contacts, by the impact law of the run.

use super::less_friction::with_less_friction;
use super::{closed_form, single};
use crate::contact::Contact;
use crate::impact::bisect::{bisect_scale, BISECTIONS, GAIN_TOLERANCE};
use crate::impact::law::Law;
use crate::islands::Island;
use crate::level::speeds::Speeds;
use crate::model::Model;
use crate::options::Impact;
use crate::outcome::{ImpactRecord, Level};
use crate::pile::limits::{fits, may_fall_back};
use crate::report::StepReport;
use crate::state::State;
use crate::stepper::Span;
use crate::workspace::IslandScratch;
use crate::{impact, pile};
use carom_solve::{SolveReport, Status};

/// Solves one island of closed contacts; writes the corrections W of its bodies and `lambda` of its contacts.
pub fn solve_island(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    accept_unconverged: bool,
) -> bool {
    if let ([m], true) = (island.contacts, island.is_free()) {
        let m = *m;
        let c = &scratch.contacts[m as usize];
        // As printed, restitution is not clipped: a contact that was separating may need a second problem.
        let printed = model.options.impact == Impact::SequencePaper;
        let separating = || {
            let [old, _] = single::wall_motion(model, state, scratch, c);
            c.n0.dot(state.velocity[c.a as usize]) - old.normal > 0.0
        };
        if closed_form(model, c) && !(printed && separating()) {
            if scratch.walls.any_moves() {
                solve_single::<true>(model, state, scratch, m, report);
            } else {
                solve_single::<false>(model, state, scratch, m, report);
            }
            return true;
        }
    }
    if fits(model, island) {
        let others = may_fall_back(island);
        let accept = accept_unconverged && !others;
        if pile::solve_velocities(model, state, scratch, island, span, report, accept) {
            return true;
        }
        if !others {
            return span.smallest
                && !accept_unconverged
                && with_less_friction(scratch, island, report, |scratch, report| {
                    pile::solve_velocities(model, state, scratch, island, span, report, false)
                });
        }
        report.fallbacks += 1;
    }
    impact::rows::solve_island(
        model,
        state,
        scratch,
        island,
        span,
        report,
        accept_unconverged,
    )
}

/// A lone sphere-plane contact: at most one impact problem, in closed form. `MOVING`: walls of this scene may move.
fn solve_single<const MOVING: bool>(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    m: u32,
    report: &mut StepReport,
) {
    let c: &Contact = &scratch.contacts[m as usize];
    let i = c.a as usize;
    let options = &model.options;
    let radius = model.radius[i];
    let (v_check, w_check) = (scratch.linear[i].velocity, scratch.angular[i].velocity);
    let mut speeds = Speeds::default();
    speeds.add(model, state, v_check, i);
    let mut of_walls = [single::ContactMeasures::default(); 2];
    if MOVING {
        let walls = &scratch.walls;
        let twists = walls.start_twist(model, c, state.position[i]);
        if let (Some(old), Some(new)) = (twists, walls.end_twist(model, c, scratch.position[i])) {
            speeds.add_wall(&old, &new);
        }
        of_walls = single::wall_motion(model, state, scratch, c);
    }
    let [wall_old, wall_new] = of_walls;
    let against = |mut z: single::ContactMeasures, wall: &single::ContactMeasures| {
        if MOVING {
            z.subtract(wall);
        }
        z
    };
    let tol = speeds.closing_tolerance(options, 1);
    let check = against(single::motion(c, radius, v_check, w_check), &wall_new);
    let gamma_n = c.n0.dot(state.velocity[i]) - wall_old.normal;
    if c.nu[0] > 0.0 && check.normal > tol && c.gap_start > options.touching_tolerance * c.length {
        report.missed_impacts += 1;
    }
    let one_shot = options.impact == Impact::OneShot;
    if tol == 0.0 || (!one_shot && check.normal >= -tol) {
        return;
    }
    let resting = options.impact.has_loads_first() && gamma_n >= -tol;
    let printed = options.impact == Impact::SequencePaper;
    let law = match (resting, printed) {
        (true, _) => Law::Plastic,
        (_, true) => Law::Printed,
        _ => Law::First,
    };
    let material = c.law(model);
    let e = [material.restitution, material.tangential_restitution];
    let before = if material.tangential_restitution == 0.0 {
        [0.0; 2]
    } else {
        let old = single::motion(c, radius, state.velocity[i], state.angular_velocity[i]);
        against(old, &wall_old).slip
    };
    let measures = |scale: f64| {
        let mut z = check;
        let [along, across] = law.terms(e, scale, gamma_n, options, tol);
        z.normal += along;
        z.slip[0] += across * before[0];
        z.slip[1] += across * before[1];
        z
    };
    let solve = |scale: f64| single::problem(model, c, &measures(scale)).solve();
    let mut scale = 1.0;
    let mut s = solve(scale);
    // The velocity jump of a solution and its work: normal, sliding, rolling, spinning.
    let effect = |s: &carom_solve::single::SingleSolution| {
        let [dv, dw] = single::correction(model, c, s);
        let after = against(
            single::motion(c, radius, v_check + dv, w_check + dw),
            &wall_new,
        );
        let work = [
            0.5 * s.normal * (check.normal + after.normal),
            0.5 * (s.sliding[0] * (check.slip[0] + after.slip[0])
                + s.sliding[1] * (check.slip[1] + after.slip[1])),
            0.5 * (s.rolling[0] * (check.turn[0] + after.turn[0])
                + s.rolling[1] * (check.turn[1] + after.turn[1])),
            0.5 * s.spinning * (check.spin + after.spin),
        ];
        ([dv, dw], work)
    };
    let (mut jump, mut done) = effect(&s);
    if options.energy_safeguard && law == Law::First {
        // The speed of a wall that moves belongs to the scale.
        let of_wall = wall_new.normal.powi(2) + wall_new.slip[0].powi(2) + wall_new.slip[1].powi(2);
        let kinetic = 0.5
            * (model.mass[i] * (v_check.length_squared() + of_wall)
                + model.inertia[i] * w_check.length_squared());
        let gains = |w: &[f64; 4]| w.iter().sum::<f64>() > GAIN_TOLERANCE * kinetic;
        if gains(&done) {
            scale = bisect_scale(BISECTIONS, |trial| !gains(&effect(&solve(trial)).1));
            s = solve(scale);
            (jump, done) = effect(&s);
            report.restitution_scale = report.restitution_scale.min(scale);
        }
    }
    if s.normal == 0.0 {
        return;
    }
    let kept = scratch.keeper.wants(1).then(|| measures(scale));
    report.add_velocity(&SolveReport::CLOSED_FORM);
    report.impact_problems = report.impact_problems.max(1);
    scratch.corrections.set(c.a, jump);
    let packed = single::pack(c, &s);
    let status = if s.slip { Status::Slip } else { Status::Stick };
    if !resting && gamma_n < -tol {
        let world = c.to_world(c.n1, &packed);
        scratch.impacts.push(ImpactRecord {
            problem: 1,
            a: c.a,
            b: c.b,
            status: status as u8,
            normal: c.n1,
            impulse: world.impulse,
            moment: world.moment,
            approach: check.normal,
            separation: c.n1.dot(v_check + jump[0]) - wall_new.normal,
            restitution_scale: scale,
        });
    }
    let target = &mut scratch.contacts[m as usize];
    target.lambda = packed;
    target.status = status;
    target.work = done;
    if let Some(z) = kept {
        let at = (Level::Velocity, u32::from(!resting));
        single::keep(model, scratch, m, at, &z, packed, [v_check, w_check], jump);
    }
}
