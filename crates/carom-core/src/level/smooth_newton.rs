//! Newton's method for the smooth sub-problem with joints and loads (eqs. 1a-b, 10, 11).
//!
//! Spheres joined by joints or by loads that depend on the motion form groups, fixed for a model; each group has its own matrix
//! `[s M + C + (h beta/gamma)(K - d(G^T lambda)/dq), -G^T; G + (h beta/gamma) d(G v)/dq, delta]`. A small `delta` keeps redundant joints
//! factorable (rule R10); it is in the matrix only, so the limit is that of eq. 1. All other spheres have the matrix `s M`.

use super::coupling::Trial;
use crate::force::total::{add_loads, own_force, pushed};
use crate::force::LoadError;
use crate::joint::{add_reaction, Joint};
use crate::model::{LinkKind, Model};
use crate::rows::{halves, Rows};
use crate::state::State;
use crate::stepper::generalized_alpha::Prediction;
use carom_solve::clusters::{apart, Forest};
use carom_solve::direct::{Entries, Gram};
use carom_solve::rows::NODE_DOF;
use glam::DVec3;

/// Roundings of the loads (1) that a residual may hold. Too few: stiff springs and large loads far apart never count as solved. Too many: a
/// residual that is real is passed over.
const ROUNDING: f64 = 16.0;

/// Spheres that move together in the smooth sub-problem.
#[derive(Default)]
pub(super) struct CoupledBodies {
    pub(super) bodies: Vec<u32>,
    pub(super) joints: Vec<u32>,
    pub(super) loads: Vec<u32>,
}

/// Factors of `dv` in the corrections of acceleration and position, and the time of the sub-problem.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// s.
    pub acceleration: f64,
    /// h beta/gamma; 0 at the start of a run, where placements are given.
    pub displacement: f64,
    /// Of velocities; 0 at the start of a run.
    pub velocity: f64,
    pub time: f64,
}

/// Terms of the residual of spheres that move together: a group, or a sphere alone. Each is a problem of its own, so that
/// a heavy sphere elsewhere is no excuse for an error here.
#[derive(Clone, Copy, Debug, Default)]
struct ResidualTerms {
    /// Squares of the balance and of its terms, N^2; parts of the loads and their rounding, N.
    residual: f64,
    terms: f64,
    parts: f64,
    rounding: f64,
    /// Of the constraints and of the motion, m/s. The speed is the largest of all iterates: it is what a velocity near 0
    /// is a difference of.
    constraint: f64,
    speed: f64,
}

impl ResidualTerms {
    /// Smallness of the residual: of the balance over its terms (eq. 44), of the constraints over the speeds, those that
    /// the loads would give in the step among them. At rest forces cancel and speeds are rounding: neither may be the measure.
    fn relative(&self) -> f64 {
        // What rounding leaves counts as nothing; what is not a number stays so.
        let excess = self.residual.sqrt() - ROUNDING * self.rounding;
        let excess = if excess <= 0.0 { 0.0 } else { excess };
        let balance = excess / (self.terms.sqrt() + self.parts).max(f64::MIN_POSITIVE);
        worst(balance, self.constraint / self.speed.max(f64::MIN_POSITIVE))
    }
}

/// The larger one; unlike `f64::max` it does not pass over what is not a number.
fn worst(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() {
        a
    } else {
        b
    }
}

#[derive(Default)]
pub struct SmoothScratch {
    pub(super) groups: Vec<CoupledBodies>,
    grouped: Vec<bool>,
    /// Local index of a sphere in its group.
    pub(super) local: Vec<u32>,
    /// Share of each sphere; those of the groups come first.
    residual_of: Vec<u32>,
    residuals: Vec<ResidualTerms>,
    /// Displacements of free walls as far as they are known.
    displaced: Vec<DVec3>,
    /// First row of each joint among all joint rows.
    pub first_row: Vec<u32>,
    /// What loads push, N^2/kg (`force::total::pushed`).
    pub pushed: f64,
    /// Smooth reactions lambda of all joint rows, N or N m.
    pub lambda: Vec<f64>,
    pub(super) gradients: Vec<Rows>,
    pub(super) constraint: Vec<f64>,
    pub(super) residual: Vec<[DVec3; 2]>,
    pub(super) rhs: Vec<f64>,
    pub(super) matrix: Entries,
    pub(super) reactions: Gram,
    pub(super) solution: Vec<f64>,
}

