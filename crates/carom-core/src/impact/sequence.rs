//! The order of impact problems in a step: with load offset (rule R2, the default), as printed, and one-shot.

use super::problem::Law;
use crate::contact::WorldImpulse;
use crate::impact::memory::ImpactScratch;
use crate::level::rest;
use crate::model::Model;
use crate::report::StepReport;
use crate::state::{State, Warm};
use crate::workspace::IslandScratch;

/// Rule R2: loads first, then impacts. `docs/theory/algorithm.md` section 5 has it stage by stage.
pub fn with_load_offset(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    work: &mut ImpactScratch,
    h: f64,
    report: &mut StepReport,
) -> bool {
    if work.tol == 0.0 {
        return true;
    }
    let Some([resting, loaded]) = stage_0(model, state, scratch, work, h, report) else {
        return false;
    };
    let slots = work.members.len();
    let offset = work.jump.clone();
    // Stage 1: contacts that close now, together with the resting ones that the load closes.
    work.choose_closing();
    if work.chosen.is_empty() {
        keep_warm(scratch, work);
        return true;
    }
    let mut closing = vec![false; slots];
    work.chosen.iter().for_each(|&s| closing[s] = true);
    work.chosen.clear();
    work.chosen
        .extend((0..slots).filter(|&s| closing[s] || loaded[s]));
    let rows = work.rows(scratch);
    work.drop_chosen(scratch.contacts);
    work.v_minus.clone_from(&work.v_old);
    if !work.solve_chosen(model, scratch, Law::Newton, Some(1), None, report) {
        return false;
    }
    if work.kept_gives(model) {
        // All of the loads together with the impact, then.
        report.fallbacks += 1;
        work.forget_all(scratch, rows);
        work.chosen.clear();
        work.chosen
            .extend((0..slots).filter(|&s| closing[s] || resting[s]));
        if !work.solve_chosen(model, scratch, Law::Newton, Some(1), None, report) {
            return false;
        }
    }
    in_turn(model, scratch, work, report, Law::Newton, 2, &offset)
}

/// Stage 0: the load of this step on contacts that were not approaching, without restitution. Which contacts these are, and which of them the loads
/// close; nothing if they were not solved.
fn stage_0(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    work: &mut ImpactScratch,
    h: f64,
    report: &mut StepReport,
) -> Option<[Vec<bool>; 2]> {
    let slots = work.members.len();
    let resting: Vec<bool> = (0..slots)
        .map(|s| work.old_normal_velocity(s) >= -work.tol)
        .collect();
    let loaded: Vec<bool> = (0..slots)
        .map(|s| resting[s] && work.normal_velocity(s, &work.jump) < -work.tol)
        .collect();
    if loaded.contains(&true) {
        work.chosen.clear();
        work.chosen.extend((0..slots).filter(|&s| resting[s]));
        let start = warm_start(state, scratch, work, h);
        let rows = work.rows(scratch);
        if !work.solve_chosen(model, scratch, Law::Plastic, None, Some(&start), report) {
            return None;
        }
        if work.gives(model) {
            // Forces that hold one another, beyond what the tolerance tells of the loads: from nothing, then.
            report.fallbacks += 1;
            work.forget_all(scratch, rows);
            if !work.solve_chosen(model, scratch, Law::Plastic, None, None, report) {
                return None;
            }
        }
    }
    Some([resting, loaded])
}

/// The paper's own sequence (eqs. 24-29): strictly closing contacts from the first problem on.
pub fn as_printed(
    model: &Model,
    scratch: &mut IslandScratch,
    work: &mut ImpactScratch,
    report: &mut StepReport,
) -> bool {
    if work.tol == 0.0 {
        return true;
    }
    let offset = vec![0.0; work.jump.len()];
    in_turn(model, scratch, work, report, Law::Printed, 1, &offset)
}

