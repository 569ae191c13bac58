//! What is simulated: compiled, immutable, arrays and integer ids.

use crate::clump::body::Clump;
use crate::deformation::law::Deformation;
use crate::flow::Flow;
use crate::force::Load;
use crate::held_apart::HeldApart;
use crate::joint::Joint;
use crate::options::Options;
use crate::outcome::Failure;
use crate::wall::{FreeWall, MeshWall, Wall};
use carom_geom::Periodic;
use carom_laws::Scalar;
use carom_solve::Bounds;
use glam::{DQuat, DVec3};
use std::ops::Range;
use std::sync::Arc;

/// Law of a pair of materials.
#[derive(Clone, Debug)]
pub struct ContactLaw {
    /// mu, rho (m), delta (m).
    pub bounds: Bounds,
    /// mu as a law of the slip speed (m/s) at the start of a step, instead of `bounds.sliding`.
    pub friction_law: Option<Scalar>,
    /// Normal restitution e_N in [0, 1].
    pub restitution: f64,
    /// e_N as a law of the approach speed (m/s) instead.
    pub restitution_law: Option<Scalar>,
    /// Stiffness over that of other pairs (1), at equal radii: for impacts through springs.
    pub stiffness: f64,
    /// Tangential restitution e_T in (-1, 1].
    pub tangential_restitution: f64,
    /// Attraction in touch, N, and the gap at which it has fallen to nothing, m.
    pub cohesion: f64,
    pub rupture_distance: f64,
}

impl ContactLaw {
    /// mu at a slip speed, m/s, as the law gives it: it may be no coefficient at all.
    #[inline]
    pub fn friction(&self, slip: f64) -> f64 {
        match &self.friction_law {
            Some(law) => law.value(slip),
            None => self.bounds.sliding,
        }
    }

    /// mu of two bodies at a slip speed, m/s.
    ///
    /// # Errors
    /// It is no coefficient.
    #[inline]
    pub fn checked_friction(&self, bodies: (u32, u32), slip: f64) -> Result<f64, Failure> {
        let mu = self.friction(slip);
        match mu >= 0.0 && mu.is_finite() {
            true => Ok(mu),
            false => Err(Failure::Friction { bodies, mu, slip }),
        }
    }

    /// Whether e_N of two bodies at an approach speed, m/s, is from 0 to 1.
    ///
    /// # Errors
    /// It is not.
    pub fn check_restitution(&self, bodies: (u32, u32), approach: f64) -> Result<(), Failure> {
        let e = match &self.restitution_law {
            Some(law) => law.value(approach),
            None => self.restitution,
        };
        match (0.0..=1.0).contains(&e) {
            true => Ok(()),
            false => Err(Failure::Restitution {
                bodies,
                e,
                approach,
            }),
        }
    }

    /// e_N at an approach speed, m/s (0 where it opens). What a law gives beyond 0 and 1 counts as these.
    #[inline]
    pub fn restitution(&self, approach: f64) -> f64 {
        match &self.restitution_law {
            Some(law) => law.value(approach.max(0.0)).clamp(0.0, 1.0),
            None => self.restitution,
        }
    }
}

/// What joins spheres beside contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkKind {
    /// Index into the joints.
    Joint(u32),
    /// Index into the loads: one that depends on the motion.
    Load(u32),
}

/// A joint or a load that depends on the motion, between spheres `a` and `b` (equal where there is one sphere only).
#[derive(Clone, Copy, Debug)]
pub struct Link {
    pub a: u32,
    pub b: u32,
    pub kind: LinkKind,
}

