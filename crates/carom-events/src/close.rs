//! The end of a step: the state, energies, overlaps and the record of contacts.

use crate::step::Run;
use carom_core::flow::exchange::is_out;
use carom_core::force::total::weight_potential;
use carom_core::outcome::{within_bounds, BlowUp, Failure, Level};
use carom_core::StepReport;

impl Run<'_> {
    /// The state at the end of the step, energies and overlaps.
    pub fn end(&mut self) -> Result<(), Failure> {
        let (model, n, h) = (self.model, self.model.bodies(), self.span.h);
        for i in self.free() {
            self.bring(i, h);
            // By the rule of every method.
            if is_out(model, self.state, i) {
                self.leave(i, h);
            }
        }
        let impacts = self.scratch.impacts.len();
        self.scratch.impact_times.resize(impacts, self.span.end);
        self.in_order();
        self.scratch.warm.clear();
        self.state.warm.clear();
        self.events
            .sums
            .hand_over(model, self.state, &mut self.scratch.contacts);
        let (islands, contacts) = (&mut self.scratch.islands, &self.scratch.contacts);
        islands.build(model, contacts, &[], |_| true);
        let (state, report) = (&*self.state, &mut *self.report);
        report.candidates = contacts.len() as u32;
        let largest = report.largest_island;
        report.count(islands);
        // Of all impacts of the step, in which not every contact need act.
        report.largest_island = report.largest_island.max(largest);
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for i in 0..n {
            let (v, w) = (state.velocity[i], state.angular_velocity[i]);
            kinetic += model.kinetic(i, v, w);
            if state.present[i] {
                potential += weight_potential(model, i, state.position[i]);
            }
            if !within_bounds(v, w) || !state.position[i].is_finite() {
                return Err(Failure::BlowUp(BlowUp::alone(Level::Velocity, i as u32)));
            }
        }
        (report.energy_kinetic, report.energy_potential) = (kinetic, potential);
        let deepest = |gap: f64, length: f64, report: &mut StepReport| {
            report.penetration = report.penetration.max(-gap);
            report.penetration_relative = report.penetration_relative.max(-gap / length);
        };
        for i in (0..n).filter(|&i| state.present[i]) {
            let (x, r) = (state.position[i], model.radius[i]);
            for &w in self.events.near[i].walls(model, x, r, 0.0) {
                let wall = &model.walls[w];
                if wall.shape.clearance(x, r) < 0.0 {
                    let gap = wall.shape.meet(x, r).gap;
                    deepest(gap, r, report);
                }
            }
            for j in (i + 1..n).filter(|&j| state.present[j]) {
                let gap = (x - state.position[j]).length() - r - model.radius[j];
                deepest(gap, r.min(model.radius[j]), report);
            }
        }
        Ok(())
    }

    /// Rows in the order of their times: what steps made is told at their end.
    fn in_order(&mut self) {
        let (rows, times) = (&mut self.scratch.impacts, &mut self.scratch.impact_times);
        if !times.is_sorted() {
            let mut all: Vec<_> = times.drain(..).zip(rows.drain(..)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            (*times, *rows) = all.into_iter().unzip();
        }
        let rows = &mut self.scratch.transitions;
        rows.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
}
