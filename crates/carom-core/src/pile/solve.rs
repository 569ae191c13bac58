//! One impact problem of the whole pile: sweeps over the chosen contacts.

use super::closed_contact::{ClosedContact, Frame};
use super::problem_data::{self, Stated};
use super::{chunks, roll};
use crate::impact::compliant::{impulses, spring};
use crate::impact::course::Courses;
use crate::impact::law::{expansion, Law};
use crate::model::Model;
use crate::pile::limits::{budget, finer, tolerance, worst, PATIENCE};
use crate::pile::memory::Pile;
use crate::report::StepReport;
use crate::rows::halves;
use crate::workspace::On;
use carom_solve::problem::Problem;
use carom_solve::solver::{split, SPLIT_CONTACTS};
use carom_solve::spheres::{self, Goal, Progress};
use carom_solve::team;
use glam::DVec3;

/// Sweeps after which impulses are scaled chunk by chunk: what takes fewer has little to tell from one end of the pile to the other. Without
/// it impulses of 64 000 grains were up to 70 % too large throughout, and lifted the pile by 2.9e-5 of its energy in a step.
const RESCALE_SWEEPS: usize = 30;

impl Pile {
    /// Solves the chosen contacts from `start` with all present impulses fixed.
    pub(super) fn solve_chosen(&mut self, on: &mut On, law: Law, problem: u32) -> Option<()> {
        let memory = &self.velocity;
        let (bodies, places) = (&self.bodies, &self.places);
        (self.problem_nodes).take(&memory.closed, &memory.chosen, bodies, places);
        self.scales.clear();
        self.law = law;
        self.frame = match problem {
            0 => Frame::of_loads(&on.task.model.options),
            _ => Frame::End,
        };
        self.write(on, law);
        self.load_sweeps().ok()?;
        if law == Law::Expansion {
            let memory = &self.velocity;
            let least = memory.chosen.iter();
            let least = least.map(|&slot| memory.closed[slot as usize].expansion.1);
            self.sweeps.set_least(&least.collect::<Vec<_>>());
        }
        self.forget_contacts();
        let goal = self.goal(on.task.model, problem);
        let before = *on.report;
        let mut progress = self.settle(on, &goal);
        self.take_solution();
        if problem <= 1 {
            if let Some(held) = self.at_rest(on, &goal, &progress) {
                // What else was found is no part of the step.
                *on.report = before;
                on.report.fallbacks += u32::from(!progress.converged);
                on.report.residual_velocity = on.report.residual_velocity.max(held.residual);
                progress = held;
            }
        }
        // The files of problems know no least impulses.
        if law != Law::Expansion {
            self.keep_velocity(on, problem, &progress);
        }
        self.explain(on);
        self.take(&progress, on.report)
    }

    /// Solves the compression of Poisson's law on them, and keeps what their expansion has; whether any has restitution.
    pub(super) fn compress(&mut self, on: &mut On) -> Option<bool> {
        let model = on.task.model;
        let (bodies, places) = (&self.bodies, &self.places);
        (self.problem_nodes).take(&self.velocity.closed, &self.velocity.chosen, bodies, places);
        (self.law, self.frame) = (Law::Compression, Frame::End);
        self.write(on, self.law);
        self.start_nothing();
        self.load_sweeps().ok()?;
        self.forget_contacts();
        let progress = self.settle(on, &self.goal(model, 1));
        self.take_solution();
        let (memory, bodies) = (&mut self.velocity, &self.bodies);
        let mut expands = false;
        for (&slot, r) in memory.chosen.iter().zip(&self.impulses) {
            let (m, r) = (&mut memory.closed[slot as usize], DVec3::from(*r));
            let inverse = m.inverse_masses(bodies);
            let normal = r.dot(m.normal);
            let [least, across] = expansion(
                &model.laws[m.law as usize],
                normal,
                inverse[0],
                &model.options,
            );
            m.expansion = (across * inverse[1] * (r - normal * m.normal), least);
            expands |= least > 0.0;
        }
        self.forget_solution();
        self.take(&progress, on.report).map(|()| expands)
    }

