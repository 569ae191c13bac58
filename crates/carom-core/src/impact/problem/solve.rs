//! Solves an impact problem, as it is stated for its chosen contacts.

use crate::clump::places::Clumps;
use crate::contact::Contact;
use crate::impact::compliant::{impulses, spring};
use crate::impact::coupled::CoupledVelocities;
use crate::impact::course::Courses;
use crate::impact::law::{expansion, Law};
use crate::impact::memory::ImpactScratch;
use crate::impact::reduced::Reduced;
use crate::level::coupling::Trial;
use crate::level::speeds::closing_left;
use crate::level::{newton_options, worst_group};
use crate::model::Model;
use crate::options::Impact;
use crate::outcome::Level;
use crate::problem::Solve;
use crate::rows::along;
use crate::workspace::On;
use carom_solve::ladder::COARSE_TOLERANCE;
use carom_solve::rows::{Measured, RowContact, Subproblem, NODE_DOF};
use carom_solve::{Beside, NewtonOptions};
use glam::DVec3;
use std::mem::take;

/// Speed over r/h (1) below which the multipliers of joints at rest are rounding. At 0 a ball that is held without gravity never counts as
/// solved; too large, and slow impacts at joints end with a residual.
const AT_REST: f64 = 1e-3;

/// How much finer (1) a problem is solved whose residual may give energy. Larger: six balls in a tree gain 1e-9 of their energy. Smaller: below the
/// rounding of large islands, and the step takes iterations for nothing.
const FINER: f64 = 1e-4;

/// Shares (1) by which contacts give way where that chooses among solutions, each from the last: with the first, others are rare. A larger last one is
/// farther from a solution; with a smaller one rounding chooses. Without the first ones grains that roll have several, or none is found.
const SOFTNESS: [f64; 7] = [1.0, 1e-2, 1e-4, 1e-6, 1e-6, 1e-6, 1e-6];
/// The stage from which on softness acts on changes alone.
const FIRM: usize = 3;
/// Residual (1) that is asked for with it at least, a little above rounding.
const LEAST_TOLERANCE: f64 = 1e-13;

/// Iterations for it. Fewer: some problems of ten contacts stay as they were; more: those that rounding keeps from it take their time.
const FINER_ITERATIONS: u32 = 8;

impl ImpactScratch {
    /// Solves the chosen contacts by `law` with all present impulses fixed. Problem 0 is that of the loads. `warm` starts from given impulses.
    pub(in crate::impact) fn solve_chosen(
        &mut self,
        on: &mut On,
        law: Law,
        problem: u32,
        warm: Option<&[f64]>,
    ) -> bool {
        self.law = law;
        self.along_middle = problem == 0 && !self.middle.is_empty();
        self.set_velocities(law);
        self.scale.clear();
        self.scale.resize(self.chosen.len(), 1.0);
        self.build(on, law);
        // Poisson's law gives back what it finds in all contacts at once.
        let gives_back = on.task.model.options.impact == Impact::Poisson && problem > 0;
        let soft = if gives_back {
            self.softly(on, problem)
        } else {
            None
        };
        let solve = |own: &mut Self, on: &mut On, start: Option<&[f64]>| {
            own.solve_stated(on, problem, start)
        };
        if !self.solve_from(on, [soft.as_deref(), warm], solve) {
            return false;
        }
        // The files of problems know no least impulses.
        if law != Law::Expansion && on.scratch.keeper.wants(self.last.iterations) {
            self.keep(on, problem);
        }
        self.explain();
        true
    }

    /// Solves the compression of Poisson's law on the chosen contacts, and keeps what their expansion has; whether any has restitution.
    pub(in crate::impact) fn compress(&mut self, on: &mut On) -> Option<bool> {
        let model = on.task.model;
        self.law = Law::Compression;
        self.along_middle = false;
        self.velocity.clone_from(&self.v_old);
        self.build(on, self.law);
        // An impact takes no time, in which loads could answer it.
        let loads = std::mem::take(&mut self.loads);
        let load = std::mem::take(&mut self.sub.load);
        let soft = self.softly(on, 1);
        let solve =
            |own: &mut Self, on: &mut On, start: Option<&[f64]>| own.solve_built(on, 1, start);
        let solved = self.solve_from(on, [soft.as_deref(), None], solve);
        (self.loads, self.sub.load) = (loads, load);
        self.expansion.clear();
        self.expansion.resize(self.full.rows(), 0.0);
        let mut expands = false;
        let reduced = Reduced::new(&self.sub, self.chosen.len());
        for (&slot, c) in self.chosen.iter().zip(&self.sub.contacts) {
            let material = on.scratch.contacts[self.members[slot] as usize].law(model);
            let (from, to) = (c.row as usize, self.full.contacts[slot].row as usize);
            let inverse = reduced.inverse[from];
            let [least, across] = expansion(material, self.lambda[from], inverse, &model.options);
            self.expansion[to] = least;
            if c.bounds.sliding > 0.0 {
                // Clumps and joints resist differently along both tangents, and not along each by itself.
                let [w1, w12, w2] = reduced.friction(&self.sub, c);
                let [l1, l2] = [self.lambda[from + 1], self.lambda[from + 2]];
                self.expansion[to + 1] = across * (w1 * l1 + w12 * l2);
                self.expansion[to + 2] = across * (w12 * l1 + w2 * l2);
            }
            expands |= least > 0.0;
        }
        solved.then_some(expands)
    }

