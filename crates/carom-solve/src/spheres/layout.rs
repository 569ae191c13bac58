//! Which contact is swept when: bodies in chunks, contacts in groups, tasks in stages.
//!
//! Bodies are sorted along a space-filling curve and cut into chunks. A task has the contacts inside one chunk, or those
//! between two; tasks of one stage share no chunk, so they may run at the same time, and the sequence of all updates depends on
//! the problem alone. Inside a task contacts follow their bodies and fill groups that share no moving body. All of it is O(contacts)
//! but for the sort of the bodies.

use super::lanes::GROUP;
use super::{team, Contact, Place};
use crate::rows::WORLD;

/// Bodies of a chunk: enough chunks for many threads, each with few contacts on its surface, at most some caches large.
const CHUNKS: usize = 64;
const CHUNK_LEAST: usize = 1024;
const CHUNK_MOST: usize = 16384;
/// Bit of [`Layout::contact`]: the sides of this contact are exchanged.
pub const SWAPPED: u32 = 1 << 31;
/// A lane without contact.
pub const EMPTY: u32 = u32::MAX;

/// Contacts between two chunks, or inside one.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    pub left: u32,
    pub right: u32,
    /// First group, and the one behind the last.
    pub groups: [u32; 2],
}

#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Per body: its place among all states, 0 for a fixed body.
    pub state: Vec<u32>,
    /// Chunk `k` has states `chunks[k]..chunks[k + 1]`; the first of a chunk is the fixed world.
    pub chunks: Vec<usize>,
    pub tasks: Vec<Task>,
    /// Stage `k` has tasks `stages[k]..stages[k + 1]`.
    pub stages: Vec<usize>,
    /// Per lane of all groups: the contact, with [`SWAPPED`]; or [`EMPTY`].
    pub contact: Vec<u32>,
}

/// A contact on its way to a group: states within the chunks of its task.
#[derive(Clone, Copy, Default)]
struct Link {
    a: u32,
    b: u32,
    contact: u32,
}

/// Lanes of a task: contact and local states.
#[derive(Clone, Copy)]
pub struct Lane {
    pub a: u32,
    pub b: u32,
    pub contact: u32,
}

impl Layout {
    /// `fixed(i)`: body `i` cannot move.
    pub fn new(
        bodies: usize,
        fixed: impl Fn(usize) -> bool,
        contacts: &[Contact],
        places: Option<&[Place]>,
        threads: usize,
    ) -> (Self, Vec<[Lane; GROUP]>) {
        let order = sorted(bodies, fixed, places);
        let moving = order.len();
        let size = moving.div_ceil(CHUNKS).clamp(CHUNK_LEAST, CHUNK_MOST);
        let count = moving.div_ceil(size).max(1);
        // Even chunks, each with one more state for the world.
        let size = moving.div_ceil(count).max(1);
        let mut layout = Self::default();
        layout.chunks = (0..count).map(|k| k * (size + 1)).collect();
        layout.chunks.push(moving + count);
        layout.state = vec![0; bodies];
        for (rank, &body) in order.iter().enumerate() {
            layout.state[body as usize] = (rank + rank / size + 1) as u32;
        }
        let (links, tasks) = layout.assign(contacts, size as u32 + 1);
        let lanes = layout.group(links, tasks, size + 1, threads);
        (layout, lanes)
    }

