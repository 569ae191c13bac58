//! What a method in time is, and a step on its way.

use super::{Coefficients, Span};
use crate::model::Model;
use crate::outcome::Failure;
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::timers::Timers;

/// One step on its way: what it changes, and what is asked of it.
pub struct Step<'a> {
    pub model: &'a Model,
    /// Written at the end alone: a step that fails leaves it as it was.
    pub state: &'a mut State,
    pub scratch: &'a mut Scratch,
    pub timers: &'a mut Timers,
    pub report: &'a mut StepReport,
    /// Of the size of this step.
    pub coefficients: &'a Coefficients,
    pub span: Span,
    /// Take an unconverged iterate, and count it.
    pub accept_unconverged: bool,
}

/// A method in time: how one step is made. Its own memory can be recomputed: what continues a run is in [`State`].
///
/// [`crate::step::step`] and Moreau-Jean are functions. Other crates hand theirs to [`crate::Simulation::with_stepper`].
pub trait Stepper: Send + Sync {
    /// Makes one step.
    fn step(&mut self, on: &mut Step) -> Result<(), Failure>;

    /// Whether it divides a step by itself: then a step that fails is not halved, and one may take as long as thousands.
    fn divides_steps(&self) -> bool {
        false
    }

    /// Energy that its contacts store at a time (s), J; 0 where they are rigid, and where the first step will say what is wrong.
    fn stored(&mut self, _: &Model, _: &State, _: &mut Scratch, _time: f64) -> f64 {
        0.0
    }
}

/// A function is a method without memory.
impl<F: Fn(&mut Step) -> Result<(), Failure> + Send + Sync> Stepper for F {
    fn step(&mut self, on: &mut Step) -> Result<(), Failure> {
        self(on)
    }
}
