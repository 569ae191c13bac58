//! Contacts and spheres of some islands, copied side by side: what waits for memory then waits at the same time, and once.

use super::front::{Edge, Front, Node};
use super::parts::Parts;
use crate::pile::velocities::Velocities;
use carom_solve::rows::WORLD;
use glam::DVec3;
use std::ops::Range;

/// Contacts copied at a time: they stay in the fastest memory, and are enough that little waiting is left.
const AT_A_TIME: u32 = 96;

#[derive(Default)]
pub(super) struct Near {
    edges: Vec<Edge>,
    nodes: Vec<Node>,
    shift: Vec<[DVec3; 2]>,
    /// First contact and sphere that are here, among all in little islands.
    first: [usize; 2],
}

/// A little island, by places among all contacts and spheres of little islands.
#[derive(Clone)]
pub(super) struct Island {
    pub contacts: Range<usize>,
    pub nodes: Range<usize>,
}

impl Near {
    /// Copies as many of the `islands` as are taken at a time, at least one; the island behind the last of them.
    pub fn take(&mut self, front: &Front, parts: &Parts, islands: Range<usize>) -> usize {
        let begin = |island: usize| parts.starts[island];
        let mut end = islands.start + 1;
        while end < islands.end && begin(end + 1)[0] - begin(islands.start)[0] <= AT_A_TIME {
            end += 1;
        }
        let ([c, n], [c_end, n_end]) = (
            begin(islands.start).map(|k| k as usize),
            begin(end).map(|k| k as usize),
        );
        self.first = [c, n];
        self.edges.clear();
        let slots = parts.slots[c..c_end].iter();
        self.edges.extend(slots.map(|&s| front.edges[s as usize]));
        let nodes = &parts.nodes[n..n_end];
        self.nodes.clear();
        self.nodes.extend(nodes.iter().map(|&n| front.node(n)));
        self.shift.clear();
        let shifts = nodes.iter().map(|&n| front.shift[n as usize]);
        self.shift.extend(shifts);
        end
    }

    pub fn edges(&self, island: &Island) -> &[Edge] {
        let Range { start, end } = island.contacts;
        &self.edges[start - self.first[0]..end - self.first[0]]
    }

    pub fn nodes(&self, island: &Island) -> &[Node] {
        let Range { start, end } = island.nodes;
        &self.nodes[start - self.first[1]..end - self.first[1]]
    }

    /// Relative velocity of the surfaces of an island's contact, between its spheres `a` and `b`: now, and `V_minus`.
    #[inline]
    pub fn relative(
        &self,
        velocity: &Velocities,
        island: &Island,
        edge: &Edge,
        [a, b]: [u32; 2],
    ) -> [DVec3; 2] {
        let first = island.nodes.start - self.first[1];
        let (nodes, shifts) = (&self.nodes[first..], &self.shift[first..]);
        let (node, [shift, shift_s]) = (&nodes[a as usize], shifts[a as usize]);
        let (mut d, mut s) = (node.linear, node.surface);
        let (mut off, mut off_s) = (shift, shift_s);
        if b != WORLD {
            let (node, [shift, shift_s]) = (&nodes[b as usize], shifts[b as usize]);
            d -= node.linear;
            s += node.surface;
            off -= shift;
            off_s += shift_s;
        }
        let now = d + edge.normal.cross(s);
        let minus = now - off - edge.normal.cross(off_s);
        match velocity.driven.get(edge.driven as usize) {
            Some([old, new]) => [now - *new, minus - *old],
            None => [now, minus],
        }
    }
}
