//! What must be saved to continue bit for bit.

use crate::contact::ContactKey;
use crate::model::Model;
use crate::transition::Mode;
use glam::{DQuat, DVec3};

/// Impulse of a resting contact, kept to start the next solve (rule R8): world vectors on body A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warm {
    pub key: ContactKey,
    /// Normal and friction impulse, N s.
    pub impulse: DVec3,
    /// Rolling and spinning impulse, N m s.
    pub moment: DVec3,
}

/// What a contact between continuous forces remembers while it is closed. Methods with impulses have none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    pub key: ContactKey,
    /// Speed at which the contact closed, to which its damping refers, m/s.
    pub approach: f64,
    /// Time since it closed, s.
    pub age: f64,
    /// Elongation of the tangential spring, world vector of A against B, m.
    pub spring: DVec3,
    /// Impulses on A since it closed, N s and N m s.
    pub impulse: DVec3,
    pub moment: DVec3,
}

impl Touch {
    /// Of a contact that closes at a speed (m/s).
    pub fn new(key: ContactKey, approach: f64) -> Touch {
        Touch {
            key,
            approach,
            age: 0.0,
            spring: DVec3::ZERO,
            impulse: DVec3::ZERO,
            moment: DVec3::ZERO,
        }
    }
}

/// The state of a run between two steps. One entry per sphere in each array.
#[derive(Clone, Debug)]
pub struct State {
    /// Steps done on the original grid.
    pub step: u64,
    pub position: Vec<DVec3>,
    pub orientation: Vec<DQuat>,
    pub velocity: Vec<DVec3>,
    /// Spatial.
    pub angular_velocity: Vec<DVec3>,
    /// Pseudo acceleration a_n (eq. 6), translation and rotation.
    pub pseudo: Vec<[DVec3; 2]>,
    /// Smooth acceleration v-dot-check_n.
    pub acceleration: Vec<[DVec3; 2]>,
    /// Smooth reaction of every joint (force and moment on sphere A) and its pseudo reaction, filtered like `pseudo`: the impulse
    /// that a joint gives in a step follows from both. Recorded only; the motion does not depend on them.
    pub reaction: Vec<[[DVec3; 2]; 2]>,
    /// Which spheres are there; see [`crate::flow`].
    pub present: Vec<bool>,
    /// How many balls of each inflow have entered.
    pub entered: Vec<u32>,
    /// Sorted by key.
    pub warm: Vec<Warm>,
    /// Step size with which `warm` was found, s.
    pub warm_step: f64,
    /// Closed contacts of a method with continuous forces, sorted by key.
    pub touches: Vec<Touch>,
    /// What method `events` has told last of each body, and of which motion ([`State::motion_hash`]); of another one it has told nothing.
    pub told: Vec<Mode>,
    pub told_of: u64,
}

impl State {
    /// A number of places and velocities, another one wherever a bit differs but for chance: below 2^53.
    pub fn motion_hash(&self) -> u64 {
        let all = [&self.position, &self.velocity, &self.angular_velocity];
        let numbers = all.into_iter().flatten().flat_map(|v| v.to_array());
        // FNV-1a, of words.
        let hash = numbers.fold(0xcbf2_9ce4_8422_2325, |hash: u64, x| {
            (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3)
        });
        (hash ^ (hash >> 29)) & ((1 << 53) - 1)
    }

    /// Takes a body away. It stands where it stood last.
    pub fn set_absent(&mut self, i: usize) {
        self.present[i] = false;
        self.velocity[i] = DVec3::ZERO;
        self.angular_velocity[i] = DVec3::ZERO;
        self.pseudo[i] = [DVec3::ZERO; 2];
        self.acceleration[i] = [DVec3::ZERO; 2];
    }

    /// Puts a sphere to `x` with velocity `v`; as at the start of a run its acceleration is that of free motion.
    pub(crate) fn set_present(&mut self, i: usize, x: DVec3, v: DVec3, gravity: DVec3) {
        self.present[i] = true;
        self.position[i] = x;
        self.velocity[i] = v;
        self.angular_velocity[i] = DVec3::ZERO;
        self.pseudo[i] = [gravity, DVec3::ZERO];
        self.acceleration[i] = [gravity, DVec3::ZERO];
    }

    /// Where a body is seen, m: nowhere while it is absent.
    pub fn seen(&self, i: usize) -> DVec3 {
        if self.present[i] {
            self.position[i]
        } else {
            DVec3::NAN
        }
    }

    /// What the neighbour list must not miss around a sphere, m; an absent one has no pairs.
    #[inline]
    pub(crate) fn need(&self, model: &Model, i: usize, need: f64) -> f64 {
        if self.present[i] {
            need
        } else {
            carom_geom::NeighbourList::absent(model.radius[i])
        }
    }
}
