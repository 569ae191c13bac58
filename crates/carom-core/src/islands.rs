//! Islands: contacts, joints and loads joined by spheres (walls and ground do not join), in a fixed order.

use crate::contact::Contact;
use crate::model::{Link, LinkKind, Model};
use carom_solve::clusters::Forest;
use carom_solve::team;

/// End of a contact at a wall that does not move freely.
const WALL: u32 = u32::MAX - 1;

/// Ends of a contact that is not admitted.
const NONE: [u32; 2] = [u32::MAX; 2];

/// Contacts, joints and loads grouped by island. Buffers are reused.
#[derive(Default)]
pub struct Islands {
    threads: usize,
    /// Movers of the contacts, [`NONE`] where one is not admitted: what a contact says besides would fill the caches.
    ends: Vec<[u32; 2]>,
    parent: Vec<u32>,
    /// Island of each root body, `u32::MAX` where none.
    slot: Vec<u32>,
    /// Whether clumps belong to each island; empty without clumps.
    clumps: Vec<bool>,
    contacts: Groups,
    joints: Groups,
    loads: Groups,
}

/// Indices, island after island, ascending within each.
#[derive(Default)]
struct Groups {
    members: Vec<u32>,
    starts: Vec<u32>,
}

/// One island.
#[derive(Clone, Copy, Debug)]
pub struct Island<'a> {
    /// Indices into the candidate contacts, the joints and the loads of the model.
    pub contacts: &'a [u32],
    pub joints: &'a [u32],
    pub loads: &'a [u32],
    /// Whether clumps belong to it.
    pub clumps: bool,
}

impl Island<'_> {
    /// Contacts alone.
    pub fn is_free(&self) -> bool {
        self.joints.is_empty() && self.loads.is_empty()
    }
}

impl Islands {
    pub fn new(threads: usize) -> Islands {
        Islands {
            threads,
            ..Islands::default()
        }
    }

    /// Groups those of `contacts` that `select` admits, with the joints and the loads that depend on the motion. Islands
    /// appear in the order of their first contact, then of their first joint; a load alone makes none.
    pub fn build(
        &mut self,
        model: &Model,
        contacts: &[Contact],
        links: &[Link],
        select: impl Fn(&Contact) -> bool + Sync,
    ) {
        for groups in [&mut self.contacts, &mut self.joints, &mut self.loads] {
            groups.members.clear();
            groups.starts.clear();
        }
        self.clumps.clear();
        let spheres = model.bodies();
        let alone = |c: &Contact| c.is_wall(model) && model.clump_of(c.a).is_none();
        if links.is_empty() && contacts.iter().all(alone) {
            self.build_apart(contacts, select);
            return;
        }
        self.ends.resize(contacts.len(), NONE);
        team::fill(self.threads, &mut self.ends, |k| match &contacts[k] {
            c if select(c) => [c.a, c.b].map(|body| model.mover(body).unwrap_or(WALL)),
            _ => NONE,
        });
        self.parent.clear();
        self.parent.extend(0..spheres as u32);
        let ends = std::mem::take(&mut self.ends);
        for &[a, b] in &ends {
            if b < WALL {
                self.parent.join(a, b);
            }
        }
        for link in links {
            self.parent.join(link.a, link.b);
        }
        // Roots are the smallest of their islands: each is known before those that lead to it.
        for body in 0..spheres {
            self.parent[body] = self.parent[self.parent[body] as usize];
        }
        self.slot.clear();
        self.slot.resize(spheres, u32::MAX);
        let mut islands = 0;
        let admitted =
            |(k, ends): (usize, &[u32; 2])| (*ends != NONE).then_some((k as u32, ends[0]));
        let contacts = ends.iter().enumerate().filter_map(admitted);
        let with_joint = links
            .iter()
            .filter(|l| matches!(l.kind, LinkKind::Joint(_)))
            .map(|l| l.a);
        for body in contacts.clone().map(|(_, a)| a).chain(with_joint) {
            let root = self.parent[body as usize] as usize;
            if self.slot[root] == u32::MAX {
                self.slot[root] = islands;
                islands += 1;
            }
        }
        let mut groups = std::mem::take(&mut self.contacts);
        groups.fill(islands, contacts.map(|(k, a)| (k, self.island_of(a))));
        (self.contacts, self.ends) = (groups, ends);
        if !model.clumps.is_empty() {
            self.mark_clumps(model, islands);
        }
        if links.is_empty() {
            return;
        }
        let mut groups = std::mem::take(&mut self.joints);
        let joints = links.iter().filter_map(|l| match l.kind {
            LinkKind::Joint(index) => Some((index, self.island_of(l.a))),
            LinkKind::Load(_) => None,
        });
        groups.fill(islands, joints);
        self.joints = groups;
        let mut groups = std::mem::take(&mut self.loads);
        let loads = links.iter().filter_map(|l| match l.kind {
            LinkKind::Load(index) => Some((index, self.island_of(l.a))),
            LinkKind::Joint(_) => None,
        });
        groups.fill(islands, loads);
        self.loads = groups;
    }

