//! Which contact is swept when: bodies in chunks, contacts in groups, groups in blocks, blocks in stages.
//!
//! Moving bodies are sorted along a space-filling curve and cut into chunks. A block has the contacts inside one chunk, or
//! those between two. Blocks of one stage share no chunk and may be swept at the same time, so the sequence of updates of every
//! body depends on the problem alone, not on the threads. Inside a block contacts follow their bodies and fill groups that
//! share no moving body. All is O(contacts) but for the sort of the bodies and of the few contacts between chunks.

use super::bodies::State;
use super::curve::Curve;
use super::groups::{ContactBlock, Packing, Source, UngroupedContact};
use super::lanes::SWAPPED;
use super::{Body, Contact, Place, SpheresError};
use crate::rows::WORLD;
use crate::team::{self, lock};
use std::ops::Range;
use std::sync::Mutex;

/// Chunks aimed at: enough for many threads. Bodies of a chunk: so many that few contacts lie between chunks, so few that
/// a chunk stays in cache.
const CHUNKS: usize = 64;
const CHUNK_LEAST: usize = 1024;
const CHUNK_MOST: usize = 16384;
/// Pieces of the contacts aimed at, and contacts of a piece.
const PIECES: usize = 64;
const PIECE_LEAST: usize = 2048;
const PIECE_MOST: usize = 1 << 16;
/// Contacts from which on the memory of the layout is given back: getting it again is cheap beside the sweeps of so many.
const HUGE: usize = 1_000_000;

/// Where bodies lie.
#[derive(Debug)]
pub struct Layout {
    /// Per body: its place among all states, 0 for a fixed body.
    pub state: Vec<u32>,
    /// States of a chunk, the first of which is the fixed world; the last chunk may have fewer.
    pub stride: usize,
    pub chunks: usize,
    /// Stage `k` has blocks `stages[k]..stages[k + 1]`.
    pub stages: Vec<usize>,
}

/// The links of a piece of the contacts.
#[derive(Debug, Default)]
struct Piece {
    /// Inside each chunk.
    inside: Vec<Vec<UngroupedContact>>,
    /// Between chunks, with their pair.
    between: Vec<([u32; 2], UngroupedContact)>,
}

/// Two chunks with contacts between them, and which of the links between chunks these are.
struct Pair {
    ends: (u32, u32),
    links: Range<usize>,
}

/// Memory in which layouts are made; what is in it says nothing about the next one.
#[derive(Debug, Default)]
pub struct Desk {
    curve: Curve,
    pieces: Vec<Piece>,
    packings: Mutex<Vec<Packing>>,
}

impl Default for Layout {
    /// No bodies, no contacts.
    fn default() -> Self {
        Self {
            state: Vec::new(),
            stride: 1,
            chunks: 0,
            stages: vec![0],
        }
    }
}

impl Layout {
    /// Places the bodies; `states` are theirs afterwards, at rest.
    pub fn place(
        &mut self,
        bodies: &[Body],
        places: Option<&[Place]>,
        states: &mut Vec<State>,
        desk: &mut Desk,
        threads: usize,
    ) {
        let order = desk.curve.order(bodies, places, threads);
        let moving = order.len();
        let size = moving.div_ceil(CHUNKS).clamp(CHUNK_LEAST, CHUNK_MOST);
        let chunks = moving.div_ceil(size).max(1);
        // Even chunks.
        let size = moving.div_ceil(chunks).max(1);
        let chunks = moving.div_ceil(size).max(1);
        self.state.clear();
        self.state.resize(bodies.len(), 0);
        states.clear();
        states.resize(moving + chunks, State::default());
        for (rank, body) in order.enumerate() {
            let at = rank + rank / size + 1;
            self.state[body as usize] = at as u32;
            let body = &bodies[body as usize];
            states[at].linear[3] = body.inv_mass;
            states[at].surface[3] = body.radius * body.radius * body.inv_inertia;
        }
        (self.stride, self.chunks) = (size + 1, chunks);
    }

    /// Cuts the contacts into blocks, by stages, in the memory of old ones.
    pub fn cut(
        &mut self,
        source: Source,
        states: &[State],
        blocks: &mut Vec<ContactBlock>,
        desk: &mut Desk,
        threads: usize,
    ) -> Result<(), SpheresError> {
        let contacts = source.contacts;
        let size = contacts.len().div_ceil(PIECES);
        let size = size.clamp(PIECE_LEAST, PIECE_MOST);
        let count = contacts.len().div_ceil(size);
        if desk.pieces.len() < count {
            desk.pieces.resize_with(count, Piece::default);
        }
        let pieces = contacts.chunks(size).zip(&mut desk.pieces);
        let pieces = pieces.enumerate().collect();
        let sorted = team::map(threads, pieces, |(k, (contacts, piece))| {
            self.sort_piece(k * size, contacts, piece)
        });
        sorted.into_iter().collect::<Result<(), SpheresError>>()?;
        let pieces = &desk.pieces[..count];
        let (between, pairs) = self.sort_between(pieces);
        let (order, colours) = colour(pairs.iter().map(|p| p.ends), self.chunks);
        self.stages.clear();
        self.stages.push(0);
        self.stages.extend(colours.iter().map(|s| self.chunks + s));
        let chunk = |k: u32| {
            let first = k as usize * self.stride;
            &states[first..states.len().min(first + self.stride)]
        };
        blocks.resize_with(self.chunks + order.len(), ContactBlock::default);
        let tasks = blocks.iter_mut().enumerate().collect();
        team::map(
            threads,
            tasks,
            |(index, block): (usize, &mut ContactBlock)| {
                let mut packing = lock(&desk.packings).pop().unwrap_or_default();
                if index < self.chunks {
                    let links = self.inner_links(index, pieces);
                    (block.left, block.right) = (index as u32, index as u32);
                    block.fill(index, &links, chunk(block.left), None, source, &mut packing);
                } else {
                    let pair = &pairs[order[index - self.chunks] as usize];
                    (block.left, block.right) = pair.ends;
                    let mut links = between[pair.links.clone()].to_vec();
                    links.sort_unstable_by_key(|link| u64::from(link.b) << 32 | u64::from(link.id));
                    let (left, right) = (chunk(block.left), chunk(block.right));
                    block.fill(index, &links, left, Some(right), source, &mut packing);
                }
                lock(&desk.packings).push(packing);
            },
        );
        if contacts.len() >= HUGE {
            *desk = Desk::default();
        }
        Ok(())
    }

