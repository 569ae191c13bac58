//! Pairs that come to overlap when positions are corrected: they join the contacts, and the level is solved again.

use crate::candidates::{contact, for_each_share, list, near, near_pairs, NearPair};
use crate::clump;
use crate::contact::{Contact, CANDIDATE_MARGIN};
use crate::model::Model;
use crate::outcome::Failure;
use crate::state::State;
use crate::stepper::method::Step;
use crate::wall::places::{proximity, Walls};
use carom_solve::team;
use glam::DVec3;

/// In scenes of many contacts: gap over r_c (1) up to which pairs join where others have come to overlap. Too small: more rounds, each with a solve
/// of the pile.
const RELIST_MARGIN: f64 = 5e-2;

/// Pairs at the corrected positions that were no candidates.
pub(crate) enum Relisted {
    /// Some overlap, and have joined: solve again from the start.
    Joined,
    /// None does; these touch.
    Touching(Vec<NearPair>),
}

/// Adds pairs that overlap at the corrected positions and were no candidates.
#[inline]
pub(crate) fn relist(on: &mut Step) -> Result<Relisted, Failure> {
    let (model, scratch) = (on.model, &*on.scratch);
    // A pair that was beyond the margin stays apart unless its spheres were pushed by as much together.
    let threads = model.options.threads as usize;
    let pushed = |_, shift: &[[DVec3; 2]]| {
        let pushed = shift.iter().map(|s| s[0].length_squared());
        pushed.fold(0.0, team::larger)
    };
    let shift = &scratch.shift[..];
    let largest = team::reduce(threads, shift.len(), shift, pushed, team::larger);
    let far = largest > 0.0 && 2.0 * largest.sqrt() >= CANDIDATE_MARGIN * scratch.smallest;
    // What of a mesh a sphere meets may change with any push.
    if !far && model.meshes.is_empty() {
        return Ok(Relisted::Touching(Vec::new()));
    }
    join_overlapping(on, if far { 0 } else { model.first_mesh_wall() })
}

/// The rest of [`relist`], where spheres were pushed far enough, or for pairs with bodies from `least` on.
#[inline(never)]
fn join_overlapping(on: &mut Step, least: u32) -> Result<Relisted, Failure> {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    let threads = model.options.threads as usize;
    let touching = model.options.touching_tolerance;
    // In a pile what is pushed pushes on: pairs that come near join with those that overlap, or every round would take the
    // front of a wave one ball further.
    let margin = if scratch.contacts.len() > model.options.pile_contacts as usize {
        RELIST_MARGIN
    } else {
        touching
    };
    let (linear, shift) = (&scratch.linear, &scratch.shift);
    let way = |i: usize| linear[i].displacement + shift[i][0];
    let of_walls = (model.first_wall()..model.bodies()).map(|i| way(i).length());
    let reach = model.cohesive_reach() + of_walls.fold(0.0, f64::max);
    let course = &scratch.walls.periodic;
    team::fill(threads, &mut scratch.need, |i| {
        let near = margin.max(CANDIDATE_MARGIN) * model.radius[i];
        let near = course.own_way(state.position[i], way(i)).length() + near + reach;
        state.need(model, i, near + course.change(model.radius[i] + near))
    });
    list(model, state, scratch)?;
    let (contacts, position) = (&scratch.contacts, &scratch.position);
    let (walls, linear) = (&scratch.walls, &scratch.linear);
    let found = for_each_share(model, scratch.neighbours.pairs(), |pairs, found| {
        let places = (state, walls, &position[..], margin);
        if model.meshes.is_empty() {
            return unknown(model, places, contacts, pairs, found);
        }
        let moved = |i: usize| position[i] != state.position[i] + linear[i].displacement;
        unknown_at_meshes(model, places, contacts, pairs, (least, moved), found)
    })?;
    let gap = |near: &NearPair| {
        let (i, j) = (near.pair.0 as usize, near.pair.1 as usize);
        let rb = if j < model.first_wall() {
            model.radius[j]
        } else {
            f64::INFINITY
        };
        near.gap / model.radius[i].min(rb)
    };
    let overlapping = |near: &NearPair| gap(near) < -model.options.gap_tolerance;
    let mut joining: Vec<NearPair> = found.into_iter().flatten().collect();
    if !joining.iter().any(overlapping) {
        joining.retain(|near| gap(near) <= touching);
        return Ok(Relisted::Touching(joining));
    }
    if margin == touching {
        joining.retain(overlapping);
    }
    join(on, &joining)?;
    start_over(on);
    Ok(Relisted::Joined)
}

