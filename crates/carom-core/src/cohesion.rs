//! Cohesion: surfaces that touch, or nearly do, attract each other. `docs/theory/algorithm.md` section 13.
//!
//! Symbols: `f` force in touch, `d` rupture distance, `g` gap. `F = f (1 - g/d)` for `0 <= g < d`, and `f` in touch. The potential is
//! `-f (d - g)^2/(2 d)`. It belongs to the smooth motion: each step it gives its pairs an impulse, which contacts take like that of any load.

use crate::candidates::{self, NearPair};
use crate::clump;
use crate::contact::Contact;
use crate::level::speeds::opening;
use crate::model::{ContactLaw, Model};
use crate::options::Method;
use crate::outcome::Failure;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::method::Step;
use crate::stepper::Span;
use crate::wall::places::{displacement, proximity_at, Walls};
use glam::{DVec3, IVec3};

/// Share (1) of a way that its own change of the attraction takes, above which a step is too long to tell that way. Above 1 there is none.
const RESOLVED: f64 = 0.5;

impl ContactLaw {
    /// Attraction at a gap, N.
    fn attraction(&self, gap: f64) -> f64 {
        let d = self.rupture_distance;
        self.cohesion * (1.0 - gap.clamp(0.0, d) / d)
    }

    /// Work that takes a pair apart from a gap on, J.
    fn work_of_rupture(&self, gap: f64) -> f64 {
        let d = self.rupture_distance;
        let left = d - gap.clamp(0.0, d);
        0.5 * self.cohesion * left * left / d
    }

    /// The attraction in a step of `h` that begins at a gap with a speed at which it opens, N: the mean on the way that it leaves the pair, which
    /// ends in touch. What a step tears apart loses the work of rupture, what comes within the distance (with the gap `end` if nothing attracted it)
    /// gains its part of it. A step too long to tell the way has that of its begin.
    fn mean_attraction(
        &self,
        [gap, end]: [f64; 2],
        opening: f64,
        inverse_mass: f64,
        h: f64,
    ) -> f64 {
        let (now, d) = (self.attraction(gap), self.rupture_distance);
        let (free, per_force) = (h * opening, 0.5 * h * h * inverse_mass);
        let change = 0.5 * per_force * self.cohesion / d;
        if gap >= d {
            return self.on_the_way_in(gap, gap - end, change);
        }
        let work = self.work_of_rupture(gap);
        let left = free * free - 4.0 * per_force * work;
        if opening > 0.0 && left > 0.0 {
            let torn = 0.5 * (free + left.sqrt());
            if torn >= d - gap {
                return work / torn;
            }
        }
        let way = match change < RESOLVED {
            true => (free - per_force * now) / (1.0 - change),
            false => free.min(0.0),
        };
        0.5 * (now + self.attraction(gap + way))
    }

    /// The same from beyond the distance, which would end nearer by `free` without attraction: `s` beyond, `p` in all, is
    /// `p = free + k s^2/p` with `k` the change of the way by the attraction over itself.
    fn on_the_way_in(&self, gap: f64, free: f64, k: f64) -> f64 {
        let beyond = gap - self.rupture_distance;
        if free <= beyond {
            return 0.0;
        }
        let way = match k < RESOLVED {
            true => {
                let half = 0.5 * free - k * beyond;
                (half + (half * half + (1.0 - k) * k * beyond * beyond).sqrt()) / (1.0 - k)
            }
            false => free,
        };
        let way = way.min(gap);
        self.work_of_rupture(gap - way) / way
    }

    /// A mean attraction that acts until the pair touches, N, where nothing answers it from there on.
    fn until_touch(&self, force: f64, gap: f64, opening: f64, inverse_mass: f64, h: f64) -> f64 {
        let (free, per_force) = (h * opening, 0.5 * h * h * inverse_mass);
        let work = self.work_of_rupture(0.0) - self.work_of_rupture(gap);
        let root = (free * free + 4.0 * per_force * work).sqrt();
        force.min(0.5 * (free + root) / per_force)
    }
}

/// The gap of a pair; none where it touches: what solvers leave of gaps is no way.
fn apart(model: &Model, (a, b): (u32, u32), gap: f64) -> f64 {
    let of_b = model
        .radius
        .get(b as usize)
        .copied()
        .unwrap_or(f64::INFINITY);
    let smaller = model.radius[a as usize].min(of_b);
    match gap <= model.options.touching_tolerance * smaller {
        true => 0.0,
        false => gap,
    }
}

impl Model {
    /// The largest rupture distance, m; 0 where nothing is cohesive.
    pub fn cohesive_reach(&self) -> f64 {
        let reach = |law: &ContactLaw| match law.cohesion > 0.0 {
            true => law.rupture_distance,
            false => 0.0,
        };
        self.laws.iter().map(reach).fold(0.0, f64::max)
    }
}

