//! What must be saved to continue bit for bit.

use crate::level::smooth_newton::initial_accelerations;
use crate::model::{InitialState, Model};
use crate::penalty::Touch;
use glam::{DQuat, DVec3};

/// Stable key of a contact: body indices, walls after spheres.
pub type ContactKey = (u32, u32);

/// Impulse of a resting contact, kept to start the next solve (rule R8): world vectors on body A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warm {
    pub key: ContactKey,
    /// Normal and friction impulse, N s.
    pub impulse: DVec3,
    /// Rolling and spinning impulse, N m s.
    pub moment: DVec3,
    /// Position multipliers, kg m; piles alone start from them.
    pub position: DVec3,
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
    /// Contacts that are closed under method `penalty`, sorted by key.
    pub touches: Vec<Touch>,
}

impl State {
    /// State at t = 0: `a_0 = v-dot_0 = M^-1 f(q_0, v_0, 0)` without contact forces (Algorithm 1, lines 2-3).
    pub fn new(model: &Model, initial: InitialState) -> State {
        let start = vec![[model.gravity, DVec3::ZERO]; model.spheres()];
        let mut state = State {
            step: 0,
            position: initial.position,
            orientation: initial.orientation,
            velocity: initial.velocity,
            angular_velocity: initial.angular_velocity,
            pseudo: start.clone(),
            acceleration: start,
            reaction: Vec::new(),
            present: model.flow.present_at_start(model.spheres()),
            entered: vec![0; model.flow.inflows.len()],
            warm: Vec::new(),
            warm_step: model.options.step,
            touches: Vec::new(),
        };
        if !model.is_free() {
            let (accelerations, reactions) = initial_accelerations(model, &state);
            state.acceleration = accelerations;
            state.reaction = reactions.iter().map(|r| [*r, *r]).collect();
            state.pseudo.clone_from(&state.acceleration);
        }
        for i in 0..model.spheres() {
            if !state.present[i] {
                state.set_absent(i);
            }
        }
        state
    }

    /// Takes a sphere away. It stands where it stood last.
    pub(crate) fn set_absent(&mut self, i: usize) {
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
