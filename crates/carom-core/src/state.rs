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
        state
    }
}