    /// Lets springs press the chosen contacts from the velocities of t_n on. Joints and loads answer the impulses.
    pub(in crate::impact) fn press(&mut self, on: &mut On) -> bool {
        let model = on.task.model;
        (self.law, self.along_middle) = (Law::Springs, false);
        self.velocity.clone_from(&self.v_old);
        let contacts: &[Contact] = on.scratch.contacts;
        self.build(on, Law::Compression);
        let of = |&slot: &usize| spring(model, &contacts[self.members[slot] as usize]);
        let springs: Vec<_> = self.chosen.iter().map(of).collect();
        let mut courses = Courses::new(model.courses);
        let Some((lambda, is_cut)) = impulses(&self.sub, &springs, &model.options, &mut courses)
        else {
            return false;
        };
        on.report.truncated += u32::from(is_cut);
        let courses = courses.of_contacts();
        let of_slots = courses.map(|(at, course)| (self.chosen[at] as u32, course));
        self.table.courses.extend(of_slots);
        self.set_velocities(self.law);
        self.scale.clear();
        self.scale.resize(self.chosen.len(), 1.0);
        self.build(on, Law::Plastic);
        self.lambda = lambda;
        self.balance();
        self.explained.clear();
        self.explained.resize(self.chosen.len(), 0.0);
        let alone = self.joints.is_empty() && self.loads.is_empty();
        alone || self.answer(on)
    }

    /// What joints and loads answer to the impulses at hand.
    fn answer(&mut self, on: &mut On) -> bool {
        let (chosen, mut lambda) = (take(&mut self.chosen), self.lambda.clone());
        for (v, u) in self.velocity.iter_mut().zip(&self.u) {
            *v += u;
        }
        self.build(on, Law::Plastic);
        let solved = self.solve_built(on, 1, None);
        let (joints, load) = (take(&mut self.lambda), take(&mut self.sub.load));
        let first = lambda.len() - joints.len();
        lambda[first..].copy_from_slice(&joints);
        self.chosen = chosen;
        self.set_velocities(self.law);
        self.build(on, Law::Plastic);
        (self.lambda, self.sub.load) = (lambda, load);
        self.balance();
        solved
    }

    /// Solves the problem at hand once more from its solution, which stays if it cannot be found more finely.
    pub(in crate::impact) fn solve_finely(&mut self, on: &mut On, problem: u32) {
        let (before, last, accept) = (self.solution(), self.last, self.accept_unconverged);
        let reported = on.snapshot();
        (self.fineness, self.accept_unconverged) = (FINER, false);
        if self.solve_built(on, problem, Some(&before.lambda)) {
            self.explain();
        } else {
            self.restore(before);
            self.last = last;
        }
        (self.fineness, self.accept_unconverged) = (1.0, accept);
        on.restore(reported);
    }

    /// Solves the problem at hand once more, without restitution.
    pub(in crate::impact) fn solve_without_restitution(
        &mut self,
        on: &mut On,
        problem: u32,
    ) -> bool {
        self.build(on, Law::Plastic);
        self.solve_built(on, problem, None)
    }

    /// Solves the problem as it is stated; at rest where it was so. With restitution only a solution counts: without it there is one.
    fn solve_stated(&mut self, on: &mut On, problem: u32, warm: Option<&[f64]>) -> bool {
        let resting = match self.law {
            Law::Printed => None,
            _ if problem > 1 => None,
            _ => self.rests_below(on),
        };
        let accept = self.accept_unconverged && !self.law.has_restitution();
        let resting = resting.map(|bound| (bound, on.snapshot()));
        let allowed = std::mem::replace(&mut self.accept_unconverged, accept && resting.is_none());
        let mut solved = self.solve_built(on, problem, warm);
        let moves = |bound: f64| !solved || self.moves(on.scratch, bound);
        if let Some((bound, before)) = resting.filter(|&(bound, _)| moves(bound)) {
            // What was tried is no part of the step.
            let tried = on.snapshot();
            on.restore(before);
            if self.hold(on, bound, warm) {
                on.report.fallbacks += u32::from(!solved);
                solved = true;
            } else {
                on.restore(tried);
            }
        }
        self.accept_unconverged = allowed;
        if !solved && accept {
            on.report.unconverged += 1;
            solved = true;
        }
        solved
    }

