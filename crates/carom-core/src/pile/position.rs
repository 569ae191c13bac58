//! Position sub-problem of a pile (eqs. 1c-e, 14, 21): linear problems of spheres, one after the other, each at the positions
//! that the last one led to.

use super::warm::Cursor;
use super::{chunks, problem_data, record};
use crate::contact::Contact;
use crate::islands::Island;
use crate::level::rest::Resting;
use crate::level::speeds::MANY;
use crate::level::{position_floor, Demand};
use crate::model::Model;
use crate::outcome::Level;
use crate::pile::limits::{
    budget, is_beyond, is_large, node, told, worst, COARSE_TOLERANCE, PATIENCE, WORST_CONTACT_FROM,
};
use crate::pile::memory::Pile;
use crate::pile::turning::{any_rolls, Turning};
use crate::report::StepReport;
use crate::state::{State, Warm};
use crate::stepper::generalized_alpha::Prediction;
use crate::stepper::Span;
use crate::wall::places::{proximity, Walls};
use crate::workspace::IslandScratch;
use carom_geom::Proximity;
use carom_solve::rows::WORLD;
use carom_solve::spheres::{self, Goal};
use carom_solve::team;
use glam::DVec3;

/// Most sweeps between two linearisations: where spheres are wedged the linear problem may have no solution, and the way out is
/// sideways. Too many: sweeps are spent on it in vain. Too few: momentum is lost at each, and piles take more sweeps.
const SWEEPS_PER_LINEARISATION: usize = 64;
/// The same from [`WORST_CONTACT_FROM`] contacts on: of 24, 32, 48, 64 and 128 the one with the fewest sweeps in a falling pile of 64 000.
const SWEEPS_OF_MANY: usize = 48;
/// The same in large islands that are hit, where fewer are the faster ones. Speed alone.
const SWEEPS_OF_HIT: usize = 32;
/// Overlap over the radius (1) that no pile's size excuses. Larger: deep overlaps in piles of 20 000 contacts and more, which later steps push apart.
/// Smaller: up to twice the sweeps there.
const MOST_OVERLAP: f64 = 4.5e-4;
/// Tolerance of a linear problem over that of the island (1): what it leaves and what the turning of the normals adds fit below it. At 1 each
/// linearisation ends just above the tolerance, and one more follows; near 0 sweeps are wasted on normals that will turn.
const LINEAR_SHARE: f64 = 0.8;
/// The same for the worst overlap in large islands that are hit, which linearising changes less there.
const CLOSING_SHARE: f64 = 0.95;
/// How many times (1) deeper overlaps may be in rough rounds, since the last sweeps take most of the time and pairs join anyway. At 1 hit piles
/// take twice the sweeps; too large, and the pairs that join are not those of the end.
const ROUGH_OVERLAP: f64 = 3.0;
/// Largest momentum of the sweeps (1) in large islands that are hit, once the residual is met by half: what is left are single contacts. At 1
/// they swing about their solution; far smaller, and news travel slowly through the pile. Speed alone.
const CALM_MOMENTUM: f64 = 0.8;

/// Solves one island; writes the corrections U of its bodies and `nu` and the frames of its contacts. False: not converged, or it moves
/// what was `resting`; nothing is written.
#[allow(clippy::too_many_arguments)] // the arguments of the level
pub fn solve_positions(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    demand: Demand,
    resting: Option<&Resting>,
) -> bool {
    let mut pile = std::mem::take(scratch.pile);
    let solved = solve(
        &mut pile, model, state, scratch, island, span, report, demand, resting,
    );
    *scratch.pile = pile;
    solved
}