    /// The links of each task in order, and the tasks (links in place of groups), inner ones first.
    fn assign(&self, contacts: &[Contact], size: u32) -> (Vec<Link>, Vec<Task>) {
        let count = self.chunks.len() - 1;
        let state = |body: u32| if body == WORLD { 0 } else { self.state[body as usize] };
        // Inner contacts: counted and placed at the later one of their states.
        let mut start = vec![0u32; self.chunks[count] + 1];
        let mut between: Vec<(u64, Link)> = Vec::new();
        let mut ends = Vec::with_capacity(contacts.len());
        for (index, c) in contacts.iter().enumerate() {
            let (a, b) = (state(c.a), state(c.b));
            let (low, high) = (a.min(b), a.max(b));
            let chunk = high / size;
            if low == 0 || low / size == chunk {
                start[high as usize] += 1;
                ends.push((high, low));
                continue;
            }
            ends.push((0, 0));
            let swapped = if a > b { SWAPPED } else { 0 };
            let link = Link {
                a: low % size,
                b: high % size,
                contact: index as u32 | swapped,
            };
            between.push((u64::from(low / size) << 32 | u64::from(chunk), link));
        }
        let mut sum = 0;
        for s in &mut start {
            sum += std::mem::replace(s, sum);
        }
        let firsts: Vec<u32> = self.chunks.iter().map(|&c| start[c]).collect();
        let mut links = vec![Link::default(); sum as usize + between.len()];
        for (index, (&(high, low), c)) in ends.iter().zip(contacts).enumerate() {
            if high == 0 {
                continue;
            }
            let (high_local, low_local) = (high % size, if low == 0 { 0 } else { low % size });
            let first = state(c.a) == high;
            let (a, b) = if first { (high_local, low_local) } else { (low_local, high_local) };
            let slot = &mut start[high as usize];
            links[*slot as usize] = Link {
                a,
                b,
                contact: index as u32,
            };
            *slot += 1;
        }
        let mut tasks: Vec<Task> = (0..count as u32)
            .map(|k| Task {
                left: k,
                right: k,
                groups: [firsts[k as usize], firsts[k as usize + 1]],
            })
            .collect();
        // Between chunks: by pair, then by the later state.
        between.sort_unstable_by_key(|(pair, link)| (*pair, link.b, link.a, link.contact));
        for (at, (pair, link)) in between.iter().enumerate() {
            let at = sum + at as u32;
            links[at as usize] = *link;
            let (left, right) = ((pair >> 32) as u32, *pair as u32);
            match tasks.last_mut() {
                Some(task) if (task.left, task.right) == (left, right) => task.groups[1] = at + 1,
                _ => tasks.push(Task {
                    left,
                    right,
                    groups: [at, at + 1],
                }),
            }
        }
        (links, tasks)
    }

    /// Fills groups and sorts the tasks into stages.
    fn group(&mut self, links: Vec<Link>, mut tasks: Vec<Task>, size: usize, threads: usize) -> Vec<[Lane; GROUP]> {
        let inner = self.chunks.len() - 1;
        let (order, stages) = colour(&tasks[inner..], inner);
        self.stages = stages.iter().map(|s| inner + s).collect();
        self.stages.insert(0, 0);
        let outer: Vec<Task> = order.iter().map(|&k| tasks[inner + k as usize]).collect();
        tasks.truncate(inner);
        tasks.extend(outer);
        let mut parts: Vec<Vec<[Lane; GROUP]>> = vec![Vec::new(); tasks.len()];
        team::each(threads, parts.iter_mut().zip(&tasks).collect(), |(part, task)| {
            let links = &links[task.groups[0] as usize..task.groups[1] as usize];
            *part = pack(links, size, task.left != task.right);
        });
        let mut groups = Vec::with_capacity(parts.iter().map(Vec::len).sum());
        for (task, part) in tasks.iter_mut().zip(&parts) {
            let first = groups.len() as u32;
            groups.extend_from_slice(part);
            task.groups = [first, groups.len() as u32];
        }
        self.tasks = tasks;
        self.contact = groups.iter().flatten().map(|lane| lane.contact).collect();
        groups
    }
}

/// Moving bodies along a Morton curve through the places; in the given order without places.
fn sorted(bodies: usize, fixed: impl Fn(usize) -> bool, places: Option<&[Place]>) -> Vec<u32> {
    let moving = (0..bodies as u32).filter(|&i| !fixed(i as usize));
    let Some(places) = places else {
        return moving.collect();
    };
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for body in moving.clone() {
        for (k, x) in places[body as usize].iter().enumerate() {
            low[k] = low[k].min(*x);
            high[k] = high[k].max(*x);
        }
    }
    let span = (0..3).fold(0.0f64, |s, k| s.max(high[k] - low[k]));
    let scale = if span > 0.0 { f64::from((1u32 << 21) - 1) / span } else { 0.0 };
    let mut keys: Vec<(u64, u32)> = moving
        .map(|body| {
            let place = &places[body as usize];
            let cell = |k: usize| spread(((place[k] - low[k]) * scale) as u64);
            (cell(0) << 2 | cell(1) << 1 | cell(2), body)
        })
        .collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, body)| body).collect()
}

