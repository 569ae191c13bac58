//! All islands of a level, in their order: solved here, or handed over by the threads that solved them.

use crate::level::Task;
use crate::report::StepReport;
use crate::scratch::Scratch;

/// Solves the islands of a level. False: one was not solved, and those behind it do not count.
pub fn solve(task: &Task, scratch: &mut Scratch, report: &mut StepReport) -> bool {
    if task.model.options.threads < 2 {
        let (islands, mut step) = scratch.of_level(task.level);
        return (0..islands.len()).all(|number| {
            step.keeper.island = number as u32;
            task.solve(&mut step, islands.island(number), report)
        });
    }
    let mut sharing = std::mem::take(&mut scratch.sharing);
    let (islands, mut step) = scratch.of_level(task.level);
    sharing.solve_shared(task, islands, &step);
    let mut batches = sharing.batches.iter_mut().peekable();
    let mut solved = true;
    for number in 0..islands.len() {
        step.keeper.island = number as u32;
        let island = islands.island(number);
        while batches.next_if(|batch| batch.is_done()).is_some() {}
        solved = match batches.peek_mut() {
            Some(batch) if batch.is_next(number as u32) => {
                batch.hand_over(&mut step, island, report)
            }
            _ => task.solve(&mut step, island, report),
        };
        if !solved {
            break;
        }
    }
    scratch.sharing = sharing;
    solved
}
