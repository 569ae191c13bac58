//! Impact laws: strategies over velocity sub-problems of one island (section 3.2; rules R2 to R4).
//!
//! `problem.rs` states and solves one impact problem over chosen contacts, `coupled.rs` adds joints and loads to it,
//! `safeguard.rs` keeps it from gaining energy, `sequence.rs` orders them, `kept.rs` looks at what the first one keeps of the loads.

mod coupled;
mod kept;
mod problem;
mod safeguard;
mod sequence;

pub use kept::{gives, Worked};
pub use problem::ImpactScratch;

use crate::islands::Island;
use crate::model::Model;
use crate::options::Impact;
use crate::report::StepReport;
use crate::scratch::IslandScratch;
use crate::state::State;
use crate::stepper::Span;

/// An impact problem gains energy if its work exceeds this share of the island's kinetic energy (rule R4).
pub const GAIN_TOLERANCE: f64 = 1e-10;

/// Bisections of the restitution scale (rule R4).
pub const BISECTIONS: u32 = 12;

/// The same in islands with joints: there a gain of 1e-9 of the energy may be only the turn of a rod within the step, and must
/// not take 2e-4 off e.
pub const BISECTIONS_JOINTS: u32 = 30;

/// Largest scale found in [0, 1] at which `admissible` holds, keeping the admissible end; 0 is taken as admissible.
pub fn bisect_scale(count: u32, mut admissible: impl FnMut(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..count {
        let middle = 0.5 * (low + high);
        if admissible(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

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
