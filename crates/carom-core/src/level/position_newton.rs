//! An island at the position level by Newton's method: its rows, the solution that rests where that is looked for, and what is tried
//! where nothing else solves the smallest part of a step.

use super::position_measures::{CoupledPositions, Positions};
use super::rest::{self, Resting};
use super::{newton_options, position_floor, wedge, worst_group};
use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::outcome::Level;
use crate::problem::{Keeper, Solve};
use crate::report::StepReport;
use crate::rows::{along, Rows};
use crate::state::State;
use crate::stepper::generalized_alpha::Prediction;
use crate::stepper::Span;
use crate::workspace::{IslandScratch, SolveScratch};
use carom_solve::rows::{RowSystem, Subproblem, NODE_DOF};
use carom_solve::{Bounds, Newton, NewtonOptions, SolveReport, Status};
use glam::DVec3;

/// What is asked for.
#[derive(Clone, Copy)]
pub(super) enum Way<'a> {
    /// The solution, at rest where that is looked for; one that does not converge where that is accepted.
    Solve {
        resting: Option<&'a Resting>,
        accept: bool,
    },
    /// The solution at rest or none.
    Hold(&'a Resting),
    /// The solution along normals alone, from where the loads have brought the spheres ([`super::loads`]).
    Normals { accept: bool },
}

/// A solution.
struct PositionSolution {
    report: SolveReport,
    /// It was looked for as one that moves nothing.
    held: bool,
    /// It moves nothing that was at rest.
    rests: bool,
}

/// Solves one island; writes the corrections U of its bodies and `nu` of its contacts. False: not solved.
pub(super) fn solve(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    way: Way,
) -> bool {
    let members = island.contacts;
    let frames: Vec<_> = match way {
        Way::Hold(_) => members
            .iter()
            .map(|&m| &scratch.contacts[m as usize])
            .map(|c| (c.t1, c.t2, c.end_frame))
            .collect(),
        _ => Vec::new(),
    };
    if matches!(way, Way::Normals { .. }) {
        push_normals(model, scratch, island);
    } else {
        push_contacts(model, state, scratch, island);
    }
    let found = find(model, state, scratch, island, span, report, way);
    let Some(found) = found else {
        for (&m, frame) in members.iter().zip(frames) {
            let c = &mut scratch.contacts[m as usize];
            (c.t1, c.t2, c.end_frame) = frame;
        }
        return false;
    };
    let accept = matches!(
        way,
        Way::Solve { accept: true, .. } | Way::Normals { accept: true }
    );
    if !found.report.converged {
        if !accept {
            return false;
        }
        report.unconverged += 1;
    }
    write(scratch, members, &found);
    true
}

/// States the normals of an island as rows of the solver.
fn push_normals(model: &Model, scratch: &mut IslandScratch, island: Island) {
    let IslandScratch {
        contacts, solve, ..
    } = scratch;
    solve.begin(model, contacts, island);
    let mut rows: Rows = Default::default();
    for &m in island.contacts {
        let c = Contact {
            bounds: Bounds::default(),
            ..contacts[m as usize]
        };
        c.rows(model, c.n1, &mut rows);
        let (a, b) = (solve.node(model, c.a), solve.node(model, c.b));
        let normal = c.n1.to_array();
        let z = [c.gap];
        (solve.system).push_contact(a, b, c.bounds, c.length, normal, &rows[..1], &z);
    }
}

