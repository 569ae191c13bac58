//! Clumps as they stand within a step: levers of their balls, rows over their nodes.

use super::body::Clump;
use crate::contact::Contact;
use crate::joint::Block6;
use crate::model::Model;
use crate::rotation::advance;
use crate::rows::{halves, Rows};
use crate::state::State;
use crate::stepper::{Coefficients, Prediction};
use carom_solve::rows::NODE_DOF;
use glam::{DMat3, DQuat, DVec3};

/// The clumps of a step as they stand at the positions of the level at hand. Empty without clumps.
#[derive(Clone, Debug, Default)]
pub struct Clumps {
    /// Centres of all balls from the centre of mass of their clump, m; 0 where they have none.
    pub(super) lever: Vec<DVec3>,
    /// The same half-way between both ends of the step.
    middle: Vec<DVec3>,
    pub orientation: Vec<DQuat>,
    /// Angular momentum of each at t_n, kg m^2/s.
    pub(super) at_start: Vec<DVec3>,
    /// What moments of the smooth step give each: angular momentum over its mean moment of inertia.
    pub(super) by_moments: Vec<Prediction>,
    /// Angular momentum where the smooth step ends, kg m^2/s.
    pub(super) momentum: Vec<DVec3>,
    /// Angular velocity that impacts find, with the body where it is then and without the moments of the smooth step, rad/s.
    pub(super) spin_before: Vec<DVec3>,
    /// At which the loads were solved, and where these have turned them.
    pub(super) at_loads: Vec<DQuat>,
    pub(super) by_loads: Vec<DQuat>,
    /// Angle by which corrections of positions have turned each angular velocity, rad.
    pub(super) turned_along: Vec<f64>,
    /// What loads on its balls gave each clump in the step, about its centre of mass, N m s.
    pub(super) moment: Vec<DVec3>,
    /// `S` of each clump, and its inverse.
    scale: Vec<[DMat3; 2]>,
}

impl Clumps {
    pub fn new(model: &Model) -> Clumps {
        let (balls, count) = match model.clumps.len() {
            0 => (0, 0),
            count => (model.balls(), count),
        };
        Clumps {
            lever: vec![DVec3::ZERO; balls],
            middle: vec![DVec3::ZERO; balls],
            orientation: vec![DQuat::IDENTITY; count],
            at_start: vec![DVec3::ZERO; count],
            by_moments: vec![Prediction::default(); count],
            momentum: vec![DVec3::ZERO; count],
            spin_before: vec![DVec3::ZERO; count],
            at_loads: vec![DQuat::IDENTITY; count],
            by_loads: vec![DQuat::IDENTITY; count],
            turned_along: vec![0.0; count],
            moment: vec![DVec3::ZERO; count],
            scale: vec![[DMat3::IDENTITY; 2]; count],
        }
    }

    /// Turns a clump from its orientation at t_n to another one.
    pub(super) fn put(&mut self, clump: &Clump, number: usize, [from, to]: [DQuat; 2]) {
        self.orientation[number] = to;
        self.scale[number] = clump.scales(to);
        // Of both signs of a quaternion the nearer one.
        let near = if from.dot(to) < 0.0 { -from } else { from };
        let middle = (near + to).normalize();
        for (ball, offset) in clump.balls.clone().zip(&clump.offsets) {
            self.lever[ball] = to * *offset;
            self.middle[ball] = middle * *offset;
        }
    }

    /// A correction of the smooth motion: of the angular velocity of what is no clump, of a clump by its angular momentum.
    pub(crate) fn correct(
        &mut self,
        model: &Model,
        (body, angular): (usize, &mut Prediction),
        coefficients: &Coefficients,
        dw: DVec3,
    ) {
        let prediction = match model.as_clump(body as u32) {
            Some(number) => &mut self.by_moments[number],
            None => angular,
        };
        coefficients.correct(prediction, dw);
    }

    /// Gradient rows over the velocities of two bodies as those over their nodes.
    pub fn scale_rows(&self, model: &Model, bodies: [u32; 2], rows: &mut [[[f64; NODE_DOF]; 2]]) {
        for (side, body) in bodies.into_iter().enumerate() {
            if let Some(number) = model.as_clump(body) {
                for row in rows.iter_mut() {
                    let turn = self.scale[number][0] * halves(&row[side])[1];
                    row[side][3..].copy_from_slice(&turn.to_array());
                }
            }
        }
    }

    /// Derivatives of the wrench on a body over the motion of another one, as those of their nodes.
    pub fn scale_block(&self, model: &Model, [of, over]: [u32; 2], block: &mut Block6) {
        if let Some(number) = model.as_clump(of) {
            let s = self.scale[number][0];
            for c in 0..NODE_DOF {
                let turn = s * DVec3::new(block[3][c], block[4][c], block[5][c]);
                (0..3).for_each(|k| block[3 + k][c] = turn[k]);
            }
        }
        if let Some(number) = model.as_clump(over) {
            for row in block.iter_mut() {
                let turn = self.scale[number][0] * halves(&row[..])[1];
                row[3..].copy_from_slice(&turn.to_array());
            }
        }
    }

    /// An impulse of a load on the centre of a ball: the body that it moves, and what it turns is noted. None of a wall that does not move freely.
    pub fn push(&mut self, model: &Model, ball: u32, impulse: DVec3) -> Option<usize> {
        if let Some(number) = model.clump_of(ball) {
            self.moment[number] += self.middle[ball as usize].cross(impulse);
        }
        Some(model.mover(ball)? as usize)
    }

