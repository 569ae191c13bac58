//! What a cascade works on: contacts and spheres in a few lines of memory each, since it looks far more often than it solves.

use crate::pile::chunks;
use crate::pile::closed_contact::{ClosedContact, ProblemImpulse, FIXED};
use crate::pile::velocities::Velocities;
use carom_solve::rows::WORLD;
use carom_solve::spheres::Body;
use glam::DVec3;

/// A contact: a line of memory.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Edge {
    pub a: u32,
    pub b: u32,
    /// Place among the velocities of moving walls; behind them where none moves.
    pub driven: u32,
    /// Closing tolerance, m/s.
    pub closing: f32,
    pub normal: DVec3,
    pub friction: f64,
    pub law: u32,
    /// Impulses move B along the normal alone.
    pub guided: bool,
}

/// A sphere: a line of memory. Its spin is the surface velocity `s = r w`, so that no contact needs its lever arms.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Node {
    pub linear: DVec3,
    pub inv_mass: f64,
    pub surface: DVec3,
    /// `r^2/I`, 1/kg.
    pub inv_surface: f64,
}

impl Node {
    pub fn kinetic(&self) -> f64 {
        0.5 * (self.linear.length_squared() / self.inv_mass
            + self.surface.length_squared() / self.inv_surface)
    }
}

/// What the graph has of a sphere besides its linear velocity.
#[derive(Clone, Copy)]
pub(super) struct Sphere {
    pub surface: DVec3,
    inv_mass: f64,
    inv_surface: f64,
}

/// A contact as one of its spheres has it, so that all that a moved sphere looks at lies side by side.
#[derive(Clone, Copy, Default)]
struct NodeContact {
    /// Towards this sphere.
    normal: DVec3,
    slot: u32,
    /// Place of the other side's velocity.
    other: u32,
}

/// What the problems of a cascade gave a contact.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
struct Tally {
    impulse: DVec3,
    work: [f64; 2],
    normal_before: f64,
    scale: f64,
    /// The first problem, 0: none.
    problem: u32,
}

/// Contacts and spheres of the pile in a cascade.
#[derive(Default)]
pub(super) struct ContactGraph {
    pub edges: Vec<Edge>,
    pub ends: Vec<[u32; 2]>,
    pub spheres: Vec<Sphere>,
    /// What Newton's law takes off the velocity of a sphere for `V_minus` (eq. 27): linear, surface.
    pub shift: Vec<[DVec3; 2]>,
    /// Linear velocities of the spheres, of what rests, and of moving walls: little memory, since most looks end here.
    pub linear: Vec<DVec3>,
    tallies: Vec<Tally>,
    /// Closed contacts before the cascade, where what was added is looked at on the way.
    base: Vec<ClosedContact>,
    /// Contacts at each node, node after node, and where each node's begin.
    at_node: Vec<NodeContact>,
    starts: Vec<u32>,
    /// Velocity of body B's image against B, of contacts across a box that deforms; empty where none does.
    images: Vec<DVec3>,
    /// Problem in which a node was last moved, 0: never.
    pub touched: Vec<u32>,
}

