//! Method `events`: the limit of small steps, computed without one. Motion between impacts is known in closed form, the times of impacts are roots of
//! polynomials, and the impact law is that of the step, by the same code ([`carom_core::moment::impact`]).
//!
//! `motion.rs` has the modes of a ball and their closed forms (`curved.rs` and `series.rs` the one that has none, `turns.rs` orientations), `meet.rs` when bodies meet,
//! [`roots`] the roots, `queue.rs` what happens next, `foresee.rs` fills it. `step.rs` is the loop over events, `carry.rs` takes a ball from one to the next,
//! `group.rs` has impacts, `handover.rs` what has no closed form (`ahead.rs` a step of it), `close.rs` the end of a step, `tell.rs` the table of transitions. `check.rs` says what it cannot do. `docs/theory/events.md` states
//! all of it.
//!
//! To the core this is a [`Stepper`](carom_core::stepper::method::Stepper) like any other: what it calls a step is the time between two reports. It keeps
//! nothing from one to the next but the state, and what that table has said.

mod ahead;
mod carry;
mod check;
mod close;
mod curved;
mod foresee;
mod group;
mod handover;
mod meet;
mod motion;
mod near;
mod queue;
pub mod roots;
mod series;
mod step;
mod sums;
mod tell;
mod turns;

use carom_core::options::Method;
use carom_core::{InitialState, Model, ModelError, Simulation};

/// Closing speed over that of the group (1) at which an impact begins, and residual (1) to which impact problems are solved. In a step larger ones hide behind its
/// own error; here they would be the only one.
const EXACT: [f64; 2] = [1e-13, 1e-12];

/// A run by method `events`.
///
/// # Errors
/// What has no closed motion between impacts is refused by name.
pub fn simulation(mut model: Model, initial: InitialState) -> Result<Simulation, ModelError> {
    check::check(&model, &initial)?;
    let mut stepping = model.clone();
    stepping.options.method = Method::Nsga;
    let o = &mut model.options;
    o.closing_tolerance_speed = o.closing_tolerance_speed.min(EXACT[0]);
    o.tolerance = o.tolerance.min(EXACT[1]);
    o.pile_tolerance = o.pile_tolerance.min(EXACT[1]);
    let stepper = Box::new(step::Events::new(stepping));
    Ok(Simulation::with_stepper(model, initial, stepper))
}
