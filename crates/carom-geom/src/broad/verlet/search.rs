//! The search for the pairs of a list of neighbours: in parts, shared among threads, with one result for any number.

use super::{walls_of, NeighbourList};
use crate::broad::cell_list::Part;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bodies of one part of the search, and bodies for which a thread is worth starting.
const PART: usize = 4096;
const BODIES_PER_THREAD: usize = 4096;

/// A part of the search for pairs.
enum Task {
    Cells(Part),
    /// First of [`PART`] bodies that may meet walls.
    Walls(usize),
}

/// The rows of consecutive bodies in the sorted list.
struct Rows<'a> {
    /// Of the first body, and where its row begins in the whole list.
    body: usize,
    first: usize,
    pairs: &'a mut [(u32, u32)],
    /// Per body, where its next pair goes in the whole list.
    next: &'a mut [u32],
}

impl Rows<'_> {
    fn fill(self, raw: &[Vec<(u32, u32)>]) {
        for &(a, b) in raw.iter().flatten() {
            if let Some(to) = self.next.get_mut((a as usize).wrapping_sub(self.body)) {
                self.pairs[*to as usize - self.first] = (a, b);
                *to += 1;
            }
        }
        let mut from = 0;
        for end in self.next {
            let to = *end as usize - self.first;
            self.pairs[from..to].sort_unstable_by_key(|pair| pair.1);
            from = to;
        }
    }
}

impl NeighbourList {
    /// Cells, then a counting sort by `a`, then each short row by `b`: an order that follows from the pairs alone, whoever
    /// found them.
    pub(super) fn search(&mut self, radius: &[f64], limit: usize) {
        let n = self.reference.len();
        let threads = self.threads.min(n.div_ceil(BODIES_PER_THREAD));
        self.extent.clear();
        self.extent.extend(self.reference.iter().map(|r| r.extent));
        let reference = &self.reference;
        self.cells
            .build(reference.iter().map(|r| r.x), &self.extent, &self.periodic);
        self.find(radius, limit, threads);
        self.sort(limit, threads);
    }

    /// Fills `raw`, a list per part of the search.
    fn find(&mut self, radius: &[f64], limit: usize, threads: usize) {
        let Self {
            cells,
            raw,
            reference,
            walls,
            moving,
            meshes,
            between,
            ..
        } = self;
        let n = reference.len();
        let first_wall = n + *between;
        let mut tasks: Vec<Task> = cells.parts(PART).into_iter().map(Task::Cells).collect();
        if !walls.is_empty() {
            tasks.extend((0..n).step_by(PART).map(Task::Walls));
        }
        raw.resize_with(tasks.len(), Vec::new);
        let total = AtomicUsize::new(0);
        let pieces = tasks.into_iter().zip(raw.iter_mut()).collect();
        share(threads, pieces, |(task, raw): (Task, &mut Vec<_>)| {
            raw.clear();
            // One more than the limit tells that it was passed; whatever the order of the parts, the sum is then above it.
            let room = (limit + 1).saturating_sub(total.load(Ordering::Relaxed));
            let mut push = |a: u32, b: u32| {
                if raw.len() >= room {
                    return ControlFlow::Break(());
                }
                raw.push((a, b));
                ControlFlow::Continue(())
            };
            // Broken off, the list is too long anyway.
            let _ = match task {
                Task::Cells(part) => cells.pairs_of(&part, push),
                Task::Walls(first) => {
                    let some = &reference[first..n.min(first + PART)];
                    some.iter().zip(first..).try_for_each(|(r, a)| {
                        walls_of(r, radius[a], walls, moving, meshes, |w| {
                            push(a as u32, (first_wall + w) as u32)
                        })
                    })
                }
            };
            total.fetch_add(raw.len(), Ordering::Relaxed);
        });
    }

    /// Makes `pairs` of `raw`, with the bodies shared among the threads.
    fn sort(&mut self, limit: usize, threads: usize) {
        let Self {
            pairs, raw, start, ..
        } = self;
        let n = self.reference.len();
        let found: usize = raw.iter().map(Vec::len).sum();
        self.truncated = found > limit;
        let mut over = found.saturating_sub(limit);
        for part in raw.iter_mut().rev() {
            let cut = over.min(part.len());
            part.truncate(part.len() - cut);
            over -= cut;
        }
        let raw = &*raw;
        let bound = |k: usize| k * n / threads;
        let rows = |k: usize| bound(k + 1) - bound(k);
        start.clear();
        start.resize(n, 0);
        let pieces = cut(start, (0..threads).map(rows));
        share(
            threads,
            pieces.into_iter().enumerate().collect(),
            |(k, count): (usize, &mut [u32])| {
                let first = bound(k);
                for &(a, _) in raw.iter().flatten() {
                    if let Some(count) = count.get_mut((a as usize).wrapping_sub(first)) {
                        *count += 1;
                    }
                }
            },
        );
        let mut sum = 0;
        for s in start.iter_mut() {
            sum += std::mem::replace(s, sum);
        }
        let total = sum as usize;
        let begin = |k: usize| start.get(bound(k)).map_or(total, |&s| s as usize);
        let lengths: Vec<usize> = (0..threads).map(|k| begin(k + 1) - begin(k)).collect();
        let firsts: Vec<usize> = (0..threads).map(begin).collect();
        pairs.clear();
        pairs.resize(total, (0, 0));
        let blocks = cut(pairs, lengths.into_iter())
            .into_iter()
            .zip(cut(start, (0..threads).map(rows)))
            .enumerate()
            .map(|(k, (pairs, next))| Rows {
                body: bound(k),
                first: firsts[k],
                pairs,
                next,
            });
        share(threads, blocks.collect(), |block: Rows| block.fill(raw));
        if !self.periodic.is_none() {
            // Found with an image of one and an image of the other.
            self.pairs.dedup();
        }
    }
}

/// `work(piece)` for every piece, by the pool of rayon that the calling thread belongs to. Called from elsewhere, one thread does all: to start
/// others for one search costs as much as a small one.
fn share<T: Send>(threads: usize, pieces: Vec<T>, work: impl Fn(T) + Sync + Send) {
    if threads > 1 && rayon::current_thread_index().is_some() {
        pieces.into_par_iter().with_max_len(1).for_each(work);
    } else {
        pieces.into_iter().for_each(work);
    }
}

/// Cuts `all` into consecutive slices of the given lengths.
fn cut<T>(mut all: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    let mut out = Vec::new();
    for length in lengths {
        let (first, rest) = all.split_at_mut(length);
        out.push(first);
        all = rest;
    }
    out
}