impl ContactGraph {
    pub fn open(&mut self, velocity: &Velocities, bodies: &[Body], threads: usize) {
        let closed = &velocity.closed;
        chunks::refill(threads, &mut self.edges, closed.len(), |slot| {
            let m = &closed[slot];
            Edge {
                a: m.a,
                b: m.b,
                driven: m.driven,
                closing: m.closing as f32,
                normal: m.normal,
                friction: m.friction,
                law: m.law,
                guided: m.guided,
            }
        });
        let edges = &self.edges;
        chunks::refill(threads, &mut self.ends, edges.len(), |slot| {
            [edges[slot].a, edges[slot].b]
        });
        chunks::refill(threads, &mut self.tallies, edges.len(), |_| {
            Tally::default()
        });
        self.base.clear();
        chunks::refill(threads, &mut self.spheres, bodies.len(), |i| {
            let ([_, check], [_, jump]) = (velocity.check[i], velocity.jump[i]);
            let body = &bodies[i];
            Sphere {
                surface: body.radius * (check + jump),
                inv_mass: body.inv_mass,
                inv_surface: body.radius * body.radius * body.inv_inertia,
            }
        });
        chunks::refill(threads, &mut self.shift, bodies.len(), |i| {
            let (check, [old, offset]) =
                (&velocity.check[i], [&velocity.old[i], &velocity.offset[i]]);
            let [v, w] = [0, 1].map(|k| check[k] + offset[k] - old[k]);
            [v, bodies[i].radius * w]
        });
        chunks::refill(threads, &mut self.linear, bodies.len(), |i| {
            velocity.check[i][0] + velocity.jump[i][0]
        });
        self.linear.push(DVec3::ZERO);
        let walls = velocity.driven.iter();
        self.linear.extend(walls.map(|[_, new]| *new));
        let driven = |m: &ClosedContact| m.b != WORLD && m.driven != FIXED;
        self.images.clear();
        if closed.iter().any(driven) {
            let of = |m: &ClosedContact| match driven(m) {
                true => velocity.wall(m, 1),
                false => DVec3::ZERO,
            };
            self.images.extend(closed.iter().map(of));
        }
        self.touched.clear();
        self.touched.resize(bodies.len(), 0);
        self.list();
    }

    fn list(&mut self) {
        let nodes = self.spheres.len();
        self.starts.clear();
        self.starts.resize(nodes + 1, 0);
        for node in self.ends.iter().flatten().filter(|&&n| n != WORLD) {
            self.starts[*node as usize + 1] += 1;
        }
        for node in 0..nodes {
            self.starts[node + 1] += self.starts[node];
        }
        self.at_node.clear();
        let entries = self.starts[nodes] as usize;
        self.at_node.resize(entries, NodeContact::default());
        let walls = self.linear.len() - nodes - 1;
        let mut add = |node: u32, slot: usize, other: u32, normal: DVec3| {
            let place = &mut self.starts[node as usize];
            let slot = slot as u32;
            self.at_node[*place as usize] = NodeContact {
                normal,
                slot,
                other,
            };
            *place += 1;
        };
        for (slot, edge) in self.edges.iter().enumerate() {
            if edge.b != WORLD {
                add(edge.a, slot, edge.b, edge.normal);
                add(edge.b, slot, edge.a, -edge.normal);
            } else if (edge.driven as usize) < walls {
                add(edge.a, slot, nodes as u32 + 1 + edge.driven, edge.normal);
            } else {
                add(edge.a, slot, nodes as u32, edge.normal);
            }
        }
        for node in (1..=nodes).rev() {
            self.starts[node] = self.starts[node - 1];
        }
        self.starts[0] = 0;
    }

    #[inline]
    pub fn node(&self, node: u32) -> Node {
        let sphere = &self.spheres[node as usize];
        Node {
            linear: self.linear[node as usize],
            inv_mass: sphere.inv_mass,
            surface: sphere.surface,
            inv_surface: sphere.inv_surface,
        }
    }

    /// Marks in `closing` the contacts of `moved` spheres that close. Those between two of them are looked at twice: to know which
    /// costs more.
    pub fn mark_closing(&self, moved: &[u32], closing: &mut Slots) {
        for &node in moved {
            let own = self.linear[node as usize];
            let (from, to) = (self.starts[node as usize], self.starts[node as usize + 1]);
            for beside in &self.at_node[from as usize..to as usize] {
                let mut speed = (own - self.linear[beside.other as usize]).dot(beside.normal);
                if let Some(image) = self.images.get(beside.slot as usize) {
                    speed -= image.dot(self.edges[beside.slot as usize].normal);
                }
                let closes =
                    speed < 0.0 && speed < -f64::from(self.edges[beside.slot as usize].closing);
                closing.insert_if(closes, beside.slot);
            }
        }
    }