/// The lower 21 bits, each followed by two zeros.
fn spread(x: u64) -> u64 {
    let x = x & 0x1f_ffff;
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// First-fit edge colouring of the chunks: tasks by colour, and where each colour starts (with the end).
fn colour(tasks: &[Task], chunks: usize) -> (Vec<u32>, Vec<usize>) {
    let mut used: Vec<Vec<u64>> = vec![Vec::new(); chunks];
    let mut stages: Vec<Vec<u32>> = Vec::new();
    for (index, task) in tasks.iter().enumerate() {
        let (left, right) = (task.left as usize, task.right as usize);
        let word = |side: usize, k: usize| used[side].get(k).copied().unwrap_or(0);
        let mut k = 0;
        while word(left, k) | word(right, k) == u64::MAX {
            k += 1;
        }
        let bit = (word(left, k) | word(right, k)).trailing_ones() as usize;
        for side in [left, right] {
            if used[side].len() <= k {
                used[side].resize(k + 1, 0);
            }
            used[side][k] |= 1 << bit;
        }
        let stage = 64 * k + bit;
        if stages.len() <= stage {
            stages.resize(stage + 1, Vec::new());
        }
        stages[stage].push(index as u32);
    }
    let mut starts = vec![0];
    for stage in &stages {
        starts.push(starts[starts.len() - 1] + stage.len());
    }
    (stages.concat(), starts)
}

/// Packs links, in order, into groups that share no moving body: first fit into a window of open groups.
fn pack(links: &[Link], size: usize, two: bool) -> Vec<[Lane; GROUP]> {
    const NONE: Lane = Lane {
        a: 0,
        b: 0,
        contact: EMPTY,
    };
    let mut groups = Vec::with_capacity(links.len() / GROUP + 16);
    let mut open = [([NONE; GROUP], 0usize); 64];
    // Per state: the open groups it is in. The right chunk's states follow the left one's.
    let offset = if two { size } else { 0 };
    let mut masks = vec![0u64; size + offset];
    let mut close = |slot: usize, open: &mut [([Lane; GROUP], usize); 64], masks: &mut [u64]| {
        let (group, filled) = std::mem::replace(&mut open[slot], ([NONE; GROUP], 0));
        for lane in &group[..filled] {
            masks[lane.a as usize] &= !(1 << slot);
            masks[lane.b as usize + offset] &= !(1 << slot);
        }
        groups.push(group);
    };
    for link in links {
        let (a, b) = (link.a as usize, link.b as usize + offset);
        let mut taken = masks[a] | masks[b];
        if taken == u64::MAX {
            close(0, &mut open, &mut masks);
            taken &= !1;
        }
        let slot = taken.trailing_ones() as usize;
        let (group, filled) = &mut open[slot];
        group[*filled] = Lane {
            a: link.a,
            b: link.b,
            contact: link.contact,
        };
        *filled += 1;
        // State 0 of a chunk is the world: shared freely.
        if link.a != 0 {
            masks[a] |= 1 << slot;
        }
        if link.b != 0 {
            masks[b] |= 1 << slot;
        }
        if *filled == GROUP {
            close(slot, &mut open, &mut masks);
        }
    }
    for slot in 0..64 {
        if open[slot].1 > 0 {
            close(slot, &mut open, &mut masks);
        }
    }
    let streams: usize = std::env::var("STREAMS").map_or(1, |s| s.parse().unwrap());
    let part = groups.len().div_ceil(streams);
    (0..part * streams)
        .filter_map(|k| groups.get(k / streams + part * (k % streams)).copied())
        .collect()
}
