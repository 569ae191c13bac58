//! Which contacts close: the closing tolerance of a contact by the loads on its bodies (rule R3).

use super::tolerance;
use crate::contact::Contact;
use crate::model::Model;
use crate::options::Options;
use crate::state::State;
use crate::stepper::Span;
use crate::wall::places::Walls;
use crate::wall::WallTwist;

/// Closing speeds below this share (1) of the island's speed are rounding. Too small: touching balls that fly together have impacts in every
/// step, without end. Too large: slow impacts within a fast island keep no restitution.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Closing speed over that of the loads, and over the tolerance of the island (1), up to `closing_tolerance_load`: it stands clear of what solvers
/// leave. Too small: piles that settle solve impacts that go round and round. Too large: slow impacts keep no restitution.
const OVER_TOLERANCE: f64 = 1e5;

/// Share (1) of the closing tolerance that solvers may leave, but for the worst of very many contacts. At 1 what a solve leaves closes again, and
/// 8000 grains never came to rest (decision 011); near 0 each solve takes more sweeps.
const CLOSING_LEFT: f64 = 0.5;

/// Closing speed that a solve may leave, m/s, by the least closing tolerance of its contacts: clear of what counts as closing, and never below what
/// the tolerance of the solve can tell at the speeds there are.
pub fn closing_left(closing: f64, tolerance: f64, speed: f64) -> f64 {
    CLOSING_LEFT * closing.max(tolerance * speed)
}

/// Speeds of an island.
#[derive(Clone, Copy, Debug, Default)]
pub struct Speeds {
    /// Largest |v-check - v_n|, m/s.
    pub load: f64,
    /// The same of walls that move: what they do to what they carry.
    pub wall_load: f64,
    /// Largest |v_n| + r |w_n|, m/s.
    pub speed: f64,
    /// Largest radius, m.
    pub radius: f64,
}

impl Speeds {
    #[inline]
    pub fn add(&mut self, model: &Model, state: &State, scratch_velocity: glam::DVec3, i: usize) {
        let load = (scratch_velocity - state.velocity[i]).length();
        let speed =
            state.velocity[i].length() + model.radius[i] * state.angular_velocity[i].length();
        self.load = self.load.max(load);
        self.speed = self.speed.max(speed);
        self.radius = self.radius.max(model.radius[i]);
    }

    /// A wall that moves.
    #[inline]
    pub fn add_wall(&mut self, old: &WallTwist, new: &WallTwist) {
        let change = (new.material - old.material).length();
        self.wall_load = self.wall_load.max(change);
        self.speed = self.speed.max(old.material.length());
        self.speed = self.speed.max(new.material.length());
    }

    pub fn join(&mut self, other: &Speeds) {
        self.load = self.load.max(other.load);
        self.wall_load = self.wall_load.max(other.wall_load);
        self.speed = self.speed.max(other.speed);
        self.radius = self.radius.max(other.radius);
    }

    /// Largest speed that the island has or gets from its loads, m/s.
    pub fn largest(&self) -> f64 {
        self.speed.max(self.load).max(self.wall_load)
    }

    /// A contact closes below minus this normal velocity, m/s (rule R3), in an island of so many contacts, whose tolerance counts. `own_load`: the
    /// larger one of the changes that the loads of the step make to the velocities of its two bodies (of a moving wall: along the normal). In a
    /// moment no way is too short.
    #[inline]
    pub fn closing_tolerance(
        &self,
        o: &Options,
        span: Span,
        contacts: usize,
        own_load: f64,
    ) -> f64 {
        let share = (OVER_TOLERANCE * tolerance(o, contacts)).min(o.closing_tolerance_load);
        let by_speed = o.closing_tolerance_speed * self.largest();
        let tolerance = by_speed.max(share * own_load);
        let moves_nothing = match span.moment {
            true => 0.0,
            false => o.moves_nothing(self.radius),
        };
        tolerance.max(ROUNDING * self.speed).max(moves_nothing)
    }
}

/// Speed at which a contact opens at t_n, along its normal of then, m/s.
pub fn opening(model: &Model, state: &State, walls: &Walls, c: &Contact) -> f64 {
    let (i, j) = (c.a as usize, c.b as usize);
    let mut other = state.velocity.get(j).copied().unwrap_or_default();
    if let Some(driven) = walls.start_twist(model, c, state.position[i]) {
        other += driven.shape;
    }
    c.n0.dot(state.velocity[i] - other)
}