    /// The velocities before the problem, and those that restitution acts on.
    pub(in crate::impact) fn set_velocities(&mut self, law: Law) {
        self.fixed.clone_from(&self.jump);
        let before = self.v_check.iter().zip(&self.fixed);
        for (v, (check, jump)) in self.velocity.iter_mut().zip(before) {
            *v = check + jump;
        }
        self.v_minus.clone_from(&self.v_old);
        if matches!(law, Law::Later | Law::Printed) {
            let jumps = self.jump.iter().zip(&self.offset);
            for (v, (jump, loads)) in self.v_minus.iter_mut().zip(jumps) {
                *v += jump - loads;
            }
        }
    }

    /// Whether the last problem gave no impulse at all: the next ones would be the same.
    pub fn stands_still(&self) -> bool {
        let contacts = self.sub.contacts.iter().filter(|c| !c.bilateral);
        contacts
            .flat_map(|c| &self.lambda[c.rows()])
            .all(|&l| l == 0.0)
    }

    /// Rows of the chosen contacts with their free measures `z0`.
    pub(in crate::impact) fn build(&mut self, on: &On, law: Law) {
        let (model, contacts) = (on.task.model, &*on.scratch.contacts);
        let mut sub = std::mem::take(&mut self.sub);
        sub.clear();
        sub.inv_mass.extend_from_slice(&self.full.inv_mass);
        sub.inv_inertia.extend_from_slice(&self.full.inv_inertia);
        sub.node_length.extend_from_slice(&self.full.node_length);
        for (position, &slot) in self.chosen.iter().enumerate() {
            let c = self.full.contacts[slot];
            let contact = &contacts[self.members[slot] as usize];
            let row = sub.jac.len();
            let rows = c.rows();
            sub.jac.extend_from_slice(&self.acting()[rows.clone()]);
            sub.diag.extend_from_slice(&self.full.diag[rows.clone()]);
            sub.z0.extend(
                rows.clone()
                    .map(|r| self.relative::<1>(&c, r, &self.velocity)),
            );
            sub.contacts.push(RowContact {
                row: row as u32,
                ..c
            });
            let material = contact.law(model);
            let minus_n = match law {
                Law::Plastic => continue,
                Law::Compression => {
                    let measures = rows.map(|r| self.relative::<0>(&c, r, &self.velocity));
                    sub.z0.splice(row.., measures);
                    continue;
                }
                Law::Expansion => {
                    sub.contacts[position].least = self.expansion[c.row as usize];
                    let slides = if c.bounds.sliding > 0.0 { 3 } else { 1 };
                    for r in 1..slides {
                        sub.z0[row + r] += self.expansion[c.row as usize + r];
                    }
                    continue;
                }
                Law::Printed => self.printed_minus_n(slot, contact.n0),
                Law::First | Law::Later | Law::Springs => {
                    self.relative::<0>(&c, c.row as usize, &self.v_minus)
                }
            };
            let [normal, across] = law.terms(material, minus_n, &model.options, self.closing[slot]);
            sub.z0[row] += normal;
            if across != 0.0 && contact.bounds.sliding > 0.0 {
                for r in 1..3 {
                    let slip = self.relative::<0>(&c, c.row as usize + r, &self.v_minus);
                    sub.z0[row + r] += across * slip;
                }
            }
        }
        self.add_joints(&mut sub, usize::from(law != Law::Compression));
        self.measured.clear();
        if self.along_middle {
            let joints = self.members.len()..self.full.contacts.len();
            for slot in self.chosen.iter().copied().chain(joints) {
                let c = &self.full.contacts[slot];
                let rows = c.rows();
                self.measured.extend_from_slice(&self.full.jac[rows]);
            }
        }
        self.sub = sub;
    }

    /// Rows along which the impulses of the problem at hand act.
    pub(in crate::impact) fn acting(&self) -> &[[[f64; NODE_DOF]; 2]] {
        if self.along_middle {
            &self.middle
        } else {
            &self.full.jac
        }
    }

