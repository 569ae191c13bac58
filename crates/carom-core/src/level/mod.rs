//! The three sub-problems of a step: smooth (eqs. 1a-b), position (1c-e) and velocity (1f-h).

pub mod coupling;
pub(crate) mod loads;
pub mod position;
mod position_measures;
mod position_newton;
pub(crate) mod rest;
pub mod single;
pub mod smooth;
mod smooth_matrix;
pub mod smooth_newton;
pub mod speeds;
pub mod velocity;

use crate::contact::Contact;
use crate::model::Model;
use crate::options::{Options, Solver};
use crate::outcome::Level;
use crate::state::State;
use crate::stepper::Span;
use carom_solve::single::SingleContact;
use carom_solve::{Beside, NewtonOptions, RowSystem};

/// Share (1) of its friction that a companion of positions has. At 0 bounds would be other rows; larger, what slides is lifted by mu times its slip.
const LITTLE_FRICTION: f64 = 1e-6;

/// A level of a step, as every island of it is solved.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    pub model: &'a Model,
    pub state: &'a State,
    pub level: Level,
    pub span: Span,
    pub demand: Demand,
}

/// What is asked of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// Convergence, or no step.
    Converged,
    /// What does not converge is taken, and counted.
    Accepted,
    /// Convergence, but for overlaps of large piles, which may be deeper: more pairs may join (`pile::position`).
    Rough,
}

impl Demand {
    /// Convergence where anything would be taken.
    pub fn unless_accepted(self) -> Self {
        match self {
            Self::Accepted => Self::Converged,
            _ => self,
        }
    }

    pub fn or_accepted(accept_unconverged: bool) -> Self {
        if accept_unconverged {
            Self::Accepted
        } else {
            Self::Converged
        }
    }
}

/// Tolerance of the sub-problems of an island.
pub(crate) fn tolerance(options: &Options, contacts: usize) -> f64 {
    if contacts > options.dense_contacts as usize {
        options.tolerance.max(options.pile_tolerance)
    } else {
        options.tolerance
    }
}

/// Solver options of one island of one level; `floor` in the unit of the multipliers.
pub(crate) fn newton_options(
    options: &Options,
    contacts: usize,
    floor: f64,
    position: bool,
) -> NewtonOptions {
    NewtonOptions {
        tolerance: tolerance(options, contacts),
        floor,
        gap_tolerance: if position {
            options.gap_tolerance
        } else {
            f64::INFINITY
        },
        closing: f64::INFINITY,
        missed: f64::INFINITY,
        rounding: 0.0,
        max_iterations: options.max_iterations,
        penalty_scale: options.penalty_scale,
        proximal_shift: options.proximal_shift,
        max_line_search: if options.line_search {
            options.max_line_search
        } else {
            0
        },
        dense_contacts: options.dense_contacts as usize,
        softness: 0.0,
        beside: Beside {
            sweeps: companion(options, position).is_some() && !options.is_printed(),
            linearised: options.gauss_seidel_sweeps > 0,
            companion: companion(options, position),
        },
    }
}

/// Friction of the companion that may be the answer where nothing solves an island; nothing for whoever asks for one solver, for Newton's
/// method alone, or for the law as printed. Positions have no friction then: what slides moves apart in a companion, and what is lifted has energy.
pub(crate) fn companion(options: &Options, position: bool) -> Option<f64> {
    let plain = options.solver == Solver::Auto
        && options.gauss_seidel_sweeps > 0
        && !options.impact.is_printed();
    plain.then_some(if position { LITTLE_FRICTION } else { 1.0 })
}

/// Absolute floor of eq. 44 over m r. Large islands are often hyperstatic: gaps, and slips around closed chains of contacts,
/// contradict one another by what earlier steps left (measured: 1e-13 to 1e-11 m at radii of 5e-3 m). What is within the tolerance
/// of touching is no error there (decision record 011).
pub(crate) fn position_floor(options: &Options, contacts: usize) -> f64 {
    if contacts > options.dense_contacts as usize {
        options.tolerance_floor.max(options.touching_tolerance)
    } else {
        options.tolerance_floor
    }
}

/// Whether a lone contact goes to the closed form.
#[inline(always)]
pub(crate) fn closed_form(model: &Model, contact: &Contact) -> bool {
    let bounds = contact.bounds;
    let i = contact.a as usize;
    model.options.solver == Solver::Auto
        && contact.is_wall(model)
        && model.wall(contact.b).is_steady_plane()
        && model.clump_of(contact.a).is_none()
        && (bounds.rolling == 0.0
            || SingleContact::settles(model.mass[i], model.inertia[i], model.radius[i]))
}

/// The contact or joint of a system with the largest residual row.
pub(crate) fn worst_group(system: &RowSystem, residual: &[f64]) -> usize {
    let size = |c: &carom_solve::rows::RowContact| {
        let rows = &residual[c.rows()];
        rows.iter().fold(0.0f64, |most, r| most.max(r.abs()))
    };
    let mut worst = (0, -1.0);
    for (i, c) in system.contacts.iter().enumerate() {
        if size(c) > worst.1 {
            worst = (i, size(c));
        }
    }
    worst.0
}
