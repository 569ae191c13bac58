//! Impulses of whole chunks, scaled: what sweeps take longest to tell from one end of a pile to the other.
//!
//! Sweeps settle a contact with its neighbours at once, and the weight of a pile layer by layer. What they leave longest are impulses that are
//! too large everywhere, which counts for little in the norm of eq. 44 but lifts the pile. So once in a while, and once more at the end where that is asked ([`super::Goal::weighed`]), the
//! impulses of each chunk `c` are multiplied by `1 + s_c` (those between two chunks by the mean of both), which leaves what is in
//! its cone there, such that `sum q.z = 0` over each chunk, contacts between chunks counted half: `q` is the impulse where it sticks and its
//! normal part where it slides, since these do no work at solutions. The factors solve a linear system of one row per chunk, Galerkin's
//! aggregation (Vanek, Mandel and Brezina, Computing 56, 179, 1996) with the present impulses as its vectors.
//!
//! Not where something rolls, nor in problems of one chunk.

use super::bodies::{ContactLanes, State};
use super::groups::ContactBlock;
use super::lanes::{head, vector};
use super::rolls::filled;
use super::sweeps::Sweeps;
use crate::direct::dense::{lu_factor, lu_solve};
use crate::team;
use glam::DVec3;

/// Bounds of `s_c` (1): cones open and close long before the linear system knows of it. Wider, impulses of a chunk change sign
/// or explode, and the sweeps begin anew.
const BOUNDS: [f64; 2] = [-0.7, 2.0];
/// Changes (1, in the mean over the impulses) that are not worth the momentum that is lost with them.
const LEAST: f64 = 1e-2;
/// Share (1) of the sums that may be left after their linear system. Near 1, changes that bring nothing.
const MOST_LEFT: f64 = 0.8;
/// Share (1) of the norm of a chunk's impulses one by one that is added to what they are together: balanced impulses have no
/// factor.
const REGULAR: f64 = 1e-8;
/// An impulse over the bound of its cone (1) from which on it slides. Smaller, sticking contacts are scaled as if they slid.
const SLIDES: f64 = 0.999;
/// No entry.
const NONE: u32 = u32::MAX;

/// Sums over contacts at a body, of impulses and of `q`: forces, and moments over the radius.
type BodySums = [DVec3; 4];

/// A contact as the chunks see it.
struct ChunkContact {
    /// Bodies, within their chunks.
    ends: [usize; 2],
    sums: BodySums,
    /// `q.z`, and `q.q` over the mass.
    slack: f64,
    alone: f64,
}

/// One body's sums by one chunk's factor.
struct Entry {
    /// The chunk, among those near.
    of: usize,
    sums: BodySums,
    next: u32,
}

/// What the bodies of a chunk say of the system: the entries of all chunks with which it has contacts, row by row, and of its own row the rest.
#[derive(Default)]
struct Share {
    near: Vec<usize>,
    entries: Vec<f64>,
    slack: f64,
    alone: f64,
}

impl Sweeps {
    /// Whether [`Sweeps::rescale`] can do anything.
    pub(super) fn scales(&self) -> bool {
        self.layout.chunks > 1
            && (self.blocks.iter()).all(|b| b.rolls.is_empty() && b.least.is_empty())
    }

    /// Scales the impulses of chunks, and forgets the momentum. Whether anything was changed.
    pub(super) fn rescale(&mut self) -> bool {
        let Some(factors) = self.factors() else {
            return false;
        };
        team::map(
            self.threads,
            self.blocks.iter_mut().collect(),
            |block: &mut ContactBlock| {
                let ends = [block.left, block.right].map(|c| factors[c as usize]);
                let factor = 1.0 + 0.5 * (ends[0] + ends[1]);
                let columns = block.groups.iter_mut().flat_map(|g| &mut g.impulse);
                columns.flatten().for_each(|r| *r *= factor);
            },
        );
        self.refresh();
        self.restart();
        true
    }

    /// What all chunks say.
    fn shares(&self) -> Vec<Share> {
        let chunks = (0..self.layout.chunks).collect();
        team::map(self.threads, chunks, |chunk| self.share(chunk))
    }

