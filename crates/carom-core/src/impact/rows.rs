//! An island whose contacts are rows in its impact problems, and the law of the run on it.

use super::energy::Admit;
use super::law::Law;
use super::laws;
use super::memory::ImpactScratch;
use super::problem::RowSolution;
use super::sequence::{loads, solve_problem, ImpactIsland, Start};
use crate::contact::{Contact, WorldImpulse};
use crate::level::rest;
use crate::options::Problems;
use crate::report::StepReport;
use crate::state::Warm;
use crate::workspace::On;

/// Share (1) of `closing_tolerance_speed` by which normals may turn between the positions at which loads are solved and those at the end of the
/// step. At 1 what rolls over a curved surface closes in every step; at 0 the same loads are solved twice.
const TURN_SHARE: f64 = 0.1;

/// Solves one island by the law of the run. A call: in its caller its memory would be that of a lone contact too.
#[inline(never)]
pub fn solve_island(on: &mut On) -> bool {
    let o = &on.task.model.options;
    let solve = |rows: &mut RowIsland, still: bool| {
        let nothing = still || rows.on.island.contacts.is_empty();
        let solved = nothing || laws::solve(o.impact, rows);
        if solved {
            if o.impact.has_loads_first() && !rows.again && !rows.impacts {
                rows.keep_warm();
            }
            rows.work.finish(rows.on);
        }
        solved
    };
    on_rows(on, o.loads_once(), solve)
}

/// Solves the loads of one island at the positions after the smooth step, with the contacts that do not approach: their impulses, and the jumps
/// of velocity W0 that these make.
#[inline(never)]
pub fn solve_loads(on: &mut On) -> bool {
    let solve = |rows: &mut RowIsland, still: bool| {
        if !still {
            let Some([resting, _]) = loads(rows) else {
                return false;
            };
            for (&m, resting) in rows.work.members.iter().zip(resting) {
                rows.on.scratch.contacts[m as usize].resting = resting;
            }
        }
        rows.keep_warm();
        rows.work.give_loads(rows.on);
        true
    };
    on_rows(on, false, solve)
}

/// Collects an island and its joints, and has it solved; `still`: nothing moves and nothing pulls.
fn on_rows(on: &mut On, again: bool, solve: impl FnOnce(&mut RowIsland, bool) -> bool) -> bool {
    let mut work = std::mem::take(on.scratch.impact);
    work.begin(on);
    let settled = on.island.is_free() || work.settle(on);
    let still = work.speeds.largest() == 0.0;
    let mut rows = RowIsland {
        work: &mut work,
        on,
        impacts: false,
        again,
    };
    let solved = settled && solve(&mut rows, still);
    *on.scratch.impact = work;
    solved
}

struct RowIsland<'w, 'r, 's> {
    work: &'w mut ImpactScratch,
    on: &'w mut On<'r, 's>,
    /// A problem other than that of the loads was solved.
    impacts: bool,
    /// The loads have been solved before positions were.
    again: bool,
}

/// Share (1) of the closing speed of its contacts above which a problem has solved nothing: where friction wedges a ball solvers may leave as much, and
/// as much again. At 1 such sequences go on to their bound; near 0 what is solved coarsely ends them.
const GOES_NOWHERE: f64 = 0.5;

