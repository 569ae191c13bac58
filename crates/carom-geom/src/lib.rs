//! Where bodies meet: shapes, the broad phase, and and one file for each thing that spheres meet.
//!
//! This crate knows positions and radii and nothing else: no mass, no force, no time step. Lengths are metres,
//! all numbers `f64`, all vectors [`glam::DVec3`] in the world frame. Equation numbers are those of the paper
//! named in `docs/theory/algorithm.md`, section 1.
//!
//! | module | question it answers |
//! |---|---|
//! | [`shape`] | what can be touched |
//! | [`mesh`] | what of a surface of triangles does a sphere meet |
//! | [`pair`] | how far apart are these two, in which direction, and how does that direction turn |
//! | [`periodic`] | where are they nearest, if space repeats itself |
//! | [`tangent`] | which two directions span the contact plane |
//! | [`broad`] | which pairs can meet at all |
//!
//! The hot path is made of small inlinable functions ([`sphere_sphere`], [`sphere_plane`], [`tangent_frame`]). Nothing here allocates
//! once its buffers have grown to the size of the problem.

pub mod broad;
pub mod mesh;
pub mod pair;
pub mod periodic;
pub mod shape;
pub mod tangent;

pub use broad::{overlaps, Meeting, NeighbourList, Overlap};
pub use glam::DVec3;
pub use mesh::{same_contact, BadTriangle, Mesh};
pub use pair::{sphere_plane, sphere_sphere, Proximity, ROUNDING};
pub use pair::{Ball, Cone, Cylinder, Disc, Line, Rectangle, Sheet, Triangle};
pub use periodic::{Periodic, Shear};
pub use shape::{Displacement, Shape};
pub use tangent::tangent_frame;