impl SmoothScratch {
    pub fn new(model: &Model) -> SmoothScratch {
        let mut first_row = Vec::with_capacity(model.joints.len());
        let mut rows = 0;
        for joint in &model.joints {
            first_row.push(rows);
            rows += joint.rows.len() as u32;
        }
        let n = if model.is_free() { 0 } else { model.bodies() };
        let mut scratch = SmoothScratch {
            grouped: vec![false; n],
            local: vec![0; n],
            first_row,
            lambda: vec![0.0; rows as usize],
            gradients: vec![Rows::default(); model.joints.len()],
            constraint: vec![0.0; rows as usize],
            residual: vec![[DVec3::ZERO; 2]; n],
            ..SmoothScratch::default()
        };
        scratch.build_groups(model);
        scratch
    }

    fn build_groups(&mut self, model: &Model) {
        let mut joined = apart(self.grouped.len());
        for link in &model.links {
            joined.join(link.a, link.b);
            self.grouped[link.a as usize] = true;
            self.grouped[link.b as usize] = true;
        }
        let mut slot = vec![u32::MAX; joined.len()];
        for body in 0..joined.len() as u32 {
            if !self.grouped[body as usize] {
                continue;
            }
            let top = joined.root(body);
            if top == body {
                slot[body as usize] = self.groups.len() as u32;
                self.groups.push(CoupledBodies::default());
            }
            // Roots are the smallest of their group: they come first.
            let group = &mut self.groups[slot[top as usize] as usize];
            self.local[body as usize] = group.bodies.len() as u32;
            group.bodies.push(body);
        }
        for link in &model.links {
            let group = &mut self.groups[slot[joined.root(link.a) as usize] as usize];
            match link.kind {
                LinkKind::Joint(index) => group.joints.push(index),
                LinkKind::Load(index) => group.loads.push(index),
            }
        }
        self.residual_of = vec![0; joined.len()];
        let mut residuals = self.groups.len() as u32;
        for body in 0..joined.len() as u32 {
            let i = body as usize;
            self.residual_of[i] = if self.grouped[i] {
                slot[joined.root(body) as usize]
            } else {
                residuals += 1;
                residuals - 1
            };
        }
        self.residuals = vec![ResidualTerms::default(); residuals as usize];
    }

    /// Starts a sub-problem: forgets the reactions and speeds of the last one. A joint's law may have left its domain.
    pub fn begin(
        &mut self,
        model: &Model,
        displaced: Vec<DVec3>,
        time: f64,
    ) -> Result<(), LoadError> {
        self.displaced = displaced;
        self.lambda.fill(0.0);
        self.residuals.fill(ResidualTerms::default());
        for (index, joint) in model.joints.iter().enumerate() {
            for row in &joint.rows {
                let (value, slope) = (row.law.value(time), row.law.slope(time));
                if !(value.is_finite() && slope.is_finite()) {
                    let text =
                        format!("its law gives {value} with the slope {slope} at t = {time} s");
                    return Err(LoadError {
                        joint: Some(index as u32),
                        ..LoadError::on(joint.a, text)
                    });
                }
            }
        }
        Ok(())
    }

    /// Whether a sphere belongs to a group; the others are explicit.
    fn is_grouped(&self, i: usize) -> bool {
        self.grouped[i]
    }

    /// Residuals `f + G^T lambda - M a` per sphere and `G v - c'` per joint row, at the motion in `trial`.
    pub fn evaluate(
        &mut self,
        model: &Model,
        (trial, present): (&mut Trial, &[bool]),
        acceleration: impl Fn(usize) -> [DVec3; 2],
        weights: &Weights,
    ) -> Result<f64, LoadError> {
        for terms in &mut self.residuals {
            *terms = ResidualTerms {
                speed: terms.speed,
                ..ResidualTerms::default()
            };
        }
        self.add_loads(model, trial, present, weights)?;
        for (index, joint) in model.joints.iter().enumerate() {
            self.add_joint(model, trial, (index, joint), weights.time);
        }
        for load in &model.loads {
            let magnitude = load.magnitude(&trial.motion(weights.time));
            if let Some(body) = load.bodies()[0] {
                let terms = &mut self.residuals[self.residual_of[body as usize] as usize];
                terms.parts += magnitude.parts;
                terms.rounding += magnitude.rounding;
            }
        }
        for i in 0..model.bodies() {
            let [a, alpha] = acceleration(i);
            let [f, m] = trial.wrench[i];
            let (inertia, turn) = (model.mass[i] * a, model.inertia[i] * alpha);
            let r = [f - inertia, m - turn];
            let arm = 1.0 / model.radius[i];
            let terms = &mut self.residuals[self.residual_of[i] as usize];
            terms.residual += r[0].length_squared() + arm * arm * r[1].length_squared();
            terms.terms += inertia.length_squared() + arm * arm * turn.length_squared();
            self.residual[i] = r;
        }
        let relative = self.residuals.iter().map(ResidualTerms::relative);
        Ok(relative.fold(0.0, worst))
    }

