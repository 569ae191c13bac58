//! Velocity sub-problem (eqs. 1f-h): one island of closed contacts, by the impact law of the run.

use super::single::ContactMeasures;
use super::{closed_form, single, Task};
use crate::contact::Contact;
use crate::impact::energy::{scales, Admit, ContactWork};
use crate::impact::law::Law;
use crate::level::speeds::Speeds;
use crate::model::Model;
use crate::options::Impact;
use crate::outcome::ImpactRecord;
use crate::pile::limits::fits;
use crate::workspace::On;
use crate::{impact, pile};
use carom_solve::rows::WORLD;
use carom_solve::single::SingleSolution;
use carom_solve::{SolveReport, Status};
use glam::DVec3;

/// Solves one island of closed contacts; writes the corrections W of its bodies and `lambda` of its contacts.
pub fn solve_island(on: &mut On) -> bool {
    let Task { model, state, .. } = *on.task;
    if let ([m], true) = (on.island.contacts, on.island.is_free()) {
        let m = *m;
        let c = &on.scratch.contacts[m as usize];
        // As printed, restitution is not clipped: a contact that was separating may need a second problem.
        let printed = model.options.impact.is_printed();
        let separating = || {
            let [old, _] = single::wall_motion(on, c);
            c.n0.dot(state.velocity[c.a as usize]) - old.normal > 0.0
        };
        let single = model.options.impact.has_closed_form();
        if single && closed_form(model, c) && !(printed && separating()) {
            if on.scratch.walls.any_moves() {
                solve_single::<true>(on, m);
            } else {
                solve_single::<false>(on, m);
            }
            return true;
        }
    }
    if fits(model, on.island) {
        return pile::solve_velocities(on);
    }
    impact::rows::solve_island(on)
}

/// A lone sphere-plane contact: at most one impact problem, in closed form. `MOVING`: walls of this scene may move.
fn solve_single<const MOVING: bool>(on: &mut On, m: u32) {
    let options = &on.task.model.options;
    let c = &on.scratch.contacts[m as usize];
    let (lone, still) = Lone::<MOVING>::of(on, c);
    let (check, tol) = (lone.check.normal, lone.tol);
    on.report.missed_impacts += u32::from(c.missed(on.task.model, check, tol));
    let one_shot = options.impact == Impact::OneShot;
    if still || (!one_shot && check >= -tol) {
        return;
    }
    let resting = match options.loads_once() {
        true => c.resting,
        false => options.impact.has_loads_first() && lone.minus_n >= -tol,
    };
    let law = match (resting, options.impact.is_printed()) {
        (true, _) => Law::Plastic,
        (_, true) => Law::Printed,
        _ => Law::First,
    };
    let (mut scale, mut impact) = (1.0, lone.impact(law));
    // Nearly always: none.
    if options.energy_safeguard && law == Law::First && impact.2.iter().sum::<f64>() > 0.0 {
        (scale, impact) = lone.without_gain(impact);
        on.report.restitution_scale = on.report.restitution_scale.min(scale);
    }
    let (s, jump, mut work) = impact;
    if s.normal == 0.0 {
        return;
    }
    if MOVING && resting && options.loads_once() {
        let there = single::wall_half_way(on, c);
        for (along, (end, there)) in (s.sliding.iter()).zip(lone.wall.slip.iter().zip(there.slip)) {
            work[1] += along * (end - there);
        }
    }
    let kept = on.scratch.keeper.wants(1).then(|| lone.measures(law));
    on.report.add_velocity(&SolveReport::CLOSED_FORM);
    on.report.impact_problems = on.report.impact_problems.max(1);
    on.scratch.corrections.set(c.a, jump);
    let packed = single::pack(c, &s);
    let status = if s.slip { Status::Slip } else { Status::Stick };
    let motion = lone.motion;
    if !resting && (options.loads_once() || lone.minus_n < -tol) {
        let world = c.to_world(c.n1, &packed);
        on.scratch.impacts.push(ImpactRecord {
            problem: 1,
            a: c.a,
            b: c.b,
            status: status as u8,
            normal: c.n1,
            impulse: world.impulse,
            moment: world.moment,
            normal_before: check,
            separation: c.n1.dot(motion[0] + jump[0]) - lone.wall.normal,
            restitution_scale: scale,
            course: None,
        });
    }
    let target = &mut on.scratch.contacts[m as usize];
    target.lambda = packed;
    if MOVING && resting && target.load != [0.0; 6] {
        // Solved anew with the wall at the end: all of it is of the loads, which act half-way.
        target.load = packed;
    }
    target.status = status;
    target.work = work;
    if let Some(z) = kept {
        single::keep(on, m, u32::from(!resting), &z, packed, motion, jump);
    }
}

/// Measures against those of a wall, where walls may move.
#[inline(always)]
fn against<const MOVING: bool>(mut z: ContactMeasures, wall: &ContactMeasures) -> ContactMeasures {
    if MOVING {
        z.subtract(wall);
    }
    z
}

/// A lone contact before its impact. All of it but [`Self::without_gain`] is written into its caller: as calls, what is passed on
/// costs as much as the impact.
#[derive(Clone, Copy)]
struct Lone<'a, const MOVING: bool> {
    model: &'a Model,
    c: &'a Contact,
    /// v-check and its angular velocity; the wall's measures at t_{n+1}, and those of the motion against it.
    motion: [DVec3; 2],
    wall: ContactMeasures,
    check: ContactMeasures,
    /// The measures of t_n on which restitution acts.
    minus_n: f64,
    slip: [f64; 2],
    tol: f64,
}

/// Multipliers, the velocity jump that they make, and their work: normal, sliding, rolling, spinning.
type LoneImpact = (SingleSolution, [DVec3; 2], [f64; 4]);

