//! A clump by itself: what it is, and how it turns without moments.

use crate::rotation::advance;
use glam::{DMat3, DQuat, DVec3};
use std::ops::Range;

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

    /// Tensor of inertia at an orientation beyond the mean moment times the unit matrix, kg m^2.
    pub fn inertia_beyond(&self, q: DQuat) -> DMat3 {
        let (axes, beyond) = (DMat3::from_quat(q), self.inertia - self.mean_inertia());
        axes * DMat3::from_diagonal(beyond) * axes.transpose()
    }

    /// Energy of its turning beyond that of its node with the same angular velocity, J.
    pub fn energy_beyond(&self, q: DQuat, w: DVec3) -> f64 {
        0.5 * (w.dot(self.momentum(q, w)) - self.mean_inertia() * w.length_squared())
    }

    /// `S` at an orientation, and its inverse.
    pub fn scales(&self, q: DQuat) -> [DMat3; 2] {
        let (axes, mean) = (DMat3::from_quat(q), self.mean_inertia());
        let root = (mean / self.inertia).map(f64::sqrt);
        [root, root.recip()].map(|s| axes * DMat3::from_diagonal(s) * axes.transpose())
    }

    /// Where it turns to in `h` without moments, from its angular momentum, which stays.
    ///
    /// With `J_r` a moment, `1/J_r` of the momentum turns it about the momentum, whatever the rest does. The rest is one turn about each of both
    /// other principal axes, one after the other and back: of second order, the same backwards in time, and exact where two moments are equal.
    pub fn free_turn(&self, q: DQuat, momentum: DVec3, h: f64) -> DQuat {
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

/// Where a ball is in the clump that carries it.
#[derive(Clone, Copy, Debug)]
pub struct Carrier {
    /// The clump among the bodies.
    pub body: u32,
    /// Centre of the ball from the centre of mass, m, and the axes of the ball, both along the principal axes of the clump.
    pub centre: DVec3,
    pub axes: DQuat,
}

impl Carrier {
    /// A point of the ball as one of the clump, both from the centres in own axes.
    pub fn arm(&self, of_ball: DVec3) -> DVec3 {
        self.centre + self.axes * of_ball
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
