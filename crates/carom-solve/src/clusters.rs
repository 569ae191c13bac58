//! Which of some numbered things hang together: the one union-find.
//!
//! The smallest index of a cluster is its root, so the result does not depend on the order in which pairs are joined.

/// What knows its parent in a forest: another index of its cluster; a root knows itself.
pub trait Linked {
    fn parent(&mut self) -> &mut u32;
}

impl Linked for u32 {
    #[inline]
    fn parent(&mut self) -> &mut u32 {
        self
    }
}

/// Clusters of the indices of a slice.
pub trait Forest {
    /// The smallest index of the cluster of `index`; halves the way to it.
    fn root(&mut self, index: u32) -> u32;

    /// Joins the clusters of two indices.
    fn join(&mut self, a: u32, b: u32);
}

impl<T: Linked> Forest for [T] {
    #[inline]
    fn root(&mut self, mut index: u32) -> u32 {
        loop {
            let parent = *self[index as usize].parent();
            if parent == index {
                return index;
            }
            let above = *self[parent as usize].parent();
            *self[index as usize].parent() = above;
            index = above;
        }
    }

    #[inline]
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        *self[a.max(b) as usize].parent() = a.min(b);
    }
}

/// A forest of `count` clusters of one index each.
pub fn apart(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}
