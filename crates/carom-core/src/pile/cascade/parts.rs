//! The closing contacts of a problem, fallen apart into little islands.

use super::front::Front;
use carom_solve::clusters::{Forest, Linked};
use carom_solve::rows::WORLD;

const NONE: u32 = u32::MAX;

/// Where a chosen contact's sphere belongs: its parent among united ones, the island of a root, its number within the island.
#[derive(Clone, Copy, Default)]
struct Place {
    parent: u32,
    island: u32,
    local: u32,
}

impl Linked for Place {
    #[inline]
    fn parent(&mut self) -> &mut u32 {
        &mut self.parent
    }
}

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
    places: Vec<Place>,
    /// Island of each chosen contact, and contacts placed so far.
    of_chosen: Vec<u32>,
    placed: Vec<u32>,
}

impl Parts {
    pub fn open(&mut self, nodes: usize) {
        self.places.clear();
        self.places.resize(nodes, Place::default());
    }

    /// Cuts `chosen`, and marks its spheres as touched by the problem. What is new in it nobody can guess, so nothing branches on it.
    pub fn cut(&mut self, front: &mut Front, chosen: &[u32], problem: u32) {
        for &slot in chosen {
            let [a, b] = front.ends[slot as usize];
            for node in [a, b].into_iter().filter(|&n| n != WORLD) {
                let touched = &mut front.touched[node as usize];
                let place = &mut self.places[node as usize];
                let is_new = *touched != problem;
                *touched = problem;
                *place = Place {
                    parent: if is_new { node } else { place.parent },
                    island: NONE,
                    local: NONE,
                };
            }
            if b != WORLD {
                self.places.join(a, b);
            }
        }
        self.of_chosen.clear();
        self.placed.clear();
        self.placed.resize(chosen.len(), 0);
        let mut islands = 0;
        for &slot in chosen {
            let root = self.places.root(front.ends[slot as usize][0]);
            let place = &mut self.places[root as usize];
            let is_new = place.island == NONE;
            let island = if is_new { islands } else { place.island };
            islands += u32::from(is_new);
            place.island = island;
            self.placed[island as usize] += 1;
            self.of_chosen.push(island);
        }
        self.placed.truncate(islands as usize);
        let mut sum = 0;
        self.starts.clear();
        for size in &mut self.placed {
            self.starts.push([sum, 0]);
            sum += std::mem::replace(size, sum);
        }
        self.starts.push([sum, 0]);
        self.slots.resize(chosen.len(), 0);
        self.sides.resize(chosen.len(), [WORLD; 2]);
        for (&slot, &island) in chosen.iter().zip(&self.of_chosen) {
            let place = &mut self.placed[island as usize];
            self.slots[*place as usize] = slot;
            self.sides[*place as usize] = front.ends[slot as usize];
            *place += 1;
        }
        self.number();
    }

    /// Numbers the spheres of each island in the order of its contacts.
    fn number(&mut self) {
        self.nodes.resize(2 * self.sides.len(), 0);
        let mut count = 0;
        for island in 0..self.starts.len() - 1 {
            let first = count;
            self.starts[island][1] = first;
            let (from, to) = (self.starts[island][0], self.starts[island + 1][0]);
            let sides = self.sides[from as usize..to as usize].iter_mut();
            for side in sides.flatten().filter(|side| **side != WORLD) {
                let local = &mut self.places[*side as usize].local;
                let is_new = *local == NONE;
                self.nodes[count as usize] = *side;
                *local = if is_new { count - first } else { *local };
                count += u32::from(is_new);
                *side = *local;
            }
        }
        if let Some(last) = self.starts.last_mut() {
            last[1] = count;
        }
        self.nodes.truncate(count as usize);
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
