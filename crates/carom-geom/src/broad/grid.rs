//! One uniform grid of cubic cells, stored as a counting sort of its bodies by cell.
//!
//! A cell is as wide as the largest pair reaches, so partners lie in the 27 cells around a body. Two layouts:
//!
//! * **dense**, where the bounding box holds O(N) cells: cells along x are neighbours in memory, so the 27 cells
//!   are 9 contiguous ranges (5 where each pair is wanted once);
//! * **hashed**, where it does not - one ball that left for the horizon is enough - with O(N) buckets whatever
//!   the coordinates.

use glam::DVec3;
use std::ops::{ControlFlow, Range};

/// A body as the grid sees it: close to another iff `|x_a - x_b| <= extent_a + extent_b`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub x: DVec3,
    pub extent: f64,
    /// Index of the body, with [`IMAGE`] set for its images in a periodic box.
    id: u32,
    slot: u32,
}

/// Marks an image.
const IMAGE: u32 = 1 << 31;

impl Entry {
    /// The image of this body at another place.
    pub fn image(&self, x: DVec3) -> Self {
        Self {
            x,
            id: self.id | IMAGE,
            ..*self
        }
    }

    /// The bodies of a pair, the smaller index first; none for two images, and for a body and its own image.
    #[inline(always)]
    pub fn pair(&self, other: &Self) -> Option<(u32, u32)> {
        let (a, b) = (self.id & !IMAGE, other.id & !IMAGE);
        (self.id & other.id & IMAGE == 0 && a != b).then(|| (a.min(b), a.max(b)))
    }

    pub fn new(id: u32, x: DVec3, extent: f64) -> Self {
        Self {
            x,
            extent,
            id,
            slot: 0,
        }
    }

    /// The test is a hair generous, so that rounding never drops a pair that the caller's own sum would keep.
    #[inline(always)]
    pub fn is_close(&self, other: &Self) -> bool {
        let reach = self.extent + other.extent;
        (self.x - other.x).length_squared() <= reach * reach * (1.0 + 1e-12)
    }
}

#[derive(Clone, Copy, Debug)]
enum Layout {
    /// Cells per axis inside; a border of empty cells on all sides saves every bounds test.
    Dense { inside: [u32; 3] },
    /// Number of bits to drop from a mixed key; the table has `2^(64 - shift)` buckets.
    Hashed { shift: u32 },
}

#[derive(Debug)]
pub(super) struct Grid {
    origin: DVec3,
    /// Cells per metre.
    inv: f64,
    /// Largest extent, m.
    largest: f64,
    layout: Layout,
    /// First entry of each slot, and the total at the end.
    start: Vec<u32>,
    entries: Vec<Entry>,
    /// Keys of `entries`; hashed layout only.
    keys: Vec<u64>,
}

/// Wider cells than needed, relatively: covers the rounding of cell coordinates up to [`FAR`] cells from the origin.
const CELL_MARGIN: f64 = 1.0 / 256.0;
/// Cell coordinates are clamped here. Clamping never separates neighbours, it only crowds the border.
const FAR: f64 = (1u64 << 40) as f64;

/// The key of a cell is linear in its integer coordinates, so a neighbour's key is one addition away, and the
/// 27 keys around a cell are provably distinct (tested below). Distant cells may share a key; the distance test
/// sorts them out.
const KEY: [u64; 3] = [
    0x9E37_79B9_7F4A_7C15,
    0xC2B2_AE3D_27D4_EB4F,
    0x1656_67B1_9E37_79F9,
];
/// Mixes a key before its top bits choose the bucket.
const MIX: u64 = 0xD6E8_FEB8_6659_FD93;

const fn key_offset(x: i64, y: i64, z: i64) -> u64 {
    (x as u64)
        .wrapping_mul(KEY[0])
        .wrapping_add((y as u64).wrapping_mul(KEY[1]))
        .wrapping_add((z as u64).wrapping_mul(KEY[2]))
}

/// All 27 neighbours; index 13 is the cell itself and the 13 after it are the forward half.
const AROUND: [u64; 27] = {
    let mut out = [0; 27];
    let mut i = 0;
    while i < 27 {
        let j = i as i64;
        out[i] = key_offset(j % 3 - 1, j / 3 % 3 - 1, j / 9 - 1);
        i += 1;
    }
    out
};

