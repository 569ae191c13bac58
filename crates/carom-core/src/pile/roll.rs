//! Rolling and spinning friction in a pile: what stands beside the closed contacts and their impulses where something rolls.
//!
//! Moments `m` on A act on the relative angular velocity `w_A - w_B`: across the normal at most `rho lambda_N`, along it
//! `delta lambda_N` (`docs/theory/algorithm.md`, section 2). Law does not act on them. In a pile in which nothing rolls the
//! list is empty, and nothing here costs anything.

use super::closed_contact::{ClosedContact, Frame};
use crate::contact::{turned, Contact};
use crate::pile::turning::Turning;
use crate::pile::velocities::Velocities;
use crate::rows::halves;
use carom_solve::rows::WORLD;
use carom_solve::spheres::Body;
use glam::DVec3;

/// Relative angular velocity of a contact's bodies, of A against B.
pub(super) fn relative(m: &ClosedContact, v: &[[DVec3; 2]]) -> DVec3 {
    between(m, |node| v[node as usize][1])
}

/// Change of it by corrections of the nodes.
pub(super) fn change(m: &ClosedContact, u: &[[f64; 6]]) -> DVec3 {
    between(m, |node| halves(&u[node as usize])[1])
}

fn between(m: &ClosedContact, of: impl Fn(u32) -> DVec3) -> DVec3 {
    match m.b {
        WORLD => of(m.a),
        b => of(m.a) - of(b),
    }
}

/// Work of a moment across the normal and along it, by the mean of the angular velocities before and after.
pub(super) fn work(normal: DVec3, moment: DVec3, before: DVec3, after: DVec3) -> [f64; 2] {
    let mean = 0.5 * (before + after);
    let spinning = moment.dot(normal) * mean.dot(normal);
    [moment.dot(mean) - spinning, spinning]
}

impl Velocities {
    /// Relative angular velocity of closed contact `slot` at `v_check`, and at `v_check + jump`.
    pub fn free_turn(&self, slot: u32) -> DVec3 {
        let wall = self.turning[slot as usize].walls[1];
        relative(&self.closed[slot as usize], &self.check) - wall
    }

    /// The same at `v_n`.
    pub fn turn_before(&self, slot: u32) -> DVec3 {
        let wall = self.turning[slot as usize].walls[0];
        relative(&self.closed[slot as usize], &self.old) - wall
    }

    pub fn turn(&self, slot: u32) -> DVec3 {
        self.free_turn(slot) + relative(&self.closed[slot as usize], &self.jump)
    }

    /// [`Self::turn`] as a problem has it whose impulses act in the frame of `stated`: as [`Self::state`] has the measures of forces.
    pub fn state_turn(&self, slot: u32, stated: &ClosedContact) -> DVec3 {
        let (m, turn) = (&self.closed[slot as usize], self.turn(slot));
        if stated.normal == m.normal {
            return turn;
        }
        let known = match self.known.is_empty() {
            true => DVec3::ZERO,
            false => relative(m, &self.known),
        };
        turned(turn + known, m.normal, stated.normal) - known
    }

    /// Relative angular velocity and moment of a closed contact so far; nothing where nothing rolls.
    pub fn turning_now(&self, slot: u32) -> Option<[DVec3; 2]> {
        let turning = self.turning.get(slot as usize)?;
        Some([self.turn(slot), turning.moment])
    }

    /// Work of a moment that changes the relative angular velocity by so much, in the frame of a normal.
    pub fn turning_work(&self, slot: u32, normal: DVec3, moment: DVec3, change: DVec3) -> [f64; 2] {
        let before = self.turn(slot);
        work(normal, moment, before, before + change)
    }

    /// Sum of squares of all moments so far over the reference lengths, as eq. 44 counts them.
    pub fn moments_squared(&self) -> f64 {
        let part = |t: &Turning| t.moment.length_squared() / (t.length * t.length);
        self.turning.iter().map(part).sum()
    }

    /// Takes the moments of the chosen contacts off the jump.
    pub fn drop_moments(&mut self, bodies: &[Body]) {
        for &slot in &self.chosen {
            let m = &self.closed[slot as usize];
            let moment = std::mem::take(&mut self.turning[slot as usize].moment);
            self.jump[m.a as usize][1] -= bodies[m.a as usize].inv_inertia * moment;
            if m.b != WORLD {
                self.jump[m.b as usize][1] += bodies[m.b as usize].inv_inertia * moment;
            }
        }
    }

    /// Work of all moments so far, from `v_check` to `v_check + jump`, in the frames of the problem that gave them.
    pub fn restate_turning_work(&mut self, contacts: &[Contact], frame: Frame) {
        for slot in 0..self.turning.len() {
            let (m, t) = (
                frame.state(contacts, &self.closed[slot]),
                &self.turning[slot],
            );
            let (before, after) = (self.free_turn(slot as u32), self.turn(slot as u32));
            self.turning[slot].work = work(m.normal, t.moment, before, after);
        }
    }
}