/// Compiled model.
#[derive(Clone, Debug)]
pub struct Model {
    pub gravity: DVec3,
    pub radius: Vec<f64>,
    pub mass: Vec<f64>,
    pub inertia: Vec<f64>,
    /// 1/m and 1/I per sphere.
    pub inv_mass: Vec<f64>,
    pub inv_inertia: Vec<f64>,
    pub material: Vec<u32>,
    /// Bodies behind balls and clumps: planes, free ones first, then the other walls.
    pub walls: Vec<Wall>,
    /// Those that move freely; the first ones. They are the last of the bodies that have masses.
    pub free_walls: Vec<FreeWall>,
    /// Which of these are meshes; the last ones.
    pub meshes: Vec<MeshWall>,
    /// Rigid bodies of balls; bodies behind the balls.
    pub clumps: Vec<Clump>,
    /// The clump + 1 of each ball, 0 where it has none; empty without clumps.
    pub(crate) clump_of: Vec<u32>,
    /// Whether impulses on walls are summed up: some wall moves, or it was asked for.
    pub record_walls: bool,
    pub drop_impacts: bool,
    pub every_impact: bool,
    /// Keep impulses within impacts through springs over their time.
    pub courses: bool,
    /// Spheres meet by their nearest images; positions are never wrapped.
    pub periodic: Periodic,
    /// How that box changes its size and shears.
    pub deformation: Option<Deformation>,
    pub flow: Flow,
    pub laws: Vec<ContactLaw>,
    /// Law index + 1 by material pair, 0 where there is none.
    pub(crate) law_table: Vec<u32>,
    pub(crate) materials: usize,
    pub joints: Vec<Joint>,
    /// Pairs that joints keep from meeting.
    pub held_apart: HeldApart,
    /// Loads beyond the weight.
    pub loads: Vec<Arc<dyn Load>>,
    /// Joints, then loads that depend on the motion.
    pub links: Vec<Link>,
    pub options: Options,
}

/// Position and velocity at the start.
#[derive(Clone, Debug)]
pub struct InitialState {
    pub position: Vec<DVec3>,
    pub orientation: Vec<DQuat>,
    pub velocity: Vec<DVec3>,
    pub angular_velocity: Vec<DVec3>,
}

impl Model {
    /// Lengths of the periodic box at a time, and how far the image one up along the gradient is off along the flow, m.
    pub fn periodic_at(&self, time: f64) -> [f64; 4] {
        let law = self.deformation.as_ref();
        let now = law.map_or(self.periodic, |law| {
            law.periodic(&self.periodic, time, self.options.step)
        });
        let [x, y, z] = now.length().to_array();
        [x, y, z, now.offset()]
    }

    /// Number of bodies whose motion is computed: balls, clumps, free walls.
    pub fn bodies(&self) -> usize {
        self.radius.len()
    }

    /// Number of balls.
    pub fn balls(&self) -> usize {
        self.first_wall() - self.clumps.len()
    }

    /// The number of the first wall among the bodies; those that are free come first.
    #[inline]
    pub fn first_wall(&self) -> usize {
        self.radius.len() - self.free_walls.len()
    }

    /// The clump of a ball.
    #[inline]
    pub fn clump_of(&self, ball: u32) -> Option<usize> {
        let clump = self.clump_of.get(ball as usize)?;
        (*clump as usize).checked_sub(1)
    }

    /// The body whose motion a body of a contact has: its clump, or itself. Walls that do not move freely have none.
    #[inline]
    pub fn mover(&self, body: u32) -> Option<u32> {
        if (body as usize) >= self.bodies() {
            return None;
        }
        let clump = self.clump_of(body);
        Some(clump.map_or(body, |k| (self.balls() + k) as u32))
    }

    /// Which clump a body is.
    #[inline]
    pub fn as_clump(&self, body: u32) -> Option<usize> {
        let clump = (body as usize).checked_sub(self.balls())?;
        (clump < self.clumps.len()).then_some(clump)
    }

    /// Clumps and their numbers among the bodies.
    pub fn numbered_clumps(&self) -> impl Iterator<Item = (usize, &Clump)> {
        (self.balls()..).zip(&self.clumps)
    }

    /// The balls that a body which moves is made of: those of a clump, or the ball itself.
    pub fn balls_of(&self, body: usize) -> Range<usize> {
        let clump = self.as_clump(body as u32);
        clump.map_or(body..body + 1, |k| self.clumps[k].balls.clone())
    }

