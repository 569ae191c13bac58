//! Lets balls and clumps enter and leave between two steps.

use crate::energy;
use crate::flow::room::Room;
use crate::flow::{Event, Exchange, Inflow, Outlet};
use crate::force::total::{add_loads, motion_of};
use crate::model::Model;
use crate::state::State;
use crate::wall::places::{displacement, Walls};
use glam::{DQuat, DVec3};

/// Places (1) tried for a body in a step before it waits for the next: bounds the time a full region costs in each step. With
/// few, balls enter later than the rate says where there is little room.
const TRIES: u64 = 20;

/// Share (1) of a step by which a ball may enter early: times of steps and of rates are rounded. With 0 some balls enter a step
/// late; with 1 all enter a step early.
const ON_TIME: f64 = 1e-6;

/// Lets bodies leave and enter after a step, with walls where they are at its end: `at` is its number and that time, s.
pub(crate) fn exchange(
    model: &Model,
    state: &mut State,
    walls: &Walls,
    at: (u64, f64),
) -> Exchange {
    let mut exchange = Exchange::default();
    for i in 0..model.first_wall() {
        if is_out(model, state, i) {
            take_out(model, state, i, at, &mut exchange);
        }
    }
    if exchange.removed > 0 {
        let present = &state.present;
        let there = |body: u32| present.get(body as usize).is_none_or(|&p| p);
        (state.touches).retain(|t| there(t.key.0) && there(t.key.1));
    }
    let entered = admit(model, state, walls, at, &mut exchange);
    if !(entered.is_empty() || model.loads.is_empty()) {
        load(model, state, at.1, &entered);
    }
    exchange
}

/// Gives bodies that have entered at a time the accelerations that loads make: the filter of accelerations has no other past of them.
fn load(model: &Model, state: &mut State, time: f64, entered: &[usize]) {
    let mut wrench = vec![[DVec3::ZERO; 2]; model.bodies()];
    if add_loads(model, &motion_of(state, time), &mut wrench).is_err() {
        return; // the step that follows says why
    }
    for &i in entered {
        let [force, moment] = wrench[i];
        for of in [&mut state.pseudo[i], &mut state.acceleration[i]] {
            of[0] += model.inv_mass[i] * force;
            of[1] += model.inv_inertia[i] * moment;
        }
    }
}

/// Whether body `i` is where an outlet takes it.
pub fn is_out(model: &Model, state: &State, i: usize) -> bool {
    let x = state.position[i];
    let leaves = |o: &Outlet| model.periodic.in_box(x, o.low, o.high) == o.inside;
    let free = state.present[i] && !model.flow.held.get(i).is_some_and(|&held| held);
    free && model.flow.outlets.iter().any(leaves)
}

/// Takes body `i` out with its balls, where it is, in a step of this number at a time, s.
pub fn take_out(
    model: &Model,
    state: &mut State,
    i: usize,
    at: (u64, f64),
    exchange: &mut Exchange,
) {
    energy::add(&mut exchange.energy_out, energy::of_body(model, state, i));
    state.set_absent(i);
    for ball in model.balls_of(i) {
        state.set_absent(ball);
        exchange.removed += 1;
        exchange.events.push(Event::new(at, ball as u32, false));
    }
}