/// Rule (26): strictly closing contacts, problem after problem, with `V_minus = v_n + (W - offset)` (eq. 27), until none
/// closes, a problem gives no impulse, or the bound is reached.
fn in_turn(
    model: &Model,
    scratch: &mut IslandScratch,
    work: &mut ImpactScratch,
    report: &mut StepReport,
    law: Law,
    first: u32,
    offset: &[f64],
) -> bool {
    let bounds = model.options.problems(work.members.len());
    let mut solved = 0;
    for problem in first..=bounds.most {
        work.choose_closing();
        if work.chosen.is_empty() {
            return true;
        }
        solved += work.chosen.len() as u64;
        if solved > bounds.work {
            break;
        }
        let jumps = work.jump.iter().zip(offset);
        for ((v, old), (jump, w0)) in work.v_minus.iter_mut().zip(&work.v_old).zip(jumps) {
            *v = old + (jump - w0);
        }
        if !work.solve_chosen(model, scratch, law, Some(problem), None, report) {
            return false;
        }
        if work.stands_still() {
            break;
        }
    }
    truncate(model, scratch, work, report)
}

/// Newton's law on all closed contacts at once.
pub fn one_shot(
    model: &Model,
    scratch: &mut IslandScratch,
    work: &mut ImpactScratch,
    report: &mut StepReport,
) -> bool {
    if work.tol == 0.0 {
        return true;
    }
    work.chosen.clear();
    work.chosen.extend(0..work.members.len());
    work.v_minus.clone_from(&work.v_old);
    work.solve_chosen(model, scratch, Law::Newton, Some(1), None, report)
}

/// The bound of the sequence: everything at once without restitution leaves nothing closing, and is dissipative.
fn truncate(
    model: &Model,
    scratch: &mut IslandScratch,
    work: &mut ImpactScratch,
    report: &mut StepReport,
) -> bool {
    work.choose_closing();
    if work.chosen.is_empty() {
        return true;
    }
    report.truncated += 1;
    work.chosen.clear();
    work.chosen.extend(0..work.members.len());
    let index = model.options.problems(work.members.len()).most + 1;
    work.solve_chosen(model, scratch, Law::Plastic, Some(index), None, report)
}

/// Impulses of the last step for the chosen contacts, scaled to this step's size (rule R8).
fn warm_start(state: &State, scratch: &IslandScratch, work: &ImpactScratch, h: f64) -> Vec<f64> {
    let mut start = Vec::with_capacity(work.full.rows());
    let scale = h / state.warm_step;
    for &slot in &work.chosen {
        let contact = &scratch.contacts[work.members[slot] as usize];
        let dim = work.full.contacts[slot].dim as usize;
        let mut packed = [0.0; 6];
        if let Some(warm) = rest::of_last_step(state, contact) {
            let world = WorldImpulse {
                impulse: scale * warm.impulse,
                moment: scale * warm.moment,
            };
            contact.to_rows(&world, &mut packed);
        }
        start.extend_from_slice(&packed[..dim]);
    }
    start
}

/// Keeps the impulses of an island that had no impact in this step.
fn keep_warm(scratch: &mut IslandScratch, work: &ImpactScratch) {
    for (slot, &m) in work.members.iter().enumerate() {
        let c = &work.full.contacts[slot];
        let row = c.row as usize;
        if work.impulse[row] <= 0.0 {
            continue;
        }
        let mut packed = [0.0; 6];
        packed[..c.dim as usize].copy_from_slice(&work.impulse[row..row + c.dim as usize]);
        let contact = &scratch.contacts[m as usize];
        let world = contact.to_world(contact.n1, &packed);
        let position = if contact.held {
            contact.to_world(contact.n0, &contact.nu)
        } else {
            WorldImpulse::default()
        };
        scratch.warm.push(Warm {
            key: (contact.a, contact.b),
            impulse: world.impulse,
            moment: world.moment,
            position: position.impulse,
            position_moment: position.moment,
        });
    }
}