    /// A body by which to name one that moves: the first ball of a clump.
    pub fn named(&self, body: u32) -> u32 {
        let clump = self.as_clump(body);
        clump.map_or(body, |k| self.clumps[k].balls.start as u32)
    }

    /// The free wall that a body is.
    #[inline]
    pub fn free_wall(&self, body: usize) -> Option<&FreeWall> {
        let wall = body.checked_sub(self.first_wall())?;
        self.free_walls.get(wall)
    }

    /// Gravity as a body feels it, m/s^2: of a free wall along its normal.
    #[inline]
    pub fn gravity_of(&self, body: usize) -> DVec3 {
        self.free_wall(body).map_or(self.gravity, |w| w.gravity)
    }

    /// Kinetic energy of sphere `i` with these velocities, J.
    #[inline]
    pub fn kinetic(&self, i: usize, v: DVec3, w: DVec3) -> f64 {
        0.5 * (self.mass[i] * v.length_squared() + self.inertia[i] * w.length_squared())
    }

    /// Number of walls whose impulses are summed up: all or none.
    pub fn recorded_walls(&self) -> usize {
        if self.record_walls {
            self.given_walls()
        } else {
            0
        }
    }

    /// Number of walls that are of no mesh; they come first.
    pub fn simple_walls(&self) -> usize {
        self.meshes
            .first()
            .map_or(self.walls.len(), |m| m.walls.start)
    }

    /// The first body that is of a mesh, if there is one.
    pub fn first_mesh_wall(&self) -> u32 {
        (self.first_wall() + self.simple_walls()) as u32
    }

    /// Which walls are those of meshes, and how many of them are triangles.
    pub fn mesh_spans(&self) -> Vec<(Range<usize>, usize)> {
        let span = |m: &MeshWall| (m.walls.clone(), m.mesh.triangles());
        self.meshes.iter().map(span).collect()
    }

    /// Number of walls as they were given: a mesh is one.
    pub fn given_walls(&self) -> usize {
        self.walls.last().map_or(0, |w| w.given as usize + 1)
    }

    /// The mesh that a wall belongs to.
    pub fn mesh_of(&self, body: u32) -> Option<&MeshWall> {
        let wall = (body as usize).checked_sub(self.first_wall())?;
        let at = self.meshes.partition_point(|m| m.walls.end <= wall);
        self.meshes.get(at).filter(|m| m.walls.contains(&wall))
    }

    /// Number of a body outside of the core, where a mesh is one wall, and a clump has the name of its first ball.
    pub fn outside(&self, body: u32) -> u32 {
        match self
            .walls
            .get((body as usize).wrapping_sub(self.first_wall()))
        {
            Some(wall) => self.balls() as u32 + wall.given,
            None => self.named(body),
        }
    }

    /// Which part of a mesh a body is ([`Mesh::part`]); none of other bodies.
    ///
    /// [`Mesh::part`]: carom_geom::Mesh::part
    pub fn part(&self, body: u32) -> Option<u32> {
        let wall = (body as usize).checked_sub(self.first_wall())?;
        let mesh = self.mesh_of(body)?;
        Some(mesh.mesh.part(wall - mesh.walls.start))
    }

    /// Wall of a body index beyond the balls.
    #[inline]
    pub fn wall(&self, body: u32) -> &Wall {
        &self.walls[body as usize - self.first_wall()]
    }

    /// Neither joints nor loads beside the weight.
    #[inline]
    pub fn is_free(&self) -> bool {
        self.joints.is_empty() && self.loads.is_empty()
    }

    /// Whether a joint holds a body (walls from N on: none does).
    #[inline]
    pub fn is_jointed(&self, body: usize) -> bool {
        self.held_apart.has_joint(body)
    }

    /// Law of a pair of bodies (`b` may be a wall: index balls + w), if its materials have one.
    #[inline]
    pub fn law_of(&self, a: usize, b: usize) -> Option<u32> {
        let wall = b.checked_sub(self.first_wall());
        let mb = match wall {
            None => self.material[b],
            Some(wall) => self.walls[wall].material,
        };
        self.law_table[self.material[a] as usize * self.materials + mb as usize].checked_sub(1)
    }
}