    /// Lets springs press the chosen contacts from the velocities of t_n on.
    pub(super) fn press(&mut self, on: &mut On) -> bool {
        let model = on.task.model;
        let (memory, bodies) = (&self.velocity, &self.bodies);
        (self.problem_nodes).take(&memory.closed, &memory.chosen, bodies, &self.places);
        self.scales.clear();
        (self.law, self.frame) = (Law::Springs, Frame::End);
        let stated = memory.chosen.iter().map(|&slot| {
            let m = &memory.closed[slot as usize];
            Stated::of(m, memory.before(m), DVec3::ZERO, [DVec3::ZERO; 2])
        });
        let stated: Vec<Stated> = stated.collect();
        let (rows, framed, _) = problem_data::rows(on, bodies, &stated);
        let springs: Vec<_> = framed.iter().map(|c| spring(model, c)).collect();
        let mut courses = Courses::new(model.courses);
        let Some((lambda, is_cut)) = impulses(&rows, &springs, &model.options, &mut courses) else {
            return false;
        };
        on.report.truncated += u32::from(is_cut);
        let courses = courses.of_contacts();
        let memory = &mut self.velocity;
        let of_slots = courses.map(|(at, course)| (memory.chosen[at], course));
        memory.table.courses.extend(of_slots);
        let (mut force, mut u) = (vec![0.0; 6 * bodies.len()], vec![0.0; 6 * bodies.len()]);
        rows.impulses(&lambda, &mut force);
        rows.apply_inverse_mass(&force, &mut u);
        self.impulses.clear();
        for (row, c) in rows.contacts.iter().zip(&framed) {
            let mut packed = [0.0; 6];
            packed[..row.dim as usize].copy_from_slice(&lambda[row.rows()]);
            let impulse = c.to_world(c.n1, &packed).impulse;
            self.impulses.push(impulse.to_array());
        }
        self.corrections = u
            .chunks_exact(6)
            .map(|u| std::array::from_fn(|k| u[k]))
            .collect();
        self.moments.clear();
        if !self.velocity.turning.is_empty() {
            self.moments.resize(self.impulses.len(), [0.0; 3]);
        }
        self.explained.clear();
        self.explained.resize(self.impulses.len(), 0.0);
        true
    }

    /// Solves them once more from nothing, without restitution.
    pub(super) fn solve_without_restitution(&mut self, on: &mut On, problem: u32) -> Option<()> {
        self.write(on, Law::Plastic);
        self.start_nothing();
        self.load_sweeps().ok()?;
        self.forget_contacts();
        let progress = self.settle(on, &self.goal(on.task.model, problem));
        self.take_solution();
        self.take(&progress, on.report)
    }

    /// Sweeps on to a finer solution of the problem at hand.
    pub(super) fn solve_finely(&mut self, on: &mut On, problem: u32) {
        let goal = finer(&self.goal(on.task.model, problem));
        let progress = self.sweeps.settle(&goal);
        on.report.sweeps_velocity += progress.sweeps as u32;
        self.take_solution();
        self.explain(on);
    }

    /// Whether what was found is taken, solved or not.
    fn take(&self, progress: &Progress, report: &mut StepReport) -> Option<()> {
        let taken = progress.converged || self.accept;
        report.unconverged += u32::from(taken && !progress.converged);
        taken.then_some(())
    }

    fn goal(&self, model: &Model, problem: u32) -> Goal {
        let o = &model.options;
        Goal {
            tolerance: tolerance(model),
            floor: self.velocity.floor,
            scale: self.velocity.terms,
            closing: self.velocity.left(o),
            worst: if o.impact.has_loads_first() {
                worst(self.velocity.chosen.len())
            } else {
                // No problem follows that takes what is left.
                1.0
            },
            penalty_scale: o.penalty_scale,
            patience: PATIENCE,
            most: budget(self.velocity.chosen.len()),
            had: 0,
            rescale: RESCALE_SWEEPS,
            weighed: problem == 0,
            calm: 1.0,
        }
    }

    /// Sweeps; where these fail, alternating directions, and their convex companion if the step may take it.
    fn settle(&mut self, on: &mut On, goal: &Goal) -> Progress {
        let mut progress = self.sweeps.settle(goal);
        let mut sweeps = progress.sweeps;
        if !progress.converged && self.law != Law::Expansion {
            if let Some(found) = self.split(on, goal) {
                on.report.fallbacks += 1;
                sweeps += found.sweeps;
                progress = found;
            }
        }
        if !progress.converged && self.companion && self.law != Law::Expansion {
            progress = self.sweeps.settle_companion(goal);
            sweeps += progress.sweeps;
            on.report.fallbacks += 1;
        }
        let report = &mut *on.report;
        progress.sweeps = sweeps;
        report.sweeps_velocity += progress.sweeps as u32;
        report.residual_velocity = report.residual_velocity.max(progress.residual);
        report.fallbacks += u32::from(progress.lenient);
        progress
    }