    /// `s_c` of each chunk; nothing if it is not worth it.
    fn factors(&self) -> Option<Vec<f64>> {
        let shares = self.shares();
        let count = shares.len();
        let mut matrix = vec![0.0; count * count];
        for share in &shares {
            let near = &share.near;
            let at = near
                .iter()
                .flat_map(|row| near.iter().map(move |column| count * row + column));
            for (at, x) in at.zip(&share.entries) {
                matrix[at] += x;
            }
        }
        for (c, share) in shares.iter().enumerate() {
            // A chunk without impulses has a row of its own.
            let alone = REGULAR * share.alone;
            matrix[count * c + c] += if alone > 0.0 { alone } else { 1.0 };
        }
        let mut found: Vec<f64> = shares.iter().map(|share| -share.slack).collect();
        let (mut factored, mut pivots) = (matrix.clone(), vec![0; count]);
        lu_factor(&mut factored, count, &mut pivots).ok()?;
        lu_solve(&factored, count, &pivots, &mut found);
        if !found.iter().all(|s| s.is_finite()) {
            return None;
        }
        let [low, high] = BOUNDS;
        found.iter_mut().for_each(|s| *s = s.clamp(low, high));
        // Chunks with hardly any impulse may have any factor.
        let all: f64 = shares.iter().map(|share| share.alone).sum();
        let weighted = shares
            .iter()
            .zip(&found)
            .map(|(share, s)| share.alone * s * s);
        let changes = weighted.sum::<f64>() >= LEAST * LEAST * all;
        let [mut before, mut after] = [0.0; 2];
        for (row, share) in matrix.chunks(count).zip(&shares) {
            let change: f64 = row.iter().zip(&found).map(|(x, s)| x * s).sum();
            before += share.slack.abs();
            after += (share.slack + change).abs();
        }
        (changes && after <= MOST_LEFT * before).then_some(found)
    }

    /// What the bodies of a chunk say.
    fn share(&self, chunk: usize) -> Share {
        let mut share = Share::default();
        let mut first = vec![NONE; self.layout.stride];
        let mut entries: Vec<Entry> = Vec::with_capacity(self.layout.stride);
        let touching = |b: &&ContactBlock| b.left as usize == chunk || b.right as usize == chunk;
        for block in self.blocks.iter().filter(touching) {
            let chunks = [block.left as usize, block.right as usize];
            let inside = chunks[0] == chunks[1];
            let local = chunks.map(|c| match share.near.iter().position(|&near| near == c) {
                Some(k) => k,
                None => {
                    share.near.push(c);
                    share.near.len() - 1
                }
            });
            let weight = if inside { 1.0 } else { 0.5 };
            self.each(block, |link| {
                share.slack += weight * link.slack;
                share.alone += weight * weight * link.alone;
                for (side, &body) in link.ends.iter().enumerate() {
                    // State 0 is the world.
                    if chunks[side] != chunk || body == 0 {
                        continue;
                    }
                    let sign = if side == 0 { weight } else { -weight };
                    let [r, turn, q, turn_q] = link.sums;
                    // Surface velocities of both sides enter alike.
                    let own = [sign * r, -weight * turn, sign * q, -weight * turn_q];
                    for &of in if inside { &local[..1] } else { &local[..] } {
                        enter(&mut entries, &mut first[body], of, &own);
                    }
                }
            });
        }
        let near = share.near.len();
        share.entries.resize(near * near, 0.0);
        let states = &self.states[chunk * self.layout.stride..];
        for (state, &head) in states.iter().zip(&first) {
            let [mass, inertia] = [state.linear[3], state.surface[3]];
            for row in chain(&entries, head) {
                for column in chain(&entries, head) {
                    let (q, r) = (&row.sums, &column.sums);
                    let work = mass * q[2].dot(r[0]) + inertia * q[3].dot(r[1]);
                    share.entries[near * row.of + column.of] += work;
                }
            }
        }
        share
    }

    /// Calls `look` for each contact of a block with impulse.
    fn each(&self, block: &ContactBlock, mut look: impl FnMut(&ChunkContact)) {
        let stride = self.layout.stride;
        let [left, right] = [block.left, block.right].map(|c| &self.states[c as usize * stride..]);
        for (group, ids) in block.groups.iter().zip(&block.ids) {
            for (lane, ..) in filled(ids) {
                if let Some(link) = link(group, lane, left, right) {
                    look(&link);
                }
            }
        }
    }
}

