//! What sweeps read and write: the bodies, and the contacts of a group column by column.

use super::lanes::{Column, Lanes, GROUP};
use super::rolls::sign;
use super::vectors::part;
use super::Contact;
use prefetch_index::prefetch_index;

/// Velocity correction of a body: one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct State {
    /// Velocity, m/s, and `1/m`, 1/kg.
    pub linear: [f64; 4],
    /// Surface velocity `r w`, m/s, and `r^2/I`, 1/kg.
    pub surface: [f64; 4],
}

/// Asks memory for a line. (A slice: an array would be copied, and its copy asked for.)
#[inline(always)]
pub fn ask<T>(column: &[T]) {
    prefetch_index(column, 0);
}

/// Contacts that share no moving body, column by column. A lane without contact has zeros and both bodies 0.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct ContactLanes {
    pub a: [u32; GROUP],
    pub b: [u32; GROUP],
    /// Impulse on `a`, N s.
    pub impulse: [Column; 3],
    /// Unit normal from `b` to `a`.
    pub normal: [Column; 3],
    /// Measures at `u = 0` as a vector, m/s.
    pub slip: [Column; 3],
    pub friction: Column,
    /// Step along the normal for `-z_N` (`kernel`), and `1/w_T`, kg.
    pub step_normal: Column,
    pub mass_tangential: Column,
    /// `w_N`, 1/kg.
    pub weight: Column,
    /// Of accelerated sweeps: the step before the last sweep and the change in it together, N s.
    pub way: [Column; 3],
}

impl ContactLanes {
    /// Sides `a` and `b` of the lanes: numbers within their chunks, and states.
    #[inline]
    pub fn set_bodies(&mut self, numbers: [[u32; 2]; GROUP], states: [[&State; 2]; GROUP]) {
        let linear = states.map(|[a, b]| a.linear[3] + b.linear[3]);
        let surface = states.map(|[a, b]| a.surface[3] + b.surface[3]);
        self.a = numbers.map(|[a, _]| a);
        self.b = numbers.map(|[_, b]| b);
        self.weight = linear;
        self.mass_tangential = std::array::from_fn(|lane| inverse(linear[lane] + surface[lane]));
    }

    /// Asks memory for the numbers that every sweep reads.
    #[inline(always)]
    pub fn fetch(&self) {
        ask(&self.a);
        for k in 0..3 {
            ask(&self.impulse[k]);
            ask(&self.normal[k]);
            ask(&self.slip[k]);
        }
        ask(&self.friction);
        ask(&self.step_normal);
        ask(&self.mass_tangential);
    }

    /// Numbers of a lane, of the contact with its sides exchanged where asked for.
    pub fn set_contact(&mut self, lane: usize, contact: &Contact, swapped: bool) {
        let sign = sign(swapped);
        for k in 0..3 {
            self.normal[k][lane] = sign * contact.normal[k];
            self.slip[k][lane] = sign * contact.slip[k];
        }
        self.friction[lane] = contact.friction;
        self.step_normal[lane] = inverse(self.weight[lane]) / contact.friction.max(1.0);
    }

    /// `1/w_N` of the lanes from `at`, kg.
    #[inline(always)]
    pub fn mass_normal<S: Lanes>(&self, s: S, at: usize) -> S::f64s {
        let steps = part::<S>(&self.step_normal, at);
        let friction = part::<S>(&self.friction, at);
        let one = s.splat_f64s(1.0);
        let most = s.select_f64s(s.greater_than_f64s(friction, one), friction, one);
        s.mul_f64s(steps, most)
    }

    /// The impulse of a lane, on side `a` of its contact.
    pub fn set_impulse(&mut self, lane: usize, impulse: [f64; 3], swapped: bool) {
        let sign = sign(swapped);
        for k in 0..3 {
            self.impulse[k][lane] = sign * impulse[k];
        }
    }
}

/// 0 of 0: with the world on both sides there is no contact.
fn inverse(w: f64) -> f64 {
    if w > 0.0 {
        1.0 / w
    } else {
        0.0
    }
}

/// Where the bodies of a block are read.
pub trait Read {
    fn pair(&self, a: u32, b: u32) -> (&State, &State);
}

/// Where the bodies of a block lie: both sides in one chunk, or one side in each of two.
pub trait Bodies: Read {
    fn a(&mut self) -> &mut [State];
    fn b(&mut self) -> &mut [State];
    /// Asks memory for the bodies of a group that comes soon.
    fn fetch(&self, group: &ContactLanes);
}

pub struct One<'a>(pub &'a mut [State]);
pub struct Two<'a>(pub &'a mut [State], pub &'a mut [State]);
/// To read only: the sides may be the same.
pub struct Both<'a>(pub &'a [State], pub &'a [State]);

impl Read for Both<'_> {
    #[inline(always)]
    fn pair(&self, a: u32, b: u32) -> (&State, &State) {
        (&self.0[a as usize], &self.1[b as usize])
    }
}

impl Read for One<'_> {
    #[inline(always)]
    fn pair(&self, a: u32, b: u32) -> (&State, &State) {
        (&self.0[a as usize], &self.0[b as usize])
    }
}

#[inline(always)]
fn fetch(states: &[State], numbers: &[u32; GROUP]) {
    for &number in numbers {
        prefetch_index(states, number as usize);
    }
}

impl Bodies for One<'_> {
    #[inline(always)]
    fn fetch(&self, group: &ContactLanes) {
        fetch(self.0, &group.a);
        fetch(self.0, &group.b);
    }
    #[inline(always)]
    fn a(&mut self) -> &mut [State] {
        self.0
    }
    #[inline(always)]
    fn b(&mut self) -> &mut [State] {
        self.0
    }
}

impl Read for Two<'_> {
    #[inline(always)]
    fn pair(&self, a: u32, b: u32) -> (&State, &State) {
        (&self.0[a as usize], &self.1[b as usize])
    }
}

impl Bodies for Two<'_> {
    #[inline(always)]
    fn fetch(&self, group: &ContactLanes) {
        fetch(self.0, &group.a);
        fetch(self.1, &group.b);
    }
    #[inline(always)]
    fn a(&mut self) -> &mut [State] {
        self.0
    }
    #[inline(always)]
    fn b(&mut self) -> &mut [State] {
        self.1
    }
}