    /// Forces and moments of all loads, the weight among them.
    fn add_loads(
        &mut self,
        model: &Model,
        trial: &mut Trial,
        present: &[bool],
        weights: &Weights,
    ) -> Result<(), LoadError> {
        let mut wrench = std::mem::take(&mut trial.wrench);
        wrench.fill([DVec3::ZERO; 2]);
        let loaded = add_loads(model, &trial.motion(weights.time), &mut wrench);
        trial.wrench = wrench;
        loaded?;
        // To what is absent a function of the user may have given something.
        let all = trial.wrench.iter_mut().zip(present);
        all.filter(|(_, &is_there)| !is_there)
            .for_each(|(w, _)| *w = [DVec3::ZERO; 2]);
        self.pushed = pushed(model, &trial.motion(weights.time), &trial.wrench);
        for (i, w) in trial.wrench.iter_mut().enumerate() {
            let weight = own_force(model, &self.displaced, i, weights.time);
            let terms = &mut self.residuals[self.residual_of[i] as usize];
            terms.parts += weight.length();
            w[0] += weight;
            let [f, m] = *w;
            let arm = 1.0 / model.radius[i];
            terms.terms += f.length_squared() + arm * arm * m.length_squared();
            let pull = model.inv_mass[i] * f.length();
            let twist = model.radius[i] * model.inv_inertia[i] * m.length();
            terms.speed = terms.speed.max(pull.max(twist) / weights.acceleration);
        }
        Ok(())
    }

    /// Rows of a joint, what they leave, and its reactions.
    fn add_joint(
        &mut self,
        model: &Model,
        trial: &mut Trial,
        (index, joint): (usize, &Joint),
        time: f64,
    ) {
        let rows = &mut self.gradients[index];
        let dim = joint.gradient_at(&trial.poses(joint), rows);
        let first = self.first_row[index] as usize;
        let mut rates = [0.0; 6];
        joint.rates(time, &mut rates);
        let twists = trial.twists(joint);
        let terms = &mut self.residuals[self.residual_of[joint.a as usize] as usize];
        for (r, row) in rows.iter().enumerate().take(dim) {
            let mut value = -rates[r];
            for (side, twist) in row.iter().zip(&twists) {
                let (v, w) = (twist.velocity, twist.angular_velocity);
                value += side[0] * v.x + side[1] * v.y + side[2] * v.z;
                value += side[3] * w.x + side[4] * w.y + side[5] * w.z;
                let fastest = v.length().max(joint.length * w.length());
                terms.speed = terms.speed.max(fastest);
            }
            self.constraint[first + r] = value;
            let turn = if r < joint.translational {
                1.0
            } else {
                joint.length
            };
            terms.constraint = worst(terms.constraint, turn * value.abs());
            let l = self.lambda[first + r];
            for (side, body) in row.iter().zip([joint.a, joint.b]) {
                if let Some(w) = trial.wrench.get_mut(body as usize) {
                    let [force, moment] = halves(side).map(|part| l * part);
                    let arm = 1.0 / model.radius[body as usize];
                    terms.terms += force.length_squared() + arm * arm * moment.length_squared();
                    w[0] += force;
                    w[1] += moment;
                }
            }
        }
    }