/// States the contacts of an island as rows of the solver.
fn push_contacts(model: &Model, state: &State, scratch: &mut IslandScratch, island: Island) {
    let IslandScratch {
        contacts,
        solve,
        linear,
        angular,
        position,
        walls,
        ..
    } = scratch;
    solve.begin(model, contacts, island);
    let moved = |body: u32| {
        let i = body as usize;
        (linear[i].displacement, angular[i].displacement)
    };
    let mut rows: Rows = Default::default();
    for &m in island.contacts {
        // A pile may have had it before.
        contacts[m as usize].set_start_frame();
        let c = &contacts[m as usize];
        let dim = c.rows(model, c.n0, &mut rows);
        // A wall is a body B whose motion is known.
        let of_b = if !c.is_wall(model) {
            Some(moved(c.b))
        } else if walls.any_moves() {
            let (from, to) = (state.position[c.a as usize], position[c.a as usize]);
            let driven = walls.displacement(model, c, from, to);
            driven.map(|[way, turn]| (way, turn))
        } else {
            None
        };
        let (way, turn) = moved(c.a);
        let mut z0 = [0.0; 6];
        for (z, row) in z0.iter_mut().zip(&rows[..dim]).skip(1) {
            *z = along(&row[0], way, turn);
            if let Some((way, turn)) = of_b {
                *z += along(&row[1], way, turn);
            }
        }
        z0[0] = c.gap_check;
        let nodes = (solve.node(model, c.a), solve.node(model, c.b));
        let normal = c.n0.to_array();
        solve.system.push_contact(
            nodes.0,
            nodes.1,
            c.bounds,
            c.length,
            normal,
            &rows[..dim],
            &z0[..dim],
        );
    }
}

/// Solves the rows, and tells the step how. Nothing: no solution at rest, where only such a one was asked for.
fn find(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    way: Way,
) -> Option<PositionSolution> {
    let IslandScratch {
        contacts,
        solve,
        linear,
        angular,
        position,
        history,
        keeper,
        trial,
        walls,
        shift,
        ..
    } = scratch;
    let SolveScratch {
        newton,
        system,
        bodies,
        node_of,
        lambda,
        u,
    } = &mut **solve;
    newton.attempts.clear();
    let coupled = (!island.is_free()).then(|| {
        CoupledPositions::open(
            model,
            state,
            island,
            span,
            ((*linear, *angular), (*position, *shift)),
            system,
            (bodies, node_of, trial),
        )
    });
    lambda.clear();
    lambda.resize(system.rows(), 0.0);
    u.clear();
    u.resize(NODE_DOF * bodies.len(), 0.0);
    let centres: Vec<DVec3> = bodies.iter().map(|&b| position[b as usize]).collect();
    let of_loads = match way {
        Way::Normals { .. } => start_from_loads(contacts, island, span, system, lambda),
        _ => Vec::new(),
    };
    let groups = island.contacts.len() + island.joints.len();
    let mut problem = Problem {
        options: options(model, bodies, &centres, groups),
        measures: Positions {
            model,
            walls,
            contacts,
            members: island.contacts,
            centres: &centres,
            coupled,
            of_loads,
        },
        state,
        span,
        linear,
        bodies,
        newton,
        system,
        lambda,
        u,
    };
    let found = match way {
        Way::Normals { .. } => problem.solve_normals(),
        _ => problem.solve(way, report)?,
    };
    let result = found.report;
    report.add_position(&result);
    history[1].keep_longest(&problem.newton.history, 0, island.contacts.len());
    if !result.converged || keeper.wants(result.iterations) {
        problem.keep(keeper, angular, result);
    }
    Some(found)
}

/// Starts from what the loads have moved along normals, which the correction counts from: empty where that is nothing.
fn start_from_loads(
    contacts: &[Contact],
    island: Island,
    span: Span,
    system: &mut RowSystem,
    lambda: &mut [f64],
) -> Vec<f64> {
    let of_load = |&m: &u32| contacts[m as usize].of_load(span.h);
    let of_loads: Vec<f64> = island.contacts.iter().map(of_load).collect();
    lambda[..of_loads.len()].copy_from_slice(&of_loads);
    if of_loads.iter().all(|&l| l == 0.0) {
        return Vec::new();
    }
    if !system.has_load() {
        system.open_load();
    }
    of_loads
}

