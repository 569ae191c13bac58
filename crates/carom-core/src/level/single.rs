//! A lone contact of a sphere with a plane: both levels in closed form (`carom_solve::single`).

use super::Task;
use crate::contact::Contact;
use crate::model::Model;
use crate::problem::Solve;
use crate::rows::Rows;
use crate::workspace::On;
use carom_solve::rows::{RowSystem, WORLD};
use carom_solve::single::{SingleContact, SingleSolution};
use carom_solve::SolveReport;
use glam::DVec3;

/// Measures of a lone sphere-plane contact in its frame: normal, slip (2), turned rolling (2), spin.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContactMeasures {
    pub normal: f64,
    pub slip: [f64; 2],
    pub turn: [f64; 2],
    pub spin: f64,
}

/// Decomposes a translation (or velocity) and a rotation (or angular velocity) at the contact.
#[inline(always)]
pub fn motion(c: &Contact, radius: f64, linear: DVec3, angular: DVec3) -> ContactMeasures {
    let slip = linear + radius * c.n0.cross(angular);
    ContactMeasures {
        normal: c.n0.dot(linear),
        slip: [c.t1.dot(slip), c.t2.dot(slip)],
        turn: [-c.t2.dot(angular), c.t1.dot(angular)],
        spin: c.n0.dot(angular),
    }
}

impl ContactMeasures {
    /// Against that of a moving wall.
    #[inline]
    pub fn subtract(&mut self, wall: &ContactMeasures) {
        self.normal -= wall.normal;
        self.spin -= wall.spin;
        for k in 0..2 {
            self.slip[k] -= wall.slip[k];
            self.turn[k] -= wall.turn[k];
        }
    }
}

/// Measures of a wall's own motion at the contact: of its shape, of its material, and rotation.
#[inline]
pub fn driven(c: &Contact, shape: DVec3, material: DVec3, rotation: DVec3) -> ContactMeasures {
    ContactMeasures {
        normal: c.n0.dot(shape),
        ..motion(c, 0.0, material, rotation)
    }
}

/// Measures of a contact's wall at t_n and t_{n+1}; 0 where it does not move.
#[inline]
pub fn wall_motion(on: &On, c: &Contact) -> [ContactMeasures; 2] {
    let (scratch, Task { model, state, .. }) = (&*on.scratch, *on.task);
    if !scratch.walls.any_moves() {
        return [ContactMeasures::default(); 2];
    }
    let twists = (scratch.walls).twists(model, c, state, scratch.position[c.a as usize]);
    twists.map_or([ContactMeasures::default(); 2], |both| {
        both.map(|t| driven(c, t.shape, t.material, t.spin))
    })
}

/// Those at t_{n+1} where loads act that are solved once.
#[inline]
pub fn wall_half_way(on: &On, c: &Contact) -> ContactMeasures {
    let (scratch, Task { model, state, .. }) = (&*on.scratch, *on.task);
    let centres = [state.position[c.a as usize], scratch.position[c.a as usize]];
    let twist = scratch.walls.twist_half_way(model, c, centres);
    twist.map_or_else(ContactMeasures::default, |t| {
        driven(c, t.shape, t.material, t.spin)
    })
}

/// The one-contact problem with the given measures.
#[inline]
pub fn problem(model: &Model, c: &Contact, z: &ContactMeasures) -> SingleContact {
    let i = c.a as usize;
    let (r, im, ii) = (model.radius[i], model.inv_mass[i], model.inv_inertia[i]);
    let bounds = c.bounds;
    SingleContact {
        z_normal: z.normal,
        z_sliding: z.slip,
        z_rolling: z.turn,
        z_spinning: z.spin,
        d_normal: im,
        d_sliding: im + r * r * ii,
        d_turn: ii,
        d_coupling: r * ii,
        mu: bounds.sliding,
        rho: bounds.rolling,
        delta: bounds.spinning,
    }
}

/// Packs a solution into the contact's rows.
#[inline(always)]
pub fn pack(c: &Contact, s: &SingleSolution) -> [f64; 6] {
    let bounds = c.bounds;
    let mut out = [s.normal, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut k = 1;
    if bounds.sliding > 0.0 {
        out[k] = s.sliding[0];
        out[k + 1] = s.sliding[1];
        k += 2;
    }
    if bounds.rolling > 0.0 {
        // Back from the turned basis (w1, w2) = (-R2, R1).
        out[k] = s.rolling[1];
        out[k + 1] = -s.rolling[0];
        k += 2;
    }
    if bounds.spinning > 0.0 {
        out[k] = s.spinning;
    }
    out
}

/// Correction of translation and rotation by a solution.
#[inline(always)]
pub fn correction(model: &Model, c: &Contact, s: &SingleSolution) -> [DVec3; 2] {
    let i = c.a as usize;
    let r = model.radius[i];
    let force = s.normal * c.n0 + s.sliding[0] * c.t1 + s.sliding[1] * c.t2;
    // Friction turns like the turned rolling rows times r; see `Motion`.
    let (w1, w2) = (
        r * s.sliding[0] + s.rolling[0],
        r * s.sliding[1] + s.rolling[1],
    );
    let moment = w2 * c.t1 - w1 * c.t2 + s.spinning * c.n0;
    [model.inv_mass[i] * force, model.inv_inertia[i] * moment]
}

/// Keeps a problem that was solved in closed form: its measures `z` before the correction, multipliers, the motion
/// before (linear, angular) and the correction.
#[cold]
pub fn keep(
    on: &mut On,
    member: u32,
    index: u32,
    z: &ContactMeasures,
    multiplier: [f64; 6],
    motion: [DVec3; 2],
    correction: [DVec3; 2],
) {
    let (scratch, Task { model, level, .. }) = (&mut *on.scratch, *on.task);
    let c = scratch.contacts[member as usize];
    let i = c.a as usize;
    let mut system = RowSystem::default();
    let node = system.push_node(model.mass[i], model.inertia[i], model.radius[i]);
    let mut rows = Rows::default();
    let dim = c.rows(model, c.n0, &mut rows);
    let normal = c.n0.to_array();
    let measured = pack_measures(&c, z);
    system.push_contact(
        node,
        WORLD,
        c.bounds,
        c.length,
        normal,
        &rows[..dim],
        &measured[..dim],
    );
    let flat = |v: [DVec3; 2]| [v[0].to_array(), v[1].to_array()].concat();
    let correction = flat(correction);
    let mut measures = vec![0.0; dim];
    system.linear_measures(&correction, &mut measures);
    scratch.keeper.keep(&Solve {
        model,
        contacts: scratch.contacts,
        clumps: scratch.clumps,
        members: &[member],
        spheres: &[c.a],
        system: &system,
        measures: &measures,
        multiplier: &multiplier[..dim],
        correction: &correction,
        motion: &flat(motion),
        level,
        index,
        report: SolveReport::CLOSED_FORM,
        attempts: &[],
        worst: 0,
    });
}

/// Packs measures into the contact's rows.
fn pack_measures(c: &Contact, z: &ContactMeasures) -> [f64; 6] {
    pack(
        c,
        &SingleSolution {
            normal: z.normal,
            sliding: z.slip,
            rolling: z.turn,
            spinning: z.spin,
            slip: false,
        },
    )
}
