//! How contacts push: contact problems as numbers, cones, one residual, semi-smooth Newton and its fallbacks.
//!
//! Nothing here knows bodies or shapes. A problem is a [`rows::RowSystem`]: nodes with a mass, contacts with rows
//! (Jacobians) over at most two nodes, and bounds that tie friction to the normal multiplier.

pub mod clusters;
mod companion;
pub mod cone;
pub mod direct;
pub mod disc;
pub mod hold;
mod island;
mod judge;
pub mod ladder;
pub mod linear_step;
mod newton;
pub mod problem;
pub mod report;
pub mod rows;
pub mod single;
pub mod solver;
pub mod spheres;
pub mod team;

pub use cone::{Bounds, Status};
pub use island::{Beside, Newton, NewtonOptions};
pub use report::SolveReport;
pub use rows::{RowSystem, Subproblem};
