//! Balls that come and go: inflows and outlets, between two steps of the run's grid.
//!
//! All balls are bodies of the model from the start; those of an inflow are absent until they enter. What an absent ball is:
//! `present` is false, it stands where it stood last at no velocity, has no pairs, no load and no energy. Nothing here has a
//! memory but [`State`]: places are drawn from the seed, the ball, the step and the number of the try.

mod room;

use crate::force;
use crate::model::Model;
use crate::model::{entry, finite, ModelError, ModelInput};
use crate::state::State;
use crate::wall::{self, Walls};
use carom_geom::tangent_frame;
use glam::DVec3;
use room::Room;

/// Places tried for a ball in a step before it waits for the next.
const TRIES: u64 = 20;
/// A ball whose time comes within this share of a step after it enters with it.
const ON_TIME: f64 = 1e-6;

/// Where the centres of balls that enter are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// Lowest and highest corner, m.
    Box { low: DVec3, high: DVec3 },
    /// Centre (m), unit normal, radius (m).
    Disc {
        centre: DVec3,
        normal: DVec3,
        radius: f64,
    },
}

/// Balls `first..first + count` enter one after the other, at most `rate` of them a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inflow {
    pub first: u32,
    pub count: u32,
    pub region: Region,
    /// Balls a second; 0: as fast as there is room.
    pub rate: f64,
    /// When the first may enter, s.
    pub start: f64,
    /// With which they enter, each component changed at random by at most `spread`, m/s.
    pub velocity: DVec3,
    pub spread: f64,
    pub seed: u64,
}

/// A box; balls whose centre is inside (or outside) leave: in a periodic world those of which an image is (or none is). Balls
/// that joints or loads of their own hold stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlet {
    pub low: DVec3,
    pub high: DVec3,
    pub inside: bool,
}

/// All inflows and outlets of a model.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    pub inflows: Vec<Inflow>,
    pub outlets: Vec<Outlet>,
    /// Which balls joints or loads of their own hold; empty without outlets.
    held: Vec<bool>,
}

/// A ball that entered or left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub step: u64,
    /// s.
    pub time: f64,
    pub body: u32,
    pub entered: bool,
}

/// What entered and left between two steps: numbers, kinetic and potential energy, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    pub entered: u32,
    pub removed: u32,
    pub energy_in: [f64; 2],
    pub energy_out: [f64; 2],
}

impl Flow {
    /// Neither inflows nor outlets: every ball is there all the time.
    pub fn is_none(&self) -> bool {
        self.inflows.is_empty() && self.outlets.is_empty()
    }

    /// Checks those of a description.
    pub(crate) fn compile(input: &ModelInput) -> Result<Flow, ModelError> {
        let n = input.radius.len();
        let mut taken = vec![false; if input.inflow.is_empty() { 0 } else { n }];
        for (index, flow) in input.inflow.iter().enumerate() {
            let refuse = |quantity, text: String| Err(entry("inflow", index, quantity, text));
            let (first, end) = (
                flow.first as usize,
                flow.first as usize + flow.count as usize,
            );
            if end > n {
                let text = format!("are {first}..{end}; there are {n} spheres");
                return refuse("bodies", text);
            }
            if taken[first..end].iter().any(|&t| t) {
                return refuse("bodies", "are those of another inflow too".to_owned());
            }
            taken[first..end].fill(true);
            let fits = match flow.region {
                Region::Box { low, high } => low.cmple(high).all(),
                Region::Disc { normal, radius, .. } => normal.is_normalized() && radius >= 0.0,
            };
            if !fits {
                let text = format!(
                    "is {:?}; it must be a box (low, high) or a disc (centre, unit normal, radius)",
                    flow.region
                );
                return refuse("region", text);
            }
            // Balls enter where balls may be from the start.
            for corner in flow.region.bounds() {
                wall::place("region", corner)
                    .map_err(|(quantity, text)| entry("inflow", index, quantity, text))?;
            }
            finite("inflow", index, "velocity", &flow.velocity.to_array())?;
            for (quantity, value) in [
                ("rate", flow.rate),
                ("start", flow.start),
                ("spread", flow.spread),
            ] {
                if !(value >= 0.0 && value.is_finite()) {
                    let text = format!("is {value}; it must be finite and not negative");
                    return refuse(quantity, text);
                }
            }
        }
        if let Some(body) = held(input).find(|&b| taken.get(b as usize) == Some(&true)) {
            let text = format!(
                "has a joint or a load of its own (sphere {body}): what enters must be free"
            );
            return Err(entry("inflow", 0, "bodies", text));
        }
        for (index, outlet) in input.outlet.iter().enumerate() {
            let fits = outlet.low.cmplt(outlet.high).all();
            if !fits || outlet.low.is_nan() || outlet.high.is_nan() {
                let text = "needs a lowest and a highest corner".to_owned();
                return Err(entry("outlet", index, "box", text));
            }
        }
        let mut stay = vec![false; if input.outlet.is_empty() { 0 } else { n }];
        for body in held(input) {
            if let Some(stays) = stay.get_mut(body as usize) {
                *stays = true;
            }
        }
        Ok(Flow {
            inflows: input.inflow.clone(),
            outlets: input.outlet.clone(),
            held: stay,
        })
    }

