//! How time passes: the decoupled nonsmooth generalized-alpha scheme for rigid spheres.
//!
//! Start at [`step`]: it is the page of the time step. `docs/theory/algorithm.md` states it in formulas; the oracle in
//! `tests/oracle` states it in NumPy.

mod all_islands;
pub mod blow_up;
pub mod build;
mod candidates;
pub mod clump;
mod cohesion;
pub mod contact;
mod cures;
pub mod deformation;
mod energy;
mod finish;
pub mod flow;
pub mod force;
pub mod held_apart;
pub mod impact;
pub mod islands;
pub mod joint;
pub mod level;
mod loads_once;
pub mod model;
pub mod moment;
pub mod options;
pub mod outcome;
mod parallel;
mod pile;
pub mod problem;
pub mod record;
mod relist;
pub mod report;
pub mod rotation;
pub mod rows;
pub mod scratch;
pub mod simulation;
pub mod state;
pub mod step;
pub mod stepper;
pub mod timers;
pub mod transition;
mod travel;
pub mod wall;
pub mod workspace;

pub use build::ModelInput;
pub use model::{InitialState, Model};
pub use options::{Options, Value};
pub use outcome::ModelError;
pub use pile::overlap as pile_overlap;
pub use report::{Monitors, Outcome, StepReport};
pub use simulation::{Recording, Simulation};
pub use state::State;
