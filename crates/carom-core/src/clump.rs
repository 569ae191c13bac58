//! Clumps: rigid bodies of balls. `docs/theory/algorithm.md` section 15.
//!
//! A clump is a body of its own behind the balls, with the mass, and a tensor of inertia. Its balls have no mass: they meet what they
//! touch, and follow. In contact problems the clump is the node of all its balls ([`Clumps::rows`]). Nodes have one moment of inertia: that of a
//! clump counts its angular velocity `w` as `y`, `w = S y`, with `S^T J S` the mean moment times the unit matrix.

use crate::contact::Contact;
use crate::model::Model;
use crate::outcome::Failure;
use crate::rotation::{advance, increment};
use crate::rows::Rows;
use crate::scratch::Scratch;
use crate::state::State;
use crate::stepper::Prediction;
use carom_solve::rows::NODE_DOF;
use glam::{DMat3, DQuat, DVec3};
use std::ops::Range;

/// Turn of a clump in a step (rad) from which on its balls may pass others within it: the step is divided. Larger: they do.
const TOO_FAR: f64 = 1.0;
/// Parts of a step (1) of second order that together are one of sixth (H. Yoshida, Phys. Lett. A 150, 1990, solution A).
const COMPOSITION: [f64; 7] = {
    let [a, b, c] = [
        0.784_513_610_477_557_3,
        0.235_573_213_359_358_13,
        -1.177_679_984_178_871,
    ];
    [a, b, c, 1.0 - 2.0 * (a + b + c), c, b, a]
};

/// A clump as it is given: its balls stand as they do at the start.
#[derive(Clone, Debug)]
pub struct ClumpInput {
    /// Its balls, one after the other.
    pub balls: Range<usize>,
    /// kg; principal moments of inertia, kg m^2.
    pub mass: f64,
    pub inertia: [f64; 3],
    /// Centre of mass, and its principal axes as a unit quaternion, w first.
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    pub velocity: [f64; 3],
    pub angular_velocity: [f64; 3],
}

/// A clump of a model.
#[derive(Clone, Debug)]
pub struct Clump {
    pub balls: Range<usize>,
    /// Centres of its balls from its centre of mass along its principal axes, m.
    pub offsets: Vec<DVec3>,
    /// Principal moments of inertia, kg m^2.
    pub inertia: DVec3,
    split: ([[DVec3; 2]; 2], f64),
}

impl Clump {
    pub fn new(input: &ClumpInput, position: &[[f64; 3]]) -> Clump {
        let (x, q) = (DVec3::from(input.position), quaternion(input.orientation));
        let balls = position[input.balls.clone()].iter();
        Clump {
            balls: input.balls.clone(),
            offsets: balls.map(|b| q.inverse() * (DVec3::from(*b) - x)).collect(),
            inertia: DVec3::from(input.inertia),
            split: split(DVec3::from(input.inertia)),
        }
    }

    /// The moment of inertia of its node, kg m^2.
    pub fn mean_inertia(&self) -> f64 {
        self.inertia.element_sum() / 3.0
    }

    /// Angular momentum at an orientation, kg m^2/s.
    pub fn momentum(&self, q: DQuat, w: DVec3) -> DVec3 {
        q * (self.inertia * (q.inverse() * w))
    }

    /// The angular velocity of an angular momentum, rad/s.
    pub fn turning(&self, q: DQuat, momentum: DVec3) -> DVec3 {
        q * ((q.inverse() * momentum) / self.inertia)
    }

    /// Energy of its turning beyond that of its node with the same angular velocity, J.
    pub fn energy_beyond(&self, q: DQuat, w: DVec3) -> f64 {
        0.5 * (w.dot(self.momentum(q, w)) - self.mean_inertia() * w.length_squared())
    }

    /// `S` at an orientation, and its inverse.
    fn scales(&self, q: DQuat) -> [DMat3; 2] {
        let (axes, mean) = (DMat3::from_quat(q), self.mean_inertia());
        let root = (mean / self.inertia).map(f64::sqrt);
        [root, root.recip()].map(|s| axes * DMat3::from_diagonal(s) * axes.transpose())
    }