    /// Marks the islands that clumps belong to.
    fn mark_clumps(&mut self, model: &Model, islands: u32) {
        self.clumps.resize(islands as usize, false);
        for &body in self.ends.iter().flatten() {
            if model.as_clump(body).is_some() {
                let island = self.island_of(body);
                self.clumps[island as usize] = true;
            }
        }
    }

    /// Only walls are touched: an island per sphere, and contacts are sorted by sphere already.
    fn build_apart(&mut self, contacts: &[Contact], select: impl Fn(&Contact) -> bool) {
        let groups = &mut self.contacts;
        let mut last = u32::MAX;
        for (index, c) in contacts.iter().enumerate().filter(|(_, c)| select(c)) {
            if c.a != last {
                groups.starts.push(groups.members.len() as u32);
                last = c.a;
            }
            groups.members.push(index as u32);
        }
        groups.starts.push(groups.members.len() as u32);
    }

    pub fn len(&self) -> usize {
        self.contacts.starts.len().saturating_sub(1)
    }

    /// Contacts of every island.
    pub fn sizes(&self) -> impl Iterator<Item = u32> + '_ {
        self.contacts.starts.windows(2).map(|w| w[1] - w[0])
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    #[inline(always)]
    pub fn island(&self, index: usize) -> Island<'_> {
        Island {
            contacts: self.contacts.of(index),
            joints: self.joints.of(index),
            loads: self.loads.of(index),
            clumps: self.clumps.get(index) == Some(&true),
        }
    }

    /// Island of a body, `u32::MAX` if it has none.
    fn island_of(&self, body: u32) -> u32 {
        self.slot[self.parent[body as usize] as usize]
    }
}

impl Groups {
    /// Counting sort of (index, island) pairs; those without an island are left out.
    fn fill(&mut self, islands: u32, entries: impl Iterator<Item = (u32, u32)> + Clone) {
        self.starts.resize(islands as usize + 1, 0);
        for (_, island) in entries.clone().filter(|e| e.1 != u32::MAX) {
            self.starts[island as usize + 1] += 1;
        }
        for island in 0..islands as usize {
            self.starts[island + 1] += self.starts[island];
        }
        self.members
            .resize(self.starts[islands as usize] as usize, 0);
        for (index, island) in entries.filter(|e| e.1 != u32::MAX) {
            let start = &mut self.starts[island as usize];
            self.members[*start as usize] = index;
            *start += 1;
        }
        // Each start now stands at its island's end: shift back.
        for island in (1..self.starts.len()).rev() {
            self.starts[island] = self.starts[island - 1];
        }
        self.starts[0] = 0;
    }

    #[inline(always)]
    fn of(&self, index: usize) -> &[u32] {
        match self.starts.get(index + 1) {
            Some(&end) => &self.members[self.starts[index] as usize..end as usize],
            None => &[],
        }
    }
}
