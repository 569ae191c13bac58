//! All close pairs of one configuration, in O(N) time and memory.
//!
//! Bodies are sorted into levels by extent, each level at most half as large as the one before, and every level has
//! its own [`Grid`] whose cells fit its largest body. A body meets its own level and the coarser ones. Spheres of
//! like size - the usual case - make one level and pay nothing for this; one bullet that looks ten metres ahead
//! makes a second level with one member instead of giving everybody cells of ten metres.

use super::grid::{Entry, Grid};
use crate::periodic::Periodic;
use glam::DVec3;
use std::ops::ControlFlow;

/// More levels than this are not made; the last takes what remains (sizes below `2^-23` of the largest).
const MAX_LEVELS: usize = 24;
/// Extents (m) beyond this, infinity included, are compared with everything instead of overflowing.
const UNBOUNDED: f64 = 1e100;

/// Reusable search structure; see the module's page.
#[derive(Debug, Default)]
pub struct CellList {
    grids: Vec<Grid>,
    /// Grids in use; the rest keep their memory for a later build.
    levels: usize,
    /// Bodies without a bound on their extent.
    unbounded: Vec<Entry>,
    all: Vec<Entry>,
    pool: Vec<Entry>,
    keys: Vec<u64>,
}

impl CellList {
    /// An empty list; buffers grow with the first [`Self::build`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in `N` bodies: centres `x` (N) (m) and extents (N) (m).
    ///
    /// A body with a position that is not finite, or with a NaN or negative extent, is left out: it is close to nothing.
    ///
    /// In a periodic box bodies are put into it, and images of those near its border are added: of every pair the body with
    /// the larger extent has an image where it is close to the other, if the two are close at all. [`Self::pairs`] may
    /// then give a pair twice.
    pub fn build(&mut self, x: impl Iterator<Item = DVec3>, extent: &[f64], periodic: &Periodic) {
        self.unbounded.clear();
        self.pool.clear();
        for (i, (x, &e)) in x.zip(extent).enumerate() {
            if x.is_finite() && e >= 0.0 {
                let target = if e < UNBOUNDED {
                    &mut self.pool
                } else {
                    &mut self.unbounded
                };
                let x = periodic.wrap(x);
                let body = Entry::new(i as u32, x, e);
                target.push(body);
                if !periodic.is_none() && e < UNBOUNDED {
                    let reach = 2.0 * e * (1.0 + 1e-9);
                    periodic.images(x, reach, |x| target.push(body.image(x)));
                }
            }
        }
        self.all.clear();
        if !self.unbounded.is_empty() {
            self.all.extend_from_slice(&self.pool);
        }
        self.levels = 0;
        let mut rest = std::mem::take(&mut self.pool);
        let mut bodies = &mut rest[..];
        while !bodies.is_empty() {
            let largest = bodies.iter().fold(0.0, |m: f64, b| m.max(b.extent));
            let count = if self.levels + 1 < MAX_LEVELS {
                take_large(bodies, 0.5 * largest)
            } else {
                bodies.len()
            };
            let (level, finer) = bodies.split_at_mut(count);
            if self.grids.len() == self.levels {
                self.grids.push(Grid::new());
            }
            self.grids[self.levels].build(level, &mut self.keys);
            self.levels += 1;
            bodies = finer;
        }
        self.pool = rest;
    }

    /// Calls `visit(a, b)`, `a < b`, once for every pair with `|x_a - x_b| <= extent_a + extent_b` (and at most a
    /// relative 1e-12 more), until it breaks. The order is arbitrary but depends on the input alone.
    pub fn pairs<F>(&self, mut visit: F) -> ControlFlow<()>
    where
        F: FnMut(u32, u32) -> ControlFlow<()>,
    {
        self.parts(usize::MAX)
            .iter()
            .try_for_each(|part| self.pairs_of(part, &mut visit))
    }

    /// The search in parts of up to `size` bodies: the union of their pairs is [`Self::pairs`], each pair once.
    pub fn parts(&self, size: usize) -> Vec<Part> {
        let mut parts = Vec::new();
        for (level, grid) in self.grids[..self.levels].iter().enumerate() {
            let count = grid.entries().len();
            let mut first = 0;
            while first < count {
                let end = first.saturating_add(size).min(count);
                parts.push(Part::Level(level, first, end));
                first = end;
            }
        }
        if !self.unbounded.is_empty() {
            parts.push(Part::Unbounded);
        }
        parts
    }

    /// The pairs of one part, as [`Self::pairs`] gives them.
    pub fn pairs_of<F>(&self, part: &Part, mut visit: F) -> ControlFlow<()>
    where
        F: FnMut(u32, u32) -> ControlFlow<()>,
    {
        let mut emit = |a: &Entry, b: &Entry| match a.pair(b) {
            Some((a, b)) => visit(a, b),
            None => ControlFlow::Continue(()),
        };
        match *part {
            Part::Level(level, first, end) => {
                let grid = &self.grids[level];
                grid.pairs(first..end, &mut emit)?;
                for coarser in &self.grids[..level] {
                    for a in &grid.entries()[first..end] {
                        coarser.around(a, &mut emit)?;
                    }
                }
            }
            Part::Unbounded => {
                for (i, a) in self.unbounded.iter().enumerate() {
                    for b in self.unbounded[i + 1..].iter().chain(&self.all) {
                        if a.is_close(b) {
                            emit(a, b)?;
                        }
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }
}

/// A part of the search: some bodies of a level, or the bodies without bound.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    /// Level, first body in the order of its cells, and the one after the last.
    Level(usize, usize, usize),
    Unbounded,
}

/// Moves the bodies with an extent of at least `bound` to the front and counts them. Already in place - one level - it
/// only reads.
fn take_large(bodies: &mut [Entry], bound: f64) -> usize {
    let mut count = 0;
    for i in 0..bodies.len() {
        if bodies[i].extent >= bound {
            if i != count {
                bodies.swap(i, count);
            }
            count += 1;
        }
    }
    count
}
