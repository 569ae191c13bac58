//! How threads share the islands of a level, with the bits of one thread.
//!
//! A thread solves its islands with memory of its own, on copies of their contacts, and lists what it finds. That enters the
//! step in the order of the islands, between those that the step solves itself, so nothing tells who solved what. Not
//! shared are contacts in closed form, which cost less than their copy, and piles that keep all threads busy by themselves.

use crate::contact::Contact;
use crate::impact::ImpactScratch;
use crate::islands::{Island, Islands};
use crate::level::coupling::Trial;
use crate::level::{closed_form, loads, position, velocity, Task};
use crate::model::Model;
use crate::outcome::{History, ImpactRecord, Level};
use crate::pile::limits::{fits, threads};
use crate::pile::memory::Pile;
use crate::problem::{Keeper, KeptProblem};
use crate::report::StepReport;
use crate::state::Warm;
use crate::workspace::{Corrections, IslandScratch, On, SolveScratch};
use carom_solve::team::{self, lock};
use glam::DVec3;
use std::cmp::Reverse;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Mutex;

/// Batches for each thread: enough that the last ones end at about the same time. Speed alone.
const BATCHES_PER_THREAD: usize = 8;

impl Task<'_> {
    #[inline]
    pub(crate) fn solve(
        &self,
        scratch: &mut IslandScratch,
        island: Island,
        report: &mut StepReport,
    ) -> bool {
        let on = &mut On {
            task: self,
            island,
            scratch,
            report,
        };
        match self.level {
            Level::Position => position::solve_island(on),
            Level::Loads => loads::solve_island(on),
            _ => velocity::solve_island(on),
        }
    }

    /// Whether another thread may solve an island.
    fn may_share(&self, contacts: &[Contact], island: Island) -> bool {
        if self.level == Level::Position && position::is_separated(self.model, contacts, island) {
            return false;
        }
        match island.contacts {
            [m] if island.is_free() => !closed_form(self.model, &contacts[*m as usize]),
            all => threads(self.model, all.len()) == 1 || !fits(self.model, island),
        }
    }
}

/// What islands are shared out with; kept from step to step.
#[derive(Default)]
pub struct Sharing {
    /// Islands of this level that other threads solve, with their weights.
    chosen: Vec<(u32, usize)>,
    pub(crate) batches: Vec<IslandBatch>,
    workers: Vec<Worker>,
}

impl Sharing {
    /// Solves all islands that are worth it; none if the work is not.
    pub(crate) fn solve_shared(&mut self, task: &Task, islands: &Islands, step: &IslandScratch) {
        for batch in &mut self.batches {
            batch.clear();
        }
        let threads = self.divide(task, islands, step.contacts);
        if threads < 2 {
            return;
        }
        let workers = Mutex::new(std::mem::take(&mut self.workers));
        // Behind a failure nothing counts.
        let failed = AtomicUsize::new(usize::MAX);
        let mut batches: Vec<_> = std::mem::take(&mut self.batches)
            .into_iter()
            .enumerate()
            .collect();
        // What takes longest begins first.
        batches.sort_by_key(|(_, batch)| Reverse(batch.weight));
        batches = team::map(threads, batches, |(place, mut batch)| {
            if place < failed.load(Ordering::Relaxed) {
                let idle = lock(&workers).pop();
                let mut worker = idle.unwrap_or_else(|| Worker::new(task.model));
                if !batch.solve(task, islands, step, &mut worker) {
                    failed.fetch_min(place, Ordering::Relaxed);
                }
                lock(&workers).push(worker);
            }
            (place, batch)
        });
        batches.sort_by_key(|(place, _)| *place);
        self.batches
            .extend(batches.into_iter().map(|(_, batch)| batch));
        std::mem::swap(&mut self.workers, &mut lock(&workers));
    }

    /// Deals the islands to batches of about the same weight; the number of threads that they are worth.
    fn divide(&mut self, task: &Task, islands: &Islands, contacts: &[Contact]) -> usize {
        let o = &task.model.options;
        self.chosen.clear();
        let mut total = 0;
        for number in 0..islands.len() {
            let island = islands.island(number);
            if task.may_share(contacts, island) {
                let weight = island.contacts.len() + island.joints.len();
                self.chosen.push((number as u32, weight));
                total += weight;
            }
        }
        let worth = total / o.shared_contacts_per_thread as usize;
        let threads = (o.threads as usize).min(worth).min(self.chosen.len());
        if threads < 2 {
            return 1;
        }
        let each = total.div_ceil(BATCHES_PER_THREAD * threads);
        let mut used = 0;
        for &(number, own) in &self.chosen {
            let full = |batch: &IslandBatch| batch.weight > 0 && batch.weight + own > each;
            used += usize::from(self.batches.get(used).is_some_and(full));
            if used == self.batches.len() {
                self.batches.push(IslandBatch::default());
            }
            let batch = &mut self.batches[used];
            batch.islands.push(number);
            batch.weight += own;
        }
        threads
    }
}

/// Memory of a thread.
struct Worker {
    solve: SolveScratch,
    trial: Trial,
    impact: ImpactScratch,
    pile: Pile,
    joint_reaction: Vec<[DVec3; 2]>,
}

impl Worker {
    fn new(model: &Model) -> Worker {
        Worker {
            solve: SolveScratch::new(model),
            trial: Trial::new(model),
            impact: ImpactScratch::default(),
            pile: Pile::new(),
            joint_reaction: vec![[DVec3::ZERO; 2]; model.joints.len()],
        }
    }
}