#[allow(clippy::too_many_arguments)] // the arguments of the level, and the memory
fn solve(
    pile: &mut Pile,
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    demand: Demand,
    resting: Option<&Resting>,
) -> bool {
    let IslandScratch {
        contacts,
        position,
        linear,
        angular,
        corrections,
        solve,
        keeper,
        walls,
        ..
    } = scratch;
    let members = island.contacts;
    pile.begin(model, contacts, members, &mut solve.node_of, position);
    let node_of = &solve.node_of;
    let o = &model.options;
    let threads = pile.sweeps.threads;
    let ratio = (span.h / state.warm_step).powi(2);
    // Solved before in this step, but for contacts that have joined: only these are new.
    let again = chunks::any(threads, members.len(), |k| {
        contacts[members[k] as usize].nu[0] > 0.0
    });
    let large = is_large(members.len());
    let of_load = 0.5 * span.h * span.h / state.warm_step;
    let beyond = |w: &Warm| is_beyond(ratio * w.position, of_load * w.impulse);
    // Of a pile that is being hit everywhere it is the impact that the positions hold, not a wedge.
    let hit = large
        && !again
        && chunks::mostly(&chunks::map(threads, members.len(), |range| {
            let mut cursor = Cursor::new(&state.warm);
            let key = |m: &u32| (contacts[*m as usize].a, contacts[*m as usize].b);
            let known = members[range].iter().filter_map(|m| cursor.find(key(m)));
            known.fold([0, 0], |n, w| [n[0] + usize::from(beyond(w)), n[1] + 1])
        }));
    let begin = |cursor: &mut Cursor, m: u32| {
        let c = &contacts[m as usize];
        if again {
            return record::position(c, c.n1);
        }
        let warm = cursor.find((c.a, c.b));
        warm.map_or([DVec3::ZERO; 2], |w| {
            if !hit && beyond(w) {
                [of_load * w.impulse, of_load * w.moment]
            } else {
                [ratio * w.position, ratio * w.position_moment]
            }
        })
    };
    chunks::refill_parts(threads, &mut pile.start, members.len(), |first, part| {
        let mut cursor = Cursor::new(&state.warm);
        for (start, &m) in part.iter_mut().zip(&members[first..]) {
            *start = begin(&mut cursor, m)[0].to_array();
        }
    });
    let rolls = any_rolls(model, contacts, members);
    pile.start_moments.clear();
    if rolls {
        let mut cursor = Cursor::new(&state.warm);
        let moments = members.iter().map(|&m| begin(&mut cursor, m)[1]);
        pile.start_moments.extend(moments.map(|m| m.to_array()));
    }
    if !again {
        pile.start_sound(|i| model.mass[i] * linear[i].displacement.length());
    }
    // The step's own displacements are the measures of the sliding rows; they do not change with the correction.
    let at = Linearisation {
        threads,
        model,
        state,
        walls,
        contacts,
        members,
        node_of,
        position,
        linear,
        angular,
    };
    let slides = if pile.huge { 0 } else { members.len() };
    chunks::refill(threads, &mut pile.slides, slides, |k| {
        at.slide(&contacts[members[k] as usize]).to_array()
    });
    at.write(&pile.slides, &mut pile.contacts);
    pile.rolls.clear();
    if rolls {
        at.write_rolls(&pile.contacts, &mut pile.rolls);
    }
    // What a wave is started from moves the spheres: the first linearisation is there. (Wedges of small piles would stay.)
    let wave = large && (hit || again);
    if pile.load_sweeps().is_err() || (wave && !at.follow(pile, rolls)) {
        return false;
    }
    let share = position_floor(o, members.len());
    let smallest = pile
        .spheres
        .iter()
        .map(|&i| model.radius[i as usize])
        .fold(f64::INFINITY, f64::min);
    let tolerance = o.tolerance.max(o.pile_tolerance);
    // What goes round in circles is mostly a wedge, which parts of the step pass one side after the other: no bound is widened
    // while there are smaller parts. (Fine tolerances take thousands of sweeps as they are.)
    let (patience, most) = if span.smallest || tolerance < COARSE_TOLERANCE {
        (PATIENCE, budget(members.len()))
    } else {
        (usize::MAX, PATIENCE)
    };
    let rough = if wave && demand == Demand::Rough {
        ROUGH_OVERLAP
    } else {
        1.0
    };
    let goal = Goal {
        tolerance,
        floor: pile.mean(|i| model.mass[i] * share * model.radius[i]),
        scale: 0.0,
        closing: rough * overlap(tolerance, members.len()) * smallest,
        penalty_scale: o.penalty_scale,
        patience,
        most,
        had: 0,
        rescale: usize::MAX,
        weighed: false,
        calm: if wave { CALM_MOMENTUM } else { 1.0 },
    };
    let strict = Goal {
        tolerance: LINEAR_SHARE * goal.tolerance,
        floor: LINEAR_SHARE * goal.floor,
        closing: if wave { CLOSING_SHARE } else { LINEAR_SHARE } * goal.closing,
        ..goal
    };
    let between = if wave {
        SWEEPS_OF_HIT
    } else if members.len() as f64 >= WORST_CONTACT_FROM {
        SWEEPS_OF_MANY
    } else {
        SWEEPS_PER_LINEARISATION
    };
    let (mut sweeps, mut round) = (0, 0);
    let mut last = pile.sweeps.judge(&goal, 0);
    while sweeps < goal.most {
        round += 1;
        let linear_problem = pile.sweeps.settle(&Goal {
            most: between.min(goal.most - sweeps),
            patience: PATIENCE.saturating_sub(sweeps),
            had: sweeps,
            ..strict
        });
        sweeps += linear_problem.sweeps.max(1);
        if !at.follow(pile, rolls) {
            break;
        }
        last = pile.sweeps.judge(&goal, sweeps);
        if last.converged {
            report.fallbacks += u32::from(last.lenient);
            break;
        }
    }
    report.sweeps_position = report.sweeps_position.max(sweeps as u32);
    pile.take_solution();
    if last.converged && resting.is_some_and(|resting| pile.moves(resting)) {
        return false;
    }
    let (velocities, impulses) = (&pile.corrections, &pile.impulses);
    let moments = if rolls {
        pile.sweeps.moments()
    } else {
        Vec::new()
    };
    let moment_of = |slot: usize| moments.get(slot).map_or(DVec3::ZERO, |&m| DVec3::from(m));
    if keeper.wants(sweeps as u32) || !last.converged {
        let stated: Vec<problem_data::Stated> = members
            .iter()
            .zip(impulses.iter().zip(&pile.contacts))
            .enumerate()
            .map(|(slot, (&contact, (r, z)))| problem_data::Stated {
                turn: pile
                    .rolls
                    .get(slot)
                    .map_or(DVec3::ZERO, |r| DVec3::from(r.turn)),
                moment: moment_of(slot),
                contact,
                nodes: (z.a, z.b),
                normal: DVec3::from(z.normal),
                slip: DVec3::from(z.slip),
                impulse: DVec3::from(*r),
            })
            .collect();
        let motion: Vec<[DVec3; 2]> = pile
            .spheres
            .iter()
            .map(|&i| {
                [
                    linear[i as usize].displacement,
                    angular[i as usize].displacement,
                ]
            })
            .collect();
        let at = problem_data::ProblemPlace {
            model,
            contacts,
            spheres: &pile.spheres,
            bodies: &pile.bodies,
            level: Level::Position,
            index: 0,
            report: problem_data::report_of(sweeps as u32, last.residual, last.converged),
        };
        problem_data::keep(keeper, &at, &stated, velocities, &motion);
    }
    if !last.converged && demand != Demand::Accepted {
        return false;
    }
    report.add_position(&told(&last, round));
    report.unconverged += u32::from(!last.converged);
    for (&i, u) in pile.spheres.iter().zip(velocities) {
        corrections.set(
            i,
            [DVec3::new(u[0], u[1], u[2]), DVec3::new(u[3], u[4], u[5])],
        );
    }
    let (stated, shares) = (&pile.contacts, chunks::cut(members, contacts));
    team::map(threads, shares, |mut share| {
        for (slot, &m) in (share.first..).zip(share.list) {
            let c = share.item(m);
            let normal = DVec3::from(stated[slot].normal);
            record::set_frame(c, normal);
            (c.held, c.rested) = (false, resting.is_some());
            c.nu = record::packed(c, normal, DVec3::from(impulses[slot]), moment_of(slot));
        }
    });
    true
}

