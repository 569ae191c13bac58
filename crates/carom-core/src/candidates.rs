//! Candidate contacts of a step: pairs of the list that are near after the smooth step.

use crate::contact::{Contact, CANDIDATE_MARGIN};
use crate::model::Model;
use crate::outcome::Failure;
use crate::scratch::Scratch;
use crate::state::State;
use crate::wall::places::{displacement, Walls};
use carom_geom::{same_contact, sphere_plane, tangent_frame};
use carom_solve::{team, Bounds};
use glam::{DVec3, IVec3};

/// Pairs that a thread looks at before it takes more. Speed alone.
const PAIRS: usize = 8_192;

/// Brings the list of pairs to the needs of the spheres. One that reached its limit has lost pairs: nothing may be concluded from it.
#[inline]
pub(crate) fn list(model: &Model, state: &State, scratch: &mut Scratch) -> Result<(), Failure> {
    let (list, walls, n) = (&mut scratch.neighbours, &mut scratch.walls, model.balls());
    walls.place_free(model, Some(&state.position[model.first_wall()..]));
    if walls.periodic.deforms {
        list.deform(walls.periodic.start);
    }
    list.refresh(
        &state.position[..n],
        &model.radius[..n],
        &walls.now,
        &scratch.need[..n],
    );
    walls.place_free(model, None);
    match list.is_truncated() {
        true => Err(Failure::TooManyPairs),
        false => Ok(()),
    }
}

/// A pair that is near, with the gap (m) at the positions that were asked for and the law of its materials.
#[derive(Clone, Copy)]
pub(crate) struct NearPair {
    pub pair: (u32, u32),
    pub gap: f64,
    pub law: u32,
}

/// Turns listed pairs into candidate contacts, with frames of t_n.
pub(crate) fn meet(model: &Model, state: &State, scratch: &mut Scratch) -> Result<(), Failure> {
    let (contacts, walls, position) = (&mut scratch.contacts, &scratch.walls, &scratch.position);
    let (pairs, margin) = (scratch.neighbours.pairs(), CANDIDATE_MARGIN);
    if pairs.len() <= PAIRS && model.meshes.is_empty() {
        let mut count = 0;
        for &pair in pairs {
            if let Some(near) = near(model, state, walls, position, pair, margin)? {
                if count == contacts.len() {
                    contacts.push(Contact::default());
                }
                begin(model, state, walls, &near, &mut contacts[count])?;
                count += 1;
            }
        }
        contacts.truncate(count);
        return Ok(());
    }
    let found = for_each_share(model, pairs, |pairs, found| {
        near_pairs(model, state, walls, position, pairs, margin, found)
    })?;
    // Contacts are large: each is written where it stays.
    contacts.resize(found.iter().map(Vec::len).sum(), Contact::default());
    let (mut shares, mut rest) = (Vec::new(), &mut contacts[..]);
    for near in found {
        let (places, behind) = rest.split_at_mut(near.len());
        shares.push((near, places));
        rest = behind;
    }
    let made = team::map(model.options.threads as usize, shares, |(near, places)| {
        let mut places = near.iter().zip(places);
        places.try_for_each(|(near, place)| begin(model, state, walls, near, place))
    });
    made.into_iter().collect()
}

/// What `look` finds in shares of the pairs, in their order; threads take one after the other.
pub(crate) fn for_each_share(
    model: &Model,
    pairs: &[(u32, u32)],
    look: impl Fn(&[(u32, u32)], &mut Vec<NearPair>) -> Result<(), Failure> + Sync,
) -> Result<Vec<Vec<NearPair>>, Failure> {
    let shares = match model.meshes.is_empty() {
        true => pairs.chunks(PAIRS).collect(),
        false => whole_rows(pairs),
    };
    let found = team::map(model.options.threads as usize, shares, |pairs| {
        let mut found = Vec::new();
        look(pairs, &mut found).map(|()| found)
    });
    found.into_iter().collect()
}

