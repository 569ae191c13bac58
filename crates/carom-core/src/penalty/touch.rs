//! What is kept of a contact: between steps, over a step, and what its law says.

use super::friction::damping_ratio;
use super::laws;
use crate::contact::ContactKey;
use crate::model::Model;
use carom_solve::Bounds;
use glam::DVec3;

/// What a closed contact remembers between steps: part of [`crate::State`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    pub key: ContactKey,
    /// v_in of the damping law, m/s: the largest closing speed since the contact closed. In a free collision that is the
    /// speed at which it closed; it is never 0 where the damping has work to do, and a contact at rest that is hit later
    /// answers to the speed of that hit. A contact that merely touched when a collision reached it has the v_in of that
    /// collision ([`super::pair::Pair::join`]).
    pub approach: f64,
    /// Time since it closed, s.
    pub age: f64,
    /// Elongation of the tangential spring, world vector of A against B, m.
    pub spring: DVec3,
    /// Impulses on A since it closed, N s and N m s.
    pub impulse: DVec3,
    pub moment: DVec3,
}

/// Impulses on A and work over some time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    pub impulse: DVec3,
    pub moment: DVec3,
    /// The normal part of `impulse`; its direction is the mean normal.
    pub normal_impulse: DVec3,
    /// Normal, sliding, rolling, spinning, J.
    pub work: [f64; 4],
}

impl Sum {
    pub fn add(&mut self, other: &Sum) {
        self.impulse += other.impulse;
        self.moment += other.moment;
        self.normal_impulse += other.normal_impulse;
        for (a, b) in self.work.iter_mut().zip(other.work) {
            *a += b;
        }
    }
}

/// Constants of the damping and friction of a contact law.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairLaw {
    /// chi.
    pub damping: f64,
    pub bounds: Bounds,
    /// Whether there is sliding friction, as a number or as a law of the slip speed.
    pub slides: bool,
    /// Of the tangential spring, share of critical.
    pub damping_ratio: f64,
}

impl PairLaw {
    pub fn all(model: &Model) -> Vec<PairLaw> {
        let o = &model.options;
        let law = |l: &crate::model::ContactLaw| PairLaw {
            damping: laws::damping(o.penalty_law, l.restitution, o.penalty_least_restitution),
            bounds: l.bounds,
            slides: l.bounds.sliding > 0.0 || l.friction_law.is_some(),
            damping_ratio: damping_ratio(l.tangential_restitution),
        };
        model.laws.iter().map(law).collect()
    }
}