    /// Relative angular velocity of a contact's spheres, less that of a wall.
    pub fn turn(&self, velocity: &Velocities, bodies: &[Body], slot: u32) -> DVec3 {
        let spin = |node: u32| {
            over(
                self.spheres[node as usize].surface,
                bodies[node as usize].radius,
            )
        };
        let [a, b] = self.ends[slot as usize];
        let turn = spin(a) - velocity.turning[slot as usize].walls[1];
        if b == WORLD {
            turn
        } else {
            turn - spin(b)
        }
    }

    /// Whether a contact closed in this cascade.
    pub fn has_closed(&self, slot: u32) -> bool {
        self.tallies[slot as usize].problem != 0
    }

    /// Adds what problem `problem` gave a contact that was closing.
    pub fn add(&mut self, slot: u32, problem: u32, given: &ProblemImpulse) {
        if given.impulse == DVec3::ZERO {
            return;
        }
        let t = &mut self.tallies[slot as usize];
        if t.problem == 0 {
            (t.problem, t.normal_before, t.scale) = (problem, given.speed[0], given.scale);
        }
        t.impulse += given.impulse;
        t.work[0] += given.work[0];
        t.work[1] += given.work[1];
        t.scale = t.scale.min(given.scale);
    }

    /// [`ContactGraph::hand_over`] with more to come: in the end the closed contacts have the same bits.
    pub fn show(&mut self, velocity: &mut Velocities, bodies: &[Body]) {
        if self.base.is_empty() {
            self.base.clone_from(&velocity.closed);
        }
        self.hand_over(velocity, bodies);
    }

    /// Hands all that was added to the closed contacts, and the velocities to the jumps.
    pub fn hand_over(&mut self, velocity: &mut Velocities, bodies: &[Body]) {
        for (slot, (m, t)) in velocity.closed.iter_mut().zip(&self.tallies).enumerate() {
            if t.problem != 0 {
                if let Some(base) = self.base.get(slot) {
                    *m = *base;
                }
                m.join(t.impulse, t.work, (t.problem, t.normal_before), t.scale);
            }
        }
        for (i, sphere) in self.spheres.iter().enumerate() {
            if self.touched[i] != 0 {
                let [v, w] = velocity.check[i];
                let spin = over(sphere.surface, bodies[i].radius);
                velocity.jump[i] = [self.linear[i] - v, spin - w];
            }
        }
    }
}

/// Angular velocity of a surface velocity; a body without lever arm does not turn.
pub(super) fn over(surface: DVec3, radius: f64) -> DVec3 {
    if radius > 0.0 {
        surface / radius
    } else {
        DVec3::ZERO
    }
}

/// A set of contacts, ascending.
#[derive(Clone, Default)]
pub(super) struct Slots {
    words: Vec<u64>,
}

impl Slots {
    pub fn clear(&mut self, slots: usize) {
        self.words.clear();
        self.words.resize(slots.div_ceil(64), 0);
    }

    #[inline]
    pub fn insert_if(&mut self, belongs: bool, slot: u32) {
        self.words[slot as usize / 64] |= u64::from(belongs) << (slot % 64);
    }

    pub fn join(&mut self, other: &Slots) {
        for (x, y) in self.words.iter_mut().zip(&other.words) {
            *x |= y;
        }
    }

    /// Lists and empties it.
    pub fn drain(&mut self, list: &mut Vec<u32>) {
        list.clear();
        for (k, word) in self.words.iter_mut().enumerate() {
            let mut left = std::mem::take(word);
            while left != 0 {
                list.push(64 * k as u32 + left.trailing_zeros());
                left &= left - 1;
            }
        }
    }
}

impl ClosedContact {
    /// Adds impulses of later problems, the first of them with its normal velocity before it.
    fn join(&mut self, impulse: DVec3, work: [f64; 2], first: (u32, f64), scale: f64) {
        self.impulse += impulse;
        self.work[0] += work[0];
        self.work[1] += work[1];
        if self.problem == 0 {
            (self.problem, self.normal_before) = first;
        }
        self.hit += impulse;
        self.scale = self.scale.min(scale);
    }
}
