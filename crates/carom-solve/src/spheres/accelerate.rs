//! Sweeps as the gradient of a nonlinear conjugate gradient method.
//!
//! A sweep changes the impulses by `d`, the steepest descent that Gauss-Seidel knows. Directions `p <- d + beta p` with
//! `beta = |d|^2 / |d_before|^2` (Fletcher and Reeves) and steps `r <- r + d + beta p` carry what a sweep takes layers and layers
//! to tell from one end of a pile to the other (Silcowitz, Niebe and Erleben, The Visual Computer 26, 893, 2010: nonsmooth nonlinear
//! conjugate gradient method). Where `beta > 1` the direction is dropped. Velocities are linear in the impulses and take the
//! same steps, so momentum balance holds throughout. The next sweep puts every contact back into its cone.

use super::groups::Block;
use super::kernel::{Column, State};
use super::lanes::{Lanes, Work, GROUP};
use super::Sweeps;
use crate::team;

/// Impulses and velocities of the last iterate, and the direction.
#[derive(Debug, Default)]
pub struct Memory {
    blocks: Vec<Part>,
    states: Vec<[State; 2]>,
    /// `|d|^2` of the last sweep; 0: no direction yet.
    length: f64,
}

/// A block's share.
#[derive(Debug, Default)]
struct Part {
    before: Vec<[Column; 3]>,
    direction: Vec<[Column; 3]>,
}

impl Sweeps {
    /// Forgets the direction: the next accelerated sweep is a plain one.
    pub(super) fn restart(&mut self) {
        self.memory.length = 0.0;
    }

    /// `count` accelerated sweeps and a plain one.
    pub(super) fn accelerated(&mut self, count: usize) {
        for _ in 0..count {
            self.keep();
            self.sweep(1);
            self.step();
        }
        self.sweep(1);
    }

    /// Copies impulses and velocities.
    fn keep(&mut self) {
        let fresh = self.memory.length == 0.0;
        let threads = self.threads;
        let Sweeps {
            blocks,
            memory,
            states,
            ..
        } = self;
        memory.blocks.resize_with(blocks.len(), Part::default);
        team::map(
            threads,
            blocks.iter().zip(&mut memory.blocks).collect(),
            |(block, part): (&Block, &mut Part)| {
                part.before.clear();
                part.before.extend(block.groups.iter().map(|g| g.impulse));
                if fresh {
                    part.direction.clear();
                    part.direction.resize(block.groups.len(), [[0.0; GROUP]; 3]);
                }
            },
        );
        if fresh {
            memory.states.clear();
            memory.states.resize(states.len(), [State::default(); 2]);
        }
        for (kept, state) in memory.states.iter_mut().zip(states) {
            kept[0] = *state;
        }
    }

    /// Goes on along the direction after a sweep.
    fn step(&mut self) {
        let threads = self.threads;
        let Sweeps {
            blocks,
            memory,
            states,
            instructions,
            layout,
            ..
        } = self;
        let parts = team::map(
            threads,
            blocks.iter().zip(&memory.blocks).collect(),
            |(block, part): (&Block, &Part)| instructions.run(Squared(block, part)),
        );
        let length: f64 = parts.iter().sum();
        let ratio = length / memory.length;
        // Without a direction, or where the method overshoots, the sweep itself is the direction.
        let beta = if ratio <= 1.0 { ratio } else { 0.0 };
        memory.length = length;
        team::map(
            threads,
            blocks.iter_mut().zip(&mut memory.blocks).collect(),
            |(block, part): (&mut Block, &mut Part)| instructions.run(Advance(block, part, beta)),
        );
        let stride = layout.stride;
        let chunks = memory
            .states
            .chunks_mut(stride)
            .zip(states.chunks_mut(stride));
        team::map(threads, chunks.collect(), |(kept, states)| {
            instructions.run(Follow(kept, states, beta));
        });
    }
}

/// The same step for the bodies of a chunk. The inverse masses beside the velocities do not change: `d` is 0 there.
struct Follow<'a>(&'a mut [[State; 2]], &'a mut [State], f64);

impl Work for Follow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, _simd: S) {
        let Follow(kept, states, beta) = self;
        for ([before, direction], state) in kept.iter_mut().zip(states) {
            for (x, b, p) in [
                (&mut state.linear, &before.linear, &mut direction.linear),
                (&mut state.surface, &before.surface, &mut direction.surface),
            ] {
                for k in 0..4 {
                    let d = x[k] - b[k];
                    let carried = beta * p[k];
                    x[k] += carried;
                    p[k] = carried + d;
                }
            }
        }
    }
}

/// `|d|^2` of a block's contacts, over their masses. Plain loops over lanes: they become vector code of the instruction set at
/// hand, and without fused operations they give the same bits on all.
struct Squared<'a>(&'a Block, &'a Part);

impl Work for Squared<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Lanes>(self, _simd: S) -> f64 {
        let mut sums = [0.0; GROUP];
        for (group, before) in self.0.groups.iter().zip(&self.1.before) {
            let mut d = [0.0; GROUP];
            for k in 0..3 {
                for lane in 0..GROUP {
                    let x = group.impulse[k][lane] - before[k][lane];
                    d[lane] += x * x;
                }
            }
            for lane in 0..GROUP {
                // Lanes without contact have no impulse and the mass 0.
                sums[lane] += d[lane] / group.mass_normal[lane].max(f64::MIN_POSITIVE);
            }
        }
        sums.iter().sum()
    }
}

/// `r <- r + beta p`, `p <- d + beta p`.
struct Advance<'a>(&'a mut Block, &'a mut Part, f64);

impl Work for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, _simd: S) {
        let Advance(block, part, beta) = self;
        let kept = part.before.iter().zip(&mut part.direction);
        for (group, (before, direction)) in block.groups.iter_mut().zip(kept) {
            for k in 0..3 {
                for lane in 0..GROUP {
                    let x = &mut group.impulse[k][lane];
                    let d = *x - before[k][lane];
                    let carried = beta * direction[k][lane];
                    *x += carried;
                    direction[k][lane] = carried + d;
                }
            }
        }
    }
}
