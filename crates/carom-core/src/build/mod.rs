//! What is compiled into a model: its description with plain arrays, as it comes over the border.

mod clumps;
mod flow;
mod model;
mod periodic;
mod state;

use crate::clump::body::ClumpInput;
use crate::deformation::law::Deformation;
use crate::flow::{Inflow, Outlet};
use crate::force::Load;
use crate::joint::Joint;
use crate::wall::{FreeWallInput, Mesh, Shape, WallMotion};
use carom_laws::Scalar;
use glam::DVec3;
use std::sync::Arc;

/// Description with plain arrays, as it comes over the border. Shapes: N spheres, P planes, L laws.
#[derive(Clone, Debug, Default)]
pub struct ModelInput {
    pub gravity: [f64; 3],
    pub radius: Vec<f64>,
    pub mass: Vec<f64>,
    pub inertia: Vec<f64>,
    pub material: Vec<u32>,
    pub position: Vec<[f64; 3]>,
    /// Unit quaternions, w first.
    pub orientation: Vec<[f64; 4]>,
    pub velocity: Vec<[f64; 3]>,
    /// Spatial angular velocities.
    pub angular_velocity: Vec<[f64; 3]>,
    pub plane_point: Vec<[f64; 3]>,
    pub plane_normal: Vec<[f64; 3]>,
    pub plane_material: Vec<u32>,
    /// Walls behind the planes: shape and material.
    pub walls: Vec<(Shape, u32)>,
    /// Meshes behind them: the point that moments are about, m, and the material.
    pub meshes: Vec<(Arc<Mesh>, DVec3, u32)>,
    /// Motions of walls, planes counted first, meshes last.
    pub wall_motion: Vec<(u32, WallMotion)>,
    /// Planes that move freely: the first of all walls, in their order.
    pub free_walls: Vec<FreeWallInput>,
    /// Rigid bodies of balls; each ball belongs to one at most.
    pub clumps: Vec<ClumpInput>,
    /// Whether impulses on walls are recorded where no wall moves.
    pub record_walls: bool,
    /// Leave out the table of impacts.
    pub drop_impacts: bool,
    /// Piles too have a row of that table for each impact problem, not for each step alone.
    pub every_impact: bool,
    /// Impacts through springs keep their impulses over their time.
    pub courses: bool,
    /// Lengths of a periodic box, m, 0 for an axis that does not repeat, and its low corner.
    pub periodic: [f64; 3],
    pub periodic_origin: [f64; 3],
    /// How that box changes its size and shears.
    pub deformation: Option<Deformation>,
    /// Balls that come and go.
    pub inflow: Vec<Inflow>,
    pub outlet: Vec<Outlet>,
    /// Unordered pairs of materials and their law: mu, e_N, e_T, rho, delta.
    pub laws: Vec<(u32, u32, [f64; 5])>,
    /// Per law: mu as a law of the slip speed instead of the number. Empty: none.
    pub friction_law: Vec<Option<Scalar>>,
    /// The same of the normal restitution.
    pub restitution_law: Vec<Option<Scalar>>,
    /// Per law: its stiffness over that of others. Empty: 1.
    pub stiffness_ratio: Vec<f64>,
    /// Attraction in touch, N, and rupture distance, m; none given: 0.
    pub cohesion: Vec<f64>,
    pub rupture_distance: Vec<f64>,
    pub joints: Vec<Joint>,
    pub loads: Vec<Arc<dyn Load>>,
}
