//! Continuous contact forces: the comparison of section 5.6 with a penalty method.
//!
//! Bodies overlap a little and push each other apart with `F = K d^n (1 + chi d'/v_in)`. [`laws`] has the published
//! dampings chi, [`elastic`] Hertz's K and times, [`friction`] the exact flows of dry friction; [`pair`] follows one pair
//! (`forces.rs`: its forces, `limit.rs`: the substep it admits), [`step`](step()) makes the substeps. `docs/theory/penalty.md` states all of it.

mod bodies;
pub mod elastic;
mod forces;
pub mod friction;
pub mod laws;
mod limit;
pub mod pair;
mod step;
pub mod touch;
pub mod workspace;

pub use step::step;
pub use touch::Touch;
pub use workspace::Workspace;

use crate::joint::Joint;
use crate::model::ContactLaw;
use crate::options::{Method, Options, PenaltyFriction};
use crate::outcome::ModelError;

/// Refuses joints and contact laws that the method cannot honour. Other methods take all.
pub fn check(options: &Options, laws: &[ContactLaw], joints: &[Joint]) -> Result<(), ModelError> {
    if options.method != Method::Penalty {
        return Ok(());
    }
    if !joints.is_empty() {
        let text = "penalty knows no joints; choose nsga, or leave the joints out".to_owned();
        return Err(ModelError::option("method", text));
    }
    for (index, law) in laws.iter().enumerate() {
        let e = law.tangential_restitution;
        let cure = match options.penalty_friction {
            PenaltyFriction::Regularised if e != 0.0 => {
                "regularised friction has none; set 0 or penalty_friction = spring"
            }
            PenaltyFriction::Spring if e < 0.0 => {
                "a tangential spring cannot leave slip over; set 0 or more"
            }
            _ => continue,
        };
        return Err(ModelError::Entry {
            kind: "contact law",
            index,
            quantity: "tangential_restitution",
            text: format!("is {e}: {cure}"),
        });
    }
    Ok(())
}