impl ImpactIsland for RowIsland<'_, '_, '_> {
    type Solution = RowSolution;

    fn slots(&self) -> usize {
        self.work.members.len()
    }

    fn closing_tolerance(&self, slot: usize) -> f64 {
        self.work.closing[slot]
    }

    fn speed_before(&self, slot: usize) -> f64 {
        self.work.old_normal_velocity(slot)
    }

    fn speed(&self, slot: usize) -> f64 {
        self.work.normal_velocity(slot, &self.work.jump)
    }

    fn contact(&self, slot: usize) -> &Contact {
        &self.on.scratch.contacts[self.work.members[slot] as usize]
    }

    fn is_of_balls(&self) -> bool {
        self.on.island.joints.is_empty() && !self.on.island.clumps
    }

    fn again(&self) -> bool {
        self.again
    }

    fn is_pressed(&self, slot: usize) -> bool {
        self.work.is_pressed(slot)
    }

    fn flags(&self, test: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
        (0..self.slots()).map(test).collect()
    }

    fn choose(&mut self, select: impl Fn(usize) -> bool) {
        let slots = 0..self.slots();
        self.work.chosen.clear();
        self.work.chosen.extend(slots.filter(|&slot| select(slot)));
    }

    fn solve(&mut self, law: Law, problem: u32, start: Start) -> bool {
        let warm = (start == Start::LastLoads).then(|| self.last_loads());
        self.impacts |= problem > 0;
        let closed = self.again
            || self.on.task.model.options.impact.has_loads_first()
            || (self.work.chosen.iter()).any(|&slot| self.approaches(slot));
        self.work.table.begin_problem(problem, closed);
        if self.again && start == Start::LastLoads && self.still_hold() {
            self.work.take_loads(self.on, &warm.unwrap_or_default());
            return true;
        }
        if law == Law::Springs {
            return self.work.press(self.on);
        }
        (self.work).solve_chosen(self.on, law, problem, warm.as_deref())
    }

    fn solve_without_restitution(&mut self, problem: u32) -> bool {
        (self.work).solve_without_restitution(self.on, problem)
    }

    fn compress(&mut self) -> Option<bool> {
        self.work.compress(self.on)
    }

    fn add(&mut self, problem: u32) {
        self.work.problems += 1;
        self.work.commit(self.on.scratch.contacts);
        self.work.record(self.on.scratch.contacts, problem);
    }

    fn has_safeguard(&self) -> bool {
        // What was given up cannot be scaled further.
        self.on.task.model.options.energy_safeguard && self.work.scale.iter().any(|&s| s > 0.0)
    }

    fn limits(&self, with: Option<&RowSolution>, admit: Admit) -> Option<Vec<f64>> {
        let (model, contacts) = (self.on.task.model, &*self.on.scratch.contacts);
        self.work.limits((model, contacts), with, admit)
    }

    fn tolerance(&self) -> f64 {
        self.on.task.model.options.tolerance
    }

    fn solve_finely(&mut self, problem: u32) {
        self.work.solve_finely(self.on, problem);
    }

    fn balance(&mut self) {
        self.work.balance();
    }

    fn take_solution(&mut self) -> RowSolution {
        self.work.solution()
    }

    fn mix(&mut self, with: RowSolution, limits: Option<Vec<f64>>) {
        let limits = limits.unwrap_or_else(|| vec![1.0; self.work.full.nodes()]);
        self.work.mix(&with, &limits);
    }

    fn give_up_restitution(&mut self) {
        self.work.scale.fill(0.0);
    }

    fn drop_chosen(&mut self) {
        self.work.drop_chosen(self.on.scratch.contacts);
    }

    fn forget_all(&mut self, problem: u32) {
        self.work.problems -= 1;
        self.work.forget_all(problem);
    }

    fn mark_loads(&mut self) {
        let work = &mut *self.work;
        work.offset.clone_from(&work.jump);
        work.offset_impulse.clone_from(&work.impulse);
        for (sum, load) in work.offset_impulse.iter_mut().zip(&work.load) {
            *sum += load;
        }
    }

    fn gains_energy(&self) -> bool {
        self.work.gains_energy(self.on.task.model)
    }

    fn later(&mut self, law: Law, first: u32) -> Option<bool> {
        let bounds = self.bounds();
        let mut solved = 0;
        for problem in first..=bounds.most {
            self.work.choose_closing();
            if self.work.chosen.is_empty() {
                return Some(true);
            }
            solved += self.work.chosen.len() as u64;
            if solved > bounds.work {
                break;
            }
            let before = self.work.closing_of_chosen();
            if !solve_problem(self, law, problem, Start::Nothing) {
                return None;
            }
            // What has no solution with restitution, or none that gains no energy, and what goes nowhere, ends the sequence.
            let given_up = self.work.scale.iter().all(|&s| s == 0.0);
            // The law as printed leaves closing what its normals of t_n do not see.
            let nowhere =
                law != Law::Printed && self.work.closing_of_chosen() > GOES_NOWHERE * before;
            if given_up || nowhere || self.work.stands_still() {
                break;
            }
        }
        self.work.choose_closing();
        Some(self.work.chosen.is_empty())
    }

    fn bounds(&self) -> Problems {
        self.on.task.model.options.problems(self.slots())
    }

    fn report(&mut self) -> &mut StepReport {
        self.on.report
    }
}

impl RowIsland<'_, '_, '_> {
    /// Whether the loads that were solved before positions satisfy their conditions at these: no normal has turned by what would make a contact
    /// close.
    fn still_hold(&self) -> bool {
        let turned = TURN_SHARE * self.on.task.model.options.closing_tolerance_speed;
        self.work.has_contacts_alone()
            && self.work.chosen.iter().all(|&slot| {
                let c = self.contact(slot);
                let clumps = self.on.scratch.clumps;
                let turn = |ball| clumps.turned_since_loads(self.on.task.model, ball);
                (c.n1 - c.load_normal).length() <= turned && turn(c.a).max(turn(c.b)) <= turned
            })
    }

    /// Impulses of the last step for the chosen contacts, scaled to this step's size (rule R8); those of this one where they are known.
    fn last_loads(&self) -> Vec<f64> {
        let work = &self.work;
        let mut start = Vec::with_capacity(work.full.rows());
        let state = self.on.task.state;
        let scale = work.span.h / state.warm_step;
        for &slot in &work.chosen {
            let contact = &self.on.scratch.contacts[work.members[slot] as usize];
            let dim = work.full.contacts[slot].dim as usize;
            let mut packed = [0.0; 6];
            if self.again {
                packed = contact.load;
            } else if let Some(warm) = rest::of_last_step(state, contact) {
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

    /// Keeps the impulses of the loads, of an island that had no impact in this step.
    fn keep_warm(&mut self) {
        let work = &self.work;
        for (slot, &m) in work.members.iter().enumerate() {
            if !work.is_pressed(slot) {
                continue;
            }
            let packed = work.packed(slot);
            let contact = &self.on.scratch.contacts[m as usize];
            let world = contact.to_world(contact.n1, &packed);
            self.on.scratch.warm.push(Warm {
                key: (contact.a, contact.b),
                impulse: world.impulse,
                moment: world.moment,
            });
        }
    }
}