/// A contact with impulse.
fn link(
    group: &ContactLanes,
    lane: usize,
    left: &[State],
    right: &[State],
) -> Option<ChunkContact> {
    let (n, r) = (vector(&group.normal, lane), vector(&group.impulse, lane));
    let normal = r.dot(n);
    if normal <= 0.0 {
        return None;
    }
    let ends = [group.a[lane] as usize, group.b[lane] as usize];
    let (a, b) = (&left[ends[0]], &right[ends[1]]);
    let spin = head(&a.surface) + head(&b.surface);
    let z = head(&a.linear) - head(&b.linear) + n.cross(spin) + vector(&group.slip, lane);
    let slides = (r - normal * n).length() >= SLIDES * group.friction[lane] * normal;
    let q = if slides { normal * n } else { r };
    Some(ChunkContact {
        ends,
        sums: [r, n.cross(r), q, n.cross(q)],
        slack: q.dot(z),
        alone: q.length_squared() * group.weight[lane],
    })
}

/// Adds sums to a body's entry of a chunk.
fn enter(entries: &mut Vec<Entry>, first: &mut u32, of: usize, sums: &BodySums) {
    let mut at = *first;
    while let Some(entry) = entries.get_mut(at as usize) {
        if entry.of == of {
            for (sum, x) in entry.sums.iter_mut().zip(sums) {
                *sum += *x;
            }
            return;
        }
        at = entry.next;
    }
    entries.push(Entry {
        of,
        sums: *sums,
        next: *first,
    });
    *first = entries.len() as u32 - 1;
}

/// Entries of a body.
fn chain(entries: &[Entry], first: u32) -> impl Iterator<Item = &Entry> {
    std::iter::successors(entries.get(first as usize), |e| {
        entries.get(e.next as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Body, Contact, Goal, Place};
    use super::*;
    use crate::rows::WORLD;

    include!("../../tests/spheres/towers.rs");

    /// What is off by the same factor everywhere is found at once, and nothing is done where nothing is off.
    #[test]
    fn a_common_factor_is_found() {
        for factor in [0.6, 1.0, 1.5] {
            let Towers {
                mut sweeps,
                holding,
            } = towers(1, 0.5);
            assert!(sweeps.scales());
            let start: Vec<[f64; 3]> = holding.iter().map(|r| r.map(|x| factor * x)).collect();
            sweeps.warm_start(&start);
            assert_eq!(sweeps.rescale(), factor != 1.0);
            // But for what keeps the system regular.
            let residual = sweeps.judge(&GOAL, 0).residual;
            assert!(
                residual < 1e-3 * (factor - 1.0f64).abs() + 1e-12,
                "{factor}: {residual}"
            );
        }
    }

    /// Each chunk is off by another factor, and a third of the contacts slide.
    #[test]
    fn the_sums_of_all_chunks_vanish_and_cones_hold() {
        let Towers {
            mut sweeps,
            holding,
        } = towers(2, 0.01);
        let start = holding.iter().enumerate().map(|(i, r)| {
            let normal = r[2] * (1.2 + 0.01 * (i / HIGH / 12) as f64);
            let across = if i % 3 == 0 { 0.01 } else { 0.001 };
            [across * normal, 0.0, normal]
        });
        let start: Vec<[f64; 3]> = start.collect();
        sweeps.warm_start(&start);
        let before: Vec<f64> = sweeps.shares().iter().map(|share| share.slack).collect();
        let factors = sweeps.factors().unwrap();
        assert!(
            factors.iter().all(|s| (-0.5..-0.05).contains(s)),
            "{factors:?}"
        );
        assert!(
            factors.windows(2).any(|s| (s[0] - s[1]).abs() > 1e-3),
            "{factors:?}"
        );
        assert!(sweeps.rescale());
        // The `q` of the next look are as much smaller: of second order.
        for (share, before) in sweeps.shares().iter().zip(&before) {
            assert!(
                share.slack.abs() < 0.05 * before.abs(),
                "{} of {before}",
                share.slack
            );
        }
        for r in sweeps.impulses() {
            assert!(
                r[2] > 0.0 && r[0].hypot(r[1]) <= 0.01 * r[2] * (1.0 + 1e-12),
                "{r:?}"
            );
        }
    }

    /// Where there is nothing to tell from one end to the other, nothing is scaled.
    #[test]
    fn a_single_chunk_is_left_alone() {
        let body = Body {
            inv_mass: 1.0,
            inv_inertia: 1.0,
            radius: 1.0,
        };
        let sweeps = Sweeps::new(&[body; 3], &[], None, 1).unwrap();
        assert!(!sweeps.scales());
    }
}