    /// Where it turns to in `h` without moments, from its angular momentum, which stays.
    ///
    /// With `J_r` a moment, `1/J_r` of the momentum turns it about the momentum, whatever the rest does. The rest is one turn about each of both
    /// other principal axes, one after the other and back: of second order, the same backwards in time, and exact where two moments are equal.
    fn free_turn(&self, q: DQuat, momentum: DVec3, h: f64) -> DQuat {
        let ([a, c], mean) = self.split;
        let mut to = q;
        let mut twist = |[axis, rate]: [DVec3; 2], h: f64| {
            let along = axis.dot(to.inverse() * momentum);
            to = (to * advance(along * h * rate, DQuat::IDENTITY)).normalize();
        };
        for share in COMPOSITION {
            let h = share * h;
            twist(c, 0.5 * h);
            twist(a, h);
            twist(c, 0.5 * h);
        }
        advance(h / mean * momentum, to)
    }
}

/// Two principal axes, each with itself times what `1/J` has there beyond that of the third axis, and the moment about that one. The axis with the
/// other two moments nearest to one another comes first: turns about the second one are slow.
fn split(inertia: DVec3) -> ([[DVec3; 2]; 2], f64) {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let rate = |k: usize| 1.0 / inertia[k];
    let apart = |a: usize| (rate((a + 1) % 3) - rate((a + 2) % 3)).abs();
    let nearest = |a: &usize, b: &usize| apart(*a).total_cmp(&apart(*b));
    let a = (0..3).min_by(nearest).unwrap_or(0);
    let (mean, c) = ((a + 1) % 3, (a + 2) % 3);
    let beyond = |k: usize| [axes[k], (rate(k) - rate(mean)) * axes[k]];
    ([beyond(a), beyond(c)], inertia[mean])
}

/// Of four numbers, w first.
pub fn quaternion(q: [f64; 4]) -> DQuat {
    DQuat::from_xyzw(q[1], q[2], q[3], q[0]).normalize()
}

