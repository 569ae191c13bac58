//! A little island of an impact cascade: a handful of contacts, solved one after the other until all agree.

use super::roll::Turning;
use super::velocity::Member;
use carom_solve::rows::WORLD;
use carom_solve::spheres::{Body, Goal, Norms};
use glam::DVec3;

/// Restitution terms of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// e_N = e_T = 0.
    Plastic,
    /// Newton's law on the velocities of t_n: the first impact problem.
    First,
    /// Newton's law on what earlier problems of the step have left (eq. 27).
    Later,
}

/// Sweeps at most. Islands of many contacts converge slowly: after this the other solvers are asked.
const MOST_SWEEPS: usize = 3_000;

/// A contact of the group.
#[derive(Clone, Copy, Debug)]
struct Local {
    a: u32,
    b: u32,
    normal: DVec3,
    arms: [f64; 2],
    friction: f64,
    /// 1/w_N and 1/w_T, kg.
    mass: [f64; 2],
    slip: DVec3,
    r: DVec3,
}

/// Rolling and spinning friction of a contact of the group.
#[derive(Clone, Copy, Debug)]
struct LocalRoll {
    /// rho, delta and the reference length, m.
    bounds: [f64; 2],
    length: f64,
    /// 1/w_M, kg m^2.
    inertia: f64,
    turn: DVec3,
    m: DVec3,
}

/// Memory of a group.
#[derive(Default)]
pub struct Group {
    contacts: Vec<Local>,
    /// As many as contacts, or none.
    rolls: Vec<LocalRoll>,
    bodies: Vec<Body>,
    u: Vec<[DVec3; 2]>,
}

