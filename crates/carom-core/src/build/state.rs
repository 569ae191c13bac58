//! The state at the start of a run, and whether a saved one belongs to a model.

use crate::clump::body::Clump;
use crate::contact::ContactKey;
use crate::deformation::join_flow;
use crate::flow::Inflow;
use crate::force::total::own_acceleration;
use crate::level::smooth_newton::initial_accelerations;
use crate::model::{InitialState, Model};
use crate::outcome::ModelError;
use crate::state::{State, Touch, Warm};
use crate::wall;
use glam::{DQuat, DVec3};

/// Share (1) of a way or velocity of a free wall that may be across its normal, and its spin, rad/s: rounding. Larger: energies of what does not turn.
const ACROSS: f64 = 1e-9;

/// Share (1) of the speed of a clump by which its balls may move otherwise: rounding. Larger: a ball that is struck by itself is ignored.
const APART: f64 = 1e-9;

/// Speed over r/h (1) below which that share is of this: rounding of what rests. Larger: slow strikes are ignored.
const AT_REST: f64 = 1e-3;

/// Which bodies are there before anything has entered.
fn present_at_start(model: &Model) -> Vec<bool> {
    let mut present = vec![true; model.bodies()];
    for i in model.flow.inflows.iter().flat_map(Inflow::bodies) {
        present[i] = false;
        model.balls_of(i).for_each(|ball| present[ball] = false);
    }
    present
}

fn refuse(text: String) -> Result<(), ModelError> {
    Err(ModelError::State(text))
}

impl State {
    /// State at t = 0: `a_0 = v-dot_0 = M^-1 f(q_0, v_0, 0)` without contact forces (Algorithm 1, lines 2-3).
    pub fn new(model: &Model, initial: InitialState) -> State {
        let displaced = &initial.position[model.first_wall()..];
        let begin = |i| [own_acceleration(model, displaced, i, 0.0), DVec3::ZERO];
        let start: Vec<_> = (0..model.bodies()).map(begin).collect();
        let mut state = State {
            step: 0,
            position: initial.position,
            orientation: initial.orientation,
            velocity: initial.velocity,
            angular_velocity: initial.angular_velocity,
            pseudo: start.clone(),
            acceleration: start,
            reaction: Vec::new(),
            present: present_at_start(model),
            entered: vec![0; model.flow.inflows.len()],
            warm: Vec::new(),
            warm_step: model.options.step,
            touches: Vec::new(),
            told: Vec::new(),
            told_of: 0,
        };
        join_flow(model, &mut state);
        if !model.is_free() {
            let (accelerations, reactions) = initial_accelerations(model, &state);
            state.acceleration = accelerations;
            state.reaction = reactions.iter().map(|r| [*r, *r]).collect();
            state.pseudo.clone_from(&state.acceleration);
        }
        for i in 0..model.bodies() {
            if !state.present[i] {
                state.set_absent(i);
            }
        }
        state
    }

    /// Whether free walls are where their guides let them be.
    fn holds_free_walls(&self, model: &Model) -> bool {
        let mut walls = model.free_walls.iter().zip(model.first_wall()..);
        walls.all(|(wall, i)| {
            let across = |v: DVec3| v.reject_from_normalized(wall.normal).length();
            let along = |v: DVec3| across(v) <= ACROSS * v.length();
            let turns = self.angular_velocity[i].length() > ACROSS;
            along(self.position[i]) && along(self.velocity[i]) && !turns && self.present[i]
        })
    }

    /// Whether each clump is there with all its balls, or with none.
    fn has_whole_clumps(&self, model: &Model) -> bool {
        let whole = |(i, clump): (usize, &Clump)| {
            (clump.balls.clone()).all(|ball| self.present[ball] == self.present[i])
        };
        model.numbered_clumps().all(whole)
    }