    /// Replaces the velocity residual of joint rows by the acceleration one: `-(dG/dt v) + c''` (start of a run).
    pub fn constrain_accelerations(&mut self, model: &Model, trial: &Trial, time: f64) {
        // One-sided: a law may begin at t = 0. The error is of second order in it.
        const STEP: f64 = 1e-5;
        for (index, joint) in model.joints.iter().enumerate() {
            let ([pa, pb], [ta, tb]) = (trial.poses(joint), trial.twists(joint));
            let mut rates = Rows::default();
            joint.gradient_rate((&pa, &ta), (&pb, &tb), &mut rates);
            let at = |steps: f64| {
                let mut rates = [0.0; 6];
                joint.rates(time + steps * STEP, &mut rates);
                rates
            };
            let (r0, r1, r2) = (at(0.0), at(1.0), at(2.0));
            let first = self.first_row[index] as usize;
            for (r, row) in rates.iter().enumerate().take(joint.rows.len()) {
                let mut value = -(4.0 * r1[r] - 3.0 * r0[r] - r2[r]) / (2.0 * STEP);
                for (side, twist) in row.iter().zip([ta, tb]) {
                    let (v, w) = (twist.velocity, twist.angular_velocity);
                    value += side[0] * v.x + side[1] * v.y + side[2] * v.z;
                    value += side[3] * w.x + side[4] * w.y + side[5] * w.z;
                }
                self.constraint[first + r] = value;
            }
        }
    }

    /// The spheres of the joint whose rows are farthest from being met (equal for the ground), or the sphere farthest from
    /// balance: where to look when the sub-problem has no solution.
    pub fn worst(&self, model: &Model) -> (u32, u32) {
        let size = |x: f64| {
            if x.is_finite() {
                x.abs()
            } else {
                f64::INFINITY
            }
        };
        let mut found = (-1.0, (0, 0));
        for (index, joint) in model.joints.iter().enumerate() {
            let first = self.first_row[index] as usize;
            let rows = &self.constraint[first..first + joint.rows.len()];
            let largest = rows.iter().map(|&x| size(x)).fold(0.0, f64::max);
            if largest > found.0 {
                let b = if joint.grounded() { joint.a } else { joint.b };
                found = (largest, (joint.a, b));
            }
        }
        if model.joints.is_empty() {
            for (i, [f, m]) in self.residual.iter().enumerate() {
                let largest = size(f.length()).max(size(m.length() / model.radius[i]));
                if largest > found.0 {
                    found = (largest, (i as u32, i as u32));
                }
            }
        }
        found.1
    }

    /// Share of a joint's force and moment along its row `r`.
    pub fn along(&self, joint: &Joint, index: usize, r: usize, given: &[DVec3; 2]) -> f64 {
        let side = &self.gradients[index][r][0];
        let (part, first) = if r < joint.translational {
            (0, 0)
        } else {
            (1, 3)
        };
        given[part].dot(DVec3::new(side[first], side[first + 1], side[first + 2]))
    }

    /// Adds the impulses of the smooth reactions in a step of size `h` to the joints' totals.
    pub fn add_reactions(&self, model: &Model, h: f64, out: &mut [[DVec3; 2]]) {
        for (index, joint) in model.joints.iter().enumerate() {
            let first = self.first_row[index] as usize;
            for r in 0..joint.rows.len() {
                let impulse = h * self.lambda[first + r];
                add_reaction(
                    joint,
                    r,
                    &self.gradients[index][r],
                    impulse,
                    &mut out[index],
                );
            }
        }
    }

    /// Solves for the velocity corrections of all bodies and adds those of the reactions; false: not factorable. Of a clump the angular one is that
    /// of its angular momentum over its mean moment of inertia.
    pub fn correct(
        &mut self,
        model: &Model,
        trial: &mut Trial,
        weights: Weights,
        mut apply: impl FnMut(usize, [DVec3; 2]),
    ) -> bool {
        let inverse = 1.0 / weights.acceleration;
        for i in 0..model.bodies() {
            if !self.is_grouped(i) {
                let [f, m] = self.residual[i];
                let scale = (inverse * model.inv_mass[i], inverse * model.inv_inertia[i]);
                apply(i, [scale.0 * f, scale.1 * m]);
            }
        }
        let groups = std::mem::take(&mut self.groups);
        let solved = groups.iter().all(|group| {
            let solved = self.solve_group(model, trial, group, weights);
            if solved {
                for (k, &body) in group.bodies.iter().enumerate() {
                    let [dv, dw] = halves(&self.solution[NODE_DOF * k..NODE_DOF * (k + 1)]);
                    apply(body as usize, [dv, scaled(model, trial, body, dw)]);
                }
                let mut at = NODE_DOF * group.bodies.len();
                for &index in &group.joints {
                    let first = self.first_row[index as usize] as usize;
                    for r in 0..model.joints[index as usize].rows.len() {
                        self.lambda[first + r] += self.solution[at];
                        at += 1;
                    }
                }
            }
            solved
        });
        self.groups = groups;
        solved
    }
}