/// Pairs of cohesive laws whose gap at `position` is below the largest rupture distance, or below `swept` beyond it.
fn near(
    model: &Model,
    state: &State,
    (walls, pairs, smallest): (&Walls, &[(u32, u32)], f64),
    position: &[DVec3],
    swept: f64,
) -> Result<Vec<NearPair>, Failure> {
    let margin = (model.cohesive_reach() + swept) / smallest;
    let mut found = Vec::new();
    for row in pairs.chunk_by(|a, b| a.0 == b.0) {
        let first = found.len();
        candidates::near_pairs(model, state, walls, position, row, margin, &mut found)?;
        uncovered(model, walls, position, first, &mut found);
    }
    found.retain(|near| model.laws[near.law as usize].cohesion > 0.0);
    Ok(found)
}

/// Leaves of the pairs of a sphere from the `first` on, sorted by key, those whose wall none other covers.
fn uncovered(
    model: &Model,
    walls: &Walls,
    position: &[DVec3],
    first: usize,
    found: &mut Vec<NearPair>,
) {
    let of_spheres = |near: &NearPair| (near.pair.1 as usize) < model.first_wall();
    let first = first + found[first..].partition_point(of_spheres);
    if found.len() < first + 2 {
        return;
    }
    // The farthest first: what covers is there until it is covered itself.
    found[first..].sort_unstable_by(|a, b| a.gap.total_cmp(&b.gap).then(a.pair.cmp(&b.pair)));
    for k in (first..found.len()).rev() {
        let ((a, b), gap) = (found[k].pair, found[k].gap);
        let x = position[a as usize];
        let met = walls.meet(model, a, b, x - displacement(position, b));
        let point = x - (model.radius[a as usize] + gap) * met.normal;
        let covers = |near: &NearPair| {
            let (by, from) = (near.pair.1, displacement(position, near.pair.1));
            by != b && walls.covers(model, a, (by, near.gap), (b, gap), point - from)
        };
        if found[first..].iter().any(covers) {
            found.remove(k);
        }
    }
    found[first..].sort_unstable_by_key(|near| near.pair);
}

/// Adds the cohesion of a step to its smooth motion, whose places `scratch.position` has (of Moreau-Jean those of the middle of the step). The list of
/// pairs is that of the step.
pub(crate) fn pull(on: &mut Step, span: Span) -> Result<(), Failure> {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    let (h, walls) = (span.h, &scratch.walls);
    let moves = walls.any_moves();
    // How far bodies come towards others at most, but for what the box does to their distance.
    let nearer = |i: usize| {
        let x = state.position[i];
        let of_walls = if moves { h * walls.speed_at(x) } else { 0.0 };
        let ways = [h * state.velocity[i], scratch.linear[i].displacement];
        let ways = ways.map(|way| walls.periodic.own_way(x, way).length());
        ways[0].max(ways[1]) + of_walls
    };
    let nearer: Vec<f64> = (0..model.bodies()).map(nearer).collect();
    let reach = |i: usize| model.radius.get(i).copied().unwrap_or(0.0);
    let widest = 2.0 * model.radius.iter().copied().fold(0.0, f64::max) + model.cohesive_reach();
    let swept = 2.0 * nearer.iter().copied().fold(0.0, f64::max) + walls.periodic.change(widest);
    let moreau = model.options.method == Method::MoreauJean;
    let way = if moreau {
        model.options.theta * h
    } else {
        0.5 * h
    };
    let (mut pulls, mut driven_pulls) = (Vec::new(), Vec::new());
    // Centres of t_n, among the walls and in the box of then: what of a mesh is near hangs on both.
    let (pairs, smallest) = (scratch.neighbours.pairs(), scratch.smallest);
    let found = (scratch.walls).at_start(|walls| {
        near(
            model,
            state,
            (walls, pairs, smallest),
            &state.position,
            swept,
        )
    });
    let walls = &scratch.walls;
    for near in found? {
        let (a, b) = (near.pair.0 as usize, near.pair.1 as usize);
        let law = &model.laws[near.law as usize];
        let together = nearer[a] + nearer.get(b).copied().unwrap_or(0.0);
        let of_box = walls.periodic.change(reach(a) + reach(b) + near.gap);
        if near.gap >= law.rupture_distance + together + of_box {
            continue;
        }
        let mut c = candidates::contact(model, state, walls, &near)?;
        // Along the normal of the impulses that answer it: else what turns would turn faster and faster.
        let there = proximity_at(model, walls, &c, &scratch.position);
        c.n1 = there.normal;
        let along = match model.options.loads_once() {
            true => c.middle_normal(),
            false => c.n1,
        };
        let inverse_mass = |body| scratch.clumps.inverse_mass(model, body, along);
        let opening = opening(model, state, walls, &c);
        let gap = apart(model, (c.a, c.b), c.gap_start);
        // Of Moreau-Jean rebounds leave the distance within the step that they are in, and pay nothing: what comes in gains nothing either.
        let end = match moreau {
            true => c.gap_start,
            false => there.gap,
        };
        let inverse_mass = inverse_mass(c.a) + inverse_mass(c.b);
        let mut force = law.mean_attraction([gap, end], opening, inverse_mass, h);
        let open = there.gap > model.options.touching_tolerance * c.length;
        if moreau && open && !model.options.position_projection {
            force = law.until_touch(force, gap, opening, inverse_mass, h);
        }
        if force == 0.0 {
            continue;
        }
        let impulse = -h * force * along;
        pulls.push((c.a, c.b, impulse));
        if (model.record_walls && c.meets_wall(model)) || c.image != IVec3::ZERO {
            c.n1 = along;
            driven_pulls.push((c, impulse));
        }
    }
    scratch.driven_pulls = driven_pulls;
    give(model, state, scratch, &pulls, way)
}