/// Shares of the pairs that hold all pairs of a sphere.
fn whole_rows(pairs: &[(u32, u32)]) -> Vec<&[(u32, u32)]> {
    let (mut shares, mut rest) = (Vec::new(), pairs);
    while let Some(last) = rest.get(PAIRS) {
        let (share, behind) = rest.split_at(rest.partition_point(|pair| pair.0 <= last.0));
        shares.push(share);
        rest = behind;
    }
    shares.push(rest);
    shares
}

/// Adds the pairs whose gap at `position` is below `margin r_c`, with all pairs of each sphere in one call: parts of meshes are
/// found by several triangles, and once.
pub(crate) fn near_pairs(
    model: &Model,
    state: &State,
    walls: &Walls,
    position: &[DVec3],
    pairs: &[(u32, u32)],
    margin: f64,
    found: &mut Vec<NearPair>,
) -> Result<(), Failure> {
    for row in pairs.chunk_by(|a, b| a.0 == b.0) {
        let first = found.len();
        for &pair in row {
            found.extend(near(model, state, walls, position, pair, margin)?);
        }
        if !model.meshes.is_empty() {
            once(model, walls, position, first, found);
        }
    }
    Ok(())
}

/// Sorts the pairs of a sphere from the `first` on by key, and leaves one of those that are the same contact with a mesh.
fn once(model: &Model, walls: &Walls, position: &[DVec3], first: usize, found: &mut Vec<NearPair>) {
    let simple = model.first_mesh_wall();
    let first = first + found[first..].partition_point(|near| near.pair.1 < simple);
    found[first..].sort_unstable_by_key(|near| near.pair);
    let at = |near: &NearPair| {
        let (a, b) = near.pair;
        walls.meet(model, a, b, position[a as usize])
    };
    let mut kept = first;
    for k in first..found.len() {
        let (pair, met) = (found[k].pair, at(&found[k]));
        let (wall, r) = (model.wall(pair.1).given, model.radius[pair.0 as usize]);
        let again = |other: &NearPair| {
            model.wall(other.pair.1).given == wall && same_contact(&at(other), &met, r)
        };
        if !found[first..kept].iter().any(again) {
            found[kept] = found[k];
            kept += 1;
        }
    }
    found.truncate(kept);
}

/// The contact of a near pair.
pub(crate) fn contact(
    model: &Model,
    state: &State,
    walls: &Walls,
    near: &NearPair,
) -> Result<Contact, Failure> {
    let mut c = Contact::default();
    begin(model, state, walls, near, &mut c)?;
    Ok(c)
}

/// Adds the contact of a pair if its gap at `position` is below `margin r_c`; false: it is not.
#[inline]
pub(crate) fn push_candidate(
    model: &Model,
    state: &State,
    walls: &Walls,
    position: &[DVec3],
    pair: (u32, u32),
    margin: f64,
    contacts: &mut Vec<Contact>,
) -> Result<bool, Failure> {
    let Some(near) = near(model, state, walls, position, pair, margin)? else {
        return Ok(false);
    };
    contacts.push(contact(model, state, walls, &near)?);
    Ok(true)
}

