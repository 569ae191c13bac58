//! The Newton matrix of one group of the smooth sub-problem (eq. 11): assembled from masses, tangents of loads and gradients of
//! joints, factored dense or sparse by its size.

use super::coupling::Trial;
use super::smooth_newton::{CoupledBodies, SmoothScratch, Weights};
use crate::joint::{add_block, Block6};
use crate::model::Model;
use crate::rows::Rows;
use carom_solve::direct::Touched;
use carom_solve::rows::NODE_DOF;

/// Most unknowns of a group whose matrix is dense. Speed alone: more, and long chains of joints take n^3; fewer, and pendulums pay for a sparse set-up.
const DENSE: usize = 72;
/// `delta` over the diagonal of `G S^-1 G^T` (1). At 0 redundant joints have a singular matrix, and the run stops; too large, and Newton's
/// method takes more iterations (its limit stays that of eq. 1).
const SHIFT: f64 = 1e-12;

/// Squares of the reactions of a group, over what they do together (1), from which on they are looked at: joints that repeat one another can hold
/// one another by anything. Less: long chains are looked at for nothing. More: such forces are shown.
const HELD: f64 = 1e4;
/// Rounds (1) in which reactions that are unique come out, however nearly they repeat one another: each leaves the shift of the factors over the eigenvalue.
const ROUNDS: usize = 4;
/// Roundings of the reactions (1) by which the least may do other than those that were found; else these stay.
const ALIKE: f64 = 256.0;

impl SmoothScratch {
    /// Of all reactions that do the same, the least, where these are much larger than what they do, or `again`. Whether they are others by far.
    pub fn least_reactions(&mut self, model: &Model, again: bool) -> bool {
        let groups = std::mem::take(&mut self.groups);
        let mut changed = false;
        for group in groups.iter().filter(|group| !group.joints.is_empty()) {
            changed |= self.least_of_group(model, group, again);
        }
        self.groups = groups;
        changed
    }

    fn least_of_group(&mut self, model: &Model, group: &CoupledBodies, again: bool) -> bool {
        let mut net = Vec::new();
        let [size, done] = self.together(model, group, &self.lambda, &mut net);
        if size <= HELD * done && !again {
            return false;
        }
        let mut rows: Vec<usize> = Vec::new();
        let touched = |&body: &u32| Touched {
            inverse: inverses(model, body),
            rows: Vec::new(),
        };
        let mut bodies: Vec<Touched> = group.bodies.iter().map(touched).collect();
        self.for_rows(model, group, |row, body, g| {
            if rows.last() != Some(&row) {
                rows.push(row);
            }
            let own = &mut bodies[self.local[body as usize] as usize].rows;
            own.push((rows.len() - 1, *g));
        });
        if self.reactions.factor(rows.len(), &bodies).is_err() {
            return false;
        }
        let mut rest = self.lambda.clone();
        let (mut rhs, mut more) = (vec![0.0; rows.len()], vec![0.0; rows.len()]);
        for _ in 0..ROUNDS {
            self.together(model, group, &rest, &mut net);
            rhs.fill(0.0);
            for (net, body) in net.iter().zip(&bodies) {
                for (row, g) in &body.rows {
                    rhs[*row] += g.iter().zip(net).map(|(g, v)| g * v).sum::<f64>();
                }
            }
            if self.reactions.solve(&rhs, &mut more).is_err() {
                return false;
            }
            for (row, more) in rows.iter().zip(&more) {
                rest[*row] -= more;
            }
        }
        let [gone, left] = self.together(model, group, &rest, &mut net);
        if left > (ALIKE * f64::EPSILON).powi(2) * size {
            return false;
        }
        for row in rows {
            self.lambda[row] -= rest[row];
        }
        2.0 * gone > size
    }

    /// What reactions do to the bodies of a group together, as velocities in a second; the squares, over the masses, of what they do one by one and together.
    fn together(
        &self,
        model: &Model,
        group: &CoupledBodies,
        lambda: &[f64],
        net: &mut Vec<[f64; NODE_DOF]>,
    ) -> [f64; 2] {
        net.clear();
        net.resize(group.bodies.len(), [0.0; NODE_DOF]);
        let (mut size, mut done) = (0.0, 0.0);
        self.for_rows(model, group, |row, body, g| {
            let inverse = inverses(model, body);
            let net = &mut net[self.local[body as usize] as usize];
            for k in 0..NODE_DOF {
                net[k] += lambda[row] * g[k];
                size += lambda[row] * lambda[row] * inverse[k] * g[k] * g[k];
            }
        });
        for (net, &body) in net.iter_mut().zip(&group.bodies) {
            for (net, inverse) in net.iter_mut().zip(inverses(model, body)) {
                done += inverse * *net * *net;
                *net *= inverse;
            }
        }
        [size, done]
    }

    /// Rows of the joints of a group, each with its bodies and its gradient over them.
    fn for_rows(
        &self,
        model: &Model,
        group: &CoupledBodies,
        mut each: impl FnMut(usize, u32, &[f64; NODE_DOF]),
    ) {
        for &index in &group.joints {
            let joint = &model.joints[index as usize];
            let first = self.first_row[index as usize] as usize;
            let gradients = self.gradients[index as usize].iter();
            for (r, sides) in gradients.take(joint.rows.len()).enumerate() {
                for (side, body) in sides.iter().zip([joint.a, joint.b]) {
                    if (body as usize) < model.bodies() {
                        each(first + r, body, side);
                    }
                }
            }
        }
    }

