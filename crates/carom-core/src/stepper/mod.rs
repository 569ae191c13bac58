//! Time-stepping schemes. Each is arithmetic on state arrays; the order of the phases is `step.rs`.

pub mod generalized_alpha;
pub mod moreau;

pub use generalized_alpha::Coefficients;