    /// Sends contacts, the first of them number `first`, to their chunks.
    fn sort_piece(
        &self,
        first: usize,
        contacts: &[Contact],
        piece: &mut Piece,
    ) -> Result<(), SpheresError> {
        let state = |contact: u32, body: u32| match self.state.get(body as usize) {
            Some(&state) => Ok(state),
            None if body == WORLD => Ok(0),
            None => Err(SpheresError::Index {
                contact: contact as usize,
                body,
            }),
        };
        let stride = self.stride as u32;
        piece.inside.iter_mut().for_each(Vec::clear);
        piece.inside.resize_with(self.chunks, Vec::new);
        piece.between.clear();
        for (id, c) in (first as u32..).zip(contacts) {
            let (a, b) = (state(id, c.a)?, state(id, c.b)?);
            if a == b {
                return Err(SpheresError::Immovable {
                    contact: id as usize,
                });
            }
            c.check(id as usize)?;
            let (chunk_a, chunk_b) = (a / stride, b / stride);
            let (a_in, b_in) = (a - chunk_a * stride, b - chunk_b * stride);
            let link = |a, b, id| UngroupedContact { a, b, id };
            if a == 0 || b == 0 || chunk_a == chunk_b {
                piece.inside[chunk_a.max(chunk_b) as usize].push(link(a_in, b_in, id));
            } else if chunk_a < chunk_b {
                let pair = [chunk_a, chunk_b];
                piece.between.push((pair, link(a_in, b_in, id)));
            } else {
                let pair = [chunk_b, chunk_a];
                piece.between.push((pair, link(b_in, a_in, id | SWAPPED)));
            }
        }
        Ok(())
    }

    /// All links between chunks, by pairs, in the order of the contacts; and the pairs.
    fn sort_between(&self, pieces: &[Piece]) -> (Vec<UngroupedContact>, Vec<Pair>) {
        let all = || pieces.iter().flat_map(|p| &p.between);
        let number = |ends: [u32; 2]| ends[0] as usize * self.chunks + ends[1] as usize;
        let mut next = vec![0; self.chunks * self.chunks];
        for (ends, _) in all() {
            next[number(*ends)] += 1;
        }
        let (mut pairs, mut sum) = (Vec::new(), 0);
        for (k, next) in next.iter_mut().enumerate().filter(|(_, count)| **count > 0) {
            let first = sum;
            sum += std::mem::replace(next, first);
            let ends = ((k / self.chunks) as u32, (k % self.chunks) as u32);
            pairs.push(Pair {
                ends,
                links: first..sum,
            });
        }
        let mut links = vec![UngroupedContact::default(); sum];
        for (ends, link) in all() {
            let next = &mut next[number(*ends)];
            links[*next] = *link;
            *next += 1;
        }
        (links, pairs)
    }

    /// All links inside a chunk, each at the later of its bodies.
    fn inner_links(&self, chunk: usize, pieces: &[Piece]) -> Vec<UngroupedContact> {
        let all = || pieces.iter().flat_map(|p| &p.inside[chunk]);
        let mut start = vec![0u32; self.stride + 1];
        for link in all() {
            start[link.a.max(link.b) as usize + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut links = vec![UngroupedContact::default(); start[self.stride] as usize];
        for link in all() {
            let slot = &mut start[link.a.max(link.b) as usize];
            links[*slot as usize] = *link;
            *slot += 1;
        }
        links
    }
}

/// First-fit colouring of pairs of chunks: pairs of one colour share no chunk. The pairs by colour, and where each colour
/// starts, with the end.
fn colour(pairs: impl Iterator<Item = (u32, u32)>, chunks: usize) -> (Vec<u32>, Vec<usize>) {
    let mut used: Vec<Vec<u64>> = vec![Vec::new(); chunks];
    let mut colours: Vec<Vec<u32>> = Vec::new();
    for (index, (left, right)) in pairs.enumerate() {
        let (left, right) = (left as usize, right as usize);
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
        let colour = 64 * k + bit;
        if colours.len() <= colour {
            colours.resize(colour + 1, Vec::new());
        }
        colours[colour].push(index as u32);
    }
    let mut starts = vec![0];
    for colour in &colours {
        starts.push(starts[starts.len() - 1] + colour.len());
    }
    (colours.concat(), starts)
}
