//! Impact laws: strategies over velocity sub-problems of one island (section 3.2; rules R2 to R4).
//!
//! `laws.rs` is the table of laws, and `laws` has those with a file of their own. `sequence.rs` orders the problems of an island, `law.rs` says what restitution adds to the measures of a contact, `energy.rs` how
//! much restitution is left where it would give energy, `table.rs` collects what they give, and `course.rs` what springs give in the course of an impact. Contacts are held as spheres in `pile`, or as rows here:
//! `problem.rs` states and solves one problem over chosen contacts, `coupled.rs` adds joints and loads to it.

pub mod compliant;
mod coupled;
pub mod course;
pub mod energy;
pub mod law;
pub mod laws;
mod memory;
mod problem;
mod reduced;
pub mod rows;
pub mod sequence;
pub mod table;

pub use memory::ImpactScratch;
