//! Sweeps with momentum.
//!
//! Sweep `k` changes the impulses by `d`; the next one starts not from where it ended but further on the way it came:
//! `p <- beta (p + d)`, `r <- r + p` with `beta = k / (k + 3)` (Nesterov's sequence, Soviet Mathematics Doklady 27, 372, 1983). It
//! carries what a sweep takes layers and layers to tell from one end of a pile to the other. Where a sweep changes more than the last
//! one did, the momentum is dropped and grows anew (O'Donoghue and Candes, Foundations of Computational Mathematics 15, 715, 2015;
//! Mazhar et al., ACM Transactions on Graphics 34, 32, 2015, for contacts): friction cones are no quadratic function. Velocities are
//! linear in the impulses and take the same steps, so momentum balance holds throughout. The next sweep puts every contact back into
//! its cone.
//!
//! Bodies take a step in a stage of its own; contacts take it when the next sweep comes to them (`carry::Along`), so that impulses
//! pass through the processor once a sweep.

use super::bodies::State;
use super::carry::Along;
use super::lanes::{Lanes, Work};
use super::momentum::Change;
use super::pass::pass;
use super::sweeps::Sweeps;
use crate::team::{self, lock};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::Mutex;

/// A sweep may change so much more than the last one, in the square, before the momentum is dropped: single contacts that open or
/// begin to slide are no reason. (Of 1, 1.04, 1.1, 1.3 and 2 the one with the fewest sweeps in piles of 1000.)
pub(crate) const GROWTH: f64 = 1.1;
/// `beta = k / (k + RAMP)`.
pub(crate) const RAMP: f64 = 3.0;

/// Age of the momentum of the first sweep: there is nothing to go on from.
const NEW: u64 = 0;

/// A sweep that several threads make; the one that ends it writes.
#[derive(Default)]
struct Round {
    squared: AtomicU64,
    age: AtomicU64,
}

impl Round {
    /// It has changed so much, and the one before it what that says.
    fn ends(&self, squared: f64, before: &Round) {
        let age = match before.age.load(Relaxed) {
            NEW => NEW + 1,
            _ if squared > GROWTH * number(&before.squared) => NEW + 1,
            age => age + 1,
        };
        set(&self.squared, squared);
        self.age.store(age, Relaxed);
    }
}

/// What a block's sweep changed.
#[derive(Default)]
struct Part {
    squared: AtomicU64,
    closing: AtomicU64,
}

fn number(at: &AtomicU64) -> f64 {
    f64::from_bits(at.load(Relaxed))
}

fn set(at: &AtomicU64, x: f64) {
    at.store(x.to_bits(), Relaxed);
}

impl Sweeps {
    /// Forgets the momentum: the next accelerated sweep is a plain one.
    pub(super) fn restart(&mut self) {
        self.memory.last = Change::default();
        self.memory.age = NEW;
    }

    /// Up to `count` sweeps with `beta <= cap`, until one changes no more than `enough`; how many there were.
    pub(super) fn accelerated(&mut self, count: usize, cap: f64, enough: Change) -> usize {
        self.norms = None;
        let Sweeps {
            layout,
            states,
            blocks,
            memory,
            threads,
            instructions,
            law,
            guided_bodies,
            ..
        } = self;
        memory.states.resize(states.len(), State::default());
        // Round k of these is number k + 1, the last one before them number 0.
        let rounds: Vec<Round> = (0..=count).map(|_| Round::default()).collect();
        set(&rounds[0].squared, memory.last.squared);
        rounds[0].age.store(memory.age, Relaxed);
        let parts: Vec<Part> = blocks.iter().map(|_| Part::default()).collect();
        // Of the sweep that ends, summed in the order of the blocks, whatever the threads.
        let change = || changed(&parts);
        let chunks: Vec<_> = states
            .chunks_mut(layout.stride)
            .zip(memory.states.chunks_mut(layout.stride))
            .map(Mutex::new)
            .collect();
        let blocks: Vec<_> = blocks.iter_mut().map(Mutex::new).collect();
        let stages: Vec<usize> = std::iter::once(0)
            .chain(layout.stages.iter().map(|k| k + chunks.len()))
            .collect();
        let work = |round: usize, task: usize| {
            let factors = factors(rounds[round].age.load(Relaxed), cap);
            let [beta, kept] = factors;
            let Some(index) = task.checked_sub(chunks.len()) else {
                let (states, last) = &mut *lock(&chunks[task]);
                let first = task * layout.stride;
                guided_bodies
                    .iter()
                    .for_each(|g| g.keep_along(states, first));
                instructions.run(Follow {
                    states,
                    last,
                    beta,
                    kept,
                });
                return;
            };
            let block = &mut **lock(&blocks[index]);
            let along = Along::new(factors, *law);
            let left = &mut *lock(&chunks[block.left as usize]);
            let done = if block.left == block.right {
                pass(*instructions, block, left.0, None, along)
            } else {
                let right = &mut *lock(&chunks[block.right as usize]);
                pass(*instructions, block, left.0, Some(right.0), along)
            };
            let part = &parts[index];
            set(&part.squared, done.squared.iter().sum());
            set(
                &part.closing,
                done.closing.iter().copied().fold(0.0, f64::max),
            );
        };
        let done = |round: usize| {
            let now = change();
            rounds[round + 1].ends(now.squared, &rounds[round]);
            now.squared <= enough.squared && now.closing <= enough.closing
        };
        let count = team::run_until(*threads, count, &stages, work, done);
        drop((chunks, blocks));
        if count > 0 {
            memory.last = change();
            memory.age = rounds[count].age.load(Relaxed);
        }
        self.guide();
        count
    }
}

/// What all parts of a sweep changed.
fn changed(parts: &[Part]) -> Change {
    parts.iter().fold(Change::default(), |sum, part| Change {
        squared: sum.squared + number(&part.squared),
        closing: sum.closing.max(number(&part.closing)),
    })
}

/// `beta` at an age of the momentum, and 0 if there is none yet, else 1.
fn factors(age: u64, cap: f64) -> [f64; 2] {
    if age == NEW {
        return [0.0, 0.0];
    }
    let k = (age - 1) as f64;
    [(k / (k + RAMP)).min(cap), 1.0]
}

/// The step of the bodies of a chunk: the contacts' step as velocities, `beta` times what a sweep and the step before it have made.
/// The inverse masses beside the velocities do not change: their step is 0.
struct Follow<'a> {
    states: &'a mut [State],
    /// After the sweep before the last one.
    last: &'a mut [State],
    beta: f64,
    kept: f64,
}

impl Work for Follow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, simd: S) {
        let factors = [self.beta, self.kept];
        for (state, last) in self.states.iter_mut().zip(self.last) {
            follow(simd, factors, [&mut state.linear, &mut last.linear]);
            follow(simd, factors, [&mut state.surface, &mut last.surface]);
        }
    }
}

#[inline(always)]
fn follow<S: Lanes>(s: S, [beta, kept]: [f64; 2], [x, last]: [&mut [f64; 4]; 2]) {
    let way = s.row_scale(kept, s.row_sub(s.row(x), s.row(last)));
    *last = *x;
    *x = s.numbers(s.row_add(s.row(x), s.row_scale(beta, way)));
}
