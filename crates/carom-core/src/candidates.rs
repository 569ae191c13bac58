//! Candidate contacts of a step: pairs of the list that are near after the smooth step, and those that come to overlap later.

use crate::contact::Contact;
use crate::level::position;
use crate::model::Model;
use crate::scratch::Scratch;
use crate::state::State;
use crate::step::Failure;
use crate::wall::Walls;
use carom_geom::{sphere_plane, tangent_frame};
use carom_solve::{team, Bounds, Status};
use glam::DVec3;

/// Candidate contacts have a gap below this share of r_c after the smooth step; others enter when they overlap.
pub(crate) const CANDIDATE_MARGIN: f64 = 1e-2;
/// In scenes of many contacts: gap over r_c up to which pairs join where others have come to overlap.
const RELIST_MARGIN: f64 = 5e-2;
/// Pairs that a thread looks at before it takes more.
const PAIRS: usize = 8_192;

/// A list that reached its limit has lost pairs: nothing may be concluded from it.
pub(crate) fn complete(list: &carom_geom::NeighbourList) -> Result<(), Failure> {
    if list.is_truncated() {
        return Err(Failure::TooManyPairs);
    }
    Ok(())
}

/// Turns listed pairs into candidate contacts, with frames of t_n.
pub(crate) fn meet(model: &Model, state: &State, scratch: &mut Scratch) -> Result<(), Failure> {
    let Scratch {
        contacts,
        neighbours,
        position,
        walls,
        ..
    } = scratch;
    contacts.clear();
    for_each_share(model, neighbours.pairs(), contacts, |pairs, found| {
        for &pair in pairs {
            let margin = CANDIDATE_MARGIN;
            push_candidate(model, state, walls, position, pair, margin, found)?;
        }
        Ok(())
    })
}

/// Adds to `contacts` what `look` finds in all pairs, in their order; threads share the pairs out.
fn for_each_share(
    model: &Model,
    pairs: &[(u32, u32)],
    contacts: &mut Vec<Contact>,
    look: impl Fn(&[(u32, u32)], &mut Vec<Contact>) -> Result<(), Failure> + Sync,
) -> Result<(), Failure> {
    let threads = (model.options.threads as usize).min(pairs.len() / PAIRS);
    if threads < 2 {
        return look(pairs, contacts);
    }
    let found = team::map(threads, pairs.chunks(PAIRS).collect(), |pairs| {
        let mut found = Vec::new();
        look(pairs, &mut found).map(|()| found)
    });
    for found in found {
        contacts.extend(found?);
    }
    Ok(())
}

/// Adds the contact of a pair if its gap at `position` is below `margin r_c`; false: it is not.
#[inline]
pub(crate) fn push_candidate(
    model: &Model,
    state: &State,
    walls: &Walls,
    position: &[DVec3],
    (a, b): (u32, u32),
    margin: f64,
    contacts: &mut Vec<Contact>,
) -> Result<bool, Failure> {
    let (i, j, n) = (a as usize, b as usize, model.spheres());
    let ra = model.radius[i];
    // A list may be older than the removal of a ball.
    if !state.present[i] || state.present.get(j) == Some(&false) {
        return Ok(false);
    }
    if j >= n {
        let wall = &model.walls[j - n];
        let plane = wall.fixed_plane();
        let gap = match plane {
            Some((point, normal)) => sphere_plane(position[i], ra, point, normal).gap,
            None => walls.meet(model, a, b, position[i]).gap,
        };
        if gap > margin * ra {
            return Ok(false);
        }
        let Some(law) = law_or_miss(model, a, b, gap)? else {
            return Ok(false);
        };
        let (start, (t1, t2)) = match plane {
            Some((point, normal)) => (
                sphere_plane(state.position[i], ra, point, normal),
                (wall.tangent1, wall.tangent2),
            ),
            None => {
                let start = walls.meet_at_start(model, a, b, state.position[i]);
                (start, tangent_frame(start.normal))
            }
        };
        let frame = (start.normal, t1, t2);
        let contact = new_contact(model, (a, b), law, frame, start.gap, gap, ra);
        contacts.push(contact);
        return with_law(model, state, walls, contacts);
    }
    let length = ra.min(model.radius[j]);
    let reach = ra + model.radius[j] + margin * length;
    let periodic = &model.periodic;
    let between = periodic.nearest(position[i] - position[j]);
    if between.length_squared() > reach * reach {
        return Ok(false);
    }
    let gap = periodic
        .sphere_sphere(position[i], ra, position[j], model.radius[j])
        .gap;
    let Some(law) = law_or_miss(model, a, b, gap)? else {
        return Ok(false);
    };
    let start = periodic.sphere_sphere(state.position[i], ra, state.position[j], model.radius[j]);
    let (t1, t2) = tangent_frame(start.normal);
    let frame = (start.normal, t1, t2);
    let contact = new_contact(model, (a, b), law, frame, start.gap, gap, length);
    contacts.push(contact);
    with_law(model, state, walls, contacts)
}