    /// What balls of a clump would have with the motion of body `of`, itself at `from` in the frame of the clump; whether they have it, but for rounding.
    fn carried(
        &self,
        model: &Model,
        (i, clump): (usize, &Clump),
        of: usize,
        from: DVec3,
    ) -> impl Iterator<Item = (usize, [DVec3; 2], bool)> + '_ {
        let (q, v, w) = (
            self.orientation[i],
            self.velocity[of],
            self.angular_velocity[of],
        );
        let still = AT_REST / model.options.step;
        let balls = clump.balls.clone().zip(clump.offsets.clone());
        let balls: Vec<_> = balls
            .map(|(k, offset)| (k, offset, model.radius[k]))
            .collect();
        balls.into_iter().map(move |(ball, offset, radius)| {
            let swing = w.cross(q * (offset - from));
            let speed = v.length() + swing.length() + still * radius;
            let off = (self.velocity[ball] - v - swing).length() <= APART * speed;
            let turned = (self.angular_velocity[ball] - w).length() <= APART * (w.length() + still);
            (ball, [v + swing, w], off && turned)
        })
    }

    /// A clump whose balls have been struck, and not it: they do not move together, or it moves as in the state `before` and they do not.
    pub fn struck_in_parts(&self, model: &Model, before: &State) -> Option<usize> {
        let parted = |&(i, clump): &(usize, &Clump)| {
            let (first, from) = (clump.balls.start, clump.offsets[0]);
            let together = self
                .carried(model, (i, clump), first, from)
                .all(|(_, _, is)| is);
            let with_clump = self
                .carried(model, (i, clump), i, DVec3::ZERO)
                .all(|(_, _, is)| is);
            let stays = self.velocity[i] == before.velocity[i]
                && self.angular_velocity[i] == before.angular_velocity[i];
            self.present[i] && !with_clump && (stays || !together)
        };
        model.numbered_clumps().find(parted).map(|(i, _)| i)
    }

    /// Lets balls follow clumps that have been struck.
    pub fn follow_clumps(&mut self, model: &Model) {
        for (i, clump) in model.numbered_clumps() {
            let motions: Vec<_> = self.carried(model, (i, clump), i, DVec3::ZERO).collect();
            for (ball, [v, w], is) in motions {
                if self.present[i] && !is {
                    (self.velocity[ball], self.angular_velocity[ball]) = (v, w);
                }
            }
        }
    }

    /// Refuses a saved state with which a run of `model` could not go on: of another model, or with numbers that are none.
    pub fn check(&self, model: &Model) -> Result<(), ModelError> {
        let n = model.bodies();
        let lengths = [
            ("position", self.position.len()),
            ("orientation", self.orientation.len()),
            ("velocity", self.velocity.len()),
            ("angular_velocity", self.angular_velocity.len()),
            ("pseudo", self.pseudo.len()),
            ("acceleration", self.acceleration.len()),
        ];
        if let Some((name, found)) = lengths.into_iter().find(|l| l.1 != n) {
            return refuse(format!(
                "{name} is for {found} bodies, the model has {n}: balls, clumps, free walls"
            ));
        }
        if self.reaction.len() != model.joints.len() {
            return refuse(format!(
                "joint_reaction is for {} joints, the model has {}",
                self.reaction.len(),
                model.joints.len()
            ));
        }
        let inflows = &model.flow.inflows;
        let admitted = inflows.iter().zip(&self.entered);
        if self.present.len() != n
            || self.entered.len() != inflows.len()
            || admitted.into_iter().any(|(flow, &k)| k > flow.count)
        {
            return refuse("present and entered are of another model".to_owned());
        }
        if !self.has_whole_clumps(model) {
            return refuse("present has parts of a clump".to_owned());
        }
        self.check_keys(model)?;
        if !(self.told.is_empty() || self.told.len() == n) {
            return refuse("told is of another model".to_owned());
        }
        if !(self.warm_step > 0.0 && self.warm_step.is_finite()) {
            return refuse("warm_step must be finite and above 0".to_owned());
        }
        // As at the start of a run; the rest is what rounding leaves.
        let unit = |q: &&DQuat| (q.length() - 1.0).abs() <= 1e-6;
        if let Some(q) = self.orientation.iter().find(|q| !unit(q)) {
            return refuse(format!("orientation has norm {}, expected 1", q.length()));
        }
        if !self.holds_free_walls(model) {
            let text = "a free wall is away from its normal, turns, or is absent";
            return refuse(text.to_owned());
        }
        self.check_numbers()
    }

    /// Contacts that are kept are of bodies of the model, and sorted.
    fn check_keys(&self, model: &Model) -> Result<(), ModelError> {
        let bodies = model.first_wall() + model.walls.len();
        let warm: Vec<ContactKey> = self.warm.iter().map(|w| w.key).collect();
        let touches: Vec<ContactKey> = self.touches.iter().map(|t| t.key).collect();
        for (name, keys) in [("warm_key", warm), ("touch_key", touches)] {
            let known = |&(a, b): &ContactKey| {
                a < b && (a as usize) < model.balls() && (b as usize) < bodies
            };
            if !keys.iter().all(known) {
                return refuse(format!("{name} names a body that the model has not"));
            }
            if !keys.windows(2).all(|k| k[0] < k[1]) {
                return refuse(format!("{name} is not sorted"));
            }
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), ModelError> {
        let vectors = |v: &[DVec3]| v.iter().all(|x| x.is_finite());
        let pairs = |v: &[[DVec3; 2]]| vectors(v.as_flattened());
        let touch = |t: &Touch| {
            t.approach.is_finite() && t.age.is_finite() && vectors(&[t.spring, t.impulse, t.moment])
        };
        let warm = |w: &Warm| vectors(&[w.impulse, w.moment]);
        let place = |x: &DVec3| wall::place("position", *x).is_ok();
        let numbers = [
            ("position", self.position.iter().all(place)),
            ("velocity", vectors(&self.velocity)),
            ("angular_velocity", vectors(&self.angular_velocity)),
            ("pseudo", pairs(&self.pseudo)),
            ("acceleration", pairs(&self.acceleration)),
            ("joint_reaction", pairs(self.reaction.as_flattened())),
            ("warm_value", self.warm.iter().all(warm)),
            ("touch_value", self.touches.iter().all(touch)),
        ];
        match numbers.into_iter().find(|(_, finite)| !finite) {
            Some((name, _)) => refuse(format!(
                "{name} holds a number that is not finite, or too large"
            )),
            None => Ok(()),
        }
    }
}
