//! Measures of the position level as functions of the correction: gaps, increments, joints, and loads that depend on positions.

use super::coupling::{position_rows, Trial};
use crate::clump::places::{ClumpPositions, Clumps};
use crate::contact::Contact;
use crate::islands::Island;
use crate::model::Model;
use crate::rotation;
use crate::rows::{halves, Rows};
use crate::state::State;
use crate::stepper::generalized_alpha::Prediction;
use crate::stepper::Span;
use crate::wall::places::{proximity, Walls};
use carom_solve::rows::{RowSystem, Subproblem, NODE_DOF, WORLD};
use glam::DVec3;

/// Position measures of an island as functions of U.
pub(super) struct Positions<'a> {
    pub model: &'a Model,
    pub walls: &'a Walls,
    pub contacts: &'a [Contact],
    pub members: &'a [u32],
    /// Centres after the smooth step, per node.
    pub centres: &'a [DVec3],
    pub coupled: Option<CoupledPositions<'a>>,
    pub clumps: Option<ClumpPositions<'a>>,
    /// What multipliers count from, where the loads have moved the spheres already ([`super::loads`]); empty: from 0.
    pub of_loads: Vec<f64>,
}

impl Positions<'_> {
    /// Takes back what the loads have moved along normals, as these are now: `-G_N^T of_loads` beside the multipliers.
    fn take_back(&self, system: &mut RowSystem) {
        if self.coupled.is_none() {
            system.load.fill(0.0);
            system.load_tangent.clear();
        }
        for (c, &of_load) in system.contacts.iter().zip(&self.of_loads) {
            if of_load == 0.0 {
                continue;
            }
            let row = [
                &system.jac[c.row as usize][0],
                &system.jac[c.row as usize][1],
            ];
            for (node, row) in [c.node_a, c.node_b].into_iter().zip(row) {
                if node != WORLD {
                    let own = &mut system.load[NODE_DOF * node as usize..][..NODE_DOF];
                    own.iter_mut().zip(row).for_each(|(b, g)| *b -= of_load * g);
                }
            }
            if of_load * c.curvature != 0.0 {
                c.turning(-of_load * c.curvature, NODE_DOF, |row, col, value| {
                    let entry = (row as u32, col as u32, value);
                    system.load_tangent.push(entry);
                });
            }
        }
    }
}

/// Joints and loads of an island.
pub(super) struct CoupledPositions<'a> {
    pub island: Island<'a>,
    pub clumps: &'a Clumps,
    pub state: &'a State,
    /// Rotation increments after the smooth step, per sphere.
    pub angular: &'a [Prediction],
    /// What the loads have moved them by since, where these come first ([`super::loads`]).
    pub load_shift: &'a [[DVec3; 2]],
    pub bodies: &'a [u32],
    pub node_of: &'a [u32],
    pub trial: &'a mut Trial,
    /// t_n and t_{n+1}.
    pub span: Span,
    /// Loads at `q_check`, 6 per node.
    pub base: Vec<f64>,
}

/// Of translation and rotation; positions of the level, and what the loads have moved spheres by to get there.
type Predictions<'a> = (&'a [Prediction], &'a [Prediction]);
type Places<'a> = (&'a [DVec3], &'a [[DVec3; 2]]);