    /// Which balls are there before anything has entered.
    pub(crate) fn present_at_start(&self, spheres: usize) -> Vec<bool> {
        let mut present = vec![true; spheres];
        for flow in &self.inflows {
            present[flow.first as usize..][..flow.count as usize].fill(false);
        }
        present
    }
}

/// Balls with a joint or a load of their own; what is no ball may be among them.
fn held(input: &ModelInput) -> impl Iterator<Item = u32> + '_ {
    let joined = input.joints.iter().flat_map(|j| [j.a, j.b]);
    joined.chain(input.loads.iter().flat_map(|l| l.bodies()).flatten())
}

/// Lets balls leave and enter after a step, with walls where they are at its end (`time`, s).
pub(crate) fn exchange(
    model: &Model,
    state: &mut State,
    walls: &Walls,
    step: u64,
    time: f64,
    events: &mut Vec<Event>,
) -> Exchange {
    let mut exchange = Exchange::default();
    let before = events.len();
    remove(model, state, (step, time), events, &mut exchange);
    if exchange.removed > 0 {
        let present = &state.present;
        let there = |body: u32| present.get(body as usize).is_none_or(|&p| p);
        (state.touches).retain(|t| there(t.key.0) && there(t.key.1));
    }
    admit(model, state, walls, (step, time), events, &mut exchange);
    debug_assert_eq!(
        events.len() - before,
        (exchange.entered + exchange.removed) as usize
    );
    exchange
}

fn energy(model: &Model, state: &State, i: usize) -> [f64; 2] {
    let (v, w) = (state.velocity[i], state.angular_velocity[i]);
    [
        0.5 * (model.mass[i] * v.length_squared() + model.inertia[i] * w.length_squared()),
        force::weight_potential(model, i, state.position[i]),
    ]
}

fn add(sum: &mut [f64; 2], part: [f64; 2]) {
    sum[0] += part[0];
    sum[1] += part[1];
}

fn remove(
    model: &Model,
    state: &mut State,
    (step, time): (u64, f64),
    events: &mut Vec<Event>,
    exchange: &mut Exchange,
) {
    if model.flow.outlets.is_empty() {
        return;
    }
    for i in 0..model.spheres() {
        if !state.present[i] || model.flow.held[i] {
            continue;
        }
        let x = state.position[i];
        let leaves = |o: &Outlet| model.periodic.in_box(x, o.low, o.high) == o.inside;
        if !model.flow.outlets.iter().any(leaves) {
            continue;
        }
        add(&mut exchange.energy_out, energy(model, state, i));
        state.set_absent(i);
        exchange.removed += 1;
        events.push(Event {
            step,
            time,
            body: i as u32,
            entered: false,
        });
    }
}

fn admit(
    model: &Model,
    state: &mut State,
    walls: &Walls,
    (step, time): (u64, f64),
    events: &mut Vec<Event>,
    exchange: &mut Exchange,
) {
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
            let Some(x) = place(model, walls, room, flow, body, &mut draw) else {
                break;
            };
            let i = body as usize;
            let change = DVec3::new(draw.next(), draw.next(), draw.next());
            let velocity = flow.velocity + flow.spread * (2.0 * change - DVec3::ONE);
            state.set_present(i, x, velocity, model.gravity);
            state.entered[index] += 1;
            room.add(x, model.radius[i]);
            add(&mut exchange.energy_in, energy(model, state, i));
            exchange.entered += 1;
            events.push(Event {
                step,
                time,
                body,
                entered: true,
            });
        }
    }
}

/// A place in the region at which the ball overlaps nothing, if one of the tries finds it.
fn place(
    model: &Model,
    walls: &Walls,
    room: &Room,
    flow: &Inflow,
    body: u32,
    draw: &mut Draw,
) -> Option<DVec3> {
    let r = model.radius[body as usize];
    let n = model.spheres() as u32;
    let wall_ends = n + model.walls.len() as u32;
    (0..TRIES).find_map(|_| {
        let x = flow.region.point([draw.next(), draw.next(), draw.next()]);
        let free = room.is_free(x, r)
            && (n..wall_ends).all(|wall| walls.meet(model, body, wall, x).gap >= 0.0);
        free.then_some(x)
    })
}

impl Region {
    /// The point of three numbers in [0, 1): evenly distributed as they are.
    fn point(&self, [u, v, w]: [f64; 3]) -> DVec3 {
        match *self {
            Region::Box { low, high } => low + DVec3::new(u, v, w) * (high - low),
            Region::Disc {
                centre,
                normal,
                radius,
            } => {
                let (t1, t2) = tangent_frame(normal);
                let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
                centre + radius * u.sqrt() * (cos * t1 + sin * t2)
            }
        }
    }

    /// Lowest and highest corner of a box around it, m.
    fn bounds(&self) -> [DVec3; 2] {
        match *self {
            Region::Box { low, high } => [low, high],
            Region::Disc { centre, radius, .. } => {
                [centre - DVec3::splat(radius), centre + DVec3::splat(radius)]
            }
        }
    }
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
}
