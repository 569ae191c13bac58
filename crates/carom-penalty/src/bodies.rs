//! The moving bodies of a step by forces, planes among them.

use carom_core::wall::places::Walls;
use glam::{DQuat, DVec3};

/// The moving state of a step. Arrays of motion and inertia have an entry for each sphere and, after them, a zero for
/// each plane: a plane is a body of infinite mass at rest.
#[derive(Debug, Default)]
pub struct Bodies {
    /// (N), m.
    pub position: Vec<DVec3>,
    /// At the time of the positions.
    pub walls: Walls,
    pub orientation: Vec<DQuat>,
    /// (N + P) velocity and spatial angular velocity.
    pub motion: Vec<[DVec3; 2]>,
    pub inv_mass: Vec<f64>,
    pub inv_inertia: Vec<f64>,
    pub radius: Vec<f64>,
    /// (N + P) accelerations by gravity and loads.
    pub smooth: Vec<[DVec3; 2]>,
    /// (N + P) of the centres, with the elastic forces, m/s^2.
    pub acceleration: Vec<DVec3>,
}
