//! Impact problems after the first (rule 26): strictly closing contacts alone, which fall apart into clusters.
//!
//! A problem looks only at the contacts of spheres that the problem before has moved, so that a cascade costs what it moves. It is
//! the same sequence as in small islands: all closing contacts of a problem at the same time, then the next problem.

mod batch;
mod cluster_copies;
mod cluster_solver;
mod clusters;
mod contact_graph;
pub(super) mod memory;

use super::{chunks, problem_data};
use crate::impact::law::Law;
use crate::model::Model;
use crate::options::Problems;
use crate::pile::memory::Pile;
use crate::pile::velocities::Velocities;
use crate::rows::flat;
use crate::workspace::On;
use batch::{Batch, View};
use carom_solve::team::{self, lock};
use clusters::Clusters;
use contact_graph::{ContactGraph, Slots};
use glam::DVec3;
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// Contacts of the first problem for which another thread is worth while. Speed alone: fewer, and threads wait for one another.
const PER_THREAD: usize = 256;
/// Batches for each thread. Speed alone: enough that the last ones end at about the same time.
const BATCHES_PER_THREAD: usize = 4;

/// A cascade does not die out where as many contacts as this, in the mean of [`MEAN_OF_PROBLEMS`], close that closed before. (Contacts that close for
/// the first time are a blow on its way through the pile: it ends at the other side.) Too few: impacts that would have died out end in one collective impact.
/// Too many: in piles that are hit everywhere a third of the step goes into sequences that are cut all the same.
const LASTING_CONTACTS: usize = 500;
/// And no fewer than this share (1) of those when it was half as long. Smaller: cascades that die out slowly are cut; larger: none is asked.
const LASTING_SHARE: f64 = 0.95;
/// Problems over which both are averaged: between layers of a lattice every other problem is the larger one, and one alone would mislead.
const MEAN_OF_PROBLEMS: usize = 4;
/// Part of `max_problems`, where it is given, from which on a cascade is asked whether it dies out: at 3 after a third of them. Larger: sequences are
/// cut that would have ended; 1: those that go on are paid for in full.
const EARLY_PART: u32 = 3;
/// Contacts solved for each contact of the island from which on it is asked. Four times as many make 8000 falling grains take 1.5
/// times as long; half as many cut sequences that would have ended.
const EARLY_WORK: u64 = 6;

/// A cascade on its way: what all threads read while they solve and look, and one writes in between.
struct Cascade<'a, 'r, 's> {
    pile: &'a mut Pile,
    on: &'a mut On<'r, 's>,
    graph: ContactGraph,
    clusters: Clusters,
    chosen: Vec<u32>,
    firsts: Vec<usize>,
    again: Vec<usize>,
    bounds: Problems,
    /// Contacts solved so far.
    solved: u64,
    /// Before the problem at hand, where it is kept.
    before: Option<Before>,
    /// The last problem, and whether nothing closes after it.
    outcome: Option<(u32, bool)>,
}

impl Pile {
    /// Problems 2, 3, ... until nothing closes: the number of the last one, and whether nothing closes (otherwise the bound of the
    /// sequence was reached, or would be, or a cluster could not be solved: a fallback).
    pub(super) fn cascade(&mut self, on: &mut On) -> (u32, bool) {
        let o = &on.task.model.options;
        let (velocity, all_threads) = (&self.velocity, self.sweeps.threads);
        let mut closes = Vec::new();
        chunks::refill(all_threads, &mut closes, velocity.closed.len(), |slot| {
            let m = &velocity.closed[slot];
            velocity.normal_speed(m) < -m.closing
        });
        let all = 0..velocity.closed.len() as u32;
        let first: Vec<u32> = all.filter(|&slot| closes[slot as usize]).collect();
        let bounds = o.problems(velocity.closed.len());
        if first.is_empty() || bounds.most < 2 {
            return (1, first.is_empty());
        }
        let mut memory = std::mem::take(&mut self.cascade);
        (memory.graph).open(&self.velocity, &self.bodies, all_threads);
        memory.clusters.open(self.bodies.len());
        let threads = (o.threads as usize).min(first.len() / PER_THREAD).max(1);
        let tasks = threads * BATCHES_PER_THREAD;
        memory.batches.resize_with(tasks, Mutex::default);
        memory.closing.resize_with(threads, Mutex::default);
        let mut cascade = Cascade {
            pile: self,
            on,
            graph: memory.graph,
            clusters: memory.clusters,
            chosen: first,
            firsts: memory.firsts,
            again: memory.again,
            bounds,
            solved: 0,
            before: None,
            outcome: None,
        };
        cascade.again.clear();
        cascade.cut(2, tasks);
        let shared = RwLock::new(cascade);
        // A problem: batches of clusters, what they gave, shares of the moved spheres, the next problem.
        let stages = [
            0,
            tasks,
            tasks + 1,
            tasks + 1 + threads,
            tasks + 2 + threads,
        ];
        let work = |round: usize, task: usize| {
            let problem = round as u32 + 2;
            if task < tasks {
                read(&shared).solve(&mut lock(&memory.batches[task]), task);
            } else if task == tasks {
                write(&shared).apply(&memory.batches, problem);
            } else if task < stages[3] {
                let share = (task - stages[2], threads);
                read(&shared).look(&mut lock(&memory.closing[share.0]), share);
            } else {
                write(&shared).go_on(&memory.closing, problem, tasks);
            }
        };
        let done = |_| read(&shared).outcome.is_some();
        team::run_until(threads, bounds.most as usize - 1, &stages, work, done);
        let cascade = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        let outcome = cascade.outcome.unwrap_or((bounds.most, false));
        (memory.graph, memory.clusters) = (cascade.graph, cascade.clusters);
        (memory.chosen, memory.firsts) = (cascade.chosen, cascade.firsts);
        memory.again = cascade.again;
        memory.graph.hand_over(&mut self.velocity, &self.bodies);
        self.cascade = memory;
        outcome
    }
}

