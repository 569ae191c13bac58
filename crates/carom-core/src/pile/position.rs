//! Position sub-problem of a pile (eqs. 1c-e, 14, 21): linear problems of spheres, one after the other, each at the positions
//! that the last one led to.

use super::position_measures::Linearisation;
use super::{chunks, problem_data};
use crate::level::{position_floor, Demand, Task};
use crate::model::Model;
use crate::pile::limits::{budget, told, worst, PATIENCE, WORST_CONTACT_FROM};
use crate::pile::memory::Pile;
use crate::rows::halves;
use crate::stepper::Span;
use crate::workspace::On;
use carom_solve::ladder::COARSE_TOLERANCE;
use carom_solve::spheres::{Goal, Progress};
use carom_solve::team;
use glam::DVec3;

/// Most sweeps between two linearisations: where spheres are wedged the linear problem may have no solution, and the way out is
/// sideways. Too many: sweeps are spent on it in vain. Too few: momentum is lost at each, and piles take more sweeps.
const SWEEPS_PER_LINEARISATION: usize = 64;
/// The same from [`WORST_CONTACT_FROM`] contacts on: of 24, 32, 48, 64 and 128 the one with the fewest sweeps in a falling pile of 64 000.
const SWEEPS_OF_MANY: usize = 48;
/// The same in large islands that are hit, where fewer are the faster ones. Speed alone.
const SWEEPS_OF_HIT: usize = 32;
/// Most contacts of an island that is asked for small overlaps. More: piles take more sweeps for gaps that nobody sees. Fewer: small islands overlap by
/// a hundred times as much.
const MANY: usize = 100;
/// Overlap over the radius (1) that no pile's size excuses; it counts at `pile_tolerance` above 1e-4. Larger: deeper overlaps there. Smaller: more sweeps.
const MOST_OVERLAP: f64 = 4.5e-4;
/// Tolerance of a linear problem over that of the island (1): what it leaves and what the turning of the normals adds fit below it. Speed alone:
/// nearer to 1 more linearisations, nearer to 0 more sweeps.
const LINEAR_SHARE: f64 = 0.8;
/// The same for the worst overlap in large islands that are hit, which linearising changes less there.
const CLOSING_SHARE: f64 = 0.95;
/// How many times (1) deeper overlaps may be in rough rounds, since the last sweeps take most of the time and pairs join anyway. Too small: hit
/// piles take more sweeps. Too large: the last, strict round has all of them to do.
const ROUGH_OVERLAP: f64 = 3.0;
/// Largest momentum of the sweeps (1) in large islands that are hit, once the residual is met by half: what is left are single contacts, for
/// which momentum is no help. Speed alone.
const CALM_MOMENTUM: f64 = 0.8;

/// How the sweeps of an island ended.
struct Swept {
    progress: Progress,
    sweeps: usize,
    linearisations: u32,
}

/// Solves one island along normals; writes the corrections U of its bodies and `nu` of its contacts. False: not converged, and nothing
/// is written.
pub fn solve_positions(on: &mut On, demand: Demand) -> bool {
    let mut pile = std::mem::take(on.scratch.pile);
    pile.begin(on);
    let solved = pile.sweep_positions(on, demand).is_some_and(|swept| {
        let Progress {
            converged, lenient, ..
        } = swept.progress;
        on.report.fallbacks += u32::from(converged && lenient);
        on.report.sweeps_position = on.report.sweeps_position.max(swept.sweeps as u32);
        pile.take_solution();
        if on.scratch.keeper.wants(swept.sweeps as u32) || !converged {
            pile.keep_positions(on, &swept);
        }
        if !converged && demand != Demand::Accepted {
            return false;
        }
        on.report
            .add_position(&told(&swept.progress, swept.linearisations));
        on.report.unconverged += u32::from(!converged);
        pile.write_positions(on);
        true
    });
    *on.scratch.pile = pile;
    solved
}

impl Pile {
    /// Sweeps and linearises in turns. Nothing: the problem has numbers that cannot be used.
    fn sweep_positions(&mut self, on: &On, demand: Demand) -> Option<Swept> {
        let Task { model, span, .. } = *on.task;
        let (scratch, members) = (&*on.scratch, on.island.contacts);
        let contacts = &*scratch.contacts;
        let of_load = |&m: &u32| contacts[m as usize].of_load(span.h);
        let of_loads: Vec<f64> = members.iter().map(of_load).collect();
        let wave = self.start_normals(contacts, members, &of_loads);
        let at = Linearisation {
            threads: self.sweeps.threads,
            model,
            walls: scratch.walls,
            contacts,
            members,
            node_of: &scratch.solve.node_of,
            position: scratch.position,
            of_loads: &of_loads,
        };
        at.write(&mut self.contacts);
        at.take_off(self);
        self.rolls.clear();
        // What a wave is started from moves the spheres: the first linearisation is there. (Wedges of small piles would stay.)
        if self.load_sweeps().is_err() || (wave && !at.follow(self)) {
            return None;
        }
        let [goal, strict] = self.position_goals(model, members.len(), span, wave, demand);
        let between = if wave {
            SWEEPS_OF_HIT
        } else if members.len() as f64 >= WORST_CONTACT_FROM {
            SWEEPS_OF_MANY
        } else {
            SWEEPS_PER_LINEARISATION
        };
        let mut swept = Swept {
            progress: self.sweeps.judge(&goal, 0),
            sweeps: 0,
            linearisations: 0,
        };
        while swept.sweeps < goal.most {
            swept.linearisations += 1;
            let linear_problem = self.sweeps.settle(&Goal {
                most: between.min(goal.most - swept.sweeps),
                patience: PATIENCE.saturating_sub(swept.sweeps),
                had: swept.sweeps,
                ..strict
            });
            swept.sweeps += linear_problem.sweeps.max(1);
            if !at.follow(self) {
                break;
            }
            swept.progress = self.sweeps.judge(&goal, swept.sweeps);
            if swept.progress.converged {
                break;
            }
        }
        Some(swept)
    }

