//! What rests and can be held stays: of the solutions of Coulomb's law the one at rest, where the solvers come upon another one first.
//!
//! Where contacts are redundant and friction is large, the same loads may have a solution that rests and others that move (a pyramid of
//! spheres; `docs/theory/algorithm.md` section 6). A solver finds the one that its path leads to. Of these a body that is at rest takes
//! the one that leaves it there: it is looked for where a solution moves, or none was found, and nothing moved before.

use crate::contact::{Contact, WorldImpulse};
use crate::islands::Island;
use crate::level::tolerance;
use crate::model::Model;
use crate::options::{Options, Solver};
use crate::state::{State, Warm};
use crate::workspace::IslandScratch;
use carom_solve::hold::hold;
use carom_solve::ladder::HELD;
use carom_solve::rows::{RowContact, RowSystem, Subproblem, NODE_DOF};
use carom_solve::{Newton, NewtonOptions, SolveReport};
use glam::DVec3;

/// Share (1) of what the loads alone would move something by in a step up to which it stays at rest. Too large: what slides is held; at 1e-2 two
/// pyramids of `validation/pyramids` do not do as friction says. At 1e-9 all still do.
const STAYS_SHARE: f64 = 1e-5;
/// The same over the solver's tolerance (1), where that is coarser: what a coarse solve leaves must not count as motion.
const STAYS_OVER_TOLERANCE: f64 = 10.0;
/// Motion up to which multipliers of the last step are taken as they are, over that up to which it stays at rest (1): they leave the same
/// motion in every step. At 1 it adds up, and pyramids of three layers fall that friction can hold.
const STILL_OVER_STAYS: f64 = 1e-4;
/// The same in roundings of a coordinate (1): gaps are differences of such. At 0 a rack at rest is solved anew in each step.
const STILL_ROUNDINGS: f64 = 4.0;
/// Share (1) of the motion by the loads up to which something was at rest at t_n. At 1e-3 the 3e-6 m/s that sweeps leave brought pyramids
/// down (decision 015): what solvers leave, step by step, must not grow into a motion that is no longer looked at. Too large: what begins to move is stopped.
const WAS_SHARE: f64 = 1e-2;
/// The same over the share up to which it stays at rest (1), for coarse tolerances; too small, and piles swept coarsely fall as above.
const WAS_OVER_STAYS: f64 = 10.0;
/// Most linearisations: normals turn with what carries an island along. Too few: what turns with a wall is not held. Speed alone elsewhere.
const LINEARISATIONS: usize = 4;
/// Most contacts of an island for which rest is looked for (`carom_solve::hold` bounds the factors of matrices besides). Too few: at 0, 16 of
/// 36 pyramids that friction can hold fall (`validation/pyramids`). More: stating the problem of a large island takes the time of its step.
const MOST_CONTACTS: usize = 10_000;

/// Shares of what the loads alone would move something by: up to the first it stays at rest, up to the second it was so.
#[derive(Clone, Copy)]
pub(crate) struct RestBounds {
    pub stays: f64,
    pub was: f64,
}

/// Nothing where rest is not looked for.
pub(crate) fn rest_bounds(o: &Options, contacts: usize) -> Option<RestBounds> {
    // Whoever asks for a solver, or for the law as printed, gets what that gives.
    let plain = o.solver == Solver::Auto && !o.impact.is_printed();
    let stays = STAYS_SHARE.max(STAYS_OVER_TOLERANCE * tolerance(o, contacts));
    (plain && contacts > 1 && contacts <= MOST_CONTACTS).then(|| RestBounds {
        stays,
        was: WAS_SHARE.max(WAS_OVER_STAYS * stays),
    })
}

/// Measures of a contact as lengths, or speeds: the largest. `z` begins with the normal and sliding rows, if there are such.
pub(crate) fn largest(sliding: bool, length: f64, z: &[f64]) -> f64 {
    let head = if sliding { 3 } else { 1 };
    let size = |(row, z): (usize, &f64)| {
        if row < head {
            z.abs()
        } else {
            length * z.abs()
        }
    };
    z.iter().enumerate().map(size).fold(0.0, f64::max)
}

