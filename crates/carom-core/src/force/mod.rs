//! Applied loads: `f(q, v, t)` of eq. 1a.
//!
//! Gravity is part of every model. Other loads implement [`Load`] and are kept in [`crate::Model::loads`]. One that
//! depends on the motion couples its bodies: it has tangents, enters the Newton matrix of the smooth sub-problem
//! (`level/smooth.rs`), and at the two correction levels its change is f^p and f^v (eqs. 3, 4; `level/coupling.rs`).

pub mod applied;
pub mod drag;
pub mod spring;
pub mod total;

use crate::clump::body::Carrier;
use crate::joint::{Block6, Pose, Twist};
use crate::outcome::Failure;
use glam::{DQuat, DVec3};
use std::error::Error;
use std::sync::Arc;

/// What a load may depend on. One entry per sphere in each array.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// s.
    pub time: f64,
    /// Centres, m.
    pub position: &'a [DVec3],
    pub orientation: &'a [DQuat],
    /// m/s.
    pub velocity: &'a [DVec3],
    /// Spatial, rad/s.
    pub angular_velocity: &'a [DVec3],
}

impl Motion<'_> {
    pub fn pose(&self, i: usize) -> Pose {
        Pose {
            position: self.position[i],
            orientation: self.orientation[i],
        }
    }

    pub fn twist(&self, i: usize) -> Twist {
        Twist {
            velocity: self.velocity[i],
            angular_velocity: self.angular_velocity[i],
        }
    }
}

/// Derivatives of force and moment on body `of` over placement and velocity of body `over`.
#[derive(Clone, Copy, Debug)]
pub struct Tangent {
    pub of: u32,
    pub over: u32,
    /// `df/dq` (translation, spatial rotation vector) and `df/dv`.
    pub position: Block6,
    pub velocity: Block6,
}

impl Tangent {
    pub fn new(of: u32, over: u32) -> Self {
        Tangent {
            of,
            over,
            position: Block6::default(),
            velocity: Block6::default(),
        }
    }
}

/// How a load hangs on the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dependence {
    /// On time only.
    Time,
    /// On placement and velocity of one sphere or two: it has tangents.
    Motion(u32, Option<u32>),
    /// On anything, without tangents: iterated in the smooth sub-problem, unchanged by contact corrections.
    Opaque,
}

/// A load on the spheres of a model.
pub trait Load: std::fmt::Debug + Send + Sync {
    fn dependence(&self) -> Dependence;

    /// The spheres it acts on; none named: any.
    fn bodies(&self) -> [Option<u32>; 2];

    /// Whether a body that it acts on stays where outlets are.
    fn holds(&self) -> bool {
        true
    }

    /// The same on the clumps that balls belong to; none where it names no ball of a clump.
    fn carried(&self, _by: &dyn Fn(u32) -> Option<Carrier>) -> Option<Arc<dyn Load>> {
        None
    }

    /// Refuses unusable numbers: quantity and what is wrong with it.
    fn check(&self) -> Result<(), (&'static str, String)>;

    /// Adds force (N) and moment (N m, spatial) on each sphere to `wrench (N)`.
    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError>;

    /// Adds its derivatives; nothing for loads that do not depend on the motion or are opaque.
    fn tangent(&self, _at: &Motion, _out: &mut Vec<Tangent>) {}

    /// Potential energy, J; 0 for loads without one.
    fn potential(&self, _at: &Motion) -> f64 {
        0.0
    }

    /// Size of the parts that its force is a difference of, N, and the rounding of that force, N: what "small" means where
    /// the resultant is small, as for a mass that hangs at rest.
    fn magnitude(&self, _at: &Motion) -> Magnitude {
        Magnitude::default()
    }

    /// Power of the part that has no potential, W.
    fn power(&self, at: &Motion) -> Result<f64, LoadError>;
}

/// See [`Load::magnitude`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Magnitude {
    pub parts: f64,
    pub rounding: f64,
}

/// A load could not be evaluated: what it said (a function of the user raised), and on which sphere it acts, if on one.
#[derive(Clone, Debug, Default)]
pub struct LoadError {
    pub text: String,
    pub body: Option<u32>,
    /// The joint whose law it was.
    pub joint: Option<u32>,
    /// The error of the user's function.
    pub source: Option<Arc<dyn Error + Send + Sync>>,
}

impl LoadError {
    pub fn on(body: u32, text: String) -> LoadError {
        LoadError {
            text,
            body: Some(body),
            ..LoadError::default()
        }
    }
}

/// Keeps what a load said that could not be evaluated.
#[inline]
pub fn evaluated<T>(
    loads: Result<T, LoadError>,
    said: &mut Option<LoadError>,
) -> Result<T, Failure> {
    loads.map_err(|error| {
        *said = Some(error);
        Failure::Load
    })
}

/// Refuses a coefficient that is not finite or negative.
pub(crate) fn coefficient(name: &'static str, value: f64) -> Result<(), (&'static str, String)> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    let text = format!("is {value}; it must be finite and not negative");
    Err((name, text))
}

/// Power of a wrench on one sphere.
pub(crate) fn wrench_power(wrench: &[DVec3; 2], twist: &Twist) -> f64 {
    wrench[0].dot(twist.velocity) + wrench[1].dot(twist.angular_velocity)
}
