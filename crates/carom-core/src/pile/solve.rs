//! One impact problem of the whole pile: sweeps over the chosen contacts, and rule R4 on what they find.

use super::closed_contact::{change, work};
use super::{chunks, roll};
use crate::contact::Contact;
use crate::impact::bisect::GAIN_TOLERANCE;
use crate::impact::law::Law;
use crate::model::Model;
use crate::pile::limits::{budget, worst, CLOSING_LEFT, GAIN_SHARE, PATIENCE};
use crate::pile::memory::Pile;
use crate::report::StepReport;
use carom_solve::clusters::{apart, Forest};
use carom_solve::rows::WORLD;
use carom_solve::spheres::{self, Goal, Progress};
use carom_solve::team;
use glam::DVec3;

/// Bisections of the restitution scale: it is found to 2^-6. Fewer lose as much restitution where a group gains; more cost a solve of the pile each.
const BISECTIONS: u32 = 6;

/// Sweeps after which impulses are scaled chunk by chunk: what takes fewer has little to tell from one end of the pile to the other. Without
/// it impulses of 64 000 grains were up to 70 % too large throughout, and lifted the pile by 2.9e-5 of its energy in a step.
const RESCALE_SWEEPS: usize = 30;

/// Share of its energy that rule R4 lets a group gain.
fn admitted(goal: &Goal) -> f64 {
    GAIN_TOLERANCE.max(GAIN_SHARE * goal.tolerance)
}

impl Pile {
    /// Solves the chosen contacts from `start` with all present impulses fixed and adds the new ones.
    pub(super) fn solve_chosen(
        &mut self,
        model: &Model,
        contacts: &[Contact],
        law: Law,
        problem: u32,
        report: &mut StepReport,
    ) -> Option<()> {
        let memory = &self.velocity;
        let (bodies, places) = (&self.bodies, &self.places);
        (self.problem_nodes).take(&memory.closed, &memory.chosen, bodies, places);
        let scale = vec![1.0; memory.chosen.len()];
        self.write(model, law, &scale);
        self.load_sweeps().ok()?;
        let most = budget(self.contacts.len());
        self.forget_contacts();
        let o = &model.options;
        // What a sequence that was cut short leaves is no load: the next step has it as an impact. And in a pile that is being hit the
        // loads are solved before its impacts, which come in every step: what still closes then joins them. (A pile that settles has no
        // such impacts, and never came to rest.)
        let end = match problem {
            0 if self.velocity.hit => 1.0 / CLOSING_LEFT,
            0 | 1 => 1.0,
            _ => worst(self.velocity.chosen.len()),
        };
        let goal = Goal {
            tolerance: o.tolerance.max(o.pile_tolerance),
            floor: self.velocity.floor,
            scale: self.velocity.terms,
            closing: end * self.velocity.left(o),
            penalty_scale: o.penalty_scale,
            patience: PATIENCE,
            most,
            had: 0,
            rescale: RESCALE_SWEEPS,
            weighed: problem == 0,
            calm: 1.0,
        };
        let before = *report;
        let mut progress = self.settle(&goal, report);
        self.take_solution();
        if problem <= 1 {
            if let Some(held) = self.at_rest(model, contacts, law, &goal, &progress) {
                // What else was found is no part of the step.
                *report = before;
                report.fallbacks += u32::from(!progress.converged);
                progress = held;
                report.residual_velocity = report.residual_velocity.max(held.residual);
            }
        }
        if !progress.converged && !self.accept {
            self.keep_velocity(model, contacts, (law, &scale), problem, &progress);
            return None;
        }
        let scale = if law == Law::First && o.energy_safeguard {
            self.safeguard(model, law, scale, &goal, &mut progress, report)?
        } else {
            scale
        };
        report.unconverged += u32::from(!progress.converged);
        self.keep_velocity(model, contacts, (law, &scale), problem, &progress);
        self.commit(problem, &scale);
        Some(())
    }

    fn settle(&mut self, goal: &Goal, report: &mut StepReport) -> Progress {
        let progress = self.sweeps.settle(goal);
        report.sweeps_velocity += progress.sweeps as u32;
        report.residual_velocity = report.residual_velocity.max(progress.residual);
        report.fallbacks += u32::from(progress.lenient);
        progress
    }