/// An island at the position level all of whose touching contacts are at rest at t_n.
pub(crate) struct Resting {
    /// Gap of each contact that touches, m.
    pub gap_start: Vec<Option<f64>>,
    /// Measures up to which they stay at rest, m.
    pub bound: f64,
}

impl Resting {
    pub fn find(
        model: &Model,
        state: &State,
        scratch: &IslandScratch,
        island: Island,
        h: f64,
    ) -> Option<Resting> {
        let (o, members, contacts) = (&model.options, island.contacts, &*scratch.contacts);
        let bounds = rest_bounds(o, members.len())?;
        if !island.loads.is_empty() {
            return None;
        }
        let touches = |c: &Contact| c.gap_start <= o.touching_tolerance * c.length;
        let (mut loads, mut frictional) = (0.0f64, false);
        for c in members.iter().map(|&m| &contacts[m as usize]) {
            if !touches(c) {
                continue;
            }
            let [of_loads, speed] = start(model, state, scratch, c, h);
            if h * speed > bounds.was * of_loads {
                return None;
            }
            loads = loads.max(of_loads);
            frictional |= c.bounds.sliding > 0.0;
        }
        // What carried something and has come apart since: not all of it was at rest.
        let carries = |c: &Contact| of_last_step(state, c).is_some();
        let mut apart = members.iter().map(|&m| &contacts[m as usize]);
        // Without friction the solution is the only one.
        if !frictional || apart.any(|c| !touches(c) && carries(c)) {
            return None;
        }
        Some(Resting {
            gap_start: members
                .iter()
                .map(|&m| &contacts[m as usize])
                .map(|c| touches(c).then_some(c.gap_start))
                .collect(),
            bound: bounds.stays * loads,
        })
    }

    /// Whether these measures, gaps among them, move by more.
    pub fn moves(&self, system: &RowSystem, measures: &[f64]) -> bool {
        self.moves_by(self.bound, system, measures)
    }

    fn moves_by(&self, bound: f64, system: &RowSystem, measures: &[f64]) -> bool {
        let z = self.changes(system, measures);
        let mut touching = system
            .contacts
            .iter()
            .zip(&self.gap_start)
            .filter(|(_, gap)| gap.is_some());
        touching.any(|(c, _)| {
            let z = &z[c.rows()];
            largest(c.bounds.sliding > 0.0, c.length, z) > bound
        })
    }

    /// Looks for the solution that moves nothing, near the multipliers `nu` or wherever it is.
    pub fn hold<P: Subproblem>(
        &self,
        newton: &mut Newton,
        (system, problem, options): (&mut RowSystem, &mut P, &NewtonOptions),
        mut nu: Vec<f64>,
    ) -> Option<StaticSolution> {
        let mut correction = vec![0.0; NODE_DOF * system.nodes()];
        let mut z = vec![0.0; system.rows()];
        for _ in 0..LINEARISATIONS {
            problem.evaluate(system, &correction, &mut z);
            // What earlier steps left of gaps stays: no multipliers without slip would close gaps that contradict one another.
            let mut free = self.changes(system, &z);
            for c in &system.contacts {
                for row in c.rows() {
                    free[row] -= system.row_velocity(c, row, &correction);
                }
            }
            let touching = |slot: usize, _: &RowContact| {
                // Joints have no gaps: they hold.
                self.gap_start.get(slot).is_some_and(Option::is_some)
            };
            if !hold(system, &free, touching, &mut nu) {
                return None;
            }
            system.correction(&nu, &mut correction);
            let report = self.judge(newton, (system, problem, options), [&nu, &correction]);
            let moves = self.moves(system, newton.measures());
            if report.converged && !moves {
                return Some(StaticSolution {
                    nu,
                    correction,
                    report,
                });
            }
        }
        None
    }

