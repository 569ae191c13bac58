//! The triangles of meshes, sorted by place: a sphere finds those near it without a look at the others.

use crate::shape::Shape;
use glam::DVec3;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{RTree, AABB};
use std::ops::{ControlFlow, Range};

type Boxed = GeomWithData<Rectangle<[f64; 3]>, u32>;

/// Which walls are triangles of meshes, and where they were at the last rebuild of the list.
#[derive(Debug, Default)]
pub(in crate::broad) struct Meshes {
    /// Walls of each mesh, in order, and how many of them are triangles.
    spans: Vec<(Range<usize>, usize)>,
    tree: RTree<Boxed>,
    /// By how much farther triangles are listed (m): so far they may move.
    pub margin: f64,
}

impl Meshes {
    pub fn new(spans: Vec<(Range<usize>, usize)>) -> Meshes {
        Meshes {
            spans,
            ..Meshes::default()
        }
    }

    /// How many triangles there are.
    pub fn triangles(&self) -> usize {
        self.spans.iter().map(|s| s.1).sum()
    }

    /// The walls that they are.
    fn walls(&self) -> impl Iterator<Item = usize> + '_ {
        let first = |(walls, count): &(Range<usize>, usize)| walls.start..walls.start + count;
        self.spans.iter().flat_map(first)
    }

    /// The walls that are of no mesh, of `count` walls.
    pub fn others(&self, count: usize) -> impl Iterator<Item = usize> + '_ {
        let starts = self.spans.iter().map(|s| s.0.end);
        let ends = self.spans.iter().map(|s| s.0.start).chain([count]);
        [0].into_iter()
            .chain(starts)
            .zip(ends)
            .flat_map(|(a, b)| a..b)
    }

    /// Sorts them anew, unless they stand still.
    pub fn sort(&mut self, walls: &[Shape], fixed: bool) {
        if self.spans.is_empty() || (fixed && self.tree.size() > 0) {
            return;
        }
        let triangle = |w: usize| match &walls[w] {
            Shape::Triangle(t) => Some((w, t.corners)),
            _ => None,
        };
        let entries = self.walls().filter_map(triangle);
        let boxed = |(w, [a, b, c]): (usize, [DVec3; 3])| {
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let place = Rectangle::from_corners(low.to_array(), high.to_array());
            GeomWithData::new(place, w as u32)
        };
        self.tree = RTree::bulk_load(entries.map(boxed).collect());
    }

    /// Whether no triangle has moved farther than it was listed.
    pub fn hold(&self, old: &[Shape], new: &[Shape]) -> bool {
        let most = self.margin * self.margin;
        self.walls().all(|w| match (&old[w], &new[w]) {
            (Shape::Triangle(old), Shape::Triangle(new)) => {
                let mut ways = old.corners.iter().zip(&new.corners);
                ways.all(|(old, new)| (*new - *old).length_squared() <= most)
            }
            _ => false,
        })
    }

    /// Calls `found` for the walls whose boxes come within `reach` (m) and the margin of a point, until it breaks.
    pub fn around(
        &self,
        x: DVec3,
        reach: f64,
        mut found: impl FnMut(usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if self.spans.is_empty() || !(x.is_finite() && reach >= 0.0) {
            return ControlFlow::Continue(());
        }
        // More than all that `reaches_wall` admits.
        let size = (reach + self.margin) * (1.0 + 1e-9) + 1e-14 * x.abs().max_element();
        let near = AABB::from_corners((x - size).to_array(), (x + size).to_array());
        let mut near = self.tree.locate_in_envelope_intersecting(near);
        near.try_for_each(|entry| found(entry.data as usize))
    }
}