/// Of Newton's method for so many contacts and joints.
fn options(model: &Model, bodies: &[u32], centres: &[DVec3], groups: usize) -> NewtonOptions {
    let nodes = bodies.len() as f64;
    let mean =
        |f: &dyn Fn(usize) -> f64| bodies.iter().map(|&b| f(b as usize)).sum::<f64>() / nodes;
    // Gaps are differences of coordinates: far from the origin rounding, not the radius, sets what can be asked.
    let largest = centres.iter().map(|x| x.abs().max_element());
    let rounding = f64::EPSILON * largest.fold(0.0, f64::max);
    let share = position_floor(&model.options, groups);
    let floor = mean(&|i| model.mass[i] * (share * model.radius[i]).max(4.0 * rounding));
    NewtonOptions {
        rounding,
        ..newton_options(&model.options, groups, floor, true)
    }
}

/// An island as Newton's method has it.
struct Problem<'a, 'p> {
    state: &'a State,
    span: Span,
    linear: &'a [Prediction],
    bodies: &'p [u32],
    newton: &'a mut Newton,
    system: &'a mut RowSystem,
    measures: Positions<'p>,
    options: NewtonOptions,
    lambda: &'a mut Vec<f64>,
    u: &'a mut Vec<f64>,
}

impl Problem<'_, '_> {
    fn solve(&mut self, way: Way, report: &mut StepReport) -> Option<PositionSolution> {
        let resting = match way {
            Way::Solve { resting, .. } => resting,
            Way::Hold(resting) => Some(resting),
            Way::Normals { .. } => None,
        };
        let only = matches!(way, Way::Hold(_));
        let before = resting.map(|resting| {
            let (contacts, members) = (self.measures.contacts, self.measures.members);
            let (nu, held) =
                rest::as_before(self.state, contacts, members, self.system, self.span.h);
            (resting, nu, held)
        });
        let rests = |report, held| PositionSolution {
            report,
            held,
            rests: true,
        };
        if let Some((resting, nu, held)) = &before {
            // What held it in the last step mostly holds it in this one.
            if let Some(report) = self.stay(resting, nu) {
                return Some(rests(report, *held));
            }
            if *held || only {
                if let Some(report) = self.hold(resting, nu) {
                    return Some(rests(report, true));
                }
            }
            if only {
                return None;
            }
        }
        let (measures, options) = (&mut self.measures, &self.options);
        let mut result = (self.newton).solve(self.system, measures, options, self.lambda, self.u);
        let moves = |r: &Resting| !result.converged || r.moves(self.system, self.newton.measures());
        let at_rest = resting.is_some_and(|r| !moves(r));
        if let (Some((resting, nu, first)), false) = (&before, at_rest) {
            if !first {
                let history = std::mem::take(&mut self.newton.history);
                if let Some(found) = self.hold(resting, nu) {
                    report.fallbacks += u32::from(!result.converged);
                    return Some(rests(found, true));
                }
                // What was tried is no part of the step: statuses and residuals are those of the solution again.
                let (measures, options) = (&mut self.measures, &self.options);
                (self.newton).judge(self.system, measures, options, self.lambda, self.u);
                self.newton.history = history;
            }
        }
        // Joints, and loads that depend on the motion, stop slides by themselves.
        if result.converged && !at_rest && self.measures.coupled.is_none() {
            let stopped = self.stopped();
            if stopped.contains(&true) {
                let of = |slot: usize| stopped.get(slot) == Some(&true);
                let less = self.with_less_friction(of, report);
                result = less.unwrap_or(result);
            }
        }
        Some(PositionSolution {
            report: result,
            held: false,
            rests: at_rest,
        })
    }

    /// The solution along normals.
    fn solve_normals(&mut self) -> PositionSolution {
        let (measures, options) = (&mut self.measures, &self.options);
        PositionSolution {
            report: (self.newton).solve(self.system, measures, options, self.lambda, self.u),
            held: false,
            rests: false,
        }
    }

    /// The multipliers `nu` of the last step, where they still hold it.
    fn stay(&mut self, resting: &Resting, nu: &[f64]) -> Option<SolveReport> {
        let problem = (&mut *self.system, &mut self.measures, &self.options);
        let found = resting.stay(self.newton, problem, nu)?;
        (*self.lambda, *self.u) = (found.nu, found.correction);
        Some(found.report)
    }

