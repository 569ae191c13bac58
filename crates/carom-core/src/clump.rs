//! Clumps: rigid bodies of balls. `docs/theory/algorithm.md` section 15.
//!
//! A clump is a body of its own behind the balls, with the mass, and a tensor of inertia. Its balls have no mass: they meet what they
//! touch, and follow. In contact problems the clump is the node of all its balls ([`places::Clumps::rows`]). Nodes have one moment of inertia: that of a
//! clump counts its angular velocity `w` as `y`, `w = S y`, with `S^T J S` the mean moment times the unit matrix.

pub mod body;
pub mod places;

use self::body::Clump;
use crate::model::Model;
use crate::outcome::Failure;
use crate::rotation::{advance, increment};
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::method::Step;
use crate::stepper::Prediction;
use glam::{DQuat, DVec3};

/// Turn of a clump in a step (rad) from which on its balls may pass others within it: the step is divided. Larger: they do.
const TOO_FAR: f64 = 1.0;

/// The clumps that are there: number among them, body, and what it is.
fn present<'a>(
    model: &'a Model,
    state: &'a State,
) -> impl Iterator<Item = (usize, usize, &'a Clump)> {
    let all = model.numbered_clumps().enumerate();
    all.filter_map(|(number, (i, clump))| state.present[i].then_some((number, i, clump)))
}

/// The motion of clumps without contacts, once their centres have it, and of their balls: what moments of the past are to it. Fails if one turns too
/// far in the step.
pub(crate) fn predict(on: &mut Step) -> Result<(), Failure> {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    for (number, i, clump) in present(model, state) {
        let (q, w) = (state.orientation[i], state.angular_velocity[i]);
        let [pseudo, acceleration] = [state.pseudo[i][1], state.acceleration[i][1]];
        // Without loads and joints there are none, whatever a state of another version has there.
        let by_moments = match model.is_free() {
            true => Prediction::default(),
            false => (on.coefficients).predict(DVec3::ZERO, pseudo, acceleration),
        };
        scratch.clumps.at_start[number] = clump.momentum(q, w);
        scratch.clumps.by_moments[number] = by_moments;
    }
    turn_by_moments(on)
}

/// Turns clumps by the moments of the smooth step as far as they are known: freely, with the mean angular momentum of the step. (A turn by that of t_n
/// and then one by the moments is no symmetric scheme: tops gain energy.) Their balls follow.
pub(crate) fn turn_by_moments(on: &mut Step) -> Result<(), Failure> {
    let (model, state, scratch) = (on.model, &*on.state, &mut *on.scratch);
    if model.clumps.is_empty() {
        return Ok(());
    }
    for (number, i, clump) in present(model, state) {
        let (before, h) = (scratch.clumps.at_start[number], on.span.h);
        let (by, mean) = (scratch.clumps.by_moments[number], clump.mean_inertia());
        let turning = before + mean / h * by.displacement;
        let to = clump.free_turn(state.orientation[i], turning, h);
        let momentum = before + mean * by.velocity;
        let (from, end) = (state.angular_velocity[i], clump.turning(to, momentum));
        let fastest = from.length().max(end.length());
        refuse_far(model, i, clump, fastest * h)?;
        scratch.clumps.momentum[number] = momentum;
        scratch.clumps.spin_before[number] = clump.turning(to, before);
        scratch.angular[i] = Prediction {
            velocity: end,
            displacement: increment(to * state.orientation[i].inverse()),
            ..by
        };
        for ball in clump.balls.clone() {
            (scratch.linear[ball], scratch.angular[ball]) =
                (Prediction::default(), scratch.angular[i]);
        }
    }
    for i in model.balls()..model.first_wall() {
        scratch.position[i] = state.position[i] + scratch.linear[i].displacement;
    }
    place(model, state, scratch, |_| [DVec3::ZERO; 2]);
    for (_, i, clump) in present(model, state) {
        for ball in clump.balls.clone() {
            scratch.linear[ball].displacement = scratch.position[ball] - state.position[ball];
        }
        give(clump, i, scratch);
    }
    let clumps = &mut scratch.clumps;
    clumps.at_loads.clone_from(&clumps.orientation);
    clumps.moment.fill(DVec3::ZERO);
    Ok(())
}

/// Turns clumps by what loads gave their balls in the step ([`places::Clumps::push`]), of which places have the share `way` (s) of the velocities.
/// Fails if one turns too far.
pub(crate) fn turn_by_loads(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    way: f64,
) -> Result<(), Failure> {
    for (number, i, clump) in present(model, state) {
        let (moment, to) = (
            scratch.clumps.moment[number],
            scratch.clumps.orientation[number],
        );
        let [before, momentum] = scratch.clumps.momenta(number);
        scratch.angular[i].velocity = clump.turning(to, momentum);
        scratch.clumps.spin_before[number] = clump.turning(to, before);
        let turn = way * clump.turning(to, moment);
        refuse_far(
            model,
            i,
            clump,
            (scratch.angular[i].displacement + turn).length(),
        )?;
        scratch.pulled[i][1] = turn;
        let shift = scratch.pulled[i][0];
        for ball in clump.balls.clone() {
            let lever = scratch.clumps.lever[ball];
            scratch.pulled[ball] = [shift + advance(turn, DQuat::IDENTITY) * lever - lever, turn];
        }
        give(clump, i, scratch);
    }
    Ok(())
}

/// Refuses a turn in a step (rad) in which balls of a clump may pass others.
fn refuse_far(model: &Model, i: usize, clump: &Clump, turn: f64) -> Result<(), Failure> {
    if turn <= TOO_FAR {
        return Ok(());
    }
    let (ball, reach) = (clump.balls.start as u32, model.radius[i]);
    Err(Failure::TooFar {
        bodies: (ball, ball),
        travel: turn * reach,
        length: TOO_FAR * reach,
    })
}

