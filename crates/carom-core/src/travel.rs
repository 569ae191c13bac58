//! Nothing passes through anything: how far bodies travel in a step, against what lies on their way.
//!
//! Contacts are sought where the smooth motion ends. A sphere that would go by its own radius or more, relative to a body
//! that it meets on the way, may end beyond it, or so deep that the normal points to the wrong side. Such a step is made in
//! parts. Travel that meets nothing may be as long as it likes.

use crate::model::Model;
use crate::outcome::Failure;
use crate::scratch::Scratch;
use crate::state::State;
use crate::wall::places::{displacement, Walls};
use glam::DVec3;

/// Most points looked at on the way to a wall, two per radius. Fewer: a ball that is faster than 500 radii a step may miss a thin wall; more cost time.
const WAY_POINTS: f64 = 1e3;
/// Overlap over the radius (1) up to which a wall may be passed within a step. At 0 a touch at a rim divides the step; too large, and balls cut corners.
const GRAZE: f64 = 1e-2;

/// Refuses the step if a sphere would travel its radius or more against a body on its way; names the worst pair. After the
/// smooth step, in which the spheres go by `fastest` (m) at most, and the listing of pairs.
#[inline]
pub(crate) fn check(
    model: &Model,
    state: &State,
    scratch: &Scratch,
    fastest: f64,
) -> Result<(), Failure> {
    // Relative to one another two bodies travel at most twice as far as the faster.
    if 2.0 * fastest < scratch.smallest && !scratch.walls.any_moves() {
        return Ok(());
    }
    find(model, state, scratch)
}

#[inline(never)]
fn find(model: &Model, state: &State, scratch: &Scratch) -> Result<(), Failure> {
    let mut worst: Option<((u32, u32), f64, f64)> = None;
    for &(a, b) in scratch.neighbours.pairs() {
        let (travel, length) = match met(model, state, scratch, a, b) {
            Some(found) => found,
            None => continue,
        };
        if worst.is_none_or(|(_, most, of)| travel * of > most * length) {
            worst = Some(((a, b), travel, length));
        }
    }
    match worst {
        Some((bodies, travel, length)) => Err(Failure::TooFar {
            bodies,
            travel,
            length,
        }),
        None => Ok(()),
    }
}

/// Relative travel of a pair and the radius that it reaches, if it meets on the way: both in m.
fn met(model: &Model, state: &State, scratch: &Scratch, a: u32, b: u32) -> Option<(f64, f64)> {
    let (i, j) = (a as usize, b as usize);
    if !state.present[i] || state.present.get(j) == Some(&false) {
        return None;
    }
    let (x, r, d) = (state.position[i], model.radius[i], scratch.way(i));
    if j >= model.first_wall() {
        // Against a free wall where it was given.
        let from = displacement(&state.position, b);
        let by = match j < model.bodies() {
            true => scratch.way(j),
            false => DVec3::ZERO,
        };
        return met_wall(model, &scratch.walls, (a, b), x - from, d - by);
    }
    let (course, between) = (&scratch.walls.periodic, x - state.position[j]);
    let image = course.images_away(between).as_dvec3();
    let from = course.start.nearest(between);
    let along = d - scratch.way(j) - course.way(image);
    let length = r.min(model.radius[j]);
    if along.length_squared() < length * length {
        return None;
    }
    let touch = r + model.radius[j];
    (closest(from, along) < touch).then_some((along.length(), length))
}

/// The same at a wall, which may move besides. A plane is met from its free side only, and along it nothing is passed
/// through; other walls are looked for all along the way. What is thinner than the sphere is met off its middle too.
fn met_wall(
    model: &Model,
    walls: &Walls,
    (a, b): (u32, u32),
    x: DVec3,
    d: DVec3,
) -> Option<(f64, f64)> {
    let r = model.radius[a as usize];
    let start = walls.meet_at_start(model, a, b, x);
    let end = walls.meet_at_end(model, a, b, x + d);
    if model.wall(b).is_steady_plane() {
        let closes_by = start.gap - end.gap;
        return (closes_by >= r && end.gap < 0.0).then_some((closes_by, r));
    }
    // Against the wall where it was: what it moves by, the sphere moves back.
    let d = d - walls.shift(model, b, x);
    let travel = d.length();
    // Through a sheet, by less than the radius where it overlapped before.
    let through = end.gap < 0.0 && start.normal.dot(end.normal) < 0.0 && start.normal.dot(d) < 0.0;
    if through && model.wall(b).is_sheet() {
        return Some((travel, r));
    }
    if travel < r {
        return None;
    }
    let parts = (2.0 * travel / r).ceil().min(WAY_POINTS);
    let along =
        (1..=parts as u32).map(|k| walls.meet_at_start(model, a, b, x + f64::from(k) / parts * d));
    let (mut first, mut deepest, mut last) = (None, 0.0f64, start.normal);
    for p in along {
        if p.gap < 0.0 {
            first.get_or_insert(p.normal);
            deepest = deepest.max(-p.gap);
        }
        last = p.normal;
    }
    let closes_by = -first?.dot(d);
    if closes_by >= r {
        return Some((closes_by, r));
    }
    // Past the middle of what is thin: out again, or where the normal drives it on.
    let passed = start.normal.dot(d) < 0.0 && last.dot(d) > 0.0 && deepest > GRAZE * r;
    passed.then_some((travel, r))
}

/// Least distance from the origin to the way from `from` along `along`, for a pair that comes nearer; else infinite.
fn closest(from: DVec3, along: DVec3) -> f64 {
    let nearing = -from.dot(along);
    if nearing <= 0.0 {
        return f64::INFINITY;
    }
    let share = (nearing / along.length_squared()).min(1.0);
    (from + share * along).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_way() {
        let from = DVec3::new(-3.0, 1.0, 0.0);
        assert_eq!(closest(from, 10.0 * DVec3::X), 1.0);
        assert_eq!(closest(from, DVec3::X), 5f64.sqrt());
        assert_eq!(closest(from, -DVec3::X), f64::INFINITY);
    }
}
