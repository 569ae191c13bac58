//! Loads that are solved once, around their level ([`crate::level::loads`]): which contacts take part, where the loads bring the spheres, and
//! how contacts meet there.

use crate::contact::Contact;
use crate::level::rest;
use crate::level::speeds::{opening, Speeds};
use crate::model::Model;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::Prediction;
use crate::wall::places::{proximity_at, Walls};
use carom_solve::team;

/// Finds the contacts whose loads are solved, with their normals where the smooth step ends: those that touch there, and those that loads may close
/// in the step of size `h`, being within their reach at t_n and separating by no more than they may bring back.
pub(crate) fn begin(model: &Model, state: &State, scratch: &mut Scratch, h: f64) {
    let (contacts, walls) = (&mut scratch.contacts, &scratch.walls);
    let (linear, position) = (&scratch.linear, &scratch.position);
    let touching = model.options.touching_tolerance;
    let threads = model.options.threads as usize;
    team::each(threads, contacts, |c| {
        let gap_allowed = touching * c.length;
        let meets = c.gap_check <= gap_allowed;
        c.rested = c.gap_start <= gap_allowed;
        c.resting = meets || brought(model, state, walls, linear, c, h);
        if c.resting {
            let p = proximity_at(model, walls, c, position);
            c.turn_to(p.normal);
            (c.gap, c.load_normal) = (p.gap, p.normal);
        }
    });
    // What carried something and has come apart since: not all of its bodies were at rest.
    let apart = |c: &&Contact| !c.rested && rest::of_last_step(state, c).is_some();
    let mut moved: Vec<u32> = contacts
        .iter()
        .filter(apart)
        .flat_map(|c| [c.a, c.b])
        .collect();
    moved.retain(|&body| (body as usize) < model.bodies());
    moved.sort_unstable();
    if !moved.is_empty() {
        let has = |body: u32| moved.binary_search(&body).is_ok();
        for c in contacts.iter_mut().filter(|c| has(c.a) || has(c.b)) {
            c.rested = false;
        }
    }
}

/// Whether loads may close a contact in the step of size `h`: it is within their reach at t_n, and separates by no more than they may bring back.
pub(crate) fn brought(
    model: &Model,
    state: &State,
    walls: &Walls,
    linear: &[Prediction],
    c: &Contact,
    h: f64,
) -> bool {
    let mut speeds = Speeds::default();
    for i in [c.a as usize, c.b as usize] {
        if i < model.bodies() {
            speeds.add(model, state, linear[i].velocity, i);
        }
    }
    let reach = model.options.touching_tolerance * c.length + 0.5 * h * speeds.load;
    // Without loads what rolls over one another opens and closes by rounding, and by what solvers leave.
    let slow = model.options.closing_tolerance_speed * speeds.speed;
    c.gap_start <= reach && opening(model, state, walls, c) <= speeds.load + slow
}

/// Where the loads bring the spheres, and cohesion: `(h/2) W0` in place of the jumps W0, and the positions that follow.
pub(crate) fn advance(model: &Model, state: &State, scratch: &mut Scratch, h: f64) {
    let (threads, half) = (model.options.threads as usize, 0.5 * h);
    team::each(threads, &mut scratch.load_shift, |way| {
        *way = way.map(|w0| half * w0);
    });
    for (way, by) in scratch.load_shift.iter_mut().zip(&scratch.pulled) {
        *way = [way[0] + by[0], way[1] + by[1]];
    }
    team::each(threads, &mut scratch.contacts, |c| {
        c.moved = c.load.map(|load| half * load);
    });
    let (linear, load_shift) = (&scratch.linear, &scratch.load_shift);
    team::fill(threads, &mut scratch.position, |i| {
        state.position[i] + linear[i].displacement + load_shift[i][0]
    });
}

/// Gaps and normals at the positions from which they are corrected.
pub(crate) fn meet(model: &Model, scratch: &mut Scratch) {
    let (walls, position) = (&scratch.walls, &scratch.position);
    team::each(model.options.threads as usize, &mut scratch.contacts, |c| {
        let p = proximity_at(model, walls, c, position);
        (c.gap, c.n1) = (p.gap, p.normal);
    });
}
