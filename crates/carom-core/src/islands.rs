//! Islands: contacts joined by spheres (planes do not join), in a fixed order.

use crate::contact::Contact;

/// Contacts grouped by island. Buffers are reused.
#[derive(Default)]
pub struct Islands {
    parent: Vec<u32>,
    /// Island of each root body, `u32::MAX` where none.
    slot: Vec<u32>,
    /// Contact indices, island after island, in contact order within each.
    members: Vec<u32>,
    starts: Vec<u32>,
}

impl Islands {
    /// Groups those of `contacts` that `select` admits. Islands appear in the order of their first contact.
    pub fn build(
        &mut self,
        spheres: usize,
        contacts: &[Contact],
        select: impl Fn(&Contact) -> bool,
    ) {
        self.members.clear();
        self.starts.clear();
        if contacts.iter().all(|c| c.b as usize >= spheres) {
            self.build_apart(contacts, select);
            return;
        }
        self.parent.clear();
        self.parent.extend(0..spheres as u32);
        for c in contacts.iter().filter(|c| select(c)) {
            if (c.b as usize) < spheres {
                let (ra, rb) = (self.root(c.a), self.root(c.b));
                // The smaller index is the root: the result does not depend on the order of the unions.
                self.parent[ra.max(rb) as usize] = ra.min(rb);
            }
        }
        self.slot.clear();
        self.slot.resize(spheres, u32::MAX);
        let mut islands = 0;
        for c in contacts.iter().filter(|c| select(c)) {
            let root = self.root(c.a) as usize;
            if self.slot[root] == u32::MAX {
                self.slot[root] = islands;
                islands += 1;
                self.starts.push(0);
            }
            self.starts[self.slot[root] as usize] += 1;
        }
        let mut total = 0;
        for start in &mut self.starts {
            let count = *start;
            *start = total;
            total += count;
        }
        self.starts.push(total);
        self.members.resize(total as usize, 0);
        for (index, c) in contacts.iter().enumerate().filter(|(_, c)| select(c)) {
            let root = self.root(c.a) as usize;
            let island = self.slot[root] as usize;
            self.members[self.starts[island] as usize] = index as u32;
            self.starts[island] += 1;
        }
        // Each start now stands at its island's end: shift back.
        for island in (1..self.starts.len()).rev() {
            self.starts[island] = self.starts[island - 1];
        }
        self.starts[0] = 0;
    }

    /// Only planes are touched: an island per sphere, and contacts are sorted by sphere already.
    fn build_apart(&mut self, contacts: &[Contact], select: impl Fn(&Contact) -> bool) {
        let mut last = u32::MAX;
        for (index, c) in contacts.iter().enumerate().filter(|(_, c)| select(c)) {
            if c.a != last {
                self.starts.push(self.members.len() as u32);
                last = c.a;
            }
            self.members.push(index as u32);
        }
        self.starts.push(self.members.len() as u32);
    }

    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Contact indices of one island.
    pub fn members(&self, island: usize) -> &[u32] {
        &self.members[self.starts[island] as usize..self.starts[island + 1] as usize]
    }

    fn root(&mut self, mut body: u32) -> u32 {
        while self.parent[body as usize] != body {
            let up = self.parent[self.parent[body as usize] as usize];
            self.parent[body as usize] = up;
            body = up;
        }
        body
    }
}