/// Consistent `v-dot_0` (Algorithm 1, line 2): loads and joints at the start, without contacts.
/// Accelerations, of clumps as [`SmoothScratch::correct`] has them, and the reaction of every joint: force and moment on its sphere A.
pub fn initial_accelerations(model: &Model, state: &State) -> (Vec<[DVec3; 2]>, Vec<[DVec3; 2]>) {
    let mut reactions = vec![[DVec3::ZERO; 2]; model.joints.len()];
    let mut accelerations = vec![[DVec3::ZERO; 2]; model.bodies()];
    let mut trial = Trial::new(model);
    trial.position.copy_from_slice(&state.position);
    trial.orientation.copy_from_slice(&state.orientation);
    trial.velocity.copy_from_slice(&state.velocity);
    trial
        .angular_velocity
        .copy_from_slice(&state.angular_velocity);
    let mut scratch = SmoothScratch::new(model);
    let weights = Weights {
        acceleration: 1.0,
        displacement: 0.0,
        velocity: 0.0,
        time: 0.0,
    };
    // Linear in the accelerations: the second round only takes out rounding and the shift. A load that fails here fails
    // in the first step, which reports it.
    for _ in 0..3 {
        if scratch
            .evaluate(
                model,
                (&mut trial, &state.present),
                |i| accelerations[i],
                &weights,
            )
            .is_err()
        {
            return (accelerations, reactions);
        }
        scratch.constrain_accelerations(model, &trial, 0.0);
        scratch.add_acceleration(model, &trial, &accelerations);
        let solved = scratch.correct(model, &mut trial, weights, |i, [a, alpha]| {
            accelerations[i][0] += a;
            accelerations[i][1] += alpha;
        });
        if !solved {
            break;
        }
    }
    scratch.add_reactions(model, 1.0, &mut reactions);
    // What overflows here stops the first step, which reports it; the state it leaves is to be one that can be saved and read.
    for pair in accelerations.iter_mut().chain(&mut reactions) {
        if !pair.iter().all(|x| x.is_finite()) {
            *pair = [DVec3::ZERO; 2];
        }
    }
    (accelerations, reactions)
}

impl SmoothScratch {
    /// Adds `G a` to the acceleration residual of joint rows.
    fn add_acceleration(&mut self, model: &Model, trial: &Trial, accelerations: &[[DVec3; 2]]) {
        let of_body = |body: u32| {
            let i = body as usize;
            let [a, alpha] = *accelerations.get(i)?;
            let clump = model.as_clump(body).map(|number| &model.clumps[number]);
            let turning = clump.map_or(alpha, |clump| {
                let (q, w) = (trial.orientation[i], trial.angular_velocity[i]);
                let moment = clump.mean_inertia() * alpha - w.cross(clump.momentum(q, w));
                clump.turning(q, moment)
            });
            Some([a, turning])
        };
        for (index, joint) in model.joints.iter().enumerate() {
            let first = self.first_row[index] as usize;
            for r in 0..joint.rows.len() {
                for (side, body) in self.gradients[index][r].iter().zip([joint.a, joint.b]) {
                    if let Some([a, alpha]) = of_body(body) {
                        self.constraint[first + r] += side[0] * a.x + side[1] * a.y + side[2] * a.z;
                        self.constraint[first + r] +=
                            side[3] * alpha.x + side[4] * alpha.y + side[5] * alpha.z;
                    }
                }
            }
        }
    }
}

/// A change of the angular velocity of a body as `correct` gives it.
fn scaled(model: &Model, trial: &Trial, body: u32, dw: DVec3) -> DVec3 {
    model.as_clump(body).map_or(dw, |number| {
        let (clump, q) = (&model.clumps[number], trial.orientation[body as usize]);
        clump.momentum(q, dw) / clump.mean_inertia()
    })
}

/// Puts the predicted motion into `trial`.
pub fn place(state: &State, linear: &[Prediction], angular: &[Prediction], trial: &mut Trial) {
    for (i, (l, a)) in linear.iter().zip(angular).enumerate() {
        trial.position[i] = state.position[i] + l.displacement;
        trial.orientation[i] = crate::rotation::advance(a.displacement, state.orientation[i]);
        trial.velocity[i] = l.velocity;
        trial.angular_velocity[i] = a.velocity;
    }
}
