//! Loads on what is at rest: the solution that leaves it there, where there is one ([`crate::level::rest`]).

use crate::impact::memory::ImpactScratch;
use crate::level::rest;
use crate::workspace::{IslandScratch, On};
use carom_solve::ladder::{Attempt, HELD};
use carom_solve::rows::{Measured, RowContact};

impl ImpactScratch {
    /// Speed up to which the problem at hand is at rest, where all of it was so at t_n, and the position level left it so.
    pub(super) fn rests_below(&self, on: &On) -> Option<f64> {
        let bounds = rest::rest_bounds(&on.task.model.options, self.sub.contacts.len())?;
        if self.sub.has_load() {
            return None;
        }
        let mut old = [0.0; 6];
        let rested = |slot: &usize| {
            if !on.scratch.contacts[self.members[*slot] as usize].rested {
                return false;
            }
            let c = &self.full.contacts[*slot];
            let old = &mut old[..c.dim as usize];
            for (k, z) in old.iter_mut().enumerate() {
                *z = self.relative::<0>(c, c.row as usize + k, &self.v_old);
            }
            rest::largest(c.bounds.sliding > 0.0, c.length, old) <= bounds.was * self.speeds.load
        };
        self.chosen
            .iter()
            .all(rested)
            .then_some(bounds.stays * self.speeds.load)
    }

    /// Whether the solution at hand moves by more.
    pub(super) fn moves(&self, scratch: &IslandScratch, bound: f64) -> bool {
        let measures = scratch.solve.newton.measures();
        let of = |c: &RowContact| &measures[c.rows()];
        let contacts = self.sub.contacts[..self.chosen.len()].iter();
        contacts
            .map(|c| rest::largest(c.bounds.sliding > 0.0, c.length, of(c)))
            .any(|z| z > bound)
    }

    /// Solves the problem at hand from multipliers that hold all of it, near `warm` if that is possible. False: there are none, and nothing changed but
    /// the report.
    pub(super) fn hold(&mut self, on: &mut On, bound: f64, warm: Option<&[f64]>) -> bool {
        let mut start = vec![0.0; self.sub.rows()];
        if let Some(warm) = warm {
            start[..warm.len()].copy_from_slice(warm);
        }
        if !carom_solve::hold::hold(&self.sub, &self.sub.z0, |_, _| true, &mut start) {
            return false;
        }
        let before = (self.lambda.clone(), self.u.clone(), self.last);
        let newton = &mut on.scratch.solve.newton;
        let history = std::mem::take(&mut newton.history);
        let mut attempts = std::mem::take(&mut newton.attempts);
        let solved = self.solve_built(on, 0, Some(&start));
        attempts.push(Attempt {
            rung: HELD,
            ..self.last.attempt()
        });
        on.scratch.solve.newton.attempts = attempts;
        if solved && !self.moves(on.scratch, bound) {
            return true;
        }
        (self.lambda, self.u, self.last) = before;
        // Residual rows and measures are those of the solution again.
        let options = self.newton_options(on.task.model);
        let newton = &mut on.scratch.solve.newton;
        newton.judge(
            &mut self.sub,
            &mut Measured(&self.measured),
            &options,
            &self.lambda,
            &self.u,
        );
        newton.history = history;
        false
    }
}
