//! What the impact problems of an island work on.

use crate::model::Model;
use crate::report::StepReport;
use crate::workspace::IslandScratch;

/// Model, memory and report of the island at hand.
pub struct On<'r, 's> {
    pub model: &'r Model,
    pub scratch: &'r mut IslandScratch<'s>,
    pub report: &'r mut StepReport,
}
