//! Which pairs can meet at all.
//!
//! [`CellList`] finds the close pairs of one configuration in O(N); [`NeighbourList`] keeps such a list valid over
//! many steps; [`overlaps`] checks a start configuration. Indices of bodies are `u32`: spheres first, `0..N`, then
//! wall `w` is body `N + w`. Pairs are `(a, b)` with `a < b`, so at a wall the sphere is always A.

mod cell_list;
mod grid;
mod overlap;
mod verlet;

pub use cell_list::CellList;
pub use overlap::{overlaps, Overlap};
pub use verlet::{Meeting, NeighbourList};
