//! Continuous contact forces: the comparison of section 5.6 with a penalty method.
//!
//! Bodies overlap a little and push each other apart with `F = K d^n (1 + chi d'/v_in)`. [`damping`] has the published
//! dampings chi, [`elastic`] Hertz's K and times, `friction.rs` the exact flows of dry friction. `pair.rs` follows one
//! pair, `law.rs` has its constants, `forces.rs` its forces, `limit.rs` the substep that it admits, `records.rs` what it tells. `step.rs` makes the
//! substeps. `docs/theory/penalty.md` states all of it.
//!
//! To the core this is a [`Stepper`](carom_core::stepper::method::Stepper) like any other: [`simulation`] hands it over.

mod bodies;
pub mod damping;
pub mod elastic;
mod forces;
mod friction;
pub mod law;
mod limit;
mod method;
mod pair;
mod records;
mod step;
mod sums;

use carom_core::options::{Method, PenaltyFriction};
use carom_core::{InitialState, Model, ModelError, Simulation};
use method::Penalty;

/// A run by the method of the model's options, whichever it is.
///
/// # Errors
/// Method `penalty` refuses joints, and contact laws that it cannot honour.
pub fn simulation(model: Model, initial: InitialState) -> Result<Simulation, ModelError> {
    if model.options.method != Method::Penalty {
        return Ok(Simulation::new(model, initial));
    }
    check(&model)?;
    let stepper = Box::new(Penalty::new(&model));
    Ok(Simulation::with_stepper(model, initial, stepper))
}

fn check(model: &Model) -> Result<(), ModelError> {
    for (there, what) in [
        (!model.joints.is_empty(), "joints"),
        (!model.meshes.is_empty(), "meshes"),
        (model.cohesive_reach() > 0.0, "cohesion"),
        (!model.free_walls.is_empty(), "free walls"),
    ] {
        if there {
            let text = format!("penalty knows no {what}; choose nsga, or leave the {what} out");
            return Err(ModelError::option("method", text));
        }
    }
    for (index, law) in model.laws.iter().enumerate() {
        let e = law.tangential_restitution;
        let cure = match model.options.penalty_friction {
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