/// Puts clumps where their centres are and turns them; `moved` are the corrections of both since the smooth step. Their balls follow.
fn place(model: &Model, state: &State, scratch: &mut Scratch, moved: impl Fn(usize) -> [DVec3; 2]) {
    for (number, i, clump) in present(model, state) {
        let turn = scratch.angular[i].displacement + moved(i)[1];
        let q = advance(turn, state.orientation[i]);
        scratch.clumps.put(clump, number, [state.orientation[i], q]);
        for ball in clump.balls.clone() {
            scratch.position[ball] = scratch.position[i] + scratch.clumps.lever[ball];
        }
    }
}

/// The same after a correction of positions, which then has what the balls were moved by.
pub(crate) fn follow(model: &Model, state: &State, scratch: &mut Scratch, of_loads: bool) {
    if model.clumps.is_empty() {
        return;
    }
    let mut shift = std::mem::take(correction(scratch, of_loads));
    place(model, state, scratch, |i| shift[i]);
    if of_loads {
        let clumps = &mut scratch.clumps;
        clumps.by_loads.clone_from(&clumps.orientation);
    }
    for (_, i, clump) in present(model, state) {
        for ball in clump.balls.clone() {
            let smooth = state.position[ball] + scratch.linear[ball].displacement;
            shift[ball] = [scratch.position[ball] - smooth, shift[i][1]];
        }
    }
    *correction(scratch, of_loads) = shift;
}

/// What loads, or corrections of positions, move bodies by.
fn correction(scratch: &mut Scratch, of_loads: bool) -> &mut Vec<[DVec3; 2]> {
    match of_loads {
        true => &mut scratch.load_shift,
        false => &mut scratch.shift,
    }
}

/// Clumps and their balls where the loads have brought them, before positions were corrected.
pub(crate) fn turn_back(model: &Model, state: &State, scratch: &mut Scratch) {
    let by_loads = std::mem::take(&mut scratch.load_shift);
    place(model, state, scratch, |i| by_loads[i]);
    scratch.load_shift = by_loads;
}

/// Velocities before impacts, of clumps that have been turned since the smooth step. While loads turn them the angular momentum stays. What corrects
/// positions takes their angular velocity along with the body: it would give them energy, or a spin that no force makes. Loads that it took back have
/// turned nothing. Where joints hold a clump they correct what is left of their own motion: its momentum stays, and impacts find the motion of t_n.
pub(crate) fn turn_velocities(model: &Model, state: &State, scratch: &mut Scratch) {
    let taken_back = match model.clumps.is_empty() {
        true => Vec::new(),
        false => taken_back(model, scratch),
    };
    for (number, i, clump) in present(model, state) {
        let [before, momentum] = scratch.clumps.momenta(number);
        let (all_loads, end) = (
            scratch.clumps.by_loads[number],
            scratch.clumps.orientation[number],
        );
        let back = clump.turning(all_loads, taken_back[number]);
        let by_loads = advance(-back, all_loads);
        let corrected = end * by_loads.inverse();
        scratch.clumps.turned_along[number] = 2.0 * corrected.xyz().length();
        let of_ends = match model.is_jointed(clump.balls.start) {
            true => [state.angular_velocity[i], clump.turning(end, momentum)],
            false => [before, momentum].map(|of| corrected * clump.turning(by_loads, of)),
        };
        [
            scratch.clumps.spin_before[number],
            scratch.angular[i].velocity,
        ] = of_ends;
        give(clump, i, scratch);
    }
}

/// What normal loads that corrections of positions took back had given clumps, N m s^2 about their centres. What presses on keeps its load: there a
/// correction of either sign is one.
fn taken_back(model: &Model, scratch: &Scratch) -> Vec<DVec3> {
    let mut moments = vec![DVec3::ZERO; model.clumps.len()];
    for c in scratch.contacts.iter().filter(|c| c.nu[0] <= 0.0) {
        let back = c.moved[0];
        for (ball, sign) in [(c.a, back), (c.b, -back)] {
            if let Some(number) = model.clump_of(ball).filter(|_| back > 0.0) {
                let lever = scratch.clumps.lever[ball as usize];
                moments[number] += lever.cross(sign * c.load_normal);
            }
        }
    }
    moments
}

/// The velocities of a clump to its balls.
fn give(clump: &Clump, i: usize, scratch: &mut Scratch) {
    let (v, w) = (scratch.linear[i].velocity, scratch.angular[i].velocity);
    for ball in clump.balls.clone() {
        scratch.linear[ball].velocity = v + w.cross(scratch.clumps.lever[ball]);
        scratch.angular[ball].velocity = w;
    }
}

/// The jumps of clumps to their balls.
pub(crate) fn give_jumps(model: &Model, scratch: &mut Scratch) {
    for (i, clump) in model.numbered_clumps() {
        let [v, w] = scratch.jump[i];
        for ball in clump.balls.clone() {
            scratch.jump[ball] = [v + w.cross(scratch.clumps.lever[ball]), w];
        }
    }
}

/// Kinetic energy of clumps beyond that of their nodes with the new velocities, J.
pub(crate) fn kinetic_beyond(model: &Model, scratch: &Scratch) -> f64 {
    let energy = |(number, (i, clump)): (usize, (usize, &Clump))| {
        clump.energy_beyond(scratch.clumps.orientation[number], scratch.jump[i][1])
    };
    model.numbered_clumps().enumerate().map(energy).sum()
}