/// The clumps of a step as they stand at the positions of the level at hand. Empty without clumps.
#[derive(Clone, Debug, Default)]
pub struct Clumps {
    /// Centres of all balls from the centre of mass of their clump, m; 0 where they have none.
    lever: Vec<DVec3>,
    /// The same half-way between both ends of the step.
    middle: Vec<DVec3>,
    pub orientation: Vec<DQuat>,
    /// At which the loads were solved, and where these have turned them.
    at_loads: Vec<DQuat>,
    by_loads: Vec<DQuat>,
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
            at_loads: vec![DQuat::IDENTITY; count],
            by_loads: vec![DQuat::IDENTITY; count],
            scale: vec![[DMat3::IDENTITY; 2]; count],
        }
    }

    /// Turns a clump from its orientation at t_n to another one.
    fn put(&mut self, clump: &Clump, number: usize, [from, to]: [DQuat; 2]) {
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

    /// How far (rad) the clump of a ball has turned since the loads were solved; 0 of what belongs to none.
    pub fn turned_since_loads(&self, model: &Model, ball: u32) -> f64 {
        model.clump_of(ball).map_or(0.0, |k| {
            let turn = self.orientation[k] * self.at_loads[k].inverse();
            2.0 * turn.xyz().length()
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
        let (v, w) = parts(row);
        let turn = self.scale[clump][0] * (w + lever.cross(v));
        row[3..].copy_from_slice(&turn.to_array());
    }

    /// Velocities of a body as those of its node, and of a node as those of its body.
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

/// Both halves of a row.
fn parts(row: &[f64; NODE_DOF]) -> (DVec3, DVec3) {
    (
        DVec3::new(row[0], row[1], row[2]),
        DVec3::new(row[3], row[4], row[5]),
    )
}

/// The motion of clumps without contacts, once their centres have it, and of their balls. Fails if one turns too far in the step.
pub(crate) fn predict(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    h: f64,
) -> Result<(), Failure> {
    for (i, clump) in model.numbered_clumps() {
        let (q, w) = (state.orientation[i], state.angular_velocity[i]);
        let momentum = clump.momentum(q, w);
        let to = clump.free_turn(q, momentum, h);
        let (end, turn) = (clump.turning(to, momentum), to * q.inverse());
        let turn = increment(turn);
        let most = w.length().max(end.length()) * h;
        if most > TOO_FAR {
            let (ball, reach) = (clump.balls.start as u32, model.radius[i]);
            return Err(Failure::TooFar {
                bodies: (ball, ball),
                travel: most * reach,
                length: TOO_FAR * reach,
            });
        }
        scratch.angular[i] = Prediction {
            velocity: end,
            displacement: turn,
            pseudo: DVec3::ZERO,
            acceleration: (end - w) / h,
        };
        for ball in clump.balls.clone() {
            (scratch.linear[ball], scratch.angular[ball]) =
                (Prediction::default(), scratch.angular[i]);
        }
    }
    place(model, state, scratch, |_| [DVec3::ZERO; 2]);
    for (i, clump) in model.numbered_clumps() {
        for ball in clump.balls.clone() {
            scratch.linear[ball].displacement = scratch.position[ball] - state.position[ball];
        }
        give(clump, i, scratch);
    }
    let clumps = &mut scratch.clumps;
    clumps.at_loads.clone_from(&clumps.orientation);
    Ok(())
}

/// Puts clumps where their centres are and turns them; `moved` are the corrections of both since the smooth step. Their balls follow.
fn place(model: &Model, state: &State, scratch: &mut Scratch, moved: impl Fn(usize) -> [DVec3; 2]) {
    for (number, (i, clump)) in model.numbered_clumps().enumerate() {
        let turn = scratch.angular[i].displacement + moved(i)[1];
        let q = advance(turn, state.orientation[i]);
        scratch.clumps.put(clump, number, [state.orientation[i], q]);
        for ball in clump.balls.clone() {
            scratch.position[ball] = scratch.position[i] + scratch.clumps.lever[ball];
        }
    }
}

/// The same after a correction of positions, which then has what the balls were moved by.
pub(crate) fn follow(model: &Model, state: &State, scratch: &mut Scratch, of_loads: bool) {
    if model.clumps.is_empty() {
        return;
    }
    let correction = |scratch: &mut Scratch| match of_loads {
        true => std::mem::take(&mut scratch.load_shift),
        false => std::mem::take(&mut scratch.shift),
    };
    let mut shift = correction(scratch);
    place(model, state, scratch, |i| shift[i]);
    if of_loads {
        let clumps = &mut scratch.clumps;
        clumps.by_loads.clone_from(&clumps.orientation);
    }
    for (i, clump) in model.numbered_clumps() {
        for ball in clump.balls.clone() {
            let smooth = state.position[ball] + scratch.linear[ball].displacement;
            shift[ball] = [scratch.position[ball] - smooth, shift[i][1]];
        }
    }
    *if of_loads {
        &mut scratch.load_shift
    } else {
        &mut scratch.shift
    } = shift;
}

/// Clumps and their balls where the loads have brought them, before positions were corrected.
pub(crate) fn turn_back(model: &Model, state: &State, scratch: &mut Scratch) {
    let by_loads = std::mem::take(&mut scratch.load_shift);
    place(model, state, scratch, |i| by_loads[i]);
    scratch.load_shift = by_loads;
}

/// Velocities before impacts, of clumps that have been turned since the smooth step. While loads turn them the angular momentum stays. What corrects
/// positions takes their angular velocity along with the body: it would give them energy, or a spin that no force makes.
pub(crate) fn turn_velocities(model: &Model, state: &State, scratch: &mut Scratch) {
    for (number, (i, clump)) in model.numbered_clumps().enumerate() {
        let momentum = clump.momentum(state.orientation[i], state.angular_velocity[i]);
        let (by_loads, end) = (
            scratch.clumps.by_loads[number],
            scratch.clumps.orientation[number],
        );
        let corrected = end * by_loads.inverse();
        scratch.angular[i].velocity = corrected * clump.turning(by_loads, momentum);
        give(clump, i, scratch);
    }
}

/// The velocities of a clump to its balls.
fn give(clump: &Clump, i: usize, scratch: &mut Scratch) {
    let (v, w) = (scratch.linear[i].velocity, scratch.angular[i].velocity);
    for ball in clump.balls.clone() {
        scratch.linear[ball].velocity = v + w.cross(scratch.clumps.lever[ball]);
        scratch.angular[ball].velocity = w;
    }
}

/// The jumps of clumps to their balls.
pub(crate) fn give_jumps(model: &Model, scratch: &mut Scratch) {
    for (i, clump) in model.numbered_clumps() {
        let [v, w] = scratch.jump[i];
        for ball in clump.balls.clone() {
            scratch.jump[ball] = [v + w.cross(scratch.clumps.lever[ball]), w];
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
        let own = self.clumps.scale[number][0] * DVec3::new(u[3], u[4], u[5]);
        let turn = self.angular[i].displacement + by_loads + own;
        let q = advance(turn, self.state.orientation[i]);
        Some((number, q * clump.offsets[ball as usize - clump.balls.start]))
    }
}

/// Kinetic energy of clumps beyond that of their nodes with the new velocities, J.
pub(crate) fn kinetic_beyond(model: &Model, scratch: &Scratch) -> f64 {
    let energy = |(number, (i, clump)): (usize, (usize, &Clump))| {
        clump.energy_beyond(scratch.clumps.orientation[number], scratch.jump[i][1])
    };
    model.numbered_clumps().enumerate().map(energy).sum()
}
