//! Projected Gauss-Seidel for contacts of spheres, without matrices: piles of millions of balls.
//!
//! The problem is that of [`crate::rows`] with linear measures and sliding friction: `M u = G^T r`, `z = z0 + G u`, and for each
//! contact `r_N >= 0`, `z_N >= 0`, `r_N z_N = 0`, `|r_T| <= mu r_N`, `r_T = -mu r_N z_T/|z_T|` where it slips. A sweep solves one
//! contact after the other, each exactly (`kernel`); rolling and spinning friction may be added (`rolling`). Impulses and slips are vectors of the world; over tangents
//! `t1, t2` the rows are `lambda = (r.n, r.t1, r.t2)` and `z0 = (s.n, s.t1, s.t2)`.
//!
//! The same bits for any number of threads and for all instruction sets (`layout`, `kernel`).

mod accelerate;
mod bodies;
mod carry;
mod coarse;
mod curve;
mod goal;
mod groups;
mod guided;
mod kernel;
pub(crate) mod lanes;
mod layout;
mod moments;
mod momentum;
mod pass;
mod problem;
mod residual;
mod rolling;
mod rolls;
mod settle;
mod sweeps;
pub(crate) mod vectors;

pub(crate) use accelerate::{GROWTH, RAMP};
pub(crate) use bodies::State;
pub use goal::{Goal, Norms, Progress};
pub(crate) use groups::{Packing, UngroupedContact};
pub use lanes::Instructions;
pub(crate) use lanes::{Lanes, Work};
pub use problem::{Body, Contact, Place, SpheresError};
pub use rolls::Roll;
pub(crate) use settle::momentum_cap;
pub use sweeps::{Shape, Sweeps};
