//! The closing contacts of a problem, fallen apart into little islands.

use super::front::Front;
use carom_solve::rows::WORLD;

const NONE: u32 = u32::MAX;

/// Little islands in the order of their first contacts.
#[derive(Default)]
pub(super) struct Parts {
    /// Contacts, island after island, with their ends as numbers within the island.
    pub slots: Vec<u32>,
    pub sides: Vec<[u32; 2]>,
    /// Spheres, island after island.
    pub nodes: Vec<u32>,
    /// Where contacts and spheres of an island begin; one more at the end.
    pub starts: Vec<[u32; 2]>,
    /// Union-find over the nodes; island of a root; number of a node within its island.
    parent: Vec<u32>,
    island: Vec<u32>,
    local: Vec<u32>,
    /// Island of each chosen contact, and contacts placed so far.
    of_chosen: Vec<u32>,
    placed: Vec<u32>,
}

impl Parts {
    pub fn open(&mut self, nodes: usize) {
        for v in [&mut self.parent, &mut self.island, &mut self.local] {
            v.clear();
            v.resize(nodes, 0);
        }
    }

    /// Cuts `chosen`, and marks its spheres as touched by the problem.
    pub fn cut(&mut self, front: &mut Front, chosen: &[u32], problem: u32) {
        let ends = |slot: u32| front.ends[slot as usize];
        for &slot in chosen {
            for node in ends(slot).into_iter().filter(|&n| n != WORLD) {
                self.parent[node as usize] = node;
                self.island[node as usize] = NONE;
            }
        }
        for &slot in chosen {
            let [a, b] = ends(slot);
            if b != WORLD {
                let (a, b) = (self.root(a), self.root(b));
                self.parent[a.max(b) as usize] = a.min(b);
            }
        }
        self.of_chosen.clear();
        self.placed.clear();
        for &slot in chosen {
            let root = self.root(ends(slot)[0]) as usize;
            if self.island[root] == NONE {
                self.island[root] = self.placed.len() as u32;
                self.placed.push(0);
            }
            let island = self.island[root];
            self.placed[island as usize] += 1;
            self.of_chosen.push(island);
        }
        let mut sum = 0;
        self.starts.clear();
        for size in &mut self.placed {
            self.starts.push([sum, 0]);
            sum += std::mem::replace(size, sum);
        }
        self.starts.push([sum, 0]);
        self.slots.clear();
        self.slots.resize(chosen.len(), 0);
        for (&slot, &island) in chosen.iter().zip(&self.of_chosen) {
            let place = &mut self.placed[island as usize];
            self.slots[*place as usize] = slot;
            *place += 1;
        }
        self.number(front, problem);
    }

    /// Numbers the spheres of each island in the order of its contacts.
    fn number(&mut self, front: &mut Front, problem: u32) {
        self.sides.clear();
        self.nodes.clear();
        for island in 0..self.starts.len() - 1 {
            let first = self.nodes.len() as u32;
            self.starts[island][1] = first;
            let (from, to) = (self.starts[island][0], self.starts[island + 1][0]);
            for &slot in &self.slots[from as usize..to as usize] {
                let ends = front.ends[slot as usize];
                for &node in ends.iter().filter(|&&n| n != WORLD) {
                    let touched = &mut front.touched[node as usize];
                    if *touched != problem {
                        *touched = problem;
                        self.local[node as usize] = self.nodes.len() as u32 - first;
                        self.nodes.push(node);
                    }
                }
                self.sides.push(ends.map(|node| match node {
                    WORLD => WORLD,
                    node => self.local[node as usize],
                }));
            }
        }
        if let Some(last) = self.starts.last_mut() {
            last[1] = self.nodes.len() as u32;
        }
    }

    fn root(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            let up = self.parent[self.parent[node as usize] as usize];
            self.parent[node as usize] = up;
            node = up;
        }
        node
    }

    /// Cuts the islands into at most `count` batches of about as many contacts: first island of each, one more at the end.
    pub fn batches(&self, count: usize, firsts: &mut Vec<usize>) {
        let islands = self.starts.len() - 1;
        let share = self.slots.len().div_ceil(count);
        firsts.clear();
        firsts.push(0);
        let mut from = 0;
        for island in 1..islands {
            let at = self.starts[island][0] as usize;
            if at - from >= share {
                firsts.push(island);
                from = at;
            }
        }
        firsts.push(islands);
    }
}