    /// The multipliers `nu` of the last step as they are, where they leave no motion that would add up to one.
    pub fn stay<P: Subproblem>(
        &self,
        newton: &mut Newton,
        (system, problem, options): (&mut RowSystem, &mut P, &NewtonOptions),
        nu: &[f64],
    ) -> Option<StaticSolution> {
        let mut correction = vec![0.0; NODE_DOF * system.nodes()];
        system.correction(nu, &mut correction);
        let report = self.judge(newton, (system, problem, options), [nu, &correction]);
        let bound = STILL_OVER_STAYS * self.bound + STILL_ROUNDINGS * options.rounding;
        let moves = self.moves_by(bound, system, newton.measures());
        if !report.converged || moves {
            newton.attempts.clear();
            return None;
        }
        Some(StaticSolution {
            nu: nu.to_vec(),
            correction,
            report,
        })
    }

    /// What multipliers and their correction leave.
    fn judge<P: Subproblem>(
        &self,
        newton: &mut Newton,
        (system, problem, options): (&mut RowSystem, &mut P, &NewtonOptions),
        [nu, correction]: [&[f64]; 2],
    ) -> SolveReport {
        let mut report = newton.judge(system, problem, options, nu, correction);
        report.rung = HELD;
        newton.attempts.push(report.attempt());
        report
    }

    /// Measures with gaps as their changes.
    fn changes(&self, system: &RowSystem, measures: &[f64]) -> Vec<f64> {
        let mut z = measures.to_vec();
        for (c, gap) in system.contacts.iter().zip(&self.gap_start) {
            z[c.row as usize] -= gap.unwrap_or_default();
        }
        z
    }
}

/// Of a contact: the way that loads alone would move its bodies, and the relative speed of its surfaces at t_n.
fn start(model: &Model, state: &State, scratch: &IslandScratch, c: &Contact, h: f64) -> [f64; 2] {
    let (i, j) = (c.a as usize, c.b as usize);
    let way = |i: usize| (scratch.linear[i].displacement - h * state.velocity[i]).length();
    let mut of_loads = way(i);
    let mut slip = state.velocity[i];
    let mut spin = model.radius[i] * state.angular_velocity[i];
    let mut turn = state.angular_velocity[i];
    if c.is_wall(model) {
        if let Some(wall) = scratch.walls.start_twist(model, c, state.position[i]) {
            slip -= wall.at(c.n0);
            turn -= wall.spin;
        }
    } else {
        of_loads = of_loads.max(way(j));
        slip -= state.velocity[j];
        spin += model.radius[j] * state.angular_velocity[j];
        turn -= state.angular_velocity[j];
    }
    let mut speed = (slip + c.n0.cross(spin)).length();
    if c.bounds.rolling > 0.0 || c.bounds.spinning > 0.0 {
        speed = speed.max(c.length * turn.length());
    }
    [of_loads, speed]
}

/// A solution that moves nothing.
pub(crate) struct StaticSolution {
    pub nu: Vec<f64>,
    pub correction: Vec<f64>,
    pub report: SolveReport,
}

/// What a contact carried in the last step.
pub(crate) fn of_last_step<'s>(state: &'s State, c: &Contact) -> Option<&'s Warm> {
    let found = state.warm.binary_search_by_key(&(c.a, c.b), |w| w.key);
    found.ok().map(|at| &state.warm[at])
}

/// Multipliers of the position level of the last step, for a step of size `h`, and whether these held an island at rest. Contacts that have none
/// have what the impulses of the loads stand for.
pub(crate) fn as_before(
    state: &State,
    contacts: &[Contact],
    members: &[u32],
    system: &RowSystem,
    h: f64,
) -> (Vec<f64>, bool) {
    let ratio = h / state.warm_step;
    let (mut nu, mut held) = (vec![0.0; system.rows()], false);
    for (&m, row) in members.iter().zip(&system.contacts) {
        let c = &contacts[m as usize];
        let Some(w) = of_last_step(state, c) else {
            continue;
        };
        let known = w.position != DVec3::ZERO;
        held |= known;
        let (scale, of) = if known {
            (ratio * ratio, (w.position, w.position_moment))
        } else {
            (0.5 * h * ratio, (w.impulse, w.moment))
        };
        let world = WorldImpulse {
            impulse: scale * of.0,
            moment: scale * of.1,
        };
        let mut packed = [0.0; 6];
        c.to_rows(&world, &mut packed);
        let dim = row.dim as usize;
        nu[row.row as usize..][..dim].copy_from_slice(&packed[..dim]);
    }
    (nu, held)
}
