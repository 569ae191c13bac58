//! A cluster of an impact cascade: a handful of contacts, solved one after the other until all agree.

use super::contact_graph::{over, Edge, Node};
use crate::pile::turning::Turning;
use carom_solve::rows::WORLD;
use carom_solve::spheres::{Body, Goal, Norms};
use glam::DVec3;

/// Most sweeps of a cluster. Clusters of many contacts converge slowly: after this the sequence ends in one collective impact, and is counted. Too
/// few: sequences are cut; too many: a cluster without solution holds up its step.
const MOST_SWEEPS: usize = 3_000;

/// A contact of the cluster.
#[derive(Clone, Copy, Debug)]
struct Local {
    a: u32,
    b: u32,
    normal: DVec3,
    /// Impulses move B along the normal alone.
    guided: bool,
    friction: f64,
    /// 1/w_N and 1/w_T, kg.
    mass: [f64; 2],
    slip: DVec3,
    r: DVec3,
}

/// Rolling and spinning friction of a contact of the cluster.
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

/// Memory of the cluster at hand.
#[derive(Clone, Default)]
pub(super) struct ClusterSolver {
    contacts: Vec<Local>,
    /// As many as contacts, or none.
    rolls: Vec<LocalRoll>,
    /// Corrections of the nodes, at first none.
    u: Vec<Node>,
    /// Bodies of the nodes, where something rolls.
    bodies: Vec<Body>,
}

impl ClusterSolver {
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.rolls.clear();
        self.u.clear();
        self.bodies.clear();
    }

    pub fn push_node(&mut self, node: &Node) {
        self.u.push(Node {
            linear: DVec3::ZERO,
            surface: DVec3::ZERO,
            ..*node
        });
    }

    /// Adds a contact between local nodes.
    pub fn push_contact(&mut self, edge: &Edge, [a, b]: [u32; 2], slip: DVec3) {
        self.contacts.push(Local::new(edge, [a, b], &self.u, slip));
    }

    /// The bodies of the nodes in their order, where something rolls.
    pub fn push_body(&mut self, body: Body) {
        self.bodies.push(body);
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
        let of = |node: u32| {
            over(
                self.u[node as usize].surface,
                self.bodies[node as usize].radius,
            )
        };
        if c.b == WORLD {
            of(c.a)
        } else {
            of(c.a) - of(c.b)
        }
    }

    /// New measures of a contact; its impulse stays as a start.
    pub fn set_slip(&mut self, contact: usize, slip: DVec3) {
        self.contacts[contact].slip = slip;
    }

    pub fn impulse(&self, contact: usize) -> DVec3 {
        self.contacts[contact].r
    }

    /// Corrections of the nodes.
    pub fn corrections(&self) -> &[Node] {
        &self.u
    }

    /// Change of a contact's relative velocity.
    pub fn change(&self, contact: usize) -> DVec3 {
        let c = &self.contacts[contact];
        self.measure(contact) - c.slip
    }

    /// Measure of a contact with what is solved.
    #[inline]
    pub fn measure(&self, contact: usize) -> DVec3 {
        self.contacts[contact].measure(&self.u)
    }

    /// Takes all impulses away.
    pub fn begin_again(&mut self) {
        self.contacts.iter_mut().for_each(|c| c.r = DVec3::ZERO);
        self.rolls.iter_mut().for_each(|r| r.m = DVec3::ZERO);
        for u in &mut self.u {
            (u.linear, u.surface) = (DVec3::ZERO, DVec3::ZERO);
        }
    }

    /// Goes from the solution at hand towards `with` as far as the scales of the nodes say; all the way if there are none.
    pub fn mix(&mut self, with: &ClusterSolver, scales: Option<&[f64]>) {
        let scale = |node: u32| scales.map_or(1.0, |s| s[node as usize]);
        for (k, c) in self.contacts.iter_mut().enumerate() {
            let s = scale(c.a);
            c.r = c.r.lerp(with.contacts[k].r, s);
            if let Some(own) = self.rolls.get_mut(k) {
                own.m = own.m.lerp(with.rolls[k].m, s);
            }
        }
        for (node, u) in self.u.iter_mut().enumerate() {
            let (s, to) = (scale(node as u32), &with.u[node]);
            u.linear = u.linear.lerp(to.linear, s);
            u.surface = u.surface.lerp(to.surface, s);
        }
    }

    /// Solves to the goal; the relative residual and whether it was reached.
    pub fn solve(&mut self, goal: &Goal) -> (f64, bool) {
        if self.contacts.len() == 1 && !self.rolls() {
            // In closed form.
            self.sweep();
            return (0.0, self.contacts[0].r.is_finite());
        }
        let mut look = 1;
        let mut sweeps = 0;
        loop {
            while sweeps < look {
                self.sweep();
                sweeps += 1;
            }
            let given_up = sweeps >= MOST_SWEEPS;
            // What is still closing tells by itself, and sooner.
            if given_up || !self.closes(goal.closing) {
                let norms = self.norms(goal.penalty_scale);
                let residual = goal.relative(&norms);
                let reached = residual < goal.tolerance && norms.closing <= goal.closing;
                if reached || given_up || !residual.is_finite() {
                    return (residual, reached);
                }
            }
            look = (sweeps + sweeps / 2 + 1).min(MOST_SWEEPS);
        }
    }

    /// Each contact by the closed form of `carom_solve::spheres`, in order.
    fn sweep(&mut self) {
        let rolls = self.rolls();
        for k in 0..self.contacts.len() {
            let c = &mut self.contacts[k];
            let new = projected(c, c.measure(&self.u), 1.0);
            let d = new - c.r;
            if d != DVec3::ZERO {
                c.r = new;
                c.push(&mut self.u, d);
            }
            if rolls {
                self.roll(k);
            }
        }
    }

    /// Whether a contact closes faster than `most`.
    fn closes(&self, most: f64) -> bool {
        self.contacts
            .iter()
            .any(|c| -c.measure(&self.u).dot(c.normal) > most)
    }

    /// Moments of a contact at its present normal impulse.
    fn roll(&mut self, contact: usize) {
        let (c, own) = (self.contacts[contact], self.rolls[contact]);
        let z = own.turn + self.turn_change(contact);
        let normal = c.r.dot(c.normal).max(0.0);
        let new = projected_moment(&own, z, c.normal, normal, 1.0);
        let d = new - own.m;
        self.rolls[contact].m = new;
        for (node, sign) in [(c.a, 1.0), (c.b, -1.0)] {
            if node != WORLD {
                let body = &self.bodies[node as usize];
                self.u[node as usize].surface += sign * body.radius * body.inv_inertia * d;
            }
        }
    }

    fn norms(&self, penalty_scale: f64) -> Norms {
        let (mut rr, mut pp, mut ll, mut closing) = (0.0, 0.0, 0.0, 0.0f64);
        for c in &self.contacts {
            let z = c.measure(&self.u);
            let phi = projected(c, z, penalty_scale);
            rr += (phi - c.r).length_squared();
            pp += phi.length_squared();
            ll += c.r.length_squared();
            closing = closing.max(-z.dot(c.normal));
        }
        for (k, (c, own)) in self.contacts.iter().zip(&self.rolls).enumerate() {
            let normal = augmented(c, c.measure(&self.u), penalty_scale);
            let z = own.turn + self.turn_change(k);
            let phi = projected_moment(own, z, c.normal, normal, penalty_scale);
            let squared = 1.0 / (own.length * own.length);
            rr += squared * (phi - own.m).length_squared();
            pp += squared * phi.length_squared();
            ll += squared * own.m.length_squared();
        }
        let momentum: f64 = self
            .u
            .iter()
            .map(|u| {
                u.linear.length_squared() / (u.inv_mass * u.inv_mass)
                    + u.surface.length_squared() / (u.inv_surface * u.inv_surface)
            })
            .sum();
        Norms {
            residual: rr.sqrt(),
            terms: 2.0 * momentum.sqrt() + pp.sqrt() + ll.sqrt(),
            closing,
        }
    }
}

