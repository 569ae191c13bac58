//! Rolling and spinning friction: the moments of contacts, beside the forces that `kernel` solves, as data.
//!
//! With `s = r w` the measure of the moments is `z = s_a / r_a - s_b / r_b + turn`, a relative angular velocity, and their block of
//! `W = G M^-1 G^T` is `w_M = 1/I_a + 1/I_b` in every direction. So, given the normal impulse, the moments of one contact have the
//! closed solution
//!
//! ```text
//! x    = m - z / w_M
//! m_R+ = (x without its part along n), on the disc of radius rho r_N
//! m_S+ = (x along n), within -delta r_N .. delta r_N
//! ```
//!
//! Forces across and moments of a contact feel each other where its sides differ in `r/I` (always at walls): a sweep solves the
//! force of a contact, then its moments. Moments are vectors of the world, on `a`. A problem in which nothing rolls has no
//! [`Rolls`] and takes none of these paths.

use super::lanes::{Column, EMPTY, GROUP, SWAPPED};
use super::problem::{Body, Contact};

/// Rolling and spinning friction of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Roll {
    /// rho and delta, m.
    pub rolling: f64,
    pub spinning: f64,
    /// Relative angular velocity of `a` against `b` at `u = 0` as a vector of the world, 1/s.
    pub turn: [f64; 3],
    /// Reference length: moments over it are compared with forces, m.
    pub length: f64,
}

impl Roll {
    pub(super) fn is_good(&self) -> bool {
        let bound = |x: f64| (0.0..f64::INFINITY).contains(&x);
        bound(self.rolling)
            && bound(self.spinning)
            && self.length > 0.0
            && self.length.is_finite()
            && self.turn.iter().all(|x| x.is_finite())
    }
}

/// Moments of a group of contacts, column by column. Lanes that do not roll have bounds 0.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct Rolls {
    /// Whether any lane rolls or spins with friction.
    pub any: bool,
    /// Moment on `a`, N m s.
    pub moment: [Column; 3],
    /// Measures at `u = 0` as a vector, 1/s.
    pub turn: [Column; 3],
    pub rolling: Column,
    pub spinning: Column,
    /// `1/r` of both sides, 1/m.
    pub per_radius: [Column; 2],
    /// `1/w_M`, kg m^2, and `w_M`.
    pub inertia: Column,
    pub weight: Column,
    /// `1/length`, 1/m.
    pub per_length: Column,
    /// Of accelerated sweeps, as in [`super::bodies::ContactLanes`], N m s.
    pub way: [Column; 3],
}

impl Rolls {
    pub(super) fn new(bodies: &[Body], contacts: &[Contact], ids: &[u32; GROUP]) -> Self {
        let mut own = Self::default();
        for (lane, index, swapped) in filled(ids) {
            let mut sides = [contacts[index].a, contacts[index].b];
            if swapped {
                sides.swap(0, 1);
            }
            let mut weight = 0.0;
            for (side, body) in sides.into_iter().enumerate() {
                // No body: the world.
                if let Some(body) = bodies.get(body as usize).filter(|b| b.radius > 0.0) {
                    own.per_radius[side][lane] = 1.0 / body.radius;
                    weight += body.inv_inertia;
                }
            }
            own.weight[lane] = weight;
            own.inertia[lane] = if weight > 0.0 { 1.0 / weight } else { 0.0 };
        }
        own
    }

    pub(super) fn set(&mut self, lane: usize, roll: &Roll, swapped: bool) {
        for k in 0..3 {
            self.turn[k][lane] = sign(swapped) * roll.turn[k];
        }
        (self.rolling[lane], self.spinning[lane]) = (roll.rolling, roll.spinning);
        self.per_length[lane] = 1.0 / roll.length;
    }
}

/// Lanes with a contact: lane, contact, and whether its sides are exchanged.
pub(super) fn filled(ids: &[u32; GROUP]) -> impl Iterator<Item = (usize, usize, bool)> + '_ {
    let there = ids.iter().enumerate().filter(|(_, &id)| id != EMPTY);
    there.map(|(lane, &id)| (lane, (id & !SWAPPED) as usize, id & SWAPPED != 0))
}

/// Of a vector of a contact whose sides are exchanged.
pub(super) fn sign(swapped: bool) -> f64 {
    if swapped {
        -1.0
    } else {
        1.0
    }
}