impl<'a> CoupledPositions<'a> {
    /// Puts the island where the smooth step ends, and pushes the rows of its joints.
    pub fn open(
        (model, clumps): (&Model, &'a Clumps),
        state: &'a State,
        island: Island<'a>,
        span: Span,
        ((linear, angular), (position, load_shift)): (Predictions<'a>, Places<'a>),
        system: &mut RowSystem,
        (bodies, node_of, trial): (&'a [u32], &'a [u32], &'a mut Trial),
    ) -> Self {
        for &body in bodies {
            let i = body as usize;
            // Velocities stay those of the smooth step at this level (eq. 3).
            trial.velocity[i] = linear[i].velocity;
            trial.angular_velocity[i] = angular[i].velocity;
            let [way, _] = load_shift.get(i).copied().unwrap_or_default();
            trial.position[i] = position[i] - way;
            trial.orientation[i] = rotation::advance(angular[i].displacement, state.orientation[i]);
        }
        let mut rows: Rows = Default::default();
        let node = |body: u32| node_of.get(body as usize).copied().unwrap_or(WORLD);
        for &index in island.joints {
            let joint = &model.joints[index as usize];
            // Nominal rows for D_cc; the measures come with the first evaluation.
            let dim = joint.gradient_at(&trial.poses(joint), &mut rows);
            clumps.scale_rows(model, [joint.a, joint.b], &mut rows[..dim]);
            let nodes = (node(joint.a), node(joint.b));
            let (rows, zeros) = (&rows[..dim], &[0.0; 6][..dim]);
            system.push_joint(nodes, joint.translational, joint.length, rows, zeros);
        }
        let mut base = vec![0.0; NODE_DOF * bodies.len()];
        if !island.loads.is_empty() {
            system.open_load();
            trial.wrenches(model, clumps, island.loads, bodies, span.end, &mut base);
        }
        CoupledPositions {
            island,
            clumps,
            state,
            angular,
            load_shift,
            bodies,
            node_of,
            trial,
            span,
            base,
        }
    }

    /// Puts the island at the correction `u`.
    fn move_to(&mut self, model: &Model, centres: &[DVec3], u: &[f64]) {
        for (node, &body) in self.bodies.iter().enumerate() {
            let (i, k) = (body as usize, NODE_DOF * node);
            self.trial.position[i] = centres[node] + DVec3::new(u[k], u[k + 1], u[k + 2]);
            let psi = self.increment(model, body, u);
            self.trial.orientation[i] = rotation::advance(psi, self.state.orientation[i]);
        }
    }

    /// `psi = psi_check + U_rot` of a body; zero for the ground.
    fn increment(&self, model: &Model, body: u32, u: &[f64]) -> DVec3 {
        let Some(prediction) = self.angular.get(body as usize) else {
            return DVec3::ZERO;
        };
        let k = NODE_DOF * self.node_of[body as usize] as usize;
        let [_, turn] = self
            .load_shift
            .get(body as usize)
            .copied()
            .unwrap_or_default();
        let own = self.clumps.from_node(model, body, halves(&u[k..]));
        prediction.displacement + turn + own[1]
    }

    fn evaluate(
        &mut self,
        model: &Model,
        first: usize,
        system: &mut RowSystem,
        u: &[f64],
        z: &mut [f64],
    ) {
        let mut rows: Rows = Default::default();
        for (slot, &index) in self.island.joints.iter().enumerate() {
            let joint = &model.joints[index as usize];
            let rc = system.contacts[first + slot];
            let range = rc.rows();
            let psi = [joint.a, joint.b].map(|body| self.increment(model, body, u));
            let poses = self.trial.poses(joint);
            let dim = position_rows(
                joint,
                poses,
                psi,
                self.span,
                &mut rows,
                &mut z[range.clone()],
            );
            let bodies = [joint.a, joint.b];
            (self.clumps).scale_rows(model, bodies, &mut rows[..dim]);
            system.jac[range].copy_from_slice(&rows[..dim]);
        }
        if system.has_load() {
            let half = 0.5 * self.span.h.powi(2);
            let (loads, end) = (self.island.loads, self.span.end);
            let mut load = std::mem::take(&mut system.load);
            self.trial
                .wrenches(model, self.clumps, loads, self.bodies, end, &mut load);
            for (b, base) in load.iter_mut().zip(&self.base) {
                *b = half * (*b - base);
            }
            self.trial.stiffness(
                model,
                self.clumps,
                (loads, self.node_of),
                end,
                (half, 0.0),
                &mut system.load_tangent,
            );
            system.load = load;
        }
    }
}

impl Subproblem for Positions<'_> {
    fn evaluate(&mut self, system: &mut RowSystem, u: &[f64], z: &mut [f64]) {
        // Centre of a ball: that of its node, with the lever in a clump.
        let at = |node: u32, ball: u32| {
            let own = &u[NODE_DOF * node as usize..][..NODE_DOF];
            let centre = self.centres[node as usize] + halves(own)[0];
            let clumps = self.clumps.as_ref();
            let lever = clumps.and_then(|clumps| clumps.lever(ball, own));
            (lever.map_or(centre, |(_, lever)| centre + lever), lever)
        };
        for (slot, &index) in self.members.iter().enumerate() {
            let c = &self.contacts[index as usize];
            let rc = system.contacts[slot];
            let wall = c.is_wall(self.model);
            let (xa, lever_a) = at(rc.node_a, c.a);
            let (xb, lever_b) = if wall {
                (DVec3::ZERO, None)
            } else {
                at(rc.node_b, c.b)
            };
            let p = proximity(self.model, self.walls, c, xa, xb);
            let row = rc.row as usize;
            z[row] = p.gap;
            let turns = lever_a.is_some() || lever_b.is_some();
            if turns || !(wall && self.model.wall(c.b).is_fixed_plane()) {
                let n = p.normal;
                system.jac[row] = [
                    [n.x, n.y, n.z, 0.0, 0.0, 0.0],
                    [-n.x, -n.y, -n.z, 0.0, 0.0, 0.0],
                ];
                if let Some(clumps) = &self.clumps {
                    let sides = system.jac[row].iter_mut().zip([lever_a, lever_b]);
                    for (side, lever) in sides {
                        if let Some((clump, lever)) = lever {
                            clumps.clumps.fold(clump, lever, side);
                        }
                    }
                }
                system.contacts[slot].normal = n.to_array();
                system.contacts[slot].curvature = p.curvature;
                system.contacts[slot].flat = p.flat.to_array();
            }
            for r in row + 1..row + rc.dim as usize {
                z[r] = system.z0[r] + system.row_velocity(&rc, r, u);
            }
        }
        if let Some(coupled) = &mut self.coupled {
            coupled.move_to(self.model, self.centres, u);
            coupled.evaluate(self.model, self.members.len(), system, u, z);
        }
        if !self.of_loads.is_empty() {
            self.take_back(system);
        }
    }
}