    /// `G_N(n) V_minus`: the normal of t_n, as eqs. 16, 24 and 43 print it.
    fn printed_minus_n(&self, slot: usize, n: DVec3) -> f64 {
        let c = &self.full.contacts[slot];
        let row = [n.x, n.y, n.z, 0.0, 0.0, 0.0];
        let part = |node: u32| {
            let v = &self.v_minus[NODE_DOF * node as usize..];
            along(&row, DVec3::new(v[0], v[1], v[2]), DVec3::ZERO)
        };
        let mut sum = part(c.node_a);
        if c.node_b != carom_solve::rows::WORLD {
            sum -= part(c.node_b);
        }
        sum + self.wall_openings.get(slot).copied().unwrap_or(0.0)
    }

    pub(super) fn newton_options(&self, model: &Model) -> NewtonOptions {
        let nodes = self.sub.nodes() as f64;
        // The harmonic mean: beside a wall of a ton grains have impulses of theirs.
        let mass = nodes / self.sub.inv_mass.iter().sum::<f64>();
        let mut speed = self.speeds.largest();
        if !self.joints.is_empty() {
            // Joints are solved at rest too, where every speed is 0.
            speed = speed.max(AT_REST * self.sub.node_length[0] / self.span.h);
        }
        let groups = self.sub.contacts.len();
        let mut floor = model.options.tolerance_floor * mass * speed;
        if groups > model.options.dense_contacts as usize {
            // The speed that would open or close the touching tolerance in this step (`position_floor`).
            let length = self.sub.node_length.iter().sum::<f64>() / nodes;
            let gap = model.options.touching_tolerance * length;
            floor = floor.max(self.span.opening(gap) * mass);
        }
        let mut options = newton_options(&model.options, groups, floor, false);
        // What the solver leaves must stay clear of what counts as closing (rule R3).
        let closing = self.chosen.iter().map(|&slot| self.closing[slot]);
        let least = closing.fold(f64::INFINITY, f64::min);
        if options.tolerance >= COARSE_TOLERANCE {
            options.closing = closing_left(least, options.tolerance, self.speeds.largest());
        } else if !model.options.is_printed() {
            // The norm of all impulses tells little of a light ball beside a heavy one, and of its joints: Newton's method ends finely at no cost.
            options.missed = (options.tolerance * speed).min(0.1 * least);
        } else if self.speeds.speed > 0.0 {
            options.tolerance = options.tolerance.min(least / (10.0 * self.speeds.speed));
        }
        if self.fineness < 1.0 {
            // From a solution, by Newton's method alone.
            options.tolerance *= self.fineness;
            options.floor *= self.fineness;
            options.max_iterations = FINER_ITERATIONS;
            options.beside = Beside::default();
        }
        if self.softness > 0.0 {
            // What is left over the softness tells solutions apart.
            let finer = (LEAST_TOLERANCE / options.tolerance).min(1.0);
            options.tolerance *= finer;
            options.floor *= finer;
            options.softness = self.softness;
            options.beside = Beside::default();
        }
        options
    }

    /// Solves from a soft solution, and from another start where there is none or nothing is found from it: what was tried is no part of the step.
    fn solve_from(
        &mut self,
        on: &mut On,
        [soft, start]: [Option<&[f64]>; 2],
        mut solve: impl FnMut(&mut Self, &mut On, Option<&[f64]>) -> bool,
    ) -> bool {
        if soft.is_some() {
            let before = on.snapshot();
            if solve(self, on, soft) {
                return true;
            }
            on.restore(before);
        }
        solve(self, on, start)
    }

    /// The impulses of the problem at hand where contacts give way a little, from nothing: of many solutions the least, as equal springs would share it.
    /// Nothing where there is one contact of free bodies, where heaps are swept to a coarse tolerance, or where they were not found.
    fn softly(&mut self, on: &mut On, problem: u32) -> Option<Vec<f64>> {
        let model = on.task.model;
        let many = self.chosen.len() > model.options.dense_contacts as usize;
        let swept = many && self.newton_options(model).tolerance >= COARSE_TOLERANCE;
        // One contact of free bodies has one solution; beside joints it may have many.
        let lone = self.chosen.len() < 2 && self.joints.is_empty();
        if lone || swept {
            return None;
        }
        let accept = std::mem::replace(&mut self.accept_unconverged, false);
        let (stated, mut found) = (self.sub.z0.clone(), None);
        for (stage, softness) in SOFTNESS.into_iter().enumerate() {
            let from: Option<Vec<f64>> = found.clone();
            if let (Some(from), true) = (&from, stage > FIRM) {
                // From there on without what the softness has left: Newton's method alone would go along self-stress.
                for c in self.sub.contacts.iter().filter(|c| !c.bilateral) {
                    for row in c.rows() {
                        self.sub.z0[row] = stated[row] - softness * self.sub.diag[row] * from[row];
                    }
                }
            }
            self.softness = softness;
            let before = on.snapshot();
            if !self.solve_built(on, problem, from.as_deref()) {
                on.restore(before);
                break;
            }
            found = Some(self.lambda.clone());
        }
        (self.softness, self.accept_unconverged) = (0.0, accept);
        self.sub.z0 = stated;
        found
    }