/// Adds pairs as contacts.
pub(crate) fn join(on: &mut Step, joining: &[NearPair]) -> Result<(), Failure> {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    let (contacts, walls, linear) = (&mut scratch.contacts, &scratch.walls, &scratch.linear);
    let smooth = |body: u32| match linear.get(body as usize) {
        Some(p) => state.position[body as usize] + p.displacement,
        None => DVec3::ZERO,
    };
    let joined = |near: &NearPair| {
        let mut c = contact(model, state, walls, near)?;
        c.gap_check = proximity(model, walls, &c, smooth(c.a), smooth(c.b)).gap;
        Ok(c)
    };
    merge(contacts, joining, joined)
}

/// Where bodies are: state, walls, places of centres, and the gap over the radius below which pairs are near.
type Where<'a> = (&'a State, &'a Walls, &'a [DVec3], f64);

/// Those of some pairs that are near and no contacts yet. Both lists are sorted by key.
fn unknown(
    model: &Model,
    (state, walls, position, margin): Where,
    contacts: &[Contact],
    pairs: &[(u32, u32)],
    found: &mut Vec<NearPair>,
) -> Result<(), Failure> {
    let Some(first) = pairs.first() else {
        return Ok(());
    };
    let from = contacts.partition_point(|c| (c.a, c.b) < *first);
    let mut known = contacts[from..].iter().map(|c| (c.a, c.b)).peekable();
    for &pair in pairs {
        while known.next_if(|key| *key < pair).is_some() {}
        if known.next_if_eq(&pair).is_none() {
            found.extend(near(model, state, walls, position, pair, margin)?);
        }
    }
    Ok(())
}

/// The same with meshes, whose triangles a ball has to be compared with together.
fn unknown_at_meshes(
    model: &Model,
    (state, walls, position, margin): Where,
    contacts: &[Contact],
    pairs: &[(u32, u32)],
    (least, moved): (u32, impl Fn(usize) -> bool),
    found: &mut Vec<NearPair>,
) -> Result<(), Failure> {
    for row in pairs.chunk_by(|a, b| a.0 == b.0) {
        if least > 0 && !moved(row[0].0 as usize) {
            continue;
        }
        let row = &row[row.partition_point(|pair| pair.1 < least)..];
        near_pairs(model, state, walls, position, row, margin, found)?;
    }
    let known = |near: &NearPair| contacts.binary_search_by_key(&near.pair, |c| (c.a, c.b));
    found.retain(|near| known(near).is_err());
    Ok(())
}

/// Two sorted runs become one, from the back: contacts are large, and a copy of those of a large pile would be the most that it needs at once.
fn merge(
    contacts: &mut Vec<Contact>,
    joining: &[NearPair],
    joined: impl Fn(&NearPair) -> Result<Contact, Failure>,
) -> Result<(), Failure> {
    let mut there = contacts.len();
    contacts.reserve_exact(joining.len());
    contacts.resize(there + joining.len(), Contact::default());
    let mut end = contacts.len();
    for near in joining.iter().rev() {
        while there > 0 && (contacts[there - 1].a, contacts[there - 1].b) > near.pair {
            (there, end) = (there - 1, end - 1);
            contacts[end] = contacts[there];
        }
        end -= 1;
        contacts[end] = joined(near)?;
    }
    Ok(())
}

/// Spheres where the smooth step has put them. Multipliers stay: piles are swept on from them.
pub(crate) fn start_over(on: &mut Step) {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    let threads = model.options.threads as usize;
    let (linear, shift) = (&scratch.linear, &mut scratch.shift);
    let by_loads = &scratch.load_shift;
    team::fill(threads, shift, |_| [DVec3::ZERO; 2]);
    team::fill(threads, &mut scratch.position, |i| {
        let smooth = state.position[i] + linear[i].displacement;
        by_loads.get(i).map_or(smooth, |by| smooth + by[0])
    });
    clump::turn_back(model, state, scratch);
}
