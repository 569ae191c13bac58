//! The contacts of one chunk with all they need, packed for the sweep.

use super::super::solve_contact;
use super::contact::{Coupled, Simple};
use super::discs::Discs;
use crate::cone::MAX_ROWS;
use crate::problem::natural::project_cone;
use crate::problem::{Problem, RowGroup};
use crate::spheres::{Lanes, Work};
use std::sync::atomic::{AtomicU64, Ordering};

/// Rows of a contact, filled up to two vectors of four.
const FULL: usize = 8;
/// Numbers behind the last block that a load of a whole column may touch.
const TAIL: usize = FULL;
/// Which way a contact is solved.
#[derive(Clone, Copy, Debug)]
enum Way {
    Simple(Simple),
    /// A place in `coupled`.
    Coupled(u32),
    /// A place in `discs`.
    Discs(u32),
    Long,
}

/// Contacts in the order of a forward sweep. Blocks `W_ij`, `j` not `i`, stand column-major, so that a product adds whole columns.
/// Multipliers of the chunk and copies of those that it feels stand together: a sweep looks outside before and after only.
#[derive(Debug, Default)]
pub struct Chunk {
    /// `row` is the first multiplier in `y`.
    groups: Vec<RowGroup>,
    ways: Vec<Way>,
    coupled: Vec<Coupled>,
    discs: Vec<Discs>,
    q: Vec<[f64; FULL]>,
    /// Diagonal blocks, row-major, and where they begin.
    diagonals: Vec<f64>,
    diagonal_at: Vec<u32>,
    /// Other blocks of contact `i`: `ptr[i]..ptr[i + 1]`; the first of their values; of each its first multiplier and columns.
    ptr: Vec<u32>,
    value_at: Vec<usize>,
    col: Vec<u32>,
    width: Vec<u8>,
    values: Vec<f64>,
    /// Own multipliers, `own` of them, then copies of others; `rows` are their rows in the problem.
    y: Vec<f64>,
    rows: Vec<u32>,
    own: usize,
    all_three: bool,
}

impl Chunk {
    /// Packs `contacts`. `local` has `u32::MAX` for every contact, before and after.
    pub fn new(problem: &Problem, contacts: &[u32], local: &mut [u32]) -> Chunk {
        let w = &problem.w;
        let mut chunk = Chunk {
            all_three: contacts.iter().all(|&i| {
                // Three rows may also be normal and rolling.
                let group = &problem.groups[i as usize];
                group.dim == 3 && (group.bilateral || group.bounds.sliding > 0.0)
            }),
            ..Chunk::default()
        };
        for &i in contacts {
            local[i as usize] = chunk.rows.len() as u32;
            chunk
                .rows
                .extend(problem.groups[i as usize].rows().map(|r| r as u32));
        }
        chunk.own = chunk.rows.len();
        chunk.reserve(problem, contacts);
        chunk.ptr.push(0);
        let mut guests = Vec::new();
        for &i in contacts {
            let i = i as usize;
            let mut group = problem.groups[i];
            let dim = group.dim;
            let mut q = [0.0; FULL];
            q[..dim].copy_from_slice(&problem.q[group.rows()]);
            let diagonal = w.block(i, w.diagonal[i]);
            chunk.q.push(q);
            let way = chunk.way(&group, diagonal);
            chunk.ways.push(way);
            chunk.diagonal_at.push(chunk.diagonals.len() as u32);
            chunk.diagonals.extend_from_slice(diagonal);
            chunk.value_at.push(chunk.values.len());
            for k in (w.ptr[i]..w.ptr[i + 1]).filter(|&k| k != w.diagonal[i]) {
                let j = w.col[k] as usize;
                let other = &problem.groups[j];
                if local[j] == u32::MAX {
                    local[j] = chunk.rows.len() as u32;
                    chunk.rows.extend(other.rows().map(|r| r as u32));
                    guests.push(j);
                }
                let block = w.block(i, k);
                // Contacts of three rows have all their neighbours' blocks as three columns as well.
                chunk.all_three &= other.dim == 3;
                chunk.col.push(local[j]);
                chunk.width.push(other.dim as u8);
                match *block {
                    [a, b, c, d, e, f, g, h, i] if dim == 3 => {
                        chunk.values.extend_from_slice(&[a, d, g, b, e, h, c, f, i]);
                    }
                    _ => {
                        for c in 0..other.dim {
                            let column = (0..dim).map(|r| block[r * other.dim + c]);
                            chunk.values.extend(column);
                        }
                    }
                }
            }
            chunk.ptr.push(chunk.col.len() as u32);
            group.row = local[i] as usize;
            chunk.groups.push(group);
        }
        chunk.values.extend([0.0; TAIL]);
        chunk.y.resize(chunk.rows.len(), 0.0);
        for i in contacts.iter().map(|&i| i as usize).chain(guests) {
            local[i] = u32::MAX;
        }
        chunk
    }