impl Cascade<'_, '_, '_> {
    /// Cuts the chosen contacts into clusters, and these into batches.
    fn cut(&mut self, problem: u32, batches: usize) {
        if self.on.scratch.keeper.wants(1) {
            self.show();
            self.before = Some(
                self.pile
                    .velocity
                    .state_of(self.on.task.model, &self.chosen),
            );
        }
        self.solved += self.chosen.len() as u64;
        self.clusters.cut(&mut self.graph, &self.chosen, problem);
        self.clusters.batches(batches, &mut self.firsts);
    }

    #[cold]
    fn show(&mut self) {
        let Pile {
            velocity, bodies, ..
        } = &mut *self.pile;
        self.graph.show(velocity, bodies);
    }

    /// Solves the clusters of a batch.
    fn solve(&self, batch: &mut Batch, number: usize) {
        let range = match self.firsts.get(number..number + 2) {
            Some(&[from, to]) => from..to,
            _ => 0..0,
        };
        let view = View {
            model: self.on.task.model,
            velocity: &self.pile.velocity,
            bodies: &self.pile.bodies,
            graph: &self.graph,
            clusters: &self.clusters,
        };
        batch.solve(&view, range);
    }

    /// Adds what the batches gave.
    fn apply(&mut self, batches: &[Mutex<Batch>], problem: u32) {
        let (mut pushed, mut failed) = (false, 0);
        let (mut slots, mut nodes) = (self.clusters.slots.iter(), self.clusters.nodes.iter());
        let velocity = &mut self.pile.velocity;
        for batch in batches {
            let batch = lock(batch);
            let report = &mut *self.on.report;
            report.residual_velocity = report.residual_velocity.max(batch.residual);
            pushed |= batch.pushed;
            failed += batch.failed;
            for (k, given) in batch.given.iter().enumerate() {
                let Some(&slot) = slots.next() else { break };
                self.graph.add(slot, problem, given);
                let mut moment = DVec3::ZERO;
                if let Some(&(m, work)) = batch.turned.get(k) {
                    moment = m;
                    let hits = given.impulse != DVec3::ZERO;
                    velocity.turning[slot as usize].add(moment, work, hits);
                }
                velocity.tell(slot, problem, moment, given);
            }
            for change in &batch.moved {
                let Some(&node) = nodes.next() else { break };
                self.graph.linear[node as usize] += change[0];
                self.graph.spheres[node as usize].surface += change[1];
            }
        }
        if let Some(before) = self.before.take() {
            self.show();
            (self.pile).keep_round(self.on, problem, &self.chosen, before);
        }
        // What is not solved here, and what goes nowhere, ends the sequence.
        if failed > 0 || !pushed {
            self.on.report.fallbacks += u32::from(failed > 0);
            self.outcome = Some((problem, false));
        }
    }

    /// Marks the contacts of moved spheres that close.
    fn look(&self, closing: &mut Slots, (share, of): (usize, usize)) {
        closing.clear(self.graph.ends.len());
        let moved = &self.clusters.nodes;
        let bound = |k: usize| k * moved.len() / of;
        let moved = &moved[bound(share)..bound(share + 1)];
        self.graph.mark_closing(moved, closing);
    }

    /// The next problem, if anything closes.
    fn go_on(&mut self, closing: &[Mutex<Slots>], problem: u32, batches: usize) {
        if self.outcome.is_some() {
            return;
        }
        let mut all = lock(&closing[0]);
        for other in &closing[1..] {
            all.join(&lock(other));
        }
        all.drain(&mut self.chosen);
        let closed = &self.pile.velocity.closed;
        let again =
            |&&slot: &&u32| closed[slot as usize].problem != 0 || self.graph.has_closed(slot);
        let again = self.chosen.iter().filter(again).count();
        self.again.push(again);
        if self.chosen.is_empty() {
            self.outcome = Some((problem, true));
        } else if (problem >= self.bounds.most / EARLY_PART
            || self.solved >= EARLY_WORK * closed.len() as u64)
            && lasts(&self.again)
            || self.solved + self.chosen.len() as u64 > self.bounds.work
        {
            self.outcome = Some((problem, false));
        } else if problem < self.bounds.most {
            self.cut(problem + 1, batches);
        }
    }
}