    /// The solution that moves nothing, near the multipliers `nu` or wherever it is.
    fn hold(&mut self, resting: &Resting, nu: &[f64]) -> Option<SolveReport> {
        let problem = (&mut *self.system, &mut self.measures, &self.options);
        let found = resting.hold(self.newton, problem, nu.to_vec())?;
        (*self.lambda, *self.u) = (found.nu, found.correction);
        Some(found.report)
    }

    /// The solution with less friction in some contacts: a fallback.
    fn with_less_friction(
        &mut self,
        of: impl Fn(usize) -> bool,
        report: &mut StepReport,
    ) -> Option<SolveReport> {
        let less = self.newton.solve_with_less_friction(
            self.system,
            &mut self.measures,
            &self.options,
            &[wedge::NEGLIGIBLE_FRICTION],
            of,
            [self.lambda, self.u],
        );
        report.fallbacks += u32::from(less.is_some());
        less
    }

    /// Contacts that stop a slide although nothing was hit.
    fn stopped(&self) -> Vec<bool> {
        let (state, model) = (self.state, self.measures.model);
        let ways = self.bodies.iter().map(|&b| {
            let i = b as usize;
            let way = self.linear[i].displacement - self.span.h * state.velocity[i];
            [way.length(), model.mass[i] * way.length()]
        });
        let [way, load] = ways.fold([0.0f64, 0.0], |[w, l], [way, load]| [w.max(way), l + load]);
        let solution = [self.newton.measures(), &self.lambda[..]];
        let (contacts, members) = (self.measures.contacts, self.measures.members);
        wedge::stopped(contacts, members, self.system, [way, load], solution)
    }

    /// Hands the problem, with what was found, to the keeper.
    #[cold]
    fn keep(&mut self, keeper: &mut Keeper, angular: &[Prediction], report: SolveReport) {
        let worst = worst_group(self.system, self.newton.residual_rows());
        let mut z = vec![0.0; self.system.rows()];
        let (mut multiplier, mut correction) = (self.lambda.clone(), self.u.clone());
        if !multiplier.iter().chain(&correction).all(|x| x.is_finite()) {
            // An iterate that ran away says nothing: the problem is stated at its start.
            multiplier.fill(0.0);
            correction.fill(0.0);
        }
        self.measures.evaluate(self.system, &correction, &mut z);
        let motion = self.bodies.iter().flat_map(|&b| {
            let (lin, ang) = (&self.linear[b as usize], &angular[b as usize]);
            let (d, psi) = (lin.displacement, ang.displacement);
            [d.x, d.y, d.z, psi.x, psi.y, psi.z]
        });
        keeper.keep(&Solve {
            model: self.measures.model,
            contacts: self.measures.contacts,
            members: self.measures.members,
            spheres: self.bodies,
            system: self.system,
            measures: &z,
            multiplier: &multiplier,
            correction: &correction,
            motion: &motion.collect::<Vec<f64>>(),
            level: Level::Position,
            index: 0,
            report,
            attempts: &self.newton.attempts,
            worst,
        });
    }
}

/// Writes a solution into the step.
fn write(scratch: &mut IslandScratch, members: &[u32], found: &PositionSolution) {
    let solve = &*scratch.solve;
    for (node, &body) in solve.bodies.iter().enumerate() {
        let v = &solve.u[NODE_DOF * node..NODE_DOF * (node + 1)];
        scratch.corrections.set(
            body,
            [DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])],
        );
    }
    for (slot, &m) in members.iter().enumerate() {
        let rc = &solve.system.contacts[slot];
        let c = &mut scratch.contacts[m as usize];
        c.held = found.held;
        // Where the loads come first they tell what rested.
        c.rested = found.rests || (c.resting && c.rested);
        c.nu = [0.0; 6];
        if solve.newton.statuses()[slot] != Status::Gap {
            c.nu[..rc.dim as usize].copy_from_slice(&solve.lambda[rc.rows()]);
        }
    }
}
