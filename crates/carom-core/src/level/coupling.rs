//! Joints and loads that depend on the motion, as the position and velocity sub-problems of an island see them:
//! rows of joints, and the change of the loads `f_p`, `f_v` (eqs. 3, 4) with its derivatives.

use crate::clump::places::Clumps;
use crate::force::{Motion, Tangent};
use crate::joint::{over_increment, Joint, Pose, Twist};
use crate::model::Model;
use crate::rows::Rows;
use crate::stepper::Span;
use carom_solve::rows::NODE_DOF;
use glam::{DQuat, DVec3};

/// A motion of all spheres at which loads and joints are evaluated. Empty in models without them.
#[derive(Default)]
pub struct Trial {
    pub position: Vec<DVec3>,
    pub orientation: Vec<DQuat>,
    pub velocity: Vec<DVec3>,
    pub angular_velocity: Vec<DVec3>,
    pub wrench: Vec<[DVec3; 2]>,
    pub tangents: Vec<Tangent>,
}

impl Trial {
    pub fn new(model: &Model) -> Trial {
        let n = if model.is_free() { 0 } else { model.bodies() };
        Trial {
            position: vec![DVec3::ZERO; n],
            orientation: vec![DQuat::IDENTITY; n],
            velocity: vec![DVec3::ZERO; n],
            angular_velocity: vec![DVec3::ZERO; n],
            wrench: vec![[DVec3::ZERO; 2]; n],
            tangents: Vec::new(),
        }
    }

    pub fn motion(&self, time: f64) -> Motion<'_> {
        Motion {
            time,
            position: &self.position,
            orientation: &self.orientation,
            velocity: &self.velocity,
            angular_velocity: &self.angular_velocity,
        }
    }

    /// Placements of a joint's bodies.
    pub fn poses(&self, joint: &Joint) -> [Pose; 2] {
        let pose = |i: u32| Pose {
            position: self.position[i as usize],
            orientation: self.orientation[i as usize],
        };
        let b = if joint.grounded() {
            Pose::GROUND
        } else {
            pose(joint.b)
        };
        [pose(joint.a), b]
    }

    /// Velocities of a joint's bodies.
    pub fn twists(&self, joint: &Joint) -> [Twist; 2] {
        let twist = |i: u32| Twist {
            velocity: self.velocity[i as usize],
            angular_velocity: self.angular_velocity[i as usize],
        };
        let b = if joint.grounded() {
            Twist::default()
        } else {
            twist(joint.b)
        };
        [twist(joint.a), b]
    }

    /// Sum of the given loads on the nodes of the given bodies, 6 per node.
    pub fn wrenches(
        &mut self,
        model: &Model,
        clumps: &Clumps,
        loads: &[u32],
        bodies: &[u32],
        time: f64,
        out: &mut [f64],
    ) {
        for &body in bodies {
            self.wrench[body as usize] = [DVec3::ZERO; 2];
        }
        let mut wrench = std::mem::take(&mut self.wrench);
        for &load in loads {
            // Loads with tangents are closed forms: they cannot fail.
            let _ = model.loads[load as usize].add(&self.motion(time), &mut wrench);
        }
        for (out, &body) in out.chunks_exact_mut(NODE_DOF).zip(bodies) {
            let [f, m] = clumps.from_node(model, body, wrench[body as usize]);
            out[..3].copy_from_slice(&f.to_array());
            out[3..].copy_from_slice(&m.to_array());
        }
        self.wrench = wrench;
    }

    /// `-(scale_q df/dq + scale_v df/dv)` of the given loads, over the nodes of `node_of`: (row, column, value).
    pub fn stiffness(
        &mut self,
        model: &Model,
        clumps: &Clumps,
        (loads, node_of): (&[u32], &[u32]),
        time: f64,
        (scale_q, scale_v): (f64, f64),
        out: &mut Vec<(u32, u32, f64)>,
    ) {
        let mut tangents = std::mem::take(&mut self.tangents);
        tangents.clear();
        for &load in loads {
            model.loads[load as usize].tangent(&self.motion(time), &mut tangents);
        }
        out.clear();
        for t in &mut tangents {
            for block in [&mut t.position, &mut t.velocity] {
                clumps.scale_block(model, [t.of, t.over], block);
            }
            let row = NODE_DOF as u32 * node_of[t.of as usize];
            let col = NODE_DOF as u32 * node_of[t.over as usize];
            for (i, (over_q, over_v)) in t.position.iter().zip(&t.velocity).enumerate() {
                for (j, (q, v)) in over_q.iter().zip(over_v).enumerate() {
                    let value = -(scale_q * q + scale_v * v);
                    out.push((row + i as u32, col + j as u32, value));
                }
            }
        }
        self.tangents = tangents;
    }
}

/// Rows of a joint at the position level: gradient over translation and increment `psi`, and measures.
pub fn position_rows(
    joint: &Joint,
    [a, b]: [Pose; 2],
    [psi_a, psi_b]: [DVec3; 2],
    span: Span,
    rows: &mut Rows,
    z: &mut [f64],
) -> usize {
    let dim = joint.gradient(&a, &b, rows);
    // A rotation row acts on psi itself.
    over_increment(&mut rows[..joint.translational], psi_a, psi_b);
    joint.position_measures(&a, &b, span.end, z);
    joint.rotation_measures(psi_a, psi_b, span, z);
    dim
}
