//! Guided bodies: many contacts may share one, and sweeps settle what they have together slowest.

use super::bodies::State;
use super::lanes::{head, vector, SWAPPED};
use super::problem::{Body, Contact};
use super::rolls::sign;
use super::sweeps::Sweeps;
use glam::DVec3;

/// Sum over the contacts of a guided body of its inverse mass over that of the other side (1) from which on it counts as shared. Momentum held to 20
/// in a layer of 400 balls. Too small, piles under heavy lids lose their momentum; too large, those under light ones never converge.
const SHARED: f64 = 5.0;

/// A guided body and its contacts.
#[derive(Debug)]
pub(super) struct Guided {
    body: u32,
    along: DVec3,
    /// Numbers of the contacts, and the bodies on their other sides.
    contacts: Vec<(u32, u32)>,
    /// Whether it is light beside all that touches it.
    pub shared: bool,
}

impl Guided {
    pub fn new(bodies: &[Body], contacts: &[Contact], (body, along): (u32, [f64; 3])) -> Guided {
        let touching = |(k, c): (u32, &Contact)| match (c.a == body, c.b == body) {
            (true, _) => Some((k, c.b)),
            (_, true) => Some((k, c.a)),
            _ => None,
        };
        let contacts: Vec<(u32, u32)> = (0..).zip(contacts).filter_map(touching).collect();
        let own = bodies[body as usize].inv_mass;
        let ratio = |&(_, other): &(u32, u32)| {
            let other = bodies.get(other as usize).map_or(0.0, |b| b.inv_mass);
            if other > 0.0 {
                own / other
            } else {
                0.0
            }
        };
        let sum: f64 = contacts.iter().map(ratio).sum();
        Guided {
            body,
            along: along.into(),
            contacts,
            shared: sum > SHARED,
        }
    }

    /// State of the body, and its direction.
    pub fn place(&self, state: &[u32]) -> (usize, DVec3) {
        (state[self.body as usize] as usize, self.along)
    }
}

/// Leaves of a velocity what is along a direction.
pub(super) fn keep_along(state: &mut State, along: DVec3) {
    let kept = head(&state.linear).dot(along) * along;
    state.linear[..3].copy_from_slice(&kept.to_array());
}

impl Sweeps {
    /// Takes off what the contacts have given guided bodies across their directions. Within a sweep that stands in their states: contacts make
    /// smaller changes by it, and the last ones are 0.
    pub(super) fn guide(&mut self) {
        for guided in &self.guided_bodies {
            let (state, along) = guided.place(&self.layout.state);
            keep_along(&mut self.states[state], along);
        }
    }

    /// Adds one impulse to all contacts that press a shared body, such that the sum of their normal measures vanishes: a step that makes the
    /// quadratic function of the problem least, and that sweeps take as many to make as there are contacts.
    pub(super) fn settle_guided(&mut self) {
        let guided = std::mem::take(&mut self.guided_bodies);
        for guided in guided.iter().filter(|g| g.shared) {
            let own = self.layout.state[guided.body as usize] as usize;
            let (mut pressing, mut sum, mut inverse, mut least) =
                (Vec::new(), 0.0, 0.0, f64::INFINITY);
            for &(contact, other) in &guided.contacts {
                let (block, group, lane) = self.slots.of(contact as usize);
                let block = &self.blocks[block];
                let lanes = &block.groups[group];
                let sign = sign(block.ids[group][lane] & SWAPPED != 0);
                let n = sign * vector(&lanes.normal, lane);
                let pressure = sign * vector(&lanes.impulse, lane).dot(n);
                if pressure <= 0.0 {
                    continue;
                }
                // The normal of the contact points from B to A, one of which is guided.
                let other = self.layout.state[other as usize] as usize;
                let (a, b) = (
                    head(&self.states[other].linear),
                    head(&self.states[own].linear),
                );
                let towards = if n.dot(guided.along) > 0.0 { n } else { -n };
                sum += towards.dot(a - b) + sign * vector(&lanes.slip, lane).dot(n);
                inverse += self.states[other].linear[3];
                least = least.min(pressure);
                pressing.push((contact, other, towards));
            }
            let count = pressing.len() as f64;
            let mass = inverse + count * count * self.states[own].linear[3];
            let more = (-sum / mass).max(-least);
            if pressing.is_empty() || !more.is_finite() {
                continue;
            }
            self.norms = None;
            self.restart();
            for (contact, other, towards) in pressing {
                let (block, group, lane) = self.slots.of(contact as usize);
                let lanes = &mut self.blocks[block].groups[group];
                let n = vector(&lanes.normal, lane);
                for (column, x) in lanes.impulse.iter_mut().zip((more * n).to_array()) {
                    column[lane] += x;
                }
                for (state, push) in [(other, more * towards), (own, -more * towards)] {
                    let linear = &mut self.states[state].linear;
                    let by = linear[3] * push;
                    for (x, by) in linear.iter_mut().zip(by.to_array()) {
                        *x += by;
                    }
                }
            }
        }
        self.guided_bodies = guided;
    }
}
