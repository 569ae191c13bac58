//! Impact laws: strategies over velocity sub-problems of one island (section 3.2; rules R2 to R4).
//!
//! `problem.rs` states and solves one impact problem over chosen contacts, `coupled.rs` adds joints and loads to it,
//! `safeguard.rs` keeps it from gaining energy, `sequence.rs` orders them, `kept.rs` looks at what the first one keeps of the loads.

pub mod bisect;
mod coupled;
mod kept;
mod memory;
mod problem;
mod safeguard;
mod sequence;

pub use kept::{gives, Worked};
pub use memory::ImpactScratch;

use crate::islands::Island;
use crate::model::Model;
use crate::options::Impact;
use crate::report::StepReport;
use crate::state::State;
use crate::stepper::Span;
use crate::workspace::IslandScratch;

/// Solves one island by the law of the run.
pub fn solve_island(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    accept_unconverged: bool,
) -> bool {
    let mut work = std::mem::take(scratch.impact);
    work.begin(model, state, scratch, island, span, accept_unconverged);
    let h = span.h;
    let settled = island.is_free() || work.settle(model, state, scratch, report);
    let solved = settled
        && (island.contacts.is_empty()
            || match model.options.impact {
                Impact::Sequence => {
                    sequence::with_load_offset(model, state, scratch, &mut work, h, report)
                }
                Impact::SequencePaper => sequence::as_printed(model, scratch, &mut work, report),
                Impact::OneShot => sequence::one_shot(model, scratch, &mut work, report),
            });
    if solved {
        work.finish(model, scratch, report);
    }
    *scratch.impact = work;
    solved
}
