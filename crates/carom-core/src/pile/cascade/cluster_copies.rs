//! Contacts and spheres of some clusters, copied side by side: what waits for memory then waits at the same time, and once.

use super::clusters::Clusters;
use super::contact_graph::{ContactGraph, Edge, Node};
use crate::pile::velocities::Velocities;
use carom_solve::rows::WORLD;
use glam::DVec3;
use std::ops::Range;

/// Contacts copied at a time. Speed alone: they stay in the fastest memory, and are enough that little waiting is left.
const COPIED_CONTACTS: u32 = 96;

#[derive(Default)]
pub(super) struct ClusterCopies {
    edges: Vec<Edge>,
    nodes: Vec<Node>,
    shift: Vec<[DVec3; 2]>,
    /// First contact and sphere that are here, among all in clusters.
    first: [usize; 2],
}

/// A cluster, by places among all contacts and spheres of clusters.
#[derive(Clone)]
pub(super) struct ClusterRange {
    pub contacts: Range<usize>,
    pub nodes: Range<usize>,
}

impl ClusterCopies {
    /// Copies as many of the clusters in `range` as are taken at a time, at least one; the cluster behind the last of them.
    pub fn take(
        &mut self,
        graph: &ContactGraph,
        clusters: &Clusters,
        range: Range<usize>,
    ) -> usize {
        let begin = |cluster: usize| clusters.starts[cluster];
        let mut end = range.start + 1;
        while end < range.end && begin(end + 1)[0] - begin(range.start)[0] <= COPIED_CONTACTS {
            end += 1;
        }
        let ([c, n], [c_end, n_end]) = (
            begin(range.start).map(|k| k as usize),
            begin(end).map(|k| k as usize),
        );
        self.first = [c, n];
        self.edges.clear();
        let slots = clusters.slots[c..c_end].iter();
        self.edges.extend(slots.map(|&s| graph.edges[s as usize]));
        let nodes = &clusters.nodes[n..n_end];
        self.nodes.clear();
        self.nodes.extend(nodes.iter().map(|&n| graph.node(n)));
        self.shift.clear();
        let shifts = nodes.iter().map(|&n| graph.shift[n as usize]);
        self.shift.extend(shifts);
        end
    }

    pub fn edges(&self, cluster: &ClusterRange) -> &[Edge] {
        let Range { start, end } = cluster.contacts;
        &self.edges[start - self.first[0]..end - self.first[0]]
    }

    pub fn nodes(&self, cluster: &ClusterRange) -> &[Node] {
        let Range { start, end } = cluster.nodes;
        &self.nodes[start - self.first[1]..end - self.first[1]]
    }

    /// Relative velocity of the surfaces of a cluster's contact, between its spheres `a` and `b`: now, and `V_minus`.
    #[inline]
    pub fn relative(
        &self,
        velocity: &Velocities,
        cluster: &ClusterRange,
        edge: &Edge,
        [a, b]: [u32; 2],
    ) -> [DVec3; 2] {
        let first = cluster.nodes.start - self.first[1];
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