/// Gives the contact that was added last the bounds of its friction law, if it has one.
#[inline]
fn with_law(
    model: &Model,
    state: &State,
    walls: &Walls,
    contacts: &mut [Contact],
) -> Result<bool, Failure> {
    if let Some(c) = contacts.last_mut() {
        if c.law(model).friction_law.is_some() {
            c.bounds = bounds_at_start(model, state, walls, c)?;
        }
    }
    Ok(true)
}

/// Bounds of a contact in this step with a friction law, which is evaluated at the slip of t_n.
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
        sign * state.velocity[i] + radius * c.n0.cross(state.angular_velocity[i])
    };
    let mut slip = part(c.a, 1.0) + part(c.b, -1.0);
    if let Some(wall) = walls.start_twist(model, c, state.position[c.a as usize]) {
        slip -= wall.material;
    }
    let across = slip - c.n0 * c.n0.dot(slip);
    let (slip, bodies) = (across.length(), (c.a, c.b));
    let mu = law.friction(slip);
    if !(mu >= 0.0 && mu.is_finite()) {
        return Err(Failure::Friction { bodies, mu, slip });
    }
    Ok(Bounds {
        sliding: mu,
        ..law.bounds
    })
}

/// The law of a pair; a pair without one may come near, not touch.
#[inline]
fn law_or_miss(model: &Model, a: u32, b: u32, gap: f64) -> Result<Option<u32>, Failure> {
    match model.law_of(a as usize, b as usize) {
        Some(law) => Ok(Some(law)),
        None if gap < 0.0 => Err(Failure::MissingLaw(a, b)),
        None => Ok(None),
    }
}

#[inline]
fn new_contact(
    model: &Model,
    (a, b): (u32, u32),
    law: u32,
    (n0, t1, t2): (DVec3, DVec3, DVec3),
    gap_start: f64,
    gap_check: f64,
    length: f64,
) -> Contact {
    Contact {
        a,
        b,
        law,
        bounds: model.laws[law as usize].bounds,
        n0,
        t1,
        t2,
        n1: n0,
        gap_start,
        gap_check,
        gap: gap_check,
        length,
        nu: [0.0; 6],
        lambda: [0.0; 6],
        work: [0.0; 4],
        closed: false,
        end_frame: false,
        status: Status::Gap,
    }
}

/// Adds pairs that overlap at the corrected positions and were no candidates. True: solve again from the start.
pub(crate) fn relist(model: &Model, state: &State, scratch: &mut Scratch) -> Result<bool, Failure> {
    // A pair that was beyond the margin stays apart unless its spheres were pushed by as much together.
    let pushed = scratch.shift.iter().map(|s| s[0].length_squared());
    let largest = pushed.fold(0.0f64, f64::max);
    if largest == 0.0 {
        return Ok(false);
    }
    if 2.0 * largest.sqrt() < CANDIDATE_MARGIN * scratch.smallest {
        return Ok(false);
    }
    let Scratch {
        contacts,
        neighbours,
        position,
        need,
        shift,
        linear,
        walls,
        ..
    } = scratch;
    // In a pile what is pushed pushes on: pairs that come near join with those that overlap, or every round would take the
    // front of a wave one ball further.
    let margin = if contacts.len() > model.options.pile_contacts as usize {
        RELIST_MARGIN
    } else {
        0.0
    };
    for i in 0..model.spheres() {
        let way = linear[i].displacement + shift[i][0];
        let near = margin.max(CANDIDATE_MARGIN) * model.radius[i];
        need[i] = state.need(model, i, way.length() + near);
    }
    neighbours.refresh(&state.position, &model.radius, &walls.now, need);
    complete(neighbours)?;
    let mut joining = Vec::new();
    for_each_share(model, neighbours.pairs(), &mut joining, |pairs, found| {
        // Both lists are sorted by key.
        let from = match pairs.first() {
            Some(first) => contacts.partition_point(|c| (c.a, c.b) < *first),
            None => return Ok(()),
        };
        let mut known = contacts[from..].iter().map(|c| (c.a, c.b)).peekable();
        for &pair in pairs {
            while known.next_if(|key| *key < pair).is_some() {}
            if known.next_if_eq(&pair).is_none() {
                push_candidate(model, state, walls, position, pair, margin, found)?;
            }
        }
        Ok(())
    })?;
    let overlapping = |c: &Contact| c.gap_check < -model.options.gap_tolerance * c.length;
    if margin == 0.0 {
        joining.retain(overlapping);
    }
    if !joining.iter().any(overlapping) {
        return Ok(false);
    }
    let smooth = |body: u32| match linear.get(body as usize) {
        Some(p) => state.position[body as usize] + p.displacement,
        None => DVec3::ZERO,
    };
    for c in &mut joining {
        c.gap_check = position::proximity(model, walls, c, smooth(c.a), smooth(c.b)).gap;
    }
    contacts.append(&mut joining);
    contacts.sort_unstable_by_key(|c| (c.a, c.b));
    // Multipliers stay: piles are swept on from them.
    for i in 0..model.spheres() {
        shift[i] = [DVec3::ZERO; 2];
        position[i] = state.position[i] + linear[i].displacement;
    }
    Ok(true)
}