    /// Memory for these contacts, in one piece for each array.
    fn reserve(&mut self, problem: &Problem, contacts: &[u32]) {
        let w = &problem.w;
        let (mut blocks, mut values, mut own) = (0, TAIL, 0);
        for &i in contacts {
            let row = w.ptr[i as usize]..w.ptr[i as usize + 1];
            let dim = problem.groups[i as usize].dim;
            own += dim * dim;
            blocks += row.len();
            for &j in &w.col[row] {
                values += dim * problem.groups[j as usize].dim;
            }
        }
        self.groups.reserve_exact(contacts.len());
        self.ways.reserve_exact(contacts.len());
        self.q.reserve_exact(contacts.len());
        self.ptr.reserve_exact(contacts.len() + 1);
        self.value_at.reserve_exact(contacts.len());
        self.diagonal_at.reserve_exact(contacts.len());
        self.diagonals.reserve_exact(own);
        self.col.reserve_exact(blocks - contacts.len());
        self.width.reserve_exact(blocks - contacts.len());
        self.values.reserve_exact(values - own);
    }

    fn way(&mut self, group: &RowGroup, block: &[f64]) -> Way {
        if let Some(simple) = Simple::new(group, block) {
            return Way::Simple(simple);
        }
        if let Some(coupled) = Coupled::new(group, block) {
            self.coupled.push(coupled);
            return Way::Coupled(self.coupled.len() as u32 - 1);
        }
        if let Some(discs) = Discs::new(group, block) {
            self.discs.push(discs);
            return Way::Discs(self.discs.len() as u32 - 1);
        }
        Way::Long
    }

    /// Own multipliers from outside.
    pub fn enter(&mut self, y: &[f64]) {
        for (own, &row) in self.y[..self.own].iter_mut().zip(&self.rows) {
            *own = y[row as usize];
        }
    }

    /// Own multipliers to outside.
    pub fn leave(&self, y: &mut [f64]) {
        for (own, &row) in self.y[..self.own].iter().zip(&self.rows) {
            y[row as usize] = *own;
        }
    }

    /// Multipliers of others from where all chunks show theirs.
    pub fn look(&mut self, shown: &[AtomicU64]) {
        for (copy, &row) in self.y[self.own..].iter_mut().zip(&self.rows[self.own..]) {
            *copy = f64::from_bits(shown[row as usize].load(Ordering::Relaxed));
        }
    }

    /// Shows own multipliers to all chunks.
    pub fn show(&self, shown: &[AtomicU64]) {
        for (own, &row) in self.y[..self.own].iter().zip(&self.rows) {
            shown[row as usize].store(own.to_bits(), Ordering::Relaxed);
        }
    }
}

/// One pass over the contacts of a chunk.
pub struct ChunkPass<'a> {
    pub chunk: &'a mut Chunk,
    pub relaxation: f64,
}

impl Work for ChunkPass<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, simd: S) {
        let ChunkPass { chunk, relaxation } = self;
        let count = chunk.groups.len();
        if chunk.all_three {
            (0..count).for_each(
                #[inline(always)]
                |k| chunk.relax_three(simd, k, relaxation),
            );
        } else {
            (0..count).for_each(
                #[inline(always)]
                |k| chunk.relax_any(simd, k, relaxation),
            );
        }
    }
}

/// The four numbers from `at` on, which are there.
#[inline(always)]
fn four<S: Lanes>(simd: S, numbers: &[f64], at: usize) -> S::Row {
    match numbers[at..].first_chunk() {
        Some(numbers) => simd.row(numbers),
        None => unreachable!("shorter than four"),
    }
}