    pub(in crate::impact) fn solve_built(
        &mut self,
        on: &mut On,
        problem: u32,
        warm: Option<&[f64]>,
    ) -> bool {
        let model = on.task.model;
        self.lambda.clear();
        self.lambda.resize(self.sub.rows(), 0.0);
        if let Some(start) = warm {
            self.lambda[..start.len()].copy_from_slice(start);
        }
        self.sub.impulses(&self.lambda, &mut self.force);
        self.sub.apply_inverse_mass(&self.force, &mut self.u);
        let options = self.newton_options(model);
        let [mut lambda, mut u] = [&mut self.lambda, &mut self.u].map(std::mem::take);
        let mut sub = std::mem::take(&mut self.sub);
        let (solve, trial) = (&mut *on.scratch.solve, &mut *on.scratch.trial);
        let newton = &mut solve.newton;
        let result = if self.loads.is_empty() {
            let mut problem = Measured(&self.measured);
            newton.solve(&mut sub, &mut problem, &options, &mut lambda, &mut u)
        } else {
            let clumps = on.scratch.clumps;
            let mut problem =
                self.velocities((model, clumps), &solve.bodies, &solve.node_of, trial);
            newton.solve(&mut sub, &mut problem, &options, &mut lambda, &mut u)
        };
        (self.sub, self.lambda, self.u) = (sub, lambda, u);
        on.report.add_velocity(&result);
        if self.softness == 0.0 {
            on.scratch.history[2].keep_longest(&newton.history, problem, self.chosen.len());
        }
        self.last = result;
        if result.converged {
            return true;
        }
        if self.fineness == 1.0 && self.softness == 0.0 {
            self.keep(on, problem);
        }
        on.report.unconverged += u32::from(self.accept_unconverged);
        self.accept_unconverged
    }

    /// Hands the problem at hand, with what was found, to the keeper.
    #[cold]
    fn keep(&mut self, on: &mut On, index: u32) {
        let (model, scratch) = (on.task.model, &mut *on.scratch);
        let members: Vec<u32> = self.chosen.iter().map(|&slot| self.members[slot]).collect();
        let (mut multiplier, mut correction) = (self.lambda.clone(), self.u.clone());
        if !multiplier.iter().chain(&correction).all(|x| x.is_finite()) {
            multiplier.fill(0.0);
            correction.fill(0.0);
        }
        // On a copy: the step goes on from what its last solve left.
        let mut system = self.sub.clone();
        let mut measures = vec![0.0; system.rows()];
        if self.loads.is_empty() {
            Measured(&self.measured).write(&system, &correction, &mut measures);
        } else {
            let solve = &*scratch.solve;
            self.velocities(
                (model, scratch.clumps),
                &solve.bodies,
                &solve.node_of,
                scratch.trial,
            )
            .evaluate(&mut system, &correction, &mut measures);
        }
        scratch.keeper.keep(&Solve {
            model,
            contacts: scratch.contacts,
            clumps: scratch.clumps,
            members: &members,
            spheres: &scratch.solve.bodies,
            system: &system,
            measures: &measures,
            multiplier: &multiplier,
            correction: &correction,
            motion: &self.velocity,
            level: Level::Velocity,
            index,
            report: self.last,
            attempts: &scratch.solve.newton.attempts,
            worst: worst_group(&self.sub, scratch.solve.newton.residual_rows()),
        });
    }

    /// The problem at hand where loads depend on the velocities.
    fn velocities<'a>(
        &'a self,
        (model, clumps): (&'a Model, &'a Clumps),
        bodies: &'a [u32],
        node_of: &'a [u32],
        trial: &'a mut Trial,
    ) -> CoupledVelocities<'a> {
        CoupledVelocities {
            model,
            clumps,
            loads: &self.loads,
            bodies,
            node_of,
            trial,
            span: self.span,
            before: &self.velocity,
            base: &self.load_base,
            measured: &self.measured,
            known: &self.load_impulse,
        }
    }
}