/// Overlap over the smallest radius that may be left in an island of so many contacts. Islands of up to 100 are asked for more.
pub fn overlap(tolerance: f64, contacts: usize) -> f64 {
    if contacts > MANY {
        (0.9 * worst(contacts) * tolerance).min(MOST_OVERLAP.max(1.8 * tolerance))
    } else {
        5e-3 * tolerance
    }
}

/// The measures of a contact at 0 that are those of `p` where its sides have moved by `u` against each other.
fn state(z: &mut spheres::Contact, p: &Proximity, u: DVec3, slide: DVec3) {
    let n = p.normal;
    let slip = (p.gap - n.dot(u)) * n + slide - n.dot(slide) * n;
    (z.normal, z.slip) = (n.to_array(), slip.to_array());
}

/// Position measures of an island, to be linearised.
struct Linearisation<'a> {
    threads: usize,
    model: &'a Model,
    state: &'a State,
    walls: &'a Walls,
    contacts: &'a [Contact],
    members: &'a [u32],
    node_of: &'a [u32],
    position: &'a [DVec3],
    linear: &'a [Prediction],
    angular: &'a [Prediction],
}

impl Linearisation<'_> {
    /// Contacts with gaps and normals after the smooth step.
    fn write(&self, slides: &[[f64; 3]], out: &mut Vec<spheres::Contact>) {
        chunks::refill(self.threads, out, self.members.len(), |k| {
            let c = &self.contacts[self.members[k] as usize];
            let [a, b] = [c.a, c.b].map(|body| node(self.model, self.node_of, body));
            let at = |body: u32| self.position.get(body as usize).copied();
            let [xa, xb] = [c.a, c.b].map(|body| at(body).unwrap_or_default());
            let p = proximity(self.model, self.walls, c, xa, xb);
            let mut z = spheres::Contact {
                a,
                b,
                friction: c.bounds.sliding,
                ..Default::default()
            };
            state(&mut z, &p, DVec3::ZERO, self.slide_of(slides, k));
            z
        });
    }

    /// Contacts with gaps and normals at the corrections `pile.corrections`, as measures at 0.
    fn rewrite(&self, pile: &mut Pile) {
        let Pile {
            contacts,
            slides,
            places,
            bodies,
            corrections,
            ..
        } = pile;
        let moved = |node: u32| {
            let u = corrections.get(node as usize);
            u.map_or(DVec3::ZERO, |u| DVec3::new(u[0], u[1], u[2]))
        };
        let centre = |node: u32| DVec3::from(places[node as usize]) + moved(node);
        chunks::each(self.threads, contacts, |k, z| {
            let (ua, ub) = (moved(z.a), moved(z.b));
            let p = if z.a == WORLD || z.b == WORLD {
                let c = &self.contacts[self.members[k] as usize];
                let at = |body: u32, u: DVec3| match self.position.get(body as usize) {
                    Some(x) => *x + u,
                    None => DVec3::ZERO,
                };
                proximity(self.model, self.walls, c, at(c.a, ua), at(c.b, ub))
            } else {
                let [ra, rb] = [z.a, z.b].map(|node| bodies[node as usize].radius);
                let periodic = &self.model.periodic;
                periodic.sphere_sphere(centre(z.a), ra, centre(z.b), rb)
            };
            state(z, &p, ua - ub, self.slide_of(slides, k));
        });
    }

    fn slide_of(&self, slides: &[[f64; 3]], k: usize) -> DVec3 {
        match slides.get(k) {
            Some(slide) => DVec3::from(*slide),
            None => self.slide(&self.contacts[self.members[k] as usize]),
        }
    }

    /// Linearises where the sweeps have come to. False: the problem has numbers that cannot be used.
    fn follow(&self, pile: &mut Pile, rolls: bool) -> bool {
        pile.sweeps.velocities_into(&mut pile.corrections);
        self.rewrite(pile);
        if pile.sweeps.set_contacts(&pile.contacts).is_err() {
            return false;
        }
        if rolls {
            self.write_rolls(&pile.contacts, &mut pile.rolls);
            return pile.sweeps.change_rolls(&pile.rolls).is_ok();
        }
        true
    }

    /// Rolling and spinning friction of the contacts as just written: the relative rotation over the smooth step, rolling and
    /// spinning as at t_n, in the frame of the end.
    fn write_rolls(&self, contacts: &[spheres::Contact], out: &mut Vec<spheres::Roll>) {
        out.clear();
        out.extend(self.members.iter().zip(contacts).map(|(&m, z)| {
            let c = &self.contacts[m as usize];
            let part = |body: u32| {
                let prediction = self.angular.get(body as usize);
                prediction.map_or(DVec3::ZERO, |p| p.displacement)
            };
            let (i, mut of_b) = (c.a as usize, part(c.b));
            let (from, to) = (self.state.position[i], self.position[i]);
            if let Some([_, turn]) = self.walls.displacement(self.model, c, from, to) {
                of_b = turn;
            }
            let psi = part(c.a) - of_b;
            let (n, spin) = (DVec3::from(z.normal), c.n0.dot(psi));
            let across = psi - spin * c.n0;
            let turn = across - n.dot(across) * n + spin * n;
            Turning::new(c, [DVec3::ZERO; 2]).stated(turn)
        }));
    }

    /// Tangential increment over the smooth step (eq. 37) in the plane of t_n.
    fn slide(&self, c: &Contact) -> DVec3 {
        let part = |body: u32| match self.linear.get(body as usize) {
            Some(p) => {
                let i = body as usize;
                (
                    p.displacement,
                    self.model.radius[i] * self.angular[i].displacement,
                )
            }
            None => (DVec3::ZERO, DVec3::ZERO),
        };
        let ((xa, sa), (mut xb, sb)) = (part(c.a), part(c.b));
        let i = c.a as usize;
        let (from, to) = (self.state.position[i], self.position[i]);
        if let Some([way, _]) = self.walls.displacement(self.model, c, from, to) {
            xb = way;
        }
        let d = xa - xb + c.n0.cross(sa + sb);
        d - c.n0.dot(d) * c.n0
    }
}
