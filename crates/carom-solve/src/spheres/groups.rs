//! Groups: contacts that share no moving body, swept as one.

use super::bodies::{ContactLanes, State};
use super::lanes::{Column, EMPTY, GROUP, SWAPPED};
use super::problem::Contact;
use super::rolls::Rolls;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Groups of a block that are open at a time.
const WINDOW: usize = 64;

/// Contacts inside a chunk (`left == right`), or between two.
#[derive(Debug, Default)]
pub struct ContactBlock {
    pub left: u32,
    pub right: u32,
    pub groups: Vec<ContactLanes>,
    /// Contact of each lane, with [`SWAPPED`]; or [`EMPTY`].
    pub ids: Vec<[u32; GROUP]>,
    /// Moments of the groups; empty where nothing rolls.
    pub rolls: Vec<Rolls>,
    /// Least normal impulses of the groups, N s; empty where all are 0.
    pub least: Vec<Column>,
}

/// No least impulses.
const NONE: Column = [0.0; GROUP];

/// Those of a group.
#[inline(always)]
pub fn least(of: &[Column], group: usize) -> &Column {
    of.get(group).unwrap_or(&NONE)
}

/// Where each contact is swept: its block, and its lane among those of the block's groups. Blocks on several threads write them.
#[derive(Debug, Default)]
pub struct Slots(Vec<AtomicU64>);

impl Slots {
    pub fn resize(&mut self, contacts: usize) {
        self.0.resize_with(contacts, AtomicU64::default);
    }

    #[inline]
    fn enter(&self, contact: usize, block: usize, lane: usize) {
        self.0[contact].store((block as u64) << 32 | lane as u64, Relaxed);
    }

    /// Block, group and lane of a contact.
    #[inline]
    pub fn of(&self, contact: usize) -> (usize, usize, usize) {
        let slot = self.0[contact].load(Relaxed);
        let lane = slot as u32 as usize;
        ((slot >> 32) as usize, lane / GROUP, lane % GROUP)
    }
}

/// A contact on its way to a group: states within the chunks of its block, and its id.
#[derive(Clone, Copy, Debug, Default)]
pub struct UngroupedContact {
    pub a: u32,
    pub b: u32,
    pub id: u32,
}

/// A lane without contact: the world on both sides.
const NOBODY: UngroupedContact = UngroupedContact {
    a: 0,
    b: 0,
    id: EMPTY,
};

/// Memory of a thread that packs.
#[derive(Debug, Default)]
pub struct Packing {
    /// Links of the groups, in order.
    pub groups: Vec<[UngroupedContact; GROUP]>,
    /// Per state of the block: the open groups it is in. All 0 when no group is open.
    masks: Vec<u64>,
}

impl Packing {
    /// Packs links, in order, into groups that share no moving body: first fit into a window of open groups. There are so many states,
    /// those of the sides `b` from number `offset` on.
    pub fn pack(&mut self, links: &[UngroupedContact], states: usize, offset: usize) {
        let Self { groups, masks } = self;
        groups.clear();
        if masks.len() < states {
            masks.resize(states, 0);
        }
        let mut open = [[NOBODY; GROUP]; WINDOW];
        let mut filled = [0usize; WINDOW];
        let mut close = |group: &mut [UngroupedContact; GROUP], slot: usize, masks: &mut [u64]| {
            for link in &*group {
                masks[link.a as usize] &= !(1 << slot);
                masks[link.b as usize + offset] &= !(1 << slot);
            }
            groups.push(std::mem::replace(group, [NOBODY; GROUP]));
        };
        for link in links {
            let (a, b) = (link.a as usize, link.b as usize + offset);
            let mut taken = masks[a] | masks[b];
            if taken == u64::MAX {
                // A body with more contacts than open groups.
                close(&mut open[0], 0, masks);
                filled[0] = 0;
                taken &= !1;
            }
            let slot = taken.trailing_ones() as usize;
            open[slot][filled[slot]] = *link;
            filled[slot] += 1;
            // State 0 of a chunk is the world: shared freely.
            for (state, mask) in [(link.a, a), (link.b, b)] {
                if state != 0 {
                    masks[mask] |= 1 << slot;
                }
            }
            if filled[slot] == GROUP {
                close(&mut open[slot], slot, masks);
                filled[slot] = 0;
            }
        }
        for slot in (0..WINDOW).filter(|&slot| filled[slot] > 0) {
            close(&mut open[slot], slot, masks);
        }
    }
}

/// What groups are made of: the contacts, the impulses to start from, and where to enter the lanes of the contacts.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    pub contacts: &'a [Contact],
    pub impulses: &'a [[f64; 3]],
    pub slots: &'a Slots,
}

impl ContactBlock {
    /// Block number `index` of these links, in the memory of an old one.
    pub fn fill(
        &mut self,
        index: usize,
        links: &[UngroupedContact],
        left: &[State],
        right: Option<&[State]>,
        source: Source,
        packing: &mut Packing,
    ) {
        // The right chunk's states follow the left one's.
        let offset = if right.is_some() { left.len() } else { 0 };
        let right = right.unwrap_or(left);
        packing.pack(links, offset + right.len(), offset);
        self.rolls.clear();
        self.least.clear();
        self.ids.clear();
        let ids = packing.groups.iter().map(|links| links.map(|link| link.id));
        self.ids.extend(ids);
        // Every number of a group is written anew.
        self.groups
            .resize(packing.groups.len(), ContactLanes::default());
        for (number, (group, links)) in self.groups.iter_mut().zip(&packing.groups).enumerate() {
            let sides = links.map(|link| [&left[link.a as usize], &right[link.b as usize]]);
            group.set_bodies(links.map(|link| [link.a, link.b]), sides);
            group.way = Default::default();
            for (lane, link) in links.iter().enumerate() {
                if link.id == EMPTY {
                    group.set_contact(lane, &Contact::default(), false);
                    group.set_impulse(lane, [0.0; 3], false);
                    continue;
                }
                let (contact, swapped) = ((link.id & !SWAPPED) as usize, link.id & SWAPPED != 0);
                group.set_contact(lane, &source.contacts[contact], swapped);
                group.set_impulse(lane, source.impulses[contact], swapped);
                source.slots.enter(contact, index, GROUP * number + lane);
            }
        }
    }
}
