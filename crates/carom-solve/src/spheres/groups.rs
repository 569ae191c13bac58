//! Groups: contacts that share no moving body, swept as one.

use super::kernel::{Group, State};
use super::lanes::GROUP;
use super::rolling::Rolls;
use super::Contact;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Groups of a block that are open at a time.
const WINDOW: usize = 64;
/// Bit of an id: the sides of this contact are exchanged.
pub const SWAPPED: u32 = 1 << 31;
/// Id of a lane without contact.
pub const EMPTY: u32 = u32::MAX;

/// Contacts inside a chunk (`left == right`), or between two.
#[derive(Debug, Default)]
pub struct Block {
    pub left: u32,
    pub right: u32,
    pub groups: Vec<Group>,
    /// Contact of each lane, with [`SWAPPED`]; or [`EMPTY`].
    pub ids: Vec<[u32; GROUP]>,
    /// Moments of the groups; empty where nothing rolls.
    pub rolls: Vec<Rolls>,
}

/// Where each contact is swept: its block, and its lane among those of the block's groups. Blocks on several threads write them.
#[derive(Debug, Default)]
pub struct Slots(Vec<AtomicU64>);

impl Slots {
    pub fn resize(&mut self, contacts: usize) {
        self.0.resize_with(contacts, AtomicU64::default);
    }

    /// Enters the contacts of block number `index`.
    pub fn enter(&self, index: usize, block: &Block) {
        for (lane, &id) in block.ids.as_flattened().iter().enumerate() {
            if id != EMPTY {
                let slot = (index as u64) << 32 | lane as u64;
                self.0[(id & !SWAPPED) as usize].store(slot, Relaxed);
            }
        }
    }

    /// Block, group and lane of a contact.
    pub fn of(&self, contact: usize) -> (usize, usize, usize) {
        let slot = self.0[contact].load(Relaxed);
        let lane = slot as u32 as usize;
        ((slot >> 32) as usize, lane / GROUP, lane % GROUP)
    }
}

/// A contact on its way to a group: states within the chunks of its block, and its id.
#[derive(Clone, Copy, Default)]
pub struct Link {
    pub a: u32,
    pub b: u32,
    pub id: u32,
}

/// A group that is being filled.
#[derive(Clone, Default)]
struct Open {
    links: [Link; GROUP],
    contacts: [Contact; GROUP],
    filled: usize,
}

/// Packs links, in order, into groups that share no moving body: first fit into a window of open groups. The memory is that
/// of an old block.
pub fn pack(
    old: Block,
    links: &[Link],
    ends: (u32, u32),
    left: &[State],
    right: Option<&[State]>,
    contacts: &[Contact],
) -> Block {
    let mut block = Block {
        left: ends.0,
        right: ends.1,
        ..old
    };
    block.rolls.clear();
    block.groups.clear();
    block.groups.reserve(links.len() / GROUP + 16);
    block.ids.clear();
    block.ids.reserve(links.len() / GROUP + 16);
    // Per state: the open groups it is in. The right chunk's states follow the left one's.
    let offset = if right.is_some() { left.len() } else { 0 };
    let right = right.unwrap_or(left);
    let mut masks = vec![0u64; offset + right.len()];
    let mut open = vec![Open::default(); WINDOW];
    let mut close = |slot: usize, open: &mut [Open], masks: &mut [u64]| {
        let (links, filled) = (&open[slot].links, &open[slot].filled);
        for link in &links[..*filled] {
            masks[link.a as usize] &= !(1 << slot);
            masks[link.b as usize + offset] &= !(1 << slot);
        }
        // Lanes without contact keep the link 0: any contact, and the world on both sides.
        let sides = links.map(|link| [&left[link.a as usize], &right[link.b as usize]]);
        block
            .groups
            .push(Group::new(links.map(|link| [link.a, link.b]), sides));
        block.ids.push(std::array::from_fn(|lane| {
            if lane < *filled {
                links[lane].id
            } else {
                EMPTY
            }
        }));
        if let Some(group) = block.groups.last_mut() {
            for lane in 0..*filled {
                group.set_contact(
                    lane,
                    &open[slot].contacts[lane],
                    links[lane].id & SWAPPED != 0,
                );
            }
        }
        open[slot].links = [Link::default(); GROUP];
        open[slot].filled = 0;
    };
    for link in links {
        let (a, b) = (link.a as usize, link.b as usize + offset);
        let mut taken = masks[a] | masks[b];
        if taken == u64::MAX {
            // A body with more contacts than open groups.
            close(0, &mut open, &mut masks);
            taken &= !1;
        }
        let slot = taken.trailing_ones() as usize;
        let group = &mut open[slot];
        group.links[group.filled] = *link;
        // Read now, many at a time: the caller's contacts may be in any order.
        group.contacts[group.filled] = contacts[(link.id & !SWAPPED) as usize];
        group.filled += 1;
        // State 0 of a chunk is the world: shared freely.
        for state in [(link.a, a), (link.b, b)] {
            if state.0 != 0 {
                masks[state.1] |= 1 << slot;
            }
        }
        if group.filled == GROUP {
            close(slot, &mut open, &mut masks);
        }
    }
    for slot in 0..WINDOW {
        if open[slot].filled > 0 {
            close(slot, &mut open, &mut masks);
        }
    }
    block
}