    /// The chosen contacts as spheres.
    pub(super) fn write(&mut self, model: &Model, law: Law, scale: &[f64]) {
        let memory = &self.velocity;
        let (threads, part) = (self.sweeps.threads, &self.problem_nodes);
        chunks::refill(threads, &mut self.contacts, memory.chosen.len(), |k| {
            let m = &memory.closed[memory.chosen[k] as usize];
            spheres::Contact {
                a: part.number(m.a),
                b: part.number(m.b),
                normal: m.normal.to_array(),
                slip: memory.measures(model, m, law, scale[k]).to_array(),
                friction: m.friction,
            }
        });
        self.rolls.clear();
        if !memory.turning.is_empty() {
            self.rolls.extend(memory.chosen.iter().map(|&slot| {
                let turning = &memory.turning[slot as usize];
                turning.stated(memory.turn(slot))
            }));
        }
    }

    /// Rule R4: scales restitution in groups of contacts with impulse whose work is positive. All such groups are bisected at once,
    /// each trial one solve from where the last one ended.
    fn safeguard(
        &mut self,
        model: &Model,
        law: Law,
        scale: Vec<f64>,
        goal: &Goal,
        progress: &mut Progress,
        report: &mut StepReport,
    ) -> Option<Vec<f64>> {
        let groups = self.gaining(goal);
        if groups.is_empty() {
            return Some(scale);
        }
        // Groups as they were found: what wakes between them joins none.
        let member_of = self.velocity.group.clone();
        let mut bounds: std::collections::BTreeMap<u32, [f64; 2]> =
            groups.iter().map(|&g| (g, [0.0, 1.0])).collect();
        let factor = |bounds: &std::collections::BTreeMap<u32, [f64; 2]>,
                      at: fn(&[f64; 2]) -> f64| {
            member_of
                .iter()
                .map(|g| bounds.get(g).map_or(1.0, at))
                .collect::<Vec<f64>>()
        };
        for _ in 0..BISECTIONS {
            let trial = factor(&bounds, |b| 0.5 * (b[0] + b[1]));
            self.write(model, law, &trial);
            self.sweeps.set_contacts(&self.contacts).ok()?;
            // A trial is no part of the step: its counts are its own, and one that fails admits nothing.
            let trial = self.settle(goal, &mut StepReport::default());
            self.take_solution();
            let gaining = self.gains_by(&member_of, admitted(goal));
            for (group, [low, high]) in &mut bounds {
                let middle = 0.5 * (*low + *high);
                if !trial.converged || gaining.binary_search(group).is_ok() {
                    *high = middle;
                } else {
                    *low = middle;
                }
            }
        }
        let mut found = factor(&bounds, |b| b[0]);
        self.write(model, law, &found);
        self.sweeps.set_contacts(&self.contacts).ok()?;
        *progress = self.settle(goal, report);
        self.take_solution();
        // From where the trials ended sweeps may come upon another solution than the one that was looked at: forces that hold one another,
        // beyond what the tolerance tells of the others. From nothing, then; and without restitution.
        for scale in [1.0, 0.0] {
            if self.gains_by(&member_of, goal.tolerance).is_empty() {
                break;
            }
            for (s, group) in found.iter_mut().zip(&member_of) {
                *s *= if bounds.contains_key(group) {
                    scale
                } else {
                    1.0
                };
            }
            report.fallbacks += 1;
            self.write(model, law, &found);
            self.start_nothing();
            self.load_sweeps().ok()?;
            *progress = self.settle(goal, report);
            self.take_solution();
        }
        if !progress.converged && !self.accept {
            return None;
        }
        Some(found)
    }

    /// Groups of chosen contacts joined by spheres and impulses, whose problem gains energy; ascending.
    fn gaining(&mut self, goal: &Goal) -> Vec<u32> {
        let (part, impulses) = (&self.problem_nodes, &self.impulses);
        let (bodies, _) = part.of(&self.bodies, &self.places);
        let mut joined = apart(bodies.len());
        let memory = &mut self.velocity;
        for (&slot, r) in memory.chosen.iter().zip(impulses) {
            let m = &memory.closed[slot as usize];
            if m.b != WORLD && *r != [0.0; 3] {
                joined.join(part.number(m.a), part.number(m.b));
            }
        }
        memory.group.clear();
        for (&slot, r) in memory.chosen.iter().zip(impulses) {
            let m = &memory.closed[slot as usize];
            let group = if *r == [0.0; 3] {
                u32::MAX
            } else {
                joined.root(part.number(m.a))
            };
            memory.group.push(group);
        }
        let groups = memory.group.clone();
        self.gains_by(&groups, admitted(goal))
    }

