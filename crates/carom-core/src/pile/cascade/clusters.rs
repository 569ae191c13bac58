//! The closing contacts of a problem, fallen apart into clusters (contacts joined by spheres).

use super::contact_graph::ContactGraph;
use carom_solve::clusters::{Forest, Linked};
use carom_solve::rows::WORLD;

const NONE: u32 = u32::MAX;

/// Where a chosen contact's sphere belongs: its parent among united ones, the cluster of a root, its number within the cluster.
#[derive(Clone, Copy, Default)]
struct ClusterPlace {
    parent: u32,
    cluster: u32,
    local: u32,
}

impl Linked for ClusterPlace {
    #[inline]
    fn parent(&mut self) -> &mut u32 {
        &mut self.parent
    }
}

/// Clusters in the order of their first contacts.
#[derive(Default)]
pub(super) struct Clusters {
    /// Contacts, cluster after cluster, with their ends as numbers within the cluster.
    pub slots: Vec<u32>,
    pub sides: Vec<[u32; 2]>,
    /// Spheres, cluster after cluster.
    pub nodes: Vec<u32>,
    /// Where contacts and spheres of a cluster begin; one more at the end.
    pub starts: Vec<[u32; 2]>,
    places: Vec<ClusterPlace>,
    /// Cluster of each chosen contact, and contacts placed so far.
    of_chosen: Vec<u32>,
    placed: Vec<u32>,
}

impl Clusters {
    pub fn open(&mut self, nodes: usize) {
        self.places.clear();
        self.places.resize(nodes, ClusterPlace::default());
    }

    /// Cuts `chosen`, and marks its spheres as touched by the problem. What is new in it nobody can guess, so nothing branches on it.
    pub fn cut(&mut self, graph: &mut ContactGraph, chosen: &[u32], problem: u32) {
        for &slot in chosen {
            let [a, b] = graph.ends[slot as usize];
            for node in [a, b].into_iter().filter(|&n| n != WORLD) {
                let touched = &mut graph.touched[node as usize];
                let place = &mut self.places[node as usize];
                let is_new = *touched != problem;
                *touched = problem;
                *place = ClusterPlace {
                    parent: if is_new { node } else { place.parent },
                    cluster: NONE,
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
        let mut count = 0;
        for &slot in chosen {
            let root = self.places.root(graph.ends[slot as usize][0]);
            let place = &mut self.places[root as usize];
            let is_new = place.cluster == NONE;
            let cluster = if is_new { count } else { place.cluster };
            count += u32::from(is_new);
            place.cluster = cluster;
            self.placed[cluster as usize] += 1;
            self.of_chosen.push(cluster);
        }
        self.placed.truncate(count as usize);
        let mut sum = 0;
        self.starts.clear();
        for size in &mut self.placed {
            self.starts.push([sum, 0]);
            sum += std::mem::replace(size, sum);
        }
        self.starts.push([sum, 0]);
        self.slots.resize(chosen.len(), 0);
        self.sides.resize(chosen.len(), [WORLD; 2]);
        for (&slot, &cluster) in chosen.iter().zip(&self.of_chosen) {
            let place = &mut self.placed[cluster as usize];
            self.slots[*place as usize] = slot;
            self.sides[*place as usize] = graph.ends[slot as usize];
            *place += 1;
        }
        self.number();
    }

    /// Numbers the spheres of each cluster in the order of its contacts.
    fn number(&mut self) {
        self.nodes.resize(2 * self.sides.len(), 0);
        let mut count = 0;
        for cluster in 0..self.starts.len() - 1 {
            let first = count;
            self.starts[cluster][1] = first;
            let (from, to) = (self.starts[cluster][0], self.starts[cluster + 1][0]);
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

    /// Cuts the clusters into at most `count` batches of about as many contacts: first cluster of each, one more at the end.
    pub fn batches(&self, count: usize, firsts: &mut Vec<usize>) {
        let clusters = self.starts.len() - 1;
        let share = self.slots.len().div_ceil(count);
        firsts.clear();
        firsts.push(0);
        let mut from = 0;
        for cluster in 1..clusters {
            let at = self.starts[cluster][0] as usize;
            if at - from >= share {
                firsts.push(cluster);
                from = at;
            }
        }
        firsts.push(clusters);
    }
}
