//! Projected Gauss-Seidel for contacts of spheres, without matrices: piles of millions.

mod kernel;
mod lanes;
mod layout;
mod team;

pub use lanes::Instructions;

use crate::rows::WORLD;
use kernel::{Group, One, Pass, State, Two};
use lanes::GROUP;
use layout::{Layout, EMPTY, SWAPPED};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Centre of a body, m.
pub type Place = [f64; 3];

/// A sphere. Both inverses 0: it is fixed, and many contacts may share it at no cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// 1/m, 1/kg.
    pub inv_mass: f64,
    /// 1/I, 1/(kg m^2).
    pub inv_inertia: f64,
    /// Lever arm of its contacts, m.
    pub radius: f64,
}

/// A contact with sliding friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Never [`WORLD`].
    pub a: u32,
    /// May be [`WORLD`].
    pub b: u32,
    /// Unit vector from `b` to `a`.
    pub normal: [f64; 3],
    /// Measures at `u = 0` as a vector in world axes, m/s: `z_N n + z_T1 t1 + z_T2 t2`.
    pub slip: [f64; 3],
    /// mu.
    pub friction: f64,
}

/// A problem in the order in which it is swept, with its impulses and velocity corrections.
pub struct Sweeps {
    layout: Layout,
    states: Vec<State>,
    groups: Vec<Group>,
    radius: Vec<f64>,
    threads: usize,
    pub instructions: Instructions,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sweeps {
    pub fn new(bodies: &[Body], contacts: &[Contact], places: Option<&[Place]>, threads: usize) -> Self {
        let fixed = |i: usize| bodies[i].inv_mass == 0.0 && bodies[i].inv_inertia == 0.0;
        let (layout, lanes) = Layout::new(bodies.len(), fixed, contacts, places, threads);
        let mut states = vec![State::default(); layout.chunks[layout.chunks.len() - 1]];
        for (body, &at) in bodies.iter().zip(&layout.state) {
            if at > 0 {
                states[at as usize].linear[3] = body.inv_mass;
                states[at as usize].surface[3] = body.radius * body.radius * body.inv_inertia;
            }
        }
        let mut groups = vec![Group::default(); lanes.len()];
        let cut = 1 + groups.len() / (16 * threads);
        team::each(threads, groups.chunks_mut(cut).zip(lanes.chunks(cut)).collect(), |(groups, lanes)| {
            for (group, lanes) in groups.iter_mut().zip(lanes) {
                for (l, lane) in lanes.iter().enumerate() {
                    if lane.contact == EMPTY {
                        continue;
                    }
                    (group.a[l], group.b[l]) = (lane.a, lane.b);
                    let c = &contacts[(lane.contact & !SWAPPED) as usize];
                    let sign = if lane.contact & SWAPPED == 0 { 1.0 } else { -1.0 };
                    let side = |body: u32| {
                        if body == WORLD {
                            return [0.0; 2];
                        }
                        let body = &bodies[body as usize];
                        [body.inv_mass, body.radius * body.radius * body.inv_inertia]
                    };
                    let (a, b) = (side(c.a), side(c.b));
                    let w_n = a[0] + b[0];
                    let w_t = w_n + (a[1] + b[1]);
                    for k in 0..3 {
                        group.normal[k][l] = sign * c.normal[k];
                        group.slip[k][l] = sign * c.slip[k];
                    }
                    group.friction[l] = c.friction;
                    group.mass_normal[l] = 1.0 / w_n;
                    group.mass_tangential[l] = 1.0 / w_t;
                }
            }
        });
        Self {
            layout,
            states,
            groups,
            radius: bodies.iter().map(|b| b.radius).collect(),
            threads,
            instructions: Instructions::default(),
        }
    }

    /// Groups, tasks, stages, lanes filled.
    pub fn shape(&self) -> [usize; 5] {
        let filled = self.layout.contact.iter().filter(|&&c| c != EMPTY).count();
        let inner = self.layout.chunks.len() - 1;
        let first = self.layout.tasks[inner - 1].groups[1] as usize * GROUP;
        let outer = self.layout.contact[first..].iter().filter(|&&c| c != EMPTY).count();
        [self.groups.len(), self.layout.tasks.len(), self.layout.stages.len() - 1, filled, outer]
    }

    /// Runs `count` sweeps.
    pub fn sweep(&mut self, count: usize) {
        let chunks: Vec<Mutex<&mut [State]>> = cut(&mut self.states, self.layout.chunks.windows(2).map(|w| w[1] - w[0]));
        let groups = cut(
            &mut self.groups,
            self.layout.tasks.iter().map(|t| (t.groups[1] - t.groups[0]) as usize),
        );
        let instructions = self.instructions;
        team::run(self.threads, count, &self.layout.stages, |index| {
            let task = &self.layout.tasks[index];
            let groups = &mut *lock(&groups[index]);
            let left = &mut *lock(&chunks[task.left as usize]);
            if task.left == task.right {
                instructions.run(Pass {
                    bodies: One(left),
                    groups,
                });
            } else {
                let right = &mut *lock(&chunks[task.right as usize]);
                instructions.run(Pass {
                    bodies: Two(left, right),
                    groups,
                });
            }
        });
    }

    /// Impulse on body `a` of each contact, N s.
    pub fn impulses(&self, impulses: &mut [[f64; 3]]) {
        for (slot, &contact) in self.layout.contact.iter().enumerate() {
            if contact == EMPTY {
                continue;
            }
            let group = &self.groups[slot / GROUP];
            let sign = if contact & SWAPPED == 0 { 1.0 } else { -1.0 };
            impulses[(contact & !SWAPPED) as usize] =
                [0, 1, 2].map(|k| sign * group.impulse[k][slot % GROUP]);
        }
    }

    /// Correction of velocity and angular velocity of each body.
    pub fn velocities(&self, velocities: &mut [[f64; 6]]) {
        for ((out, &at), &radius) in velocities.iter_mut().zip(&self.layout.state).zip(&self.radius) {
            let state = &self.states[at as usize];
            let turn = if radius > 0.0 { 1.0 / radius } else { 0.0 };
            for k in 0..3 {
                out[k] = state.linear[k];
                out[3 + k] = turn * state.surface[k];
            }
        }
    }
}

/// Cuts a slice into parts of the given lengths, each behind a lock that is never waited for.
fn cut<'a, T>(mut rest: &'a mut [T], lengths: impl Iterator<Item = usize>) -> Vec<Mutex<&'a mut [T]>> {
    lengths
        .map(|length| {
            let (part, tail) = std::mem::take(&mut rest).split_at_mut(length);
            rest = tail;
            Mutex::new(part)
        })
        .collect()
}
