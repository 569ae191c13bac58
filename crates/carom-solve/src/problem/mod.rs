//! A contact problem in local form, as data: `u = W r + q`, bodies eliminated, one group of rows for each contact.
//!
//! Find `r` with `K* contains u + s(u) n, perpendicular to r in K` for every contact, `s(u) = sum_b mu_b |u_b|`
//! (docs/reference/problems.md). `W` may be singular, unsymmetric by little, and its blocks of any form: contacts of
//! bodies that are no spheres.

mod blocks;
mod build;
mod group;
pub mod natural;
mod scaled;
mod statement;

pub use blocks::BlockMatrix;
pub use build::{ProblemError, RowMap};
pub use group::RowGroup;
pub use scaled::Scaled;
pub use statement::Problem;
