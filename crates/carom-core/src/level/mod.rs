//! The three sub-problems of a step: smooth (eqs. 1a-b), position (1c-e) and velocity (1f-h).

pub mod coupling;
pub mod position;
pub mod single;
pub mod smooth;
mod smooth_matrix;
pub mod smooth_newton;
pub mod velocity;

use crate::contact::Contact;
use crate::model::Model;
use crate::options::{Options, Solver};
use crate::scratch::{FailedProblem, SolveScratch};
use carom_solve::single::SingleContact;
use carom_solve::NewtonOptions;

/// Contacts of an island up to which the gap tolerance is asked for.
const GAP_CHECK_CONTACTS: usize = 50;

/// Solver options of one island of one level; `floor` in the unit of the multipliers.
pub(crate) fn newton_options(
    options: &Options,
    contacts: usize,
    floor: f64,
    position: bool,
) -> NewtonOptions {
    let large = contacts > options.dense_contacts as usize;
    NewtonOptions {
        tolerance: if large {
            options.tolerance.max(options.pile_tolerance)
        } else {
            options.tolerance
        },
        floor,
        gap_tolerance: if position && contacts <= GAP_CHECK_CONTACTS {
            options.gap_tolerance
        } else {
            f64::INFINITY
        },
        gap_floor: 0.0,
        max_iterations: options.max_iterations,
        penalty_scale: options.penalty_scale,
        proximal_shift: options.proximal_shift,
        max_line_search: if options.line_search {
            options.max_line_search
        } else {
            0
        },
        sweeps: options.gauss_seidel_sweeps,
        dense_contacts: options.dense_contacts as usize,
    }
}

/// Whether a lone contact goes to the closed form.
pub(crate) fn closed_form(model: &Model, contact: &Contact) -> bool {
    let bounds = contact.bounds;
    let i = contact.a as usize;
    model.options.solver == Solver::Auto
        && contact.is_plane(model)
        && (bounds.rolling == 0.0
            || SingleContact::settles(model.mass[i], model.inertia[i], model.radius[i]))
}

/// Keeps a problem that could not be solved, with the contact that is worst.
pub(crate) fn keep_failed(
    scratch: &SolveScratch,
    contacts: &[Contact],
    members: &[u32],
    level: &'static str,
    residual: f64,
) -> FailedProblem {
    let system = &scratch.system;
    let worst = system
        .contacts
        .iter()
        .enumerate()
        .map(|(i, c)| {
            let rows = c.row as usize..(c.row + c.dim) as usize;
            (
                i,
                rows.map(|r| scratch.newton.residual_rows()[r].abs())
                    .fold(0.0f64, f64::max),
            )
        })
        .fold((0, -1.0), |best, x| if x.1 > best.1 { x } else { best })
        .0;
    FailedProblem {
        level,
        step: 0,
        time: 0.0,
        // A dense matrix of a large island would not help anyone and could fill the memory.
        delassus: if system.rows() <= 3000 {
            system.dense_delassus()
        } else {
            Vec::new()
        },
        free: system.z0.clone(),
        // Joints stand after the contacts; the ground counts as the joined sphere itself.
        bodies: system
            .contacts
            .iter()
            .enumerate()
            .map(|(slot, c)| match members.get(slot) {
                Some(&m) => (contacts[m as usize].a, contacts[m as usize].b),
                None => {
                    let body = |node: u32| scratch.bodies.get(node as usize).copied();
                    let a = body(c.node_a).unwrap_or(0);
                    (a, body(c.node_b).unwrap_or(a))
                }
            })
            .collect(),
        first_row: system.contacts.iter().map(|c| c.row).collect(),
        rows: system.contacts.iter().map(|c| c.dim).collect(),
        bounds: system
            .contacts
            .iter()
            .map(|c| [c.bounds.sliding, c.bounds.rolling, c.bounds.spinning])
            .collect(),
        joints: (system.contacts.len() - members.len()) as u32,
        residual,
        worst: worst as u32,
    }
}
