//! Guided bodies: many contacts may share one, and sweeps settle what they have together slowest.

use super::bodies::State;
use super::groups::{ContactBlock, Slots};
use super::lanes::{head, vector};
use super::problem::{Body, Contact};
use glam::DVec3;

/// Sum over the contacts of a guided body of its inverse mass over that of the other side (1) from which on it counts as shared. Momentum held to 20
/// in a layer of 400 balls. Too small, piles under heavy lids lose their momentum; too large, those under light ones never converge.
const SHARED: f64 = 5.0;

/// A guided body and its contacts.
#[derive(Debug)]
pub(super) struct Guided {
    /// Number of its state.
    state: usize,
    along: DVec3,
    /// Numbers of the contacts, and the bodies on their other sides.
    contacts: Vec<(u32, u32)>,
    /// Whether it is light beside all that touches it.
    pub shared: bool,
}

impl Guided {
    /// Of the bodies of a problem, whose states have these numbers.
    pub fn new(
        bodies: &[Body],
        states: &[u32],
        contacts: &[Contact],
        (body, along): (u32, [f64; 3]),
    ) -> Guided {
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
            state: states[body as usize] as usize,
            along: along.into(),
            contacts,
            shared: sum > SHARED,
        }
    }

    /// Leaves of its velocity what is along its direction, where its state is among these, of which this is the number of the first.
    pub fn keep_along(&self, states: &mut [State], first: usize) {
        let own = self.state.checked_sub(first);
        if let Some(state) = own.and_then(|own| states.get_mut(own)) {
            let kept = head(&state.linear).dot(self.along) * self.along;
            state.linear[..3].copy_from_slice(&kept.to_array());
        }
    }
}

/// What a step of a guided body reads and changes.
pub(super) struct Parts<'a> {
    /// State of each body.
    pub state: &'a [u32],
    pub slots: &'a Slots,
    pub blocks: &'a mut [ContactBlock],
    pub states: &'a mut [State],
}

impl Guided {
    /// Adds one impulse to all contacts that press the body, such that the sum of their normal measures vanishes: a step that makes the quadratic
    /// function of the problem least, and that sweeps take as many to make as there are contacts. Whether there was any.
    pub fn settle(&self, parts: &mut Parts) -> bool {
        let own = self.state;
        let (mut pressing, mut sum, mut inverse, mut least) = (Vec::new(), 0.0, 0.0, f64::INFINITY);
        for &(contact, other) in &self.contacts {
            let (block, group, lane) = parts.slots.of(contact as usize);
            let block = &parts.blocks[block];
            let lanes = &block.groups[group];
            let n = vector(&lanes.normal, lane);
            let pressure = vector(&lanes.impulse, lane).dot(n);
            if pressure <= 0.0 {
                continue;
            }
            // The lane may have the sides of its contact exchanged: towards the other body all are alike.
            let towards = if n.dot(self.along) > 0.0 { n } else { -n };
            let other = parts.state[other as usize] as usize;
            let apart = head(&parts.states[other].linear) - head(&parts.states[own].linear);
            sum += towards.dot(apart) + vector(&lanes.slip, lane).dot(n);
            inverse += parts.states[other].linear[3];
            least = least.min(pressure);
            pressing.push((contact, other, towards));
        }
        let count = pressing.len() as f64;
        let mass = inverse + count * count * parts.states[own].linear[3];
        let more = (-sum / mass).max(-least);
        if pressing.is_empty() || !more.is_finite() {
            return false;
        }
        for (contact, other, towards) in pressing {
            let (block, group, lane) = parts.slots.of(contact as usize);
            let lanes = &mut parts.blocks[block].groups[group];
            let n = vector(&lanes.normal, lane);
            for (column, x) in lanes.impulse.iter_mut().zip((more * n).to_array()) {
                column[lane] += x;
            }
            for (state, push) in [(other, more * towards), (own, -more * towards)] {
                let linear = &mut parts.states[state].linear;
                let by = linear[3] * push;
                for (x, by) in linear.iter_mut().zip(by.to_array()) {
                    *x += by;
                }
            }
        }
        true
    }
}
