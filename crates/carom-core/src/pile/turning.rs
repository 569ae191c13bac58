//! Moments of rolling and spinning friction at a contact of a pile.

use crate::contact::Contact;
use crate::model::Model;
use carom_solve::spheres::Roll;
use glam::DVec3;

/// Moments of a closed contact.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turning {
    /// rho, delta and the reference length, m.
    pub rolling: f64,
    pub spinning: f64,
    pub length: f64,
    /// Angular velocities of a moving wall's material at t_n and t_{n+1}.
    pub walls: [DVec3; 2],
    /// Moment on A of all problems so far, and of the loads alone.
    pub moment: DVec3,
    pub load: DVec3,
    /// Work of rolling and of spinning, J.
    pub work: [f64; 2],
    /// Moment of impacts.
    pub hit: DVec3,
}

impl Turning {
    pub fn new(c: &Contact, walls: [DVec3; 2]) -> Self {
        Self {
            rolling: c.bounds.rolling,
            spinning: c.bounds.spinning,
            length: c.length,
            walls,
            moment: DVec3::ZERO,
            load: DVec3::ZERO,
            work: [0.0; 2],
            hit: DVec3::ZERO,
        }
    }

    /// As the sweeps have it, with the relative angular velocity at `u = 0`.
    pub fn stated(&self, turn: DVec3) -> Roll {
        Roll {
            rolling: self.rolling,
            spinning: self.spinning,
            turn: turn.to_array(),
            length: self.length,
        }
    }

    /// Adds what one problem gave; `hits`: it is an impact of this contact.
    pub fn add(&mut self, moment: DVec3, work: [f64; 2], hits: bool) {
        self.moment += moment;
        self.work[0] += work[0];
        self.work[1] += work[1];
        if hits {
            self.hit += moment;
        }
    }
}

/// Whether a contact has moments.
pub(super) fn rolls(c: &Contact) -> bool {
    c.bounds.rolling > 0.0 || c.bounds.spinning > 0.0
}

/// Whether any of the `members` among the contacts has moments.
pub(super) fn any_rolls(model: &Model, contacts: &[Contact], members: &[u32]) -> bool {
    let mut laws = model.laws.iter().map(|law| law.bounds);
    laws.any(|b| b.rolling > 0.0 || b.spinning > 0.0)
        && members.iter().any(|&m| rolls(&contacts[m as usize]))
}
