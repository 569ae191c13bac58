//! Which contact is swept when: bodies in chunks, contacts in groups, groups in blocks, blocks in stages.
//!
//! Moving bodies are sorted along a space-filling curve and cut into chunks. A block has the contacts inside one chunk, or
//! those between two. Blocks of one stage share no chunk and may be swept at the same time, so the sequence of updates of every
//! body depends on the problem alone, not on the threads. Inside a block contacts follow their bodies and fill groups that
//! share no moving body. All is O(contacts) but for the sort of the bodies and of the few contacts between chunks.

use super::groups::{pack, Block, Link, Slots, SWAPPED};
use super::kernel::State;
use super::{Body, Contact, Place, SpheresError};
use crate::rows::WORLD;
use crate::team;

/// Chunks aimed at: enough for many threads. Bodies of a chunk: so many that few contacts lie between chunks, so few that
/// a chunk stays in cache.
const CHUNKS: usize = 64;
const CHUNK_LEAST: usize = 1024;
const CHUNK_MOST: usize = 16384;
/// Contacts that are looked at in one go.
const PIECE: usize = 1 << 16;
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

/// The links of a piece of the contacts: inside each chunk, and between chunks with their pair.
type Sorted = (Vec<Vec<Link>>, Vec<(u64, Link)>);

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
    pub fn new(bodies: &[Body], places: Option<&[Place]>, states: &mut Vec<State>) -> Self {
        let order = sorted(bodies, places);
        let moving = order.len();
        let size = moving.div_ceil(CHUNKS).clamp(CHUNK_LEAST, CHUNK_MOST);
        let chunks = moving.div_ceil(size).max(1);
        // Even chunks.
        let size = moving.div_ceil(chunks).max(1);
        let chunks = moving.div_ceil(size).max(1);
        let mut state = vec![0; bodies.len()];
        states.clear();
        states.resize(moving + chunks, State::default());
        for (rank, &body) in order.iter().enumerate() {
            let at = rank + rank / size + 1;
            state[body as usize] = at as u32;
            let body = &bodies[body as usize];
            states[at].linear[3] = body.inv_mass;
            states[at].surface[3] = body.radius * body.radius * body.inv_inertia;
        }
        Self {
            state,
            stride: size + 1,
            chunks,
            stages: Vec::new(),
        }
    }

    /// Cuts the contacts into blocks, by stages, in the memory of `old` ones.
    pub fn blocks(
        &mut self,
        contacts: &[Contact],
        states: &[State],
        threads: usize,
        old: Vec<Block>,
        slots: &mut Slots,
    ) -> Result<Vec<Block>, SpheresError> {
        let pieces: Vec<(usize, &[Contact])> = contacts.chunks(PIECE).enumerate().collect();
        let pieces = team::map(threads, pieces, |(k, piece)| {
            self.sort_piece(k * PIECE, piece)
        });
        let mut pieces = pieces
            .into_iter()
            .collect::<Result<Vec<Sorted>, SpheresError>>()?;
        let mut between: Vec<(u64, Link)> = pieces
            .iter_mut()
            .flat_map(|p| std::mem::take(&mut p.1))
            .collect();
        between.sort_unstable_by_key(|(pair, link)| (*pair, link.b, link.id));
        let pairs: Vec<&[(u64, Link)]> = between.chunk_by(|x, y| x.0 == y.0).collect();
        let ends = |pair: u64| ((pair >> 32) as u32, pair as u32);
        let (order, starts) = colour(pairs.iter().map(|p| ends(p[0].0)), self.chunks);
        self.stages = vec![0];
        self.stages.extend(starts.iter().map(|s| self.chunks + s));
        let chunk = |k: u32| {
            let first = k as usize * self.stride;
            &states[first..states.len().min(first + self.stride)]
        };
        let count = self.chunks + order.len();
        let old = old
            .into_iter()
            .chain(std::iter::repeat_with(Block::default));
        slots.resize(contacts.len());
        let slots = &*slots;
        let blocks = team::map(threads, (0..count).zip(old).collect(), |(index, old)| {
            let block = if index < self.chunks {
                let links = self.inner_links(index, &pieces);
                let own = (index as u32, index as u32);
                pack(old, &links, own, chunk(own.0), None, contacts)
            } else {
                let pair = pairs[order[index - self.chunks] as usize];
                let between = ends(pair[0].0);
                let links: Vec<Link> = pair.iter().map(|p| p.1).collect();
                let (left, right) = (chunk(between.0), chunk(between.1));
                pack(old, &links, between, left, Some(right), contacts)
            };
            slots.enter(index, &block);
            block
        });
        Ok(blocks)
    }

    /// Sends contacts, the first of them number `first`, to their chunks.
    fn sort_piece(&self, first: usize, contacts: &[Contact]) -> Result<Sorted, SpheresError> {
        let state = |contact: u32, body: u32| match self.state.get(body as usize) {
            Some(&state) => Ok(state),
            None if body == WORLD => Ok(0),
            None => Err(SpheresError::Index {
                contact: contact as usize,
                body,
            }),
        };
        let stride = self.stride as u32;
        let mut inside: Vec<Vec<Link>> = vec![Vec::new(); self.chunks];
        let mut between = Vec::new();
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
            if a == 0 || b == 0 || chunk_a == chunk_b {
                inside[chunk_a.max(chunk_b) as usize].push(Link {
                    a: a_in,
                    b: b_in,
                    id,
                });
            } else if chunk_a < chunk_b {
                let link = Link {
                    a: a_in,
                    b: b_in,
                    id,
                };
                between.push((u64::from(chunk_a) << 32 | u64::from(chunk_b), link));
            } else {
                let id = id | SWAPPED;
                let link = Link {
                    a: b_in,
                    b: a_in,
                    id,
                };
                between.push((u64::from(chunk_b) << 32 | u64::from(chunk_a), link));
            }
        }
        Ok((inside, between))
    }

    /// All links inside a chunk, each at the later of its bodies.
    fn inner_links(&self, chunk: usize, pieces: &[Sorted]) -> Vec<Link> {
        let all = || pieces.iter().flat_map(|p| &p.0[chunk]);
        let mut start = vec![0u32; self.stride + 1];
        for link in all() {
            start[link.a.max(link.b) as usize + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut links = vec![Link::default(); start[self.stride] as usize];
        for link in all() {
            let slot = &mut start[link.a.max(link.b) as usize];
            links[*slot as usize] = *link;
            *slot += 1;
        }
        links
    }
}

/// Moving bodies along a Morton curve through the places; in the given order without places.
fn sorted(bodies: &[Body], places: Option<&[Place]>) -> Vec<u32> {
    let moving = (0..bodies.len() as u32).filter(|&i| !bodies[i as usize].is_fixed());
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
    // Key and body in one number: as fine a grid as the bits beside the body allow.
    let name = usize::BITS - bodies.len().leading_zeros();
    let cells = ((1u64 << ((u64::BITS - name) / 3).min(21)) - 1) as f64;
    let scale = if span > 0.0 { cells / span } else { 0.0 };
    let mut keys: Vec<u64> = moving
        .map(|body| {
            let place = &places[body as usize];
            let cell = |k: usize| spread(((place[k] - low[k]) * scale) as u64);
            (cell(0) << 2 | cell(1) << 1 | cell(2)) << name | u64::from(body)
        })
        .collect();
    keys.sort_unstable();
    keys.into_iter()
        .map(|key| (key & ((1 << name) - 1)) as u32)
        .collect()
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