/// Lets bodies enter whose time has come; which ones.
fn admit(
    model: &Model,
    state: &mut State,
    walls: &Walls,
    (step, time): (u64, f64),
    exchange: &mut Exchange,
) -> Vec<usize> {
    let mut entered = Vec::new();
    let early = ON_TIME * model.options.step;
    for (index, flow) in model.flow.inflows.iter().enumerate() {
        let mut room = None;
        while state.entered[index] < flow.count {
            let number = state.entered[index];
            let wait = if flow.rate > 0.0 {
                f64::from(number) / flow.rate
            } else {
                0.0
            };
            if time < flow.start + wait - early {
                break;
            }
            let body = flow.first + number;
            let room = room.get_or_insert_with(|| Room::new(model, state, flow));
            let mut draw = Draw::new([flow.seed, u64::from(body), step]);
            let Some(place) = place(model, state, walls, room, flow, body, &mut draw) else {
                break;
            };
            let i = body as usize;
            let change = DVec3::new(draw.next(), draw.next(), draw.next());
            let velocity = flow.velocity + flow.spread * (2.0 * change - DVec3::ONE);
            for (ball, x) in balls_at(model, state, i, &place).collect::<Vec<_>>() {
                put(state, ball, x, place.turn, velocity, model.gravity);
                room.add(x, model.radius[ball]);
                exchange.entered += 1;
                exchange
                    .events
                    .push(Event::new((step, time), ball as u32, true));
            }
            if model.as_clump(body).is_some() {
                put(state, i, place.centre, place.turn, velocity, model.gravity);
            }
            state.entered[index] += 1;
            entered.push(i);
            energy::add(&mut exchange.energy_in, energy::of_body(model, state, i));
        }
    }
    entered
}

/// Where a body enters: its centre, m, and its turn from how it waits, if it is turned.
struct Place {
    centre: DVec3,
    turn: Option<DQuat>,
}

/// The balls of body `i` at a place, and their centres there, m.
fn balls_at<'a>(
    model: &'a Model,
    state: &State,
    i: usize,
    place: &Place,
) -> impl Iterator<Item = (usize, DVec3)> + 'a {
    let clump = model.as_clump(i as u32).map(|k| &model.clumps[k]);
    let (x, q) = (place.centre, state.orientation[i]);
    let q = place.turn.map_or(q, |turn| turn * q);
    let centre = move |k: usize| clump.map_or(x, |clump| x + q * clump.offsets[k]);
    let balls = model.balls_of(i).enumerate();
    balls.map(move |(k, ball)| (ball, centre(k)))
}

/// Puts a ball or a clump to `x`, turned from how it waited, with velocity `v`.
fn put(state: &mut State, i: usize, x: DVec3, turn: Option<DQuat>, v: DVec3, gravity: DVec3) {
    state.set_present(i, x, v, gravity);
    if let Some(turn) = turn {
        state.orientation[i] = (turn * state.orientation[i]).normalize();
    }
}

/// A place in the region at which no ball of the body overlaps anything, if one of the tries finds it.
fn place(
    model: &Model,
    state: &State,
    walls: &Walls,
    room: &Room,
    flow: &Inflow,
    body: u32,
    draw: &mut Draw,
) -> Option<Place> {
    let is_free = |(ball, x): (usize, DVec3)| {
        let clear = |wall| {
            let from = displacement(&state.position, wall);
            walls.meet(model, ball as u32, wall, x - from).gap >= 0.0
        };
        room.is_free(x, model.radius[ball]) && walls.listed(model).all(clear)
    };
    (0..TRIES).find_map(|_| {
        let centre = flow.region.point([draw.next(), draw.next(), draw.next()]);
        let turn = flow.turned.then(|| draw.turn());
        let place = Place { centre, turn };
        let free = balls_at(model, state, body as usize, &place).all(is_free);
        free.then_some(place)
    })
}

/// Numbers that follow from a key (splitmix64).
struct Draw(u64);

impl Draw {
    fn new(key: [u64; 3]) -> Draw {
        let mut draw = Draw(0);
        for part in key {
            draw.0 ^= part;
            draw.0 = draw.bits();
        }
        draw
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A turn, evenly distributed over all orientations (K. Shoemake, in Graphics Gems III, 1992, p. 124).
    fn turn(&mut self) -> DQuat {
        let [share, first, second] = [self.next(), self.next(), self.next()];
        let [a, b] = [first, second].map(|angle| (std::f64::consts::TAU * angle).sin_cos());
        let (s, c) = ((1.0 - share).sqrt(), share.sqrt());
        DQuat::from_xyzw(s * a.0, s * a.1, c * b.0, c * b.1)
    }
}