    /// What the island is judged by, and each of its linear problems. `wave`: a large pile that is being hit or solved once more.
    fn position_goals(
        &self,
        model: &Model,
        contacts: usize,
        span: Span,
        wave: bool,
        demand: Demand,
    ) -> [Goal; 2] {
        let o = &model.options;
        let share = position_floor(o, contacts);
        let radii = self.spheres.iter().map(|&i| model.radius[i as usize]);
        let smallest = radii.fold(f64::INFINITY, f64::min);
        let tolerance = o.tolerance.max(o.pile_tolerance);
        // What goes round in circles is mostly a wedge, which parts of the step pass one side after the other: no bound is widened
        // while there are smaller parts. (Fine tolerances take thousands of sweeps as they are.)
        let (patience, most) = if span.smallest || tolerance < COARSE_TOLERANCE {
            (PATIENCE, budget(contacts))
        } else {
            (usize::MAX, PATIENCE)
        };
        let rough = if wave && demand == Demand::Rough {
            ROUGH_OVERLAP
        } else {
            1.0
        };
        let goal = Goal {
            tolerance,
            floor: self.mean(|i| share * model.radius[i]) / self.mean(|i| model.inv_mass[i]),
            scale: 0.0,
            closing: rough * overlap(tolerance, contacts) * smallest,
            worst: 1.0,
            penalty_scale: o.penalty_scale,
            patience,
            most,
            had: 0,
            rescale: usize::MAX,
            weighed: false,
            calm: if wave { CALM_MOMENTUM } else { 1.0 },
        };
        let strict = Goal {
            tolerance: LINEAR_SHARE * goal.tolerance,
            floor: LINEAR_SHARE * goal.floor,
            closing: if wave { CLOSING_SHARE } else { LINEAR_SHARE } * goal.closing,
            ..goal
        };
        [goal, strict]
    }

    /// Hands the problem at hand, with what was found, to the keeper.
    #[cold]
    fn keep_positions(&self, on: &mut On, swept: &Swept) {
        let solved = self.impulses.iter().zip(&self.contacts);
        let stated = on.island.contacts.iter().zip(solved);
        let stated = stated.map(|(&contact, (r, z))| problem_data::Stated {
            turn: DVec3::ZERO,
            moment: DVec3::ZERO,
            contact,
            nodes: (z.a, z.b),
            normal: DVec3::from(z.normal),
            slip: DVec3::from(z.slip),
            impulse: DVec3::from(*r),
        });
        let nodes = self.spheres.iter().zip(&self.taken);
        let motion = nodes.map(|(&i, &taken)| {
            let [way, turn] = on.scratch.moved(i as usize);
            [way - taken, turn]
        });
        let Progress {
            residual,
            converged,
            ..
        } = swept.progress;
        let report = problem_data::report_of(swept.sweeps as u32, residual, converged);
        let (stated, motion): (Vec<_>, Vec<_>) = (stated.collect(), motion.collect());
        self.keep(on, (0, report), &stated, &self.corrections, &motion);
    }

    /// Writes the solution into the step.
    fn write_positions(&self, on: &mut On) {
        for ((&i, u), &taken) in self.spheres.iter().zip(&self.corrections).zip(&self.taken) {
            let [way, turn] = halves(u);
            on.scratch.corrections.set(i, [way - taken, turn]);
        }
        let chunks = chunks::cut(on.island.contacts, on.scratch.contacts);
        team::map(self.sweeps.threads, chunks, |mut chunk| {
            for (slot, &m) in (chunk.first..).zip(chunk.list) {
                let c = chunk.item(m);
                let normal = DVec3::from(self.contacts[slot].normal);
                let nu = DVec3::from(self.impulses[slot]).dot(normal);
                c.nu = [nu, 0.0, 0.0, 0.0, 0.0, 0.0];
                // The loads come first, and tell what rested.
                c.rested &= c.resting;
            }
        });
    }
}

/// Overlap over the smallest radius that may be left in an island of so many contacts. Islands of up to 100 are asked for more.
pub fn overlap(tolerance: f64, contacts: usize) -> f64 {
    if contacts > MANY {
        (0.9 * worst(contacts) * tolerance).min(MOST_OVERLAP.max(1.8 * tolerance))
    } else {
        5e-3 * tolerance
    }
}
