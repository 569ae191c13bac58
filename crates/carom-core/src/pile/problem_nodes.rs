//! The spheres of a velocity problem: all of the island, or those of its contacts alone where these are few.

use super::closed_contact::ClosedContact;
use carom_solve::rows::WORLD;
use carom_solve::spheres::{Body, Place, Sweeps};

/// Contacts of the island over those of a problem (1) from which on only their own spheres are taken. Speed alone: larger, and problems of a
/// few contacts pass over all spheres; smaller, and copying costs more than it spares.
const FEW_CONTACTS: usize = 4;

/// Spheres of a problem, by the nodes of the island.
#[derive(Default)]
pub(super) struct ProblemNodes {
    /// All nodes, with their own numbers.
    whole: bool,
    /// Otherwise: the nodes, ascending, and the number of each among them.
    nodes: Vec<u32>,
    numbers: Vec<u32>,
    bodies: Vec<Body>,
    places: Vec<Place>,
}

impl ProblemNodes {
    /// Takes the whole island.
    pub fn take_all(&mut self) {
        self.whole = true;
    }

    /// Takes the spheres of the chosen contacts.
    pub fn take(
        &mut self,
        closed: &[ClosedContact],
        chosen: &[u32],
        bodies: &[Body],
        places: &[Place],
    ) {
        self.whole = FEW_CONTACTS * chosen.len() > closed.len();
        if self.whole {
            return;
        }
        let Self {
            nodes,
            numbers,
            bodies: own,
            places: at,
            ..
        } = self;
        nodes.clear();
        numbers.clear();
        numbers.resize(bodies.len(), WORLD);
        for &slot in chosen {
            let m = &closed[slot as usize];
            for node in [m.a, m.b] {
                if node != WORLD && numbers[node as usize] == WORLD {
                    numbers[node as usize] = 0;
                    nodes.push(node);
                }
            }
        }
        nodes.sort_unstable();
        own.clear();
        at.clear();
        for (number, &node) in (0..).zip(nodes.iter()) {
            numbers[node as usize] = number;
            own.push(bodies[node as usize]);
            at.push(places[node as usize]);
        }
    }

    /// Number of a node in the problem; the world stays.
    #[inline]
    pub fn number(&self, node: u32) -> u32 {
        if self.whole || node == WORLD {
            node
        } else {
            self.numbers[node as usize]
        }
    }

    /// What belongs to nodes of the island, by their numbers in the problem; without what is not in it.
    pub fn numbered<'a, T: 'a>(
        &'a self,
        at_nodes: impl Iterator<Item = (u32, T)> + 'a,
    ) -> impl Iterator<Item = (u32, T)> + 'a {
        let numbered = at_nodes.map(|(node, of)| (self.number(node), of));
        numbered.filter(|(number, _)| *number != WORLD)
    }

    /// Bodies and places of the problem, of those of the island.
    pub fn of<'a>(&'a self, bodies: &'a [Body], places: &'a [Place]) -> (&'a [Body], &'a [Place]) {
        if self.whole {
            (bodies, places)
        } else {
            (&self.bodies, &self.places)
        }
    }

    /// Corrections of velocity of the bodies of the problem, at the nodes of the island; 0 at the others.
    pub fn spread(&self, sweeps: &Sweeps, all: &mut Vec<[f64; 6]>, count: usize) {
        if self.whole {
            sweeps.velocities_into(all);
            return;
        }
        all.clear();
        all.resize(count, [0.0; 6]);
        for (&node, u) in self.nodes.iter().zip(&sweeps.velocities()) {
            all[node as usize] = *u;
        }
    }

    /// The nodes of the problem, of `count` of the island.
    pub fn nodes(&self, count: usize) -> impl Iterator<Item = u32> + '_ {
        let all = if self.whole { count as u32 } else { 0 };
        let own = if self.whole { &[] } else { &self.nodes[..] };
        (0..all).chain(own.iter().copied())
    }
}
