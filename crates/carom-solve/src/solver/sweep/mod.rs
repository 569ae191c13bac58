//! Sweeps of block Gauss-Seidel over a problem: coloured chunks, several threads, the same bits for any number of them.
//!
//! Few contacts are swept as they come. Many are cut into chunks of neighbours (`order`); inside a chunk contacts follow one
//! another as they come, and chunks that do not feel each other may be swept at the same time. So every update sees the same
//! numbers whichever thread makes it. All sweeps run forwards: with every second one backwards piles at rest take ten times as
//! many, or cycle (measured).

mod chunk;
mod contact;
mod discs;
mod order;
#[cfg(test)]
mod tests;

use crate::problem::Problem;
use crate::spheres::Instructions;
use crate::team::{self, lock};
use chunk::{Chunk, ChunkPass};
pub use order::Order;
use std::sync::atomic::AtomicU64;
use std::sync::Mutex;

/// Contacts (1) from which on they are swept in chunks. Below, threads would wait for one another most of the time.
const MANY: usize = 2000;
/// Contacts (1) for each thread at least; fewer, for the same reason, are slower with threads than without.
const SHARE: usize = 1000;
/// Chunks aimed at, so that a stage has some for each thread, and contacts of one: so few that they stay in cache, so many
/// that copies of others' multipliers are few, and that the order is nearly the one given, which converges best: after 480
/// sweeps of heaps and flows `err` is 1.3 to 1.8 times as large with chunks of one contact, at most 1.26 times with 32 to 256.
const CHUNKS: usize = 128;
const CHUNK_LEAST: usize = 32;
const CHUNK_MOST: usize = 256;

/// A problem packed for sweeping, and its multipliers (0 at first).
#[derive(Debug)]
pub struct ConeSweeps {
    chunks: Vec<Chunk>,
    stages: Vec<usize>,
    /// Multipliers as all chunks see them; unused where there is one chunk.
    shown: Vec<AtomicU64>,
    /// Factor on the change of every contact: 1 is Gauss-Seidel, above is over-relaxation.
    pub relaxation: f64,
    contacts: usize,
    /// Threads of all that follows, at most; changes no bit of any result.
    pub threads: usize,
    pub instructions: Instructions,
}

impl ConeSweeps {
    pub fn new(problem: &Problem, threads: usize) -> ConeSweeps {
        let count = problem.groups.len();
        let order = if count < MANY {
            Order::natural(count)
        } else {
            Order::coloured(&problem.w, (count / CHUNKS).clamp(CHUNK_LEAST, CHUNK_MOST))
        };
        ConeSweeps::ordered(problem, threads, &order)
    }

    /// In an order of the caller's.
    pub fn ordered(problem: &Problem, threads: usize, order: &Order) -> ConeSweeps {
        // Room for numbering, one for each thread that packs.
        let rooms: Mutex<Vec<Vec<u32>>> = Mutex::default();
        let lists: Vec<&[u32]> = order
            .chunks
            .windows(2)
            .map(|c| &order.contacts[c[0]..c[1]])
            .collect();
        let shown = if lists.len() > 1 { problem.rows() } else { 0 };
        let chunks = team::map(threads, lists, |contacts| {
            let mut room = lock(&rooms)
                .pop()
                .unwrap_or_else(|| vec![u32::MAX; problem.groups.len()]);
            let chunk = Chunk::new(problem, contacts, &mut room);
            lock(&rooms).push(room);
            chunk
        });
        ConeSweeps {
            chunks,
            stages: order.stages.clone(),
            shown: (0..shown).map(|_| AtomicU64::new(0)).collect(),
            relaxation: 1.0,
            contacts: problem.groups.len(),
            threads,
            instructions: Instructions::default(),
        }
    }

    /// Starts from `y`.
    pub fn enter(&mut self, y: &[f64]) {
        for chunk in &mut self.chunks {
            chunk.enter(y);
            if !self.shown.is_empty() {
                chunk.show(&self.shown);
            }
        }
    }

    pub fn leave(&self, y: &mut [f64]) {
        self.chunks.iter().for_each(|chunk| chunk.leave(y));
    }

    /// Runs `count` sweeps, or ends in the midst of one as soon as `stop` says so.
    pub fn sweep(&mut self, count: u32, stop: impl Fn() -> bool + Sync) {
        let tasks = self.chunks.len();
        let threads = self.threads.min(self.contacts / SHARE).max(1);
        // Stages of all sweeps; task `t` is chunk `t % tasks` of its sweep.
        let mut stages = vec![0];
        for sweep in 0..count as usize {
            stages.extend(self.stages.iter().skip(1).map(|end| sweep * tasks + end));
        }
        let chunks: Vec<Mutex<&mut Chunk>> = self.chunks.iter_mut().map(Mutex::new).collect();
        let (shown, instructions, relaxation) = (&self.shown, self.instructions, self.relaxation);
        team::run(threads, 1, &stages, |task| {
            if stop() {
                return;
            }
            let chunk = &mut **lock(&chunks[task % tasks]);
            if !shown.is_empty() {
                chunk.look(shown);
            }
            instructions.run(ChunkPass { chunk, relaxation });
            if !shown.is_empty() {
                chunk.show(shown);
            }
        });
    }
}