    /// Of the given groups those whose present solution does more work than `most` of their energy; ascending.
    fn gains_by(&self, groups: &[u32], most: f64) -> Vec<u32> {
        let (memory, part, u) = (&self.velocity, &self.problem_nodes, &self.corrections);
        let (bodies, _) = part.of(&self.bodies, &self.places);
        // Of the chosen contacts; none where nothing rolls.
        let moments = self.moments();
        let mut sums = vec![[0.0f64; 2]; bodies.len()];
        let mut seen = vec![false; bodies.len()];
        let chosen = memory.chosen.iter().zip(&self.impulses).zip(groups);
        for (k, ((&slot, r), &group)) in chosen.enumerate() {
            if group == u32::MAX {
                continue;
            }
            let m = &memory.closed[slot as usize];
            let before = memory.now(m);
            let after = before + change(m, u);
            let [normal, across] = work(m.normal, DVec3::from(*r), before, after);
            sums[group as usize][0] += normal + across;
            if let Some(&moment) = moments.get(k) {
                let change = roll::change(m, u);
                let [rolling, spinning] = memory.turning_work(slot, DVec3::from(moment), change);
                sums[group as usize][0] += rolling + spinning;
            }
            for node in [m.a, m.b] {
                let number = part.number(node) as usize;
                if node == WORLD || std::mem::replace(&mut seen[number], true) {
                    continue;
                }
                let body = &self.bodies[node as usize];
                let ([v, w], [jv, jw]) = (memory.check[node as usize], memory.jump[node as usize]);
                sums[group as usize][1] += 0.5
                    * ((v + jv).length_squared() / body.inv_mass
                        + (w + jw).length_squared() / body.inv_inertia);
            }
        }
        (0..sums.len() as u32)
            .filter(|&g| {
                let [work, kinetic] = sums[g as usize];
                work > most * kinetic
            })
            .collect()
    }

    /// Moments of the solve at hand; none where nothing rolls.
    pub(super) fn moments(&self) -> Vec<[f64; 3]> {
        if self.velocity.turning.is_empty() {
            return Vec::new();
        }
        self.sweeps.moments()
    }

    /// Adds the impulses of the solve at hand, and their work, to the totals.
    fn commit(&mut self, problem: u32, scale: &[f64]) {
        let moments = self.moments();
        let threads = self.sweeps.threads;
        let (impulses, u) = (&self.impulses, &self.corrections);
        let memory = &mut self.velocity;
        if memory.table.wanted || !moments.is_empty() {
            for (k, (r, &scale)) in impulses.iter().zip(scale).enumerate() {
                let slot = memory.chosen[k];
                let r = DVec3::from(*r);
                let m = memory.closed[slot as usize];
                let given = memory.given(&m, r, u, scale);
                let turned = moments.get(k).map(|&moment| DVec3::from(moment));
                let moment = turned.unwrap_or_default();
                memory.tell(slot, problem, moment, &given);
                let hits = memory.closed[slot as usize].add(problem, &given, memory.tol);
                if let Some(moment) = turned {
                    let change = roll::change(&m, u);
                    let done = memory.turning_work(slot, moment, change);
                    memory.turning[slot as usize].add(moment, done, hits);
                }
            }
        } else {
            let mut closed = std::mem::take(&mut memory.closed);
            let parts = chunks::cut(&memory.chosen, &mut closed);
            team::map(threads, parts, |mut share| {
                for (k, &slot) in (share.first..).zip(share.list) {
                    let m = share.item(slot);
                    let given = memory.given(m, DVec3::from(impulses[k]), u, scale[k]);
                    m.add(problem, &given, memory.tol);
                }
            });
            memory.closed = closed;
        }
        for node in self.problem_nodes.nodes(self.bodies.len()) {
            let (jump, u) = (&mut memory.jump[node as usize], &u[node as usize]);
            jump[0] += DVec3::new(u[0], u[1], u[2]);
            jump[1] += DVec3::new(u[3], u[4], u[5]);
        }
        // Stage 1 replaces part of stage 0: the larger of both is what later problems add to.
        memory.terms = memory.terms.max(memory.total(&self.bodies, threads));
        self.forget_solution();
    }
}
