//! What rests and can be held stays ([`crate::level::rest`]), in piles of up to some thousand contacts.

use super::closed_contact::change;
use super::{problem_data, roll};
use crate::level::rest;
use crate::pile::memory::Pile;
use crate::workspace::On;
use carom_solve::spheres::{Goal, Progress};

impl Pile {
    /// Speed up to which all chosen contacts stay at rest, where they were so at t_n, and the position level left them so.
    fn rests_below(&self, on: &On) -> Option<f64> {
        let memory = &self.velocity;
        let bounds = rest::rest_bounds(&on.task.model.options, memory.chosen.len())?;
        let at_rest = |&slot: &u32| {
            let m = &memory.closed[slot as usize];
            if !on.scratch.contacts[m.contact as usize].rested {
                return false;
            }
            let turn = memory.turning.get(slot as usize);
            let turned = turn.map_or(0.0, |t| t.length * memory.turn_before(slot).length());
            memory.before(m).length().max(turned) <= bounds.was * memory.load
        };
        memory
            .chosen
            .iter()
            .all(at_rest)
            .then_some(bounds.stays * memory.load)
    }

    /// Whether the solution at hand moves any of them by more.
    pub(super) fn sets_off(&self, bound: f64) -> bool {
        let (memory, u) = (&self.velocity, &self.corrections);
        memory.chosen.iter().any(|&slot| {
            let m = &memory.closed[slot as usize];
            let moved = memory.now(m) + change(m, u);
            let turn = memory.turning.get(slot as usize);
            let turned = turn.map_or(0.0, |t| {
                t.length * (memory.turn(slot) + roll::change(m, u)).length()
            });
            moved.length().max(turned) > bound
        })
    }

    /// The solution at rest, where the one at hand moves what was so, or is none. Nothing: there is no other; the one at hand stays.
    pub(super) fn at_rest(
        &mut self,
        on: &On,
        goal: &Goal,
        progress: &Progress,
    ) -> Option<Progress> {
        let bound = self.rests_below(on)?;
        if progress.converged && !self.sets_off(bound) {
            return None;
        }
        if self.contacts.is_empty() {
            // Given back since the scene is huge; this island is not.
            self.write(on, self.law);
        }
        let solved = (self.impulses.clone(), self.moments.clone());
        if !self.start_held(on) {
            return None;
        }
        if self.load_sweeps().is_ok() {
            let held = self.sweeps.judge(goal, 0);
            self.take_solution();
            if held.converged && !self.sets_off(bound) {
                return Some(held);
            }
        }
        // As it was.
        (self.start, self.start_moments) = solved;
        if self.load_sweeps().is_ok() {
            self.take_solution();
        }
        None
    }

    /// Starts from impulses that hold all chosen contacts. False: there are none.
    fn start_held(&mut self, on: &On) -> bool {
        // Given back where the scene is huge.
        if self.start.is_empty() {
            self.start.clone_from(&self.impulses);
        }
        if self.start_moments.is_empty() {
            self.start_moments.clone_from(&self.moments);
        }
        let stated = self.stated(&self.start, &self.start_moments);
        let (system, turned, mut lambda) = problem_data::rows(on, &self.bodies, &stated);
        if !carom_solve::hold::hold(&system, &system.z0, |_, _| true, &mut lambda) {
            return false;
        }
        self.start_from_rows(&system, &turned, &lambda);
        true
    }
}