    pub(super) fn solve_group(
        &mut self,
        model: &Model,
        trial: &mut Trial,
        group: &CoupledBodies,
        w: Weights,
    ) -> bool {
        self.assemble(model, trial, group, w);
        (self.matrix)
            .solve(DENSE, &self.rhs, &mut self.solution)
            .is_ok()
    }

    fn assemble(&mut self, model: &Model, trial: &mut Trial, group: &CoupledBodies, w: Weights) {
        self.matrix.list.clear();
        self.rhs.clear();
        for (k, &body) in (0..).zip(&group.bodies) {
            let [f, m] = self.residual[body as usize];
            self.rhs.extend(f.to_array());
            self.rhs.extend(m.to_array());
            self.add_mass(model, trial, (k, body), w.acceleration);
        }
        let mut tangents = std::mem::take(&mut trial.tangents);
        tangents.clear();
        for &load in &group.loads {
            model.loads[load as usize].tangent(&trial.motion(w.time), &mut tangents);
        }
        for t in &tangents {
            let (of, over) = (self.local[t.of as usize], self.local[t.over as usize]);
            self.add_block(of, over, &t.position, -w.displacement);
            self.add_block(of, over, &t.velocity, -w.velocity);
        }
        trial.tangents = tangents;
        let mut row = (NODE_DOF * group.bodies.len()) as u32;
        for &index in &group.joints {
            let joint = &model.joints[index as usize];
            let first = self.first_row[index as usize] as usize;
            let sides = [Some(joint.a), (!joint.grounded()).then_some(joint.b)];
            let nodes = sides.map(|s| s.map(|body| self.local[body as usize]));
            let ([pa, pb], [ta, tb]) = (trial.poses(joint), trial.twists(joint));
            let mut rates = Rows::default();
            joint.gradient_rate((&pa, &ta), (&pb, &tb), &mut rates);
            let mut geometric = [[Block6::default(); 2]; 2];
            let dim = joint.rows.len();
            let lambda = &self.lambda[first..first + dim];
            joint.gradient_stiffness(&pa, &pb, lambda, &mut geometric);
            for (i, of) in nodes.iter().enumerate() {
                for (j, over) in nodes.iter().enumerate() {
                    if let (Some(of), Some(over)) = (of, over) {
                        self.add_block(*of, *over, &geometric[i][j], -w.displacement);
                    }
                }
            }
            for (r, rate) in rates.iter().enumerate().take(dim) {
                let mut compliance = 0.0;
                for (side, node) in nodes.iter().enumerate() {
                    let (Some(node), g) = (node, &self.gradients[index as usize][r][side]) else {
                        continue;
                    };
                    let body = if side == 0 { joint.a } else { joint.b } as usize;
                    for c in 0..NODE_DOF {
                        let at = NODE_DOF as u32 * node + c as u32;
                        let inverse = if c < 3 {
                            model.inv_mass[body]
                        } else {
                            model.inv_inertia[body]
                        };
                        compliance += g[c] * g[c] * inverse;
                        self.matrix.list.push((at, row, -g[c]));
                        let value = g[c] + w.displacement * rate[side][c];
                        self.matrix.list.push((row, at, value));
                    }
                }
                let corner = SHIFT * compliance / w.acceleration;
                self.matrix.list.push((row, row, corner));
                self.rhs.push(-self.constraint[first + r]);
                row += 1;
            }
        }
    }

    /// Adds mass and inertia of a body at its place `k` of a group.
    fn add_mass(&mut self, model: &Model, trial: &Trial, (k, body): (u32, u32), factor: f64) {
        let i = body as usize;
        for c in 0..NODE_DOF as u32 {
            let mass = if c < 3 {
                model.mass[i]
            } else {
                model.inertia[i]
            };
            let at = NODE_DOF as u32 * k + c;
            self.matrix.list.push((at, at, factor * mass));
        }
        if let Some(number) = model.as_clump(body) {
            let mut beyond = Block6::default();
            let tensor = model.clumps[number].inertia_beyond(trial.orientation[i]);
            add_block(&mut beyond, 1, 1, tensor, 1.0);
            self.add_block(k, k, &beyond, factor);
        }
    }

    fn add_block(&mut self, of: u32, over: u32, block: &Block6, factor: f64) {
        for (r, values) in block.iter().enumerate() {
            for (c, value) in values.iter().enumerate() {
                let (row, col) = (
                    NODE_DOF as u32 * of + r as u32,
                    NODE_DOF as u32 * over + c as u32,
                );
                self.matrix.list.push((row, col, factor * value));
            }
        }
    }
}

/// Over velocity and angular velocity.
fn inverses(model: &Model, body: u32) -> [f64; NODE_DOF] {
    let (m, i) = (
        model.inv_mass[body as usize],
        model.inv_inertia[body as usize],
    );
    [m, m, m, i, i, i]
}