    /// Solves the problem at hand by alternating directions ([`split`]) and sweeps, from the impulses that sweeps have left. Nothing, and the sweeps
    /// as they were: it is too large, or not solved so either.
    fn split(&mut self, on: &On, goal: &Goal) -> Option<Progress> {
        if self.contacts.is_empty() || self.contacts.len() > SPLIT_CONTACTS {
            return None;
        }
        self.take_solution();
        let stated = self.stated(&self.impulses, &self.moments);
        let (rows, framed, mut lambda) = problem_data::rows(on, &self.bodies, &stated);
        let problem = Problem::from_rows(&rows, &rows.z0);
        split(&problem, goal.tolerance, &mut lambda);
        let before = (self.impulses.clone(), self.moments.clone());
        self.start_from_rows(&rows, &framed, &lambda);
        if self.load_sweeps().is_ok() {
            let found = self.sweeps.settle(goal);
            if found.converged {
                return Some(found);
            }
        }
        (self.start, self.start_moments) = before;
        self.load_sweeps().ok()?;
        None
    }

    /// The chosen contacts as spheres.
    pub(super) fn write(&mut self, on: &On, law: Law) {
        let (model, contacts) = (on.task.model, &*on.scratch.contacts);
        let (memory, frame) = (&self.velocity, self.frame);
        let (threads, part) = (self.sweeps.threads, &self.problem_nodes);
        chunks::refill(threads, &mut self.contacts, memory.chosen.len(), |k| {
            let m = &memory.closed[memory.chosen[k] as usize];
            let (m, slip) = memory.state(model, contacts, m, law, frame);
            spheres::Contact {
                a: part.number(m.a),
                b: part.number(m.b),
                normal: m.normal.to_array(),
                slip: slip.to_array(),
                friction: m.friction,
            }
        });
        self.rolls.clear();
        if !memory.turning.is_empty() {
            self.rolls.extend(memory.chosen.iter().map(|&slot| {
                let turning = &memory.turning[slot as usize];
                let stated = frame.state(contacts, &memory.closed[slot as usize]);
                turning.stated(memory.state_turn(slot, &stated))
            }));
        }
    }

    /// Adds the impulses of the solve at hand, and their work, to the totals; `once`: the loads of the step are solved once.
    pub(super) fn commit(&mut self, on: &On, problem: u32, once: bool) {
        let contacts = &*on.scratch.contacts;
        let (threads, frame) = (self.sweeps.threads, self.frame);
        let (impulses, moments, u) = (&self.impulses, &self.moments, &self.corrections);
        let scale = |m: &ClosedContact| self.scales.get(m.a as usize).copied().unwrap_or(1.0);
        let memory = &mut self.velocity;
        for (&slot, explained) in memory.chosen.iter().zip(&self.explained) {
            memory.closed[slot as usize].explained += explained;
        }
        if memory.table.wanted || !moments.is_empty() {
            for (k, r) in impulses.iter().enumerate() {
                let slot = memory.chosen[k];
                let r = DVec3::from(*r);
                let end = memory.closed[slot as usize];
                let m = frame.state(contacts, &end);
                let given = match frame {
                    Frame::End => memory.given(&m, r, u, scale(&m)),
                    Frame::Middle => memory.loaded(&m, &end, r, u, scale(&m)),
                };
                let turned = moments.get(k).map(|&moment| DVec3::from(moment));
                let moment = turned.unwrap_or_default();
                memory.tell(slot, problem, moment, &given);
                let hits = memory.closed[slot as usize].add(problem, &given, once);
                if let Some(moment) = turned {
                    let change = roll::change(&m, u);
                    let done = memory.turning_work(slot, m.normal, moment, change);
                    memory.turning[slot as usize].add(moment, done, hits);
                }
            }
        } else {
            let mut closed = std::mem::take(&mut memory.closed);
            let parts = chunks::cut(&memory.chosen, &mut closed);
            team::map(threads, parts, |mut share| {
                for (k, &slot) in (share.first..).zip(share.list) {
                    let m = share.item(slot);
                    let r = DVec3::from(impulses[k]);
                    let given = match frame {
                        Frame::End => memory.given(m, r, u, scale(m)),
                        Frame::Middle => {
                            memory.loaded(&frame.state(contacts, m), m, r, u, scale(m))
                        }
                    };
                    m.add(problem, &given, once);
                }
            });
            memory.closed = closed;
        }
        for node in self.problem_nodes.nodes(self.bodies.len()) {
            let (jump, [v, w]) = (&mut memory.jump[node as usize], halves(&u[node as usize]));
            jump[0] += v;
            jump[1] += w;
        }
        // Stage 1 replaces part of stage 0: the larger of both is what later problems add to.
        memory.terms = memory.terms.max(memory.total(&self.bodies, threads));
        self.forget_solution();
    }
}
