//! Islands of many contacts: both levels by sweeps over spheres without matrices, started from the impulses of the last step.
//!
//! The law is that of the small islands (`level`, `impact`); decision record 011 says what differs: one frame per contact, at the
//! normal of the end of the step, so that [`carom_solve::spheres`] applies; a tolerance of piles; impact problems after the first
//! are solved where something closes and nowhere else (`cascade`). Velocities that do not converge are
//! those of the convex companion, positions go to the solvers of the small islands; both are counted.

mod cascade;
mod chunks;
mod closed_contact;
mod energy_gain;
pub mod limits;
pub mod memory;
mod position;
mod position_measures;
mod problem_data;
mod problem_nodes;
mod record;
mod rest;
mod results;
mod roll;
mod solve;
mod start;
mod turning;
mod velocities;
mod velocity;
mod warm;

use crate::contact::Contact;
use crate::islands::Islands;
use crate::model::Model;
use crate::pile::limits::{fits, is_large, threads};
use std::ops::Range;

pub use position::{overlap, solve_positions};
pub use velocity::solve_velocities;

/// Relative difference (1) of an overlap that is measured twice. At 0 a rough round that met its bound is repeated for a rounding.
const ROUNDING: f64 = 1e-6;

/// Whether something overlaps deeper than it may after a round of [`crate::level::Demand::Rough`].
pub fn is_left_rough(model: &Model, contacts: &[Contact], islands: &Islands) -> bool {
    if !is_large(contacts.len()) {
        return false;
    }
    let o = &model.options;
    let tolerance = o.tolerance.max(o.pile_tolerance);
    let mut all = (0..islands.len()).map(|k| islands.island(k));
    all.any(|island| {
        if !is_large(island.contacts.len()) || !fits(model, island) {
            return false;
        }
        let (members, count) = (island.contacts, island.contacts.len());
        let extremes = |range: Range<usize>| {
            let (mut smallest, mut deepest) = (f64::INFINITY, 0.0f64);
            for c in members[range].iter().map(|&m| &contacts[m as usize]) {
                let radius = |body: u32| model.radius.get(body as usize).copied();
                let radii = [c.a, c.b].map(|body| radius(body).unwrap_or(f64::INFINITY));
                smallest = smallest.min(radii[0]).min(radii[1]);
                deepest = deepest.max(-c.gap);
            }
            (smallest, deepest)
        };
        let both = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let (smallest, deepest) = chunks::reduce(threads(model, count), count, extremes, both);
        deepest > (1.0 + ROUNDING) * overlap(tolerance, count) * smallest
    })
}
