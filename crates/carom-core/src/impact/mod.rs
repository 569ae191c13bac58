//! Impact laws: strategies over velocity sub-problems of one island (section 3.2; rules R2 to R4).
//!
//! `sequence.rs` orders the problems of an island, `law.rs` says what restitution adds to the measures of a contact, `kept.rs` looks at
//! what the first problem keeps of the loads, `table.rs` collects what they give. Contacts are held as spheres in `pile`, or as rows here:
//! `problem.rs` states and solves one problem over chosen contacts, `coupled.rs` adds joints and loads to it, `safeguard.rs` keeps it from
//! gaining energy.

pub mod bisect;
mod coupled;
mod energy_gain;
pub mod law;
mod memory;
mod problem;
pub mod rows;
mod safeguard;
pub mod sequence;
pub mod table;

pub use energy_gain::{gains_energy, ContactWork};
pub use memory::ImpactScratch;