impl Grid {
    pub fn new() -> Self {
        Self {
            origin: DVec3::ZERO,
            inv: 0.0,
            largest: 0.0,
            layout: Layout::Hashed { shift: 63 },
            start: Vec::new(),
            entries: Vec::new(),
            keys: Vec::new(),
        }
    }

    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Sorts `bodies` (finite, not empty) into cells; `scratch` is any reusable buffer.
    pub fn build(&mut self, bodies: &mut [Entry], scratch: &mut Vec<u64>) {
        let (mut low, mut high, mut largest) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 1e-100_f64);
        for b in bodies.iter() {
            low = low.min(b.x);
            high = high.max(b.x);
            largest = largest.max(b.extent);
        }
        self.origin = low;
        self.largest = largest;
        self.inv = 1.0 / (2.0 * largest * (1.0 + CELL_MARGIN));
        let cells = ((high - low) * self.inv).floor() + DVec3::ONE;
        let n = bodies.len();
        let padded = (cells.x + 2.0) * (cells.y + 2.0) * (cells.z + 2.0);
        // A packing has about 0.4 cells per ball; 8 leave room for loose clouds and for tables seen flat.
        let slots = if padded <= 8.0 * n as f64 + 1024.0 {
            self.layout = Layout::Dense {
                inside: [cells.x as u32, cells.y as u32, cells.z as u32],
            };
            for b in bodies.iter_mut() {
                b.slot = self.dense_slot(b.x);
            }
            padded as usize
        } else {
            let bits = (2 * n).next_power_of_two().trailing_zeros().max(1);
            self.layout = Layout::Hashed { shift: 64 - bits };
            scratch.clear();
            for b in bodies.iter_mut() {
                let key = self.key(b.x);
                b.slot = bucket(key, 64 - bits);
                scratch.push(key);
            }
            1 << bits
        };
        self.sort(bodies, slots, scratch);
    }

    /// Stable counting sort by slot.
    fn sort(&mut self, bodies: &[Entry], slots: usize, keys: &[u64]) {
        self.start.clear();
        self.start.resize(slots + 1, 0);
        for b in bodies {
            self.start[b.slot as usize] += 1;
        }
        let mut sum = 0;
        for s in &mut self.start {
            sum += std::mem::replace(s, sum);
        }
        self.entries.clear();
        self.entries
            .resize(bodies.len(), Entry::new(0, DVec3::ZERO, 0.0));
        let hashed = matches!(self.layout, Layout::Hashed { .. });
        self.keys.clear();
        self.keys.resize(if hashed { bodies.len() } else { 0 }, 0);
        for (i, b) in bodies.iter().enumerate() {
            let to = self.start[b.slot as usize] as usize;
            self.start[b.slot as usize] += 1;
            self.entries[to] = *b;
            if hashed {
                self.keys[to] = keys[i];
            }
        }
        // Every start has moved to the end of its slot, which is the start of the next.
        self.start.copy_within(0..slots, 1);
        self.start[0] = 0;
    }

    #[inline]
    fn dense_slot(&self, x: DVec3) -> u32 {
        let Layout::Dense {
            inside: [nx, ny, nz],
        } = self.layout
        else {
            unreachable!("dense grid")
        };
        let c = (x - self.origin) * self.inv;
        // A float-to-integer cast saturates and maps negative numbers to 0: this is the clamp.
        let (ix, iy, iz) = (
            (c.x as u32).min(nx - 1),
            (c.y as u32).min(ny - 1),
            (c.z as u32).min(nz - 1),
        );
        ((iz + 1) * (ny + 2) + iy + 1) * (nx + 2) + ix + 1
    }

    #[inline]
    fn key(&self, x: DVec3) -> u64 {
        let c = ((x - self.origin) * self.inv)
            .floor()
            .clamp(DVec3::splat(-FAR), DVec3::splat(FAR));
        key_offset(c.x as i64, c.y as i64, c.z as i64)
    }

    #[inline(always)]
    fn slots(&self, first: u32, end: u32) -> &[Entry] {
        &self.entries[self.start[first as usize] as usize..self.start[end as usize] as usize]
    }

    /// Every close pair of this grid's bodies whose first lies in `range` of [`Self::entries`], in an order that depends on
    /// the input alone. Over the whole range each pair comes once.
    pub fn pairs<F>(&self, range: Range<usize>, mut visit: F) -> ControlFlow<()>
    where
        F: FnMut(&Entry, &Entry) -> ControlFlow<()>,
    {
        let mut scan = |a: &Entry, others: &[Entry]| -> ControlFlow<()> {
            for b in others {
                if a.is_close(b) {
                    visit(a, b)?;
                }
            }
            ControlFlow::Continue(())
        };
        match self.layout {
            Layout::Dense {
                inside: [nx, ny, _],
            } => {
                let (row, layer) = (nx + 2, (nx + 2) * (ny + 2));
                for k in range {
                    let a = &self.entries[k];
                    let s = a.slot;
                    scan(a, &self.entries[k + 1..self.start[s as usize + 2] as usize])?;
                    for t in [s + row, s + layer - row, s + layer, s + layer + row] {
                        scan(a, self.slots(t - 1, t + 2))?;
                    }
                }
            }
            Layout::Hashed { shift } => {
                for k in range {
                    let (a, key) = (&self.entries[k], self.keys[k]);
                    for (j, offset) in AROUND[13..].iter().enumerate() {
                        let wanted = key.wrapping_add(*offset);
                        let slot = bucket(wanted, shift) as usize;
                        let first = if j == 0 {
                            k + 1
                        } else {
                            self.start[slot] as usize
                        };
                        for i in first..self.start[slot + 1] as usize {
                            if self.keys[i] == wanted {
                                scan(a, std::slice::from_ref(&self.entries[i]))?;
                            }
                        }
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Every body of this grid close to `a`, which is not in it and whose extent is at most the grid's largest. Looks into
    /// the cells that `a` reaches only: 8 of the 27 around it where it is much smaller than they are.
    pub fn around<F>(&self, a: &Entry, mut visit: F) -> ControlFlow<()>
    where
        F: FnMut(&Entry, &Entry) -> ControlFlow<()>,
    {
        let centre = (a.x - self.origin) * self.inv;
        let reach = DVec3::splat((a.extent + self.largest) * self.inv + 0.5 * CELL_MARGIN);
        let (low, high) = ((centre - reach).floor(), (centre + reach).floor());
        match self.layout {
            Layout::Dense {
                inside: [nx, ny, nz],
            } => {
                let last = DVec3::new(f64::from(nx), f64::from(ny), f64::from(nz)) - DVec3::ONE;
                let (low, high) = (low.max(DVec3::ZERO), high.min(last));
                if low.cmpgt(high).any() {
                    return ControlFlow::Continue(());
                }
                let (low, high) = (low.as_uvec3(), high.as_uvec3());
                for z in low.z..=high.z {
                    for y in low.y..=high.y {
                        let row = ((z + 1) * (ny + 2) + y + 1) * (nx + 2) + 1;
                        for b in self.slots(row + low.x, row + high.x + 1) {
                            if a.is_close(b) {
                                visit(a, b)?;
                            }
                        }
                    }
                }
            }
            Layout::Hashed { shift } => {
                let far = DVec3::splat(FAR);
                let whole = |c: DVec3| c.clamp(-far, far).as_i64vec3();
                let (low, high) = (whole(low), whole(high));
                for z in low.z..=high.z {
                    for y in low.y..=high.y {
                        for x in low.x..=high.x {
                            let wanted = key_offset(x, y, z);
                            let slot = bucket(wanted, shift) as usize;
                            for i in self.start[slot] as usize..self.start[slot + 1] as usize {
                                if self.keys[i] == wanted && a.is_close(&self.entries[i]) {
                                    visit(a, &self.entries[i])?;
                                }
                            }
                        }
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }
}

#[inline(always)]
fn bucket(key: u64, shift: u32) -> u32 {
    (key.wrapping_mul(MIX) >> shift) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_cells_up_to_two_apart_are_distinct() {
        // Then no pair is met twice, and a forward key is never also a backward one.
        for x in -2..=2 {
            for y in -2..=2 {
                for z in -2..=2 {
                    assert_eq!(key_offset(x, y, z) == 0, (x, y, z) == (0, 0, 0));
                }
            }
        }
        assert_eq!(AROUND[13], 0);
    }
}