/// Moves bodies by impulses on the first ones of pairs: their places by the share `way` (s) of the velocities, at once or with the loads.
fn give(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    pulls: &[(u32, u32, DVec3)],
    way: f64,
) -> Result<(), Failure> {
    for &(a, b, impulse) in pulls {
        for (body, sign) in [(a, 1.0), (b, -1.0)] {
            if let Some(i) = scratch.clumps.push(model, body, sign * impulse) {
                let change = sign * model.inv_mass[i] * impulse;
                let p = &mut scratch.linear[i];
                p.velocity += change;
                if let Some(by) = scratch.pulled.get_mut(i) {
                    by[0] += way * change;
                } else {
                    p.displacement += way * change;
                    scratch.position[i] = state.position[i] + p.displacement;
                }
            }
        }
    }
    clump::turn_by_loads(model, state, scratch, way)
}

/// Adds what cohesion gave walls in the step to their impulses, with balls at `position`; returns the work that moving ones, and images of a box that
/// deforms, did by it, J.
pub(crate) fn of_driven(
    model: &Model,
    (state, position): (&State, &[DVec3]),
    walls: &Walls,
    pulls: &[(Contact, DVec3)],
    out: &mut [[DVec3; 2]],
) -> f64 {
    let mut work = 0.0;
    for (c, impulse) in pulls {
        if !c.meets_wall(model) {
            let image = walls.image_twist(model, c);
            work += image.map_or(0.0, |image| impulse.dot(image.shape));
            continue;
        }
        // Along the normal half-way, and there.
        let then = Contact { n0: c.n1, ..*c };
        let [_, lever] = walls.levers(model, &then, state, position);
        let on_wall = &mut out[model.wall(c.b).given as usize];
        on_wall[0] -= *impulse;
        on_wall[1] -= lever.arm.cross(*impulse);
        let mean = walls.mean_twist(model, c, &lever);
        work += mean.map_or(0.0, |mean| impulse.dot(mean.shape));
    }
    work
}

/// Potential energy of all pairs at a position, walls where they are now, J. The list of pairs reaches as far as cohesion does.
pub(crate) fn potential(
    model: &Model,
    state: &State,
    scratch: &Scratch,
    position: &[DVec3],
) -> Result<f64, Failure> {
    let near_by = (&scratch.walls, scratch.neighbours.pairs(), scratch.smallest);
    let found = near(model, state, near_by, position, 0.0)?;
    let work = |near: &NearPair| {
        let gap = apart(model, near.pair, near.gap);
        model.laws[near.law as usize].work_of_rupture(gap)
    };
    Ok(-found.iter().map(work).sum::<f64>())
}

/// The same where a record begins, at a time (s), where nothing has been listed.
pub(crate) fn first_potential(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    time: f64,
) -> f64 {
    let reach = model.cohesive_reach();
    if reach == 0.0 {
        return 0.0;
    }
    scratch.walls.place(model, time);
    // Too many pairs, or one without a law: the first step says so.
    listed_potential(model, state, scratch).unwrap_or(0.0)
}

/// The same between two steps, where balls may have come.
pub(crate) fn listed_potential(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
) -> Result<f64, Failure> {
    let reach = model.cohesive_reach();
    for i in 0..model.bodies() {
        scratch.need[i] = state.need(model, i, reach);
    }
    candidates::list(model, state, scratch)?;
    potential(model, state, scratch, &state.position)
}