impl Local {
    /// A contact between nodes of `u`, without impulse.
    #[inline]
    fn new(edge: &Edge, [a, b]: [u32; 2], u: &[Node], slip: DVec3) -> Local {
        let of_a = &u[a as usize];
        let (mut w_n, mut w_t) = (of_a.inv_mass, of_a.inv_mass + of_a.inv_surface);
        if b != WORLD {
            let of_b = &u[b as usize];
            w_n += of_b.inv_mass;
            w_t += of_b.inv_surface + if edge.guided { 0.0 } else { of_b.inv_mass };
        }
        Local {
            a,
            b,
            normal: edge.normal,
            guided: edge.guided,
            friction: edge.friction,
            mass: [1.0 / w_n, 1.0 / w_t],
            slip,
            r: DVec3::ZERO,
        }
    }

    #[inline]
    fn measure(&self, u: &[Node]) -> DVec3 {
        let of_a = &u[self.a as usize];
        let (mut d, mut s) = (of_a.linear, of_a.surface);
        if self.b != WORLD {
            let of_b = &u[self.b as usize];
            d -= of_b.linear;
            s += of_b.surface;
        }
        d + self.normal.cross(s) + self.slip
    }

    /// Corrections of the nodes by an impulse.
    #[inline]
    fn push(&self, u: &mut [Node], d: DVec3) {
        let turn = self.normal.cross(d);
        let mut push = |node: u32, d: DVec3| {
            let u = &mut u[node as usize];
            u.linear += u.inv_mass * d;
            u.surface -= u.inv_surface * turn;
        };
        push(self.a, d);
        if self.b != WORLD {
            let along = || d.dot(self.normal) * self.normal;
            push(self.b, -if self.guided { along() } else { d });
        }
    }
}

/// `P(r - s z / w)`.
#[inline]
fn projected(c: &Local, z: DVec3, s: f64) -> DVec3 {
    let normal = augmented(c, z, s);
    let across = (c.r - s * c.mass[1] * z).reject_from_normalized(c.normal);
    normal * c.normal + across.clamp_length_max(c.friction * normal)
}

/// Normal impulse after `-s z / w`, at least 0.
#[inline]
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