impl Chunk {
    /// Contact `i` where all blocks are three by three.
    #[inline(always)]
    fn relax_three<S: Lanes>(&mut self, simd: S, i: usize, relaxation: f64) {
        let blocks = self.ptr[i] as usize..self.ptr[i + 1] as usize;
        let values = &self.values[9 * blocks.start..9 * blocks.end + 1];
        let mut sum = four(simd, &self.q[i], 0);
        for (k, &at) in self.col[blocks].iter().enumerate() {
            let w = &values[9 * k..9 * k + 10];
            let x = &self.y[at as usize..at as usize + 3];
            let first = simd.row_add(
                simd.row_scale(x[0], four(simd, w, 0)),
                simd.row_scale(x[1], four(simd, w, 3)),
            );
            let all = simd.row_add(first, simd.row_scale(x[2], four(simd, w, 6)));
            sum = simd.row_add(sum, all);
        }
        let b = simd.numbers(sum);
        let row = 3 * i;
        let block = &self.diagonals[9 * i..9 * i + 9];
        let last = [self.y[row], self.y[row + 1], self.y[row + 2]];
        let r = match &self.ways[i] {
            Way::Simple(simple) => simple.solve_three(b),
            Way::Coupled(k) => self.coupled[*k as usize]
                .solve(block, [b[0], b[1], b[2]], last)
                .unwrap_or_else(|| self.solve_long(i, block, &b[..3], last)),
            _ => self.solve_long(i, block, &b[..3], last),
        };
        self.y[row..row + 3].copy_from_slice(&r);
        if relaxation != 1.0 {
            self.overshoot(i, &last, relaxation);
        }
    }

    /// Goes `relaxation` times as far as the solution of contact `i`, and back into its cone.
    #[inline(always)]
    fn overshoot(&mut self, i: usize, last: &[f64], relaxation: f64) {
        let group = &self.groups[i];
        let r = &mut self.y[group.rows()];
        for (r, last) in r.iter_mut().zip(last) {
            *r = last + relaxation * (*r - last);
        }
        project_cone(group, r);
    }

    /// Contact `i` of any rows.
    #[inline(always)]
    fn relax_any<S: Lanes>(&mut self, simd: S, i: usize, relaxation: f64) {
        let group = &self.groups[i];
        let dim = group.dim;
        let blocks = self.ptr[i] as usize..self.ptr[i + 1] as usize;
        let mut column = self.value_at[i];
        let (mut low, mut high) = (four(simd, &self.q[i], 0), four(simd, &self.q[i], 4));
        for (&at, &width) in self.col[blocks.clone()].iter().zip(&self.width[blocks]) {
            for &x in &self.y[at as usize..at as usize + width as usize] {
                let w = &self.values[column..column + FULL];
                low = simd.row_add(low, simd.row_scale(x, four(simd, w, 0)));
                if dim > 4 {
                    high = simd.row_add(high, simd.row_scale(x, four(simd, w, 4)));
                }
                column += dim;
            }
        }
        let mut b = [0.0; FULL];
        b[..4].copy_from_slice(&simd.numbers(low));
        b[4..].copy_from_slice(&simd.numbers(high));
        let mut last = [0.0; MAX_ROWS];
        last[..dim].copy_from_slice(&self.y[group.rows()]);
        let r = &mut self.y[group.rows()];
        let at = self.diagonal_at[i] as usize;
        let block = &self.diagonals[at..at + dim * dim];
        let done = match &self.ways[i] {
            Way::Simple(simple) => {
                simple.solve(&b, r);
                true
            }
            Way::Discs(k) => self.discs[*k as usize].solve(block, &b[..dim], r),
            _ => false,
        };
        if !done {
            solve_contact(group, block, &b[..dim], r);
        }
        if relaxation != 1.0 {
            self.overshoot(i, &last[..dim], relaxation);
        }
    }

    #[cold]
    fn solve_long(&self, i: usize, block: &[f64], b: &[f64], last: [f64; 3]) -> [f64; 3] {
        let mut r = last;
        solve_contact(&self.groups[i], block, b, &mut r);
        r
    }
}
