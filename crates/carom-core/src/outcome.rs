//! What can go wrong, and what a step tells beside its state: refusals of a model, failures of a step, records of impacts.

use glam::DVec3;
use std::sync::Arc;
use thiserror::Error;

/// A number of the model is unusable.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ModelError {
    #[error("option {name} {text}")]
    Option { name: String, text: String },
    #[error("{quantity} of {kind} {index}: {text}")]
    Entry {
        kind: &'static str,
        index: usize,
        quantity: &'static str,
        text: String,
    },
    #[error("array {name} has {found} entries, expected {expected}")]
    Length {
        name: &'static str,
        found: usize,
        expected: usize,
    },
    #[error("the model has no spheres")]
    Empty,
    /// A saved state that is not one of this model.
    #[error("state: {0}")]
    State(String),
}

impl ModelError {
    pub fn option(name: &str, text: String) -> Self {
        ModelError::Option {
            name: name.to_owned(),
            text,
        }
    }
}

/// The entry of a model that is being checked, which refusals name: its kind, and its number among those.
#[derive(Clone, Copy)]
pub(crate) struct Entry(pub &'static str, pub usize);

impl Entry {
    /// The refusal of a quantity of it: its name, and what is wrong with it.
    pub fn refused(self, (quantity, text): (&'static str, String)) -> ModelError {
        ModelError::Entry {
            kind: self.0,
            index: self.1,
            quantity,
            text,
        }
    }

    pub fn positive(self, quantity: &'static str, value: f64) -> Result<(), ModelError> {
        // A subnormal mass has an infinite inverse.
        if value > 0.0 && value.is_finite() && (1.0 / value).is_finite() {
            return Ok(());
        }
        let text = format!("is {value}; it must be finite and above 0");
        Err(self.refused((quantity, text)))
    }

    pub fn finite(self, quantity: &'static str, values: &[f64]) -> Result<(), ModelError> {
        if values.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        let text = format!("is {values:?}; it must be finite");
        Err(self.refused((quantity, text)))
    }

    /// Refuses an orientation that is no unit quaternion.
    pub fn unit(self, q: &[f64; 4]) -> Result<(), ModelError> {
        self.finite("orientation", q)?;
        let size = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (size - 1.0).abs() > 1e-6 {
            let text = format!("has norm {size}, expected 1");
            return Err(self.refused(("orientation", text)));
        }
        Ok(())
    }
}

/// Why a step could not be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    NotConverged(Level),
    /// A velocity or position is no finite number, or grew beyond [`crate::outcome::FASTEST`].
    BlowUp(BlowUp),
    MissingLaw(u32, u32),
    /// More pairs may meet within the step than the list holds: the step is far too long for the speeds.
    TooManyPairs,
    /// The method would need more substeps than it may take.
    TooManySubsteps,
    /// More events within a step of method `events` than it may have, at last of these bodies.
    TooManyEvents(u32, u32),
    /// A pair would meet after a relative travel (m) of the radius `length` (m) of one or more.
    TooFar {
        bodies: (u32, u32),
        travel: f64,
        length: f64,
    },
    /// A load could not be evaluated.
    Load,
    /// A friction law gave `mu` at a slip speed, m/s: no coefficient.
    Friction {
        bodies: (u32, u32),
        mu: f64,
        slip: f64,
    },
    /// A law of restitution gave `e` at an approach speed, m/s: not from 0 to 1.
    Restitution {
        bodies: (u32, u32),
        e: f64,
        approach: f64,
    },
}

/// Level of a sub-problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Smooth,
    Position,
    Velocity,
    /// The velocity sub-problem of the loads, where it comes before positions ([`crate::level::loads`]).
    Loads,
}

impl Level {
    /// Place among the histories of a step.
    pub(crate) fn index(self) -> usize {
        match self {
            Level::Smooth => 0,
            Level::Position => 1,
            Level::Velocity | Level::Loads => 2,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Level::Smooth => "smooth",
            Level::Position => "position",
            Level::Velocity | Level::Loads => "velocity",
        }
    }
}

/// Speeds (m/s, rad/s) beyond which a motion has blown up: a thousand times what a scenario may begin with. At 1e150 their
/// squares leave the range of numbers, and nothing that is computed between here and there means anything.
pub(crate) const FASTEST: f64 = 1e12;

/// Where a motion left the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlowUp {
    /// Of the sub-problem.
    pub level: Level,
    /// The sphere, and the body of the contact at which it happened; the sphere itself where it touches nothing.
    pub bodies: (u32, u32),
    /// m/s; not a number or infinite where the velocity is neither.
    pub speed: f64,
}

impl BlowUp {
    /// Of a sphere that touches nothing; its speed is no number.
    pub fn alone(level: Level, body: u32) -> BlowUp {
        BlowUp {
            level,
            bodies: (body, body),
            speed: f64::NAN,
        }
    }

    /// Of a sphere of velocity `v`; the contact is the first of `touching` that it has a part in.
    pub fn of(
        level: Level,
        body: u32,
        v: DVec3,
        mut touching: impl Iterator<Item = (u32, u32)>,
    ) -> BlowUp {
        BlowUp {
            level,
            bodies: touching
                .find(|&(a, b)| a == body || b == body)
                .unwrap_or((body, body)),
            speed: v.length(),
        }
    }
}

/// Whether velocities are numbers, and of a size at which numbers still mean something.
#[inline]
pub fn within_bounds(v: DVec3, w: DVec3) -> bool {
    // Written so that what is not a number is not within.
    v.length_squared() <= FASTEST * FASTEST && w.length_squared() <= FASTEST * FASTEST
}

/// Residual history of one solve, kept for the plot of quadratic convergence.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Relative residuals of eq. 44 at each iterate, all rungs in order.
    pub values: Vec<f64>,
    pub problem: u32,
    pub contacts: u32,
}

impl History {
    pub(crate) fn clear(&mut self) {
        self.values.clear();
        (self.problem, self.contacts) = (0, 0);
    }

    /// Takes the residuals of a solve that took longer.
    pub(crate) fn keep_longest(&mut self, values: &[f64], problem: u32, contacts: usize) {
        if values.len() > self.values.len() {
            self.values.clear();
            self.values.extend_from_slice(values);
            (self.problem, self.contacts) = (problem, contacts as u32);
        }
    }
}

/// Normal impulses of a contact within an impact problem that takes a time: shares of that time (1), from 0 to 1, and impulses so far, N s.
pub type ImpulseCurve = Arc<[[f64; 2]]>;

/// One contact's share in one impact problem.
#[derive(Clone, Debug)]
pub struct ImpactRecord {
    pub problem: u32,
    pub a: u32,
    pub b: u32,
    pub status: u8,
    pub normal: DVec3,
    /// World vectors on body A, N s and N m s.
    pub impulse: DVec3,
    pub moment: DVec3,
    /// Normal relative velocity before and after the problem, m/s.
    pub normal_before: f64,
    pub separation: f64,
    pub restitution_scale: f64,
    /// Kept on demand, by laws through springs.
    pub course: Option<ImpulseCurve>,
}