impl<'a, const MOVING: bool> Lone<'a, MOVING> {
    /// The contact as the step has it, and whether nothing moves and nothing pulls.
    #[inline(always)]
    fn of(on: &On<'a, '_>, c: &'a Contact) -> (Self, bool) {
        let (
            scratch,
            Task {
                model, state, span, ..
            },
        ) = (&*on.scratch, *on.task);
        let i = c.a as usize;
        let motion = [scratch.linear[i].velocity, scratch.angular[i].velocity];
        let mut speeds = Speeds::default();
        speeds.add(model, state, motion[0], i);
        let mut of_walls = [ContactMeasures::default(); 2];
        if MOVING {
            let walls = &scratch.walls;
            if let Some([old, new]) = walls.twists(model, c, state, scratch.position[i]) {
                speeds.add_wall(&old, &new);
            }
            of_walls = single::wall_motion(on, c);
        }
        let [wall_old, wall] = of_walls;
        let load = speeds.load.max((wall.normal - wall_old.normal).abs());
        let slip = if c.law(model).tangential_restitution == 0.0 {
            [0.0; 2]
        } else {
            let (v, w) = (state.velocity[i], state.angular_velocity[i]);
            against::<MOVING>(single::motion(c, model.radius[i], v, w), &wall_old).slip
        };
        let measured = single::motion(c, model.radius[i], motion[0], motion[1]);
        let lone = Lone {
            model,
            c,
            motion,
            wall,
            check: against::<MOVING>(measured, &wall),
            minus_n: c.n0.dot(state.velocity[i]) - wall_old.normal,
            slip,
            tol: speeds.closing_tolerance(&model.options, span, 1, load),
        };
        (lone, speeds.largest() == 0.0)
    }

    /// Measures of the problem by a law.
    #[inline(always)]
    fn measures(&self, law: Law) -> ContactMeasures {
        let (mut z, material) = (self.check, self.c.law(self.model));
        let o = &self.model.options;
        let [along, across] = law.terms(material, self.minus_n, o, self.tol);
        z.normal += along;
        z.slip[0] += across * self.slip[0];
        z.slip[1] += across * self.slip[1];
        z
    }

    #[inline(always)]
    fn impact(&self, law: Law) -> LoneImpact {
        self.given(single::problem(self.model, self.c, &self.measures(law)).solve())
    }

    /// What the multipliers `s` give.
    #[inline(always)]
    fn given(&self, s: SingleSolution) -> LoneImpact {
        let Lone { model, c, .. } = *self;
        let [dv, dw] = single::correction(model, c, &s);
        let ([v, w], check, radius) = (self.motion, &self.check, model.radius[c.a as usize]);
        let after = against::<MOVING>(single::motion(c, radius, v + dv, w + dw), &self.wall);
        let work = [
            0.5 * s.normal * (check.normal + after.normal),
            0.5 * (s.sliding[0] * (check.slip[0] + after.slip[0])
                + s.sliding[1] * (check.slip[1] + after.slip[1])),
            0.5 * (s.rolling[0] * (check.turn[0] + after.turn[0])
                + s.rolling[1] * (check.turn[1] + after.turn[1])),
            0.5 * s.spinning * (check.spin + after.spin),
        ];
        (s, [dv, dw], work)
    }

    /// What is left of restitution where it would give energy (rule R4), and the impact that belongs to it.
    #[cold]
    fn without_gain(self, with: LoneImpact) -> (f64, LoneImpact) {
        let Lone { c, model, .. } = self;
        let (i, [v, w], wall) = (c.a as usize, self.motion, &self.wall);
        let plastic = self.impact(Law::Plastic);
        let rows = |s: &SingleSolution| {
            let ([x, y], [a, b]) = (s.sliding, s.rolling);
            [s.normal, x, y, a, b, s.spinning]
        };
        let measures = |z: ContactMeasures| {
            let ([x, y], [a, b]) = (z.slip, z.turn);
            [z.normal, x, y, a, b, z.spin]
        };
        let [of_0, of_1] = [&plastic, &with].map(|(s, [dv, dw], _)| {
            let change = single::motion(c, model.radius[i], *dv, *dw);
            (rows(s), measures(change))
        });
        let mut work = ContactWork {
            is_pressed: true,
            ..ContactWork::between(0, WORLD)
        };
        for (k, before) in measures(self.check).into_iter().enumerate() {
            work.add(before, [of_0.0[k], of_1.0[k]], [of_0.1[k], of_1.1[k]]);
        }
        // The speed of a wall that moves belongs to the scale.
        let of_wall = wall.normal.powi(2) + wall.slip[0].powi(2) + wall.slip[1].powi(2);
        let linear = model.mass[i] * (v.length_squared() + of_wall);
        let kinetic = 0.5 * (linear + model.inertia[i] * w.length_squared());
        let Some(scales) = scales(&[work], Admit::Rounding, || vec![kinetic]) else {
            return (1.0, with);
        };
        let s = scales[0];
        let mix = |of_0: f64, of_1: f64| of_0 + s * (of_1 - of_0);
        let both = |of_0: [f64; 2], of_1: [f64; 2]| [0, 1].map(|k| mix(of_0[k], of_1[k]));
        let (r0, r1) = (plastic.0, with.0);
        let mixed = SingleSolution {
            normal: mix(r0.normal, r1.normal),
            sliding: both(r0.sliding, r1.sliding),
            rolling: both(r0.rolling, r1.rolling),
            spinning: mix(r0.spinning, r1.spinning),
            slip: r0.slip && r1.slip,
        };
        (s, self.given(mixed))
    }
}