/// Some islands, in their order, and what a thread found in them.
#[derive(Default)]
pub(crate) struct IslandBatch {
    islands: Vec<u32>,
    weight: usize,
    /// Those of the islands, one after the other.
    contacts: Vec<Contact>,
    members: Vec<u32>,
    corrections: Vec<(u32, [DVec3; 2])>,
    joint_reaction: Vec<[DVec3; 2]>,
    warm: Vec<Warm>,
    impacts: Vec<ImpactRecord>,
    history: [History; 3],
    /// Island that the longest history is of.
    longest: u32,
    keeper: Keeper,
    failed: Vec<KeptProblem>,
    report: StepReport,
    /// Of every island that was solved, or could not be.
    ends: Vec<End>,
    /// Islands handed over, and where their results end.
    handed: usize,
    at: End,
}

/// Where the results of an island end.
#[derive(Clone, Copy, Default)]
struct End {
    solved: bool,
    contacts: usize,
    corrections: usize,
    joints: usize,
    warm: usize,
    impacts: usize,
}

impl IslandBatch {
    fn clear(&mut self) {
        self.islands.clear();
        self.weight = 0;
        self.contacts.clear();
        self.members.clear();
        self.corrections.clear();
        self.joint_reaction.clear();
        self.warm.clear();
        self.impacts.clear();
        for history in &mut self.history {
            history.values.clear();
        }
        self.failed.clear();
        self.ends.clear();
        (self.handed, self.at) = (0, End::default());
    }

    /// Solves its islands up to the first that cannot be solved: then false. `step` is what the step knows before the level.
    fn solve(
        &mut self,
        task: &Task,
        islands: &Islands,
        step: &IslandScratch,
        worker: &mut Worker,
    ) -> bool {
        for &number in &self.islands {
            let members = islands.island(number as usize).contacts.iter();
            self.contacts
                .extend(members.map(|&m| step.contacts[m as usize]));
        }
        self.members.extend(0..self.contacts.len() as u32);
        self.keeper = step.keeper.fork();
        self.report = StepReport::new(0, 0.0);
        let mut scratch = IslandScratch {
            linear: step.linear,
            angular: step.angular,
            position: step.position,
            shift: step.shift,
            walls: step.walls,
            clumps: step.clumps,
            contacts: &mut self.contacts,
            corrections: Corrections::Listed(&mut self.corrections),
            joint_reaction: &mut worker.joint_reaction,
            warm: &mut self.warm,
            impacts: &mut self.impacts,
            history: &mut self.history,
            keeper: &mut self.keeper,
            solve: &mut worker.solve,
            trial: &mut worker.trial,
            impact: &mut worker.impact,
            pile: &mut worker.pile,
        };
        let (mut end, mut longest) = (End::default(), 0);
        for &number in &self.islands {
            let own = islands.island(number as usize);
            let first = end.contacts;
            end.contacts += own.contacts.len();
            let island = Island {
                contacts: &self.members[first..end.contacts],
                ..own
            };
            for &joint in island.joints {
                scratch.joint_reaction[joint as usize] = step.joint_reaction[joint as usize];
            }
            scratch.keeper.island = number;
            end.solved = task.solve(&mut scratch, island, &mut self.report);
            let joints = island.joints.iter();
            self.joint_reaction
                .extend(joints.map(|&joint| scratch.joint_reaction[joint as usize]));
            self.failed.extend(scratch.keeper.failed.take());
            let length = scratch.history[task.level.index()].values.len();
            if length > longest {
                (longest, self.longest) = (length, number);
            }
            end.corrections = scratch.corrections.listed();
            end.joints = self.joint_reaction.len();
            (end.warm, end.impacts) = (scratch.warm.len(), scratch.impacts.len());
            self.ends.push(end);
            if !end.solved {
                return false;
            }
        }
        true
    }

    pub(crate) fn is_done(&self) -> bool {
        self.handed == self.islands.len()
    }

    pub(crate) fn is_next(&self, number: u32) -> bool {
        self.islands.get(self.handed) == Some(&number)
    }

    /// Hands the results of the next island to the step. False: it was not solved.
    pub(crate) fn hand_over(
        &mut self,
        step: &mut IslandScratch,
        island: Island,
        report: &mut StepReport,
    ) -> bool {
        // What is behind a failure was left, and is not asked for.
        let Some(&end) = self.ends.get(self.handed) else {
            return false;
        };
        let (at, number) = (self.at, self.islands[self.handed]);
        if self.handed == 0 {
            // Largest values and counts: these have no order.
            report.join(&self.report);
        }
        for (&m, c) in island
            .contacts
            .iter()
            .zip(&self.contacts[at.contacts..end.contacts])
        {
            step.contacts[m as usize] = *c;
        }
        for &(body, correction) in &self.corrections[at.corrections..end.corrections] {
            step.corrections.set(body, correction);
        }
        let reactions = &self.joint_reaction[at.joints..end.joints];
        for (&joint, reaction) in island.joints.iter().zip(reactions) {
            step.joint_reaction[joint as usize] = *reaction;
        }
        step.warm.extend_from_slice(&self.warm[at.warm..end.warm]);
        step.impacts
            .extend_from_slice(&self.impacts[at.impacts..end.impacts]);
        if self.longest == number {
            for (all, own) in step.history.iter_mut().zip(&mut self.history) {
                if own.values.len() > all.values.len() {
                    std::mem::swap(all, own);
                }
            }
        }
        let failed = self.failed.iter().find(|p| p.island == number);
        step.keeper.take_over(&mut self.keeper, number, failed);
        self.handed += 1;
        self.at = end;
        end.solved
    }
}
