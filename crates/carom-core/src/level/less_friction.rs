//! Piles that jam: where sweeps do not solve the smallest part of a step, less friction in all contacts, as small islands have it.

use super::LESS_FRICTION;
use crate::islands::Island;
use crate::report::StepReport;
use crate::workspace::IslandScratch;
use carom_solve::Bounds;

/// Solves an island with shares of its friction, the largest first, until one is solved; counted as a fallback.
pub(super) fn with_less_friction(
    scratch: &mut IslandScratch,
    island: Island,
    report: &mut StepReport,
    mut solve: impl FnMut(&mut IslandScratch, &mut StepReport) -> bool,
) -> bool {
    let failed = scratch.keeper.failed.take();
    let members = || island.contacts.iter().map(|&m| m as usize);
    let bounds: Vec<Bounds> = members().map(|m| scratch.contacts[m].bounds).collect();
    let solved = LESS_FRICTION.iter().any(|&share| {
        for (m, b) in members().zip(&bounds) {
            scratch.contacts[m].bounds = b.scaled(share);
        }
        solve(scratch, report)
    });
    for (m, b) in members().zip(bounds) {
        scratch.contacts[m].bounds = b;
    }
    report.fallbacks += u32::from(solved);
    if !solved {
        // What stopped the run is the problem itself.
        scratch.keeper.failed = failed;
    }
    solved
}