/// Whether a cascade goes on and on in which so many contacts closed again, problem by problem.
fn lasts(again: &[usize]) -> bool {
    let ending_at = |end: usize| -> usize { again[end - MEAN_OF_PROBLEMS..end].iter().sum() };
    if again.len() < 2 * MEAN_OF_PROBLEMS {
        return false;
    }
    let (now, half) = (ending_at(again.len()), ending_at(again.len().div_ceil(2)));
    now >= MEAN_OF_PROBLEMS * LASTING_CONTACTS && now as f64 >= LASTING_SHARE * half as f64
}

/// Locks that the stages of a cascade never wait for.
fn read<T>(shared: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    shared.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(shared: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    shared.write().unwrap_or_else(PoisonError::into_inner)
}

/// Velocities, jumps and impulses before a problem of the cascade, and the measures of its contacts.
struct Before {
    motion: Vec<[DVec3; 2]>,
    jump: Vec<[DVec3; 2]>,
    impulse: Vec<DVec3>,
    slip: Vec<DVec3>,
    /// Relative angular velocities and moments, where something rolls.
    turn: Vec<[DVec3; 2]>,
}

impl Velocities {
    #[cold]
    fn state_of(&self, model: &Model, chosen: &[u32]) -> Before {
        let contacts = || chosen.iter().map(|&slot| &self.closed[slot as usize]);
        Before {
            motion: self.velocities(),
            jump: self.jump.clone(),
            impulse: contacts().map(|m| m.impulse).collect(),
            slip: contacts()
                .map(|m| self.measures(model, m, Law::Later))
                .collect(),
            turn: chosen
                .iter()
                .filter_map(|&slot| self.turning_now(slot))
                .collect(),
        }
    }
}

impl Pile {
    /// Keeps a problem of the cascade: all its clusters as one. (Restitution that the safeguard scaled is stated unscaled.)
    #[cold]
    fn keep_round(&mut self, on: &mut On, index: u32, chosen: &[u32], before: Before) {
        let velocity = &self.velocity;
        let stated: Vec<problem_data::Stated> = chosen
            .iter()
            .zip(before.slip.iter().zip(&before.impulse))
            .enumerate()
            .map(|(k, (&slot, (&slip, &impulse)))| {
                let m = &velocity.closed[slot as usize];
                let turning = before
                    .turn
                    .get(k)
                    .map_or([DVec3::ZERO; 2], |[turn, moment]| {
                        [*turn, velocity.turning[slot as usize].moment - *moment]
                    });
                problem_data::Stated::of(m, slip, m.impulse - impulse, turning)
            })
            .collect();
        let correction: Vec<[f64; 6]> = velocity
            .jump
            .iter()
            .zip(&before.jump)
            .map(|([v, w], [v0, w0])| flat([*v - *v0, *w - *w0]))
            .collect();
        let report = problem_data::report_of(1, 0.0, true);
        self.keep(on, (index, report), &stated, &correction, &before.motion);
    }
}

#[cfg(test)]
mod tests {
    use super::lasts;

    #[test]
    fn what_grows_or_stays_lasts_and_what_dies_out_or_is_small_does_not() {
        let from = |first: f64, factor: f64, problems: i32| -> Vec<usize> {
            (0..problems)
                .map(|k| (first * factor.powi(k)) as usize)
                .collect()
        };
        assert!(lasts(&from(1000.0, 1.05, 15)));
        assert!(lasts(&from(1000.0, 1.0, 15)));
        assert!(!lasts(&from(4000.0, 0.98, 15)));
        assert!(!lasts(&from(400.0, 1.01, 15)));
        // Every other problem is larger, as between the layers of a lattice.
        let mut turns = from(4000.0, 0.95, 15);
        turns.iter_mut().step_by(2).for_each(|n| *n *= 2);
        assert!(!lasts(&turns));
        assert!(!lasts(&from(1000.0, 1.05, 7)));
    }
}
