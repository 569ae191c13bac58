//! What the impact problems of an island work on.

use crate::model::Model;
use crate::outcome::History;
use crate::report::StepReport;
use crate::workspace::IslandScratch;

/// Model, memory and report of the island at hand.
pub struct On<'r, 's> {
    pub model: &'r Model,
    pub scratch: &'r mut IslandScratch<'s>,
    pub report: &'r mut StepReport,
}

impl On<'_, '_> {
    /// What the step reports so far, with the history of residuals of velocities.
    pub fn told(&self) -> (StepReport, History) {
        (*self.report, self.scratch.history[2].clone())
    }

    /// Reports that again: what was solved since is no part of the step.
    pub fn tell(&mut self, told: (StepReport, History)) {
        (*self.report, self.scratch.history[2]) = told;
    }
}