impl Group {
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.rolls.clear();
        self.bodies.clear();
        self.u.clear();
    }

    /// Adds a node; returns its number.
    pub fn push_node(&mut self, body: Body) -> u32 {
        self.bodies.push(body);
        self.u.push([DVec3::ZERO; 2]);
        self.bodies.len() as u32 - 1
    }

    /// Adds a contact between local nodes.
    pub fn push_contact(&mut self, m: &Member, (a, b): (u32, u32), slip: DVec3) {
        let side = |node: u32, arm: f64| {
            if node == WORLD {
                return [0.0; 2];
            }
            let body = &self.bodies[node as usize];
            [body.inv_mass, arm * arm * body.inv_inertia]
        };
        let (wa, wb) = (side(a, m.arms[0]), side(b, m.arms[1]));
        let w_n = wa[0] + wb[0];
        let w_t = w_n + wa[1] + wb[1];
        self.contacts.push(Local {
            a,
            b,
            normal: m.normal,
            arms: m.arms,
            friction: m.friction,
            mass: [1.0 / w_n, 1.0 / w_t],
            slip,
            r: DVec3::ZERO,
        });
    }

    /// Adds rolling and spinning friction to the contact added last, with its relative angular velocity.
    pub fn push_roll(&mut self, turning: &Turning, turn: DVec3) {
        let Some(c) = self.contacts.last() else {
            return;
        };
        let side = |node: u32| match node {
            WORLD => 0.0,
            node => self.bodies[node as usize].inv_inertia,
        };
        self.rolls.push(LocalRoll {
            bounds: [turning.rolling, turning.spinning],
            length: turning.length,
            inertia: 1.0 / (side(c.a) + side(c.b)),
            turn,
            m: DVec3::ZERO,
        });
    }

    pub fn rolls(&self) -> bool {
        !self.rolls.is_empty()
    }

    pub fn moment(&self, contact: usize) -> DVec3 {
        self.rolls[contact].m
    }

    /// Change of a contact's relative angular velocity.
    pub fn turn_change(&self, contact: usize) -> DVec3 {
        let c = &self.contacts[contact];
        let of_a = self.u[c.a as usize][1];
        if c.b == WORLD {
            of_a
        } else {
            of_a - self.u[c.b as usize][1]
        }
    }

    /// New measures of a contact; its impulse stays as a start.
    pub fn set_slip(&mut self, contact: usize, slip: DVec3) {
        self.contacts[contact].slip = slip;
    }

    pub fn impulse(&self, contact: usize) -> DVec3 {
        self.contacts[contact].r
    }

    /// Correction of a node.
    pub fn correction(&self, node: u32) -> [DVec3; 2] {
        self.u[node as usize]
    }

    /// Change of a contact's relative velocity.
    pub fn change(&self, contact: usize) -> DVec3 {
        let c = &self.contacts[contact];
        self.measure(c) - c.slip
    }

    fn measure(&self, c: &Local) -> DVec3 {
        let [mut d, wa] = self.u[c.a as usize];
        let mut spin = c.arms[0] * wa;
        if c.b != WORLD {
            let [v, w] = self.u[c.b as usize];
            d -= v;
            spin += c.arms[1] * w;
        }
        d + c.normal.cross(spin) + c.slip
    }

    /// Solves to the goal; the sweeps, the relative residual and whether it was reached.
    pub fn solve(&mut self, goal: &Goal) -> (usize, f64, bool) {
        if self.contacts.len() == 1 && !self.rolls() {
            // In closed form.
            self.sweep();
            return (1, 0.0, self.contacts[0].r.is_finite());
        }
        let mut look = 1;
        let mut sweeps = 0;
        loop {
            while sweeps < look {
                self.sweep();
                sweeps += 1;
            }
            let norms = self.norms(goal.penalty_scale);
            let residual = goal.relative(&norms);
            let reached = residual < goal.tolerance && norms.closing <= goal.closing;
            if reached || sweeps >= MOST_SWEEPS || !residual.is_finite() {
                return (sweeps, residual, reached);
            }
            look = (sweeps + sweeps / 2 + 1).min(MOST_SWEEPS);
        }
    }

    /// Each contact by the closed form of `carom_solve::spheres`, in order.
    fn sweep(&mut self) {
        for k in 0..self.contacts.len() {
            let c = self.contacts[k];
            let new = projected(&c, self.measure(&c), 1.0);
            let d = new - c.r;
            if d != DVec3::ZERO {
                self.contacts[k].r = new;
                self.push(&c, d);
            }
            if !self.rolls.is_empty() {
                self.roll(k);
            }
        }
    }

    fn push(&mut self, c: &Local, d: DVec3) {
        let turn = c.normal.cross(d);
        let mut add = |node: u32, sign: f64, arm: f64| {
            let body = &self.bodies[node as usize];
            let u = &mut self.u[node as usize];
            u[0] += sign * body.inv_mass * d;
            u[1] -= body.inv_inertia * arm * turn;
        };
        add(c.a, 1.0, c.arms[0]);
        if c.b != WORLD {
            add(c.b, -1.0, c.arms[1]);
        }
    }

    /// Moments of a contact at its present normal impulse.
    fn roll(&mut self, contact: usize) {
        let (c, own) = (self.contacts[contact], self.rolls[contact]);
        let z = own.turn + self.turn_change(contact);
        let normal = c.r.dot(c.normal).max(0.0);
        let new = projected_moment(&own, z, c.normal, normal, 1.0);
        let d = new - own.m;
        self.rolls[contact].m = new;
        self.u[c.a as usize][1] += self.bodies[c.a as usize].inv_inertia * d;
        if c.b != WORLD {
            self.u[c.b as usize][1] -= self.bodies[c.b as usize].inv_inertia * d;
        }
    }

    fn norms(&self, penalty_scale: f64) -> Norms {
        let (mut rr, mut pp, mut ll, mut closing) = (0.0, 0.0, 0.0, 0.0f64);
        for c in &self.contacts {
            let z = self.measure(c);
            let phi = projected(c, z, penalty_scale);
            rr += (phi - c.r).length_squared();
            pp += phi.length_squared();
            ll += c.r.length_squared();
            closing = closing.max(-z.dot(c.normal));
        }
        for (k, (c, own)) in self.contacts.iter().zip(&self.rolls).enumerate() {
            let normal = augmented(c, self.measure(c), penalty_scale);
            let z = own.turn + self.turn_change(k);
            let phi = projected_moment(own, z, c.normal, normal, penalty_scale);
            let squared = 1.0 / (own.length * own.length);
            rr += squared * (phi - own.m).length_squared();
            pp += squared * phi.length_squared();
            ll += squared * own.m.length_squared();
        }
        let momentum: f64 = self
            .bodies
            .iter()
            .zip(&self.u)
            .map(|(body, u)| {
                let turn = u[1].length() / (body.inv_inertia * body.radius);
                u[0].length_squared() / (body.inv_mass * body.inv_mass) + turn * turn
            })
            .sum();
        Norms {
            residual: rr.sqrt(),
            terms: 2.0 * momentum.sqrt() + pp.sqrt() + ll.sqrt(),
            closing,
        }
    }
}

/// `P(r - s z / w)`.
fn projected(c: &Local, z: DVec3, s: f64) -> DVec3 {
    let normal = augmented(c, z, s);
    let across = (c.r - s * c.mass[1] * z).reject_from_normalized(c.normal);
    normal * c.normal + across.clamp_length_max(c.friction * normal)
}

/// Normal impulse after `-s z / w`, at least 0.
fn augmented(c: &Local, z: DVec3, s: f64) -> f64 {
    (c.r.dot(c.normal) - s * c.mass[0] * z.dot(c.normal)).max(0.0)
}

/// `P(m - s z / w_M)`: across on the disc of rolling, along in the interval of spinning.
fn projected_moment(own: &LocalRoll, z: DVec3, n: DVec3, normal: f64, s: f64) -> DVec3 {
    let [rolling, spinning] = own.bounds.map(|bound| bound * normal);
    let x = own.m - s * own.inertia * z;
    let along = x.dot(n);
    (x - along * n).clamp_length_max(rolling) + along.min(spinning).max(-spinning) * n
}
