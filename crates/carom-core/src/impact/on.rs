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
    /// What the step reports so far, with the residual history of the velocity level.
    pub fn snapshot(&self) -> (StepReport, History) {
        (*self.report, self.scratch.history[2].clone())
    }

    /// Goes back to a snapshot: what was solved since is no part of the step.
    pub fn restore(&mut self, snapshot: (StepReport, History)) {
        (*self.report, self.scratch.history[2]) = snapshot;
    }
}