/// The pair, if its gap at `position` is below `margin r_c`.
#[inline(always)]
pub(crate) fn near(
    model: &Model,
    state: &State,
    walls: &Walls,
    position: &[DVec3],
    pair: (u32, u32),
    margin: f64,
) -> Result<Option<NearPair>, Failure> {
    let (i, j, n) = (pair.0 as usize, pair.1 as usize, model.first_wall());
    let ra = model.radius[i];
    // A list may be older than the removal of a ball.
    if !state.present[i] || state.present.get(j) == Some(&false) {
        return Ok(None);
    }
    let mut pair = pair;
    let gap;
    if j >= n {
        gap = match model.walls[j - n].fixed_plane() {
            Some((point, normal)) => sphere_plane(position[i], ra, point, normal).gap,
            None => {
                match walls.part(model, pair, position[i], margin * ra) {
                    Some(wall) => pair.1 = wall,
                    None => return Ok(None),
                }
                let from = displacement(position, pair.1);
                walls.meet(model, pair.0, pair.1, position[i] - from).gap
            }
        };
        if gap > margin * ra {
            return Ok(None);
        }
    } else {
        let rb = model.radius[j];
        let reach = ra + rb + margin * ra.min(rb);
        let periodic = &walls.periodic.now;
        let between = periodic.nearest(position[i] - position[j]);
        if between.length_squared() > reach * reach {
            return Ok(None);
        }
        if model.held_apart.holds(pair) && between == position[i] - position[j] {
            return Ok(None);
        }
        gap = periodic.sphere_sphere(position[i], ra, position[j], rb).gap;
    }
    // A pair without a law may come near, not touch.
    match model.law_of(i, j) {
        Some(law) => Ok(Some(NearPair { pair, gap, law })),
        None if gap < 0.0 => Err(Failure::MissingLaw(pair.0, pair.1)),
        None => Ok(None),
    }
}

/// Makes `c` the contact of a near pair, with the frame of t_n and the bounds of its law. Contacts are large: each is written where
/// it stays.
#[inline(always)]
fn begin(
    model: &Model,
    state: &State,
    walls: &Walls,
    near: &NearPair,
    c: &mut Contact,
) -> Result<(), Failure> {
    let ((a, b), law) = (near.pair, &model.laws[near.law as usize]);
    let (i, j, n) = (a as usize, b as usize, model.first_wall());
    let (ra, x) = (model.radius[i], state.position[i]);
    let once = model.options.loads_once();
    c.forget(once);
    c.image = IVec3::ZERO;
    c.jointed = once && (model.is_jointed(i) || model.is_jointed(j));
    (c.a, c.b, c.law, c.bounds) = (a, b, near.law, law.bounds);
    (c.gap_check, c.gap) = (near.gap, near.gap);
    let start;
    if j >= n {
        let wall = &model.walls[j - n];
        c.length = ra;
        match wall.fixed_plane() {
            Some((point, normal)) => {
                start = sphere_plane(x, ra, point, normal);
                (c.t1, c.t2) = (wall.tangent1, wall.tangent2);
            }
            None => {
                start = walls.meet_at_start(model, a, b, x - displacement(&state.position, b));
                (c.t1, c.t2) = tangent_frame(start.normal);
            }
        }
    } else {
        let rb = model.radius[j];
        c.length = ra.min(rb);
        start = (walls.periodic.start).sphere_sphere(x, ra, state.position[j], rb);
        c.image = walls.periodic.images_away(x - state.position[j]);
        (c.t1, c.t2) = tangent_frame(start.normal);
    }
    (c.n0, c.n1, c.gap_start) = (start.normal, start.normal, start.gap);
    if law.friction_law.is_some() || law.restitution_law.is_some() {
        c.bounds = bounds_at_start(model, state, walls, c)?;
    }
    Ok(())
}

/// Bounds of a contact in this step with laws, which are evaluated at the relative velocity of t_n.
#[inline(never)]
fn bounds_at_start(
    model: &Model,
    state: &State,
    walls: &Walls,
    c: &Contact,
) -> Result<Bounds, Failure> {
    let law = c.law(model);
    let part = |body: u32, sign: f64| {
        let i = body as usize;
        let Some(&radius) = model.radius.get(i) else {
            return DVec3::ZERO;
        };
        // A free wall never turns.
        sign * state.velocity[i] + radius * c.n0.cross(state.angular_velocity[i])
    };
    let mut slip = part(c.a, 1.0) + part(c.b, -1.0);
    if let Some(wall) = walls.start_twist(model, c, state.position[c.a as usize]) {
        slip -= wall.material;
    }
    let along = c.n0.dot(slip);
    law.check_restitution((c.a, c.b), (-along).max(0.0))?;
    let across = slip - c.n0 * along;
    Ok(Bounds {
        sliding: law.checked_friction((c.a, c.b), across.length())?,
        ..law.bounds
    })
}