    /// Inverse mass of a body at a contact along its normal, 1/kg; 0 of a wall that does not move freely.
    pub fn inverse_mass(&self, model: &Model, body: u32, normal: DVec3) -> f64 {
        let turning = model.clump_of(body).map_or(0.0, |number| {
            let arm = self.middle[body as usize].cross(normal);
            let turned = model.clumps[number].turning(self.orientation[number], arm);
            arm.dot(turned)
        });
        let moving = model
            .mover(body)
            .map_or(0.0, |i| model.inv_mass[i as usize]);
        moving + turning
    }

    /// Angular momenta of a clump with what cohesion gave it, kg m^2/s: at t_n, and with the moments of the smooth step.
    pub(super) fn momenta(&self, number: usize) -> [DVec3; 2] {
        [self.at_start[number], self.momentum[number]].map(|of| of + self.moment[number])
    }

    /// Angular velocity of a body that impacts find, rad/s.
    pub(crate) fn spin_before(&self, model: &Model, state: &State, body: u32) -> DVec3 {
        match model.as_clump(body) {
            Some(number) => self.spin_before[number],
            None => state.angular_velocity[body as usize],
        }
    }

    /// How far (rad) the clump of a ball, or its angular velocity, has turned since the loads were solved; 0 of what belongs to none.
    pub fn turned_since_loads(&self, model: &Model, ball: u32) -> f64 {
        model.clump_of(ball).map_or(0.0, |k| {
            let turn = self.orientation[k] * self.at_loads[k].inverse();
            self.turned_along[k].max(2.0 * turn.xyz().length())
        })
    }

    /// Jacobian rows of a contact over the nodes of its bodies, with the given normal ([`Contact::rows`]); returns their number.
    #[inline]
    pub fn rows(&self, model: &Model, c: &Contact, normal: DVec3, rows: &mut Rows) -> usize {
        let count = c.rows(model, normal, rows);
        self.fold_rows(model, c, &self.lever, &mut rows[..count]);
        count
    }

    /// Those along which loads act ([`Contact::middle`]): clumps too stand half-way between both ends of the step.
    #[inline]
    pub fn middle_rows(&self, model: &Model, c: &Contact, rows: &mut Rows) {
        let middle = c.middle();
        let count = middle.rows(model, middle.n1, rows);
        self.fold_rows(model, c, &self.middle, &mut rows[..count]);
    }

    #[inline]
    fn fold_rows(
        &self,
        model: &Model,
        c: &Contact,
        levers: &[DVec3],
        rows: &mut [[[f64; NODE_DOF]; 2]],
    ) {
        if !self.orientation.is_empty() {
            for (side, ball) in [(0, c.a), (1, c.b)] {
                if let Some(clump) = model.clump_of(ball) {
                    let lever = levers[ball as usize];
                    rows.iter_mut()
                        .for_each(|row| self.fold(clump, lever, &mut row[side]));
                }
            }
        }
    }

    /// A gradient over the velocities of a ball as one over those of the node of its clump.
    pub fn fold(&self, clump: usize, lever: DVec3, row: &mut [f64; NODE_DOF]) {
        let [v, w] = halves(row);
        let turn = self.scale[clump][0] * (w + lever.cross(v));
        row[3..].copy_from_slice(&turn.to_array());
    }

    /// Velocities of a body as those of its node, and of a node as those of its body. S is symmetric: so wrenches and gradients of a body go the other
    /// way.
    #[inline]
    pub fn to_node(&self, model: &Model, body: u32, motion: [DVec3; 2]) -> [DVec3; 2] {
        self.scaled(model, body, motion, 1)
    }

    #[inline]
    pub fn from_node(&self, model: &Model, body: u32, motion: [DVec3; 2]) -> [DVec3; 2] {
        self.scaled(model, body, motion, 0)
    }

    #[inline]
    fn scaled(&self, model: &Model, body: u32, [v, w]: [DVec3; 2], which: usize) -> [DVec3; 2] {
        match model.as_clump(body) {
            Some(clump) => [v, self.scale[clump][which] * w],
            None => [v, w],
        }
    }
}

/// Positions of balls of an island at the position level, by the corrections `u` of its nodes.
pub(crate) struct ClumpPositions<'a> {
    pub model: &'a Model,
    pub state: &'a State,
    pub clumps: &'a Clumps,
    pub angular: &'a [Prediction],
    /// What the loads have moved them by since the smooth step.
    pub load_shift: &'a [[DVec3; 2]],
}

impl ClumpPositions<'_> {
    /// Centre of a ball from that of its clump, whose node has the correction `u`; none of what belongs to no clump.
    pub fn lever(&self, ball: u32, u: &[f64]) -> Option<(usize, DVec3)> {
        let number = self.model.clump_of(ball)?;
        let clump = &self.model.clumps[number];
        let i = self.model.balls() + number;
        let [_, by_loads] = self.load_shift.get(i).copied().unwrap_or_default();
        let own = self.clumps.scale[number][0] * halves(u)[1];
        let turn = self.angular[i].displacement + by_loads + own;
        let q = advance(turn, self.state.orientation[i]);
        Some((number, q * clump.offsets[ball as usize - clump.balls.start]))
    }
}
