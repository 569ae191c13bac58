//! Solvers of contact problems given as data: one trait, one judge, a family of methods.
//!
//! A solver takes a [`crate::problem::Problem`] and a start, and leaves the best multipliers it found. It works on a scaled
//! copy and is judged by [`crate::problem::natural::residual`] on the problem as given, which no method uses as its own
//! merit.

mod admm;
mod auto;
mod by_name;
mod gauss_seidel;
mod interior;
mod judge;
mod matrix;
mod one_contact;
mod semi_smooth;
mod split;
pub mod sweep;

pub use admm::Admm;
pub use auto::Auto;
pub use by_name::{by_name, solve, SOLVERS};
pub use gauss_seidel::GaussSeidel;
pub use interior::InteriorPoint;
pub use judge::{Clock, ConeSolver, Judge, Outcome, Settings, Stage};
pub use one_contact::solve_contact;
pub use semi_smooth::SemiSmoothNewton;
pub use split::{split, SPLIT_CONTACTS};

pub(crate) use auto::fill;
