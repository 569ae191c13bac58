//! Bilateral constraints (set `U-bar` of eqs. 1-13): points held, guided or shared, rods, locked axes, prescribed motion.
//!
//! A joint is a group of up to six rows between sphere A and sphere B or the ground, of three kinds. `docs/theory/algorithm.md`
//! section 7 has their measures; gradients are over spatial velocities `(v_A, w_A, v_B, w_B)`.

use crate::clump::body::Carrier;
use crate::rotation;
use crate::rows::Rows;
use crate::stepper::Span;
use carom_laws::Scalar;
use glam::{DMat3, DQuat, DVec3};

/// Body B of a joint with the ground.
pub const GROUND: u32 = u32::MAX;

/// What a row holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowKind {
    /// `d . (p_A - p_B) = c(t)`, `d` in fixed axes.
    Point,
    /// `|p_A - p_B| = c(t)`.
    Distance,
    /// Rotation of A relative to B about the fixed axis `d` follows `c(t)`.
    Rotation,
}

#[derive(Clone, Debug)]
pub struct JointRow {
    pub kind: RowKind,
    /// Unit vector, fixed axes.
    pub direction: DVec3,
    /// Attachment points in the bodies' axes, from their centres; of the ground: the fixed point.
    pub arm_a: DVec3,
    pub arm_b: DVec3,
    /// `c(t)`, m or rad.
    pub law: Scalar,
}

#[derive(Clone, Debug)]
pub struct Joint {
    /// Sphere A.
    pub a: u32,
    /// Sphere B or [`GROUND`].
    pub b: u32,
    /// Points and distances first.
    pub rows: Vec<JointRow>,
    /// Number of these.
    pub translational: usize,
    /// Radius of A, m: makes rotational rows comparable.
    pub length: f64,
}

/// Placement of a body.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub position: DVec3,
    pub orientation: DQuat,
}

impl Pose {
    /// The ground: arms are fixed points.
    pub const GROUND: Pose = Pose {
        position: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
    };
}

/// Velocity of a body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Twist {
    pub velocity: DVec3,
    pub angular_velocity: DVec3,
}

/// A row at a placement.
struct PlacedRow {
    direction: DVec3,
    /// World arms.
    arm_a: DVec3,
    arm_b: DVec3,
    /// `p_A - p_B`.
    between: DVec3,
}

impl Joint {
    /// The same on the clumps that its balls belong to.
    pub fn carried(&self, by: &dyn Fn(u32) -> Option<Carrier>) -> Joint {
        let mut joint = self.clone();
        if let Some(clump) = by(self.a) {
            joint.a = clump.body;
            (joint.rows.iter_mut()).for_each(|row| row.arm_a = clump.arm(row.arm_a));
        }
        if let Some(clump) = (!self.grounded()).then(|| by(self.b)).flatten() {
            joint.b = clump.body;
            (joint.rows.iter_mut()).for_each(|row| row.arm_b = clump.arm(row.arm_b));
        }
        joint
    }

    pub fn grounded(&self) -> bool {
        self.b == GROUND
    }

    fn place(&self, row: &JointRow, a: &Pose, b: &Pose) -> PlacedRow {
        let arm_a = a.orientation * row.arm_a;
        // A point of the ground has no arm that turns.
        let (arm_b, point_b) = if self.grounded() {
            (DVec3::ZERO, row.arm_b)
        } else {
            let arm = b.orientation * row.arm_b;
            (arm, b.position + arm)
        };
        let between = a.position + arm_a - point_b;
        let direction = if row.kind == RowKind::Distance {
            between.normalize_or_zero()
        } else {
            row.direction
        };
        PlacedRow {
            direction,
            arm_a,
            arm_b,
            between,
        }
    }

    /// Gradient of every row; returns their number.
    pub fn gradient(&self, a: &Pose, b: &Pose, out: &mut Rows) -> usize {
        for (row, g) in self.rows.iter().zip(out.iter_mut()) {
            let p = self.place(row, a, b);
            let d = p.direction;
            let (va, wa, wb) = if row.kind == RowKind::Rotation {
                (DVec3::ZERO, d, d)
            } else {
                (d, p.arm_a.cross(d), p.arm_b.cross(d))
            };
            let (vb, wb) = if self.grounded() {
                (DVec3::ZERO, DVec3::ZERO)
            } else {
                (-va, -wb)
            };
            *g = [join(va, wa), join(vb, wb)];
        }
        self.rows.len()
    }

    /// [`Joint::gradient`] at a pair of placements.
    pub fn gradient_at(&self, [a, b]: &[Pose; 2], out: &mut Rows) -> usize {
        self.gradient(a, b, out)
    }

    /// Measures of points and distances, `g - c(t)`; rotations are left alone.
    pub fn position_measures(&self, a: &Pose, b: &Pose, time: f64, out: &mut [f64]) {
        for (row, z) in self.rows.iter().zip(out).take(self.translational) {
            let p = self.place(row, a, b);
            let value = if row.kind == RowKind::Distance {
                p.between.length()
            } else {
                p.direction.dot(p.between)
            };
            *z = value - row.law.value(time);
        }
    }

    /// Measures of rotations over a step: `e . (psi_A - psi_B) - (c(t1) - c(t0))`.
    pub fn rotation_measures(&self, psi_a: DVec3, psi_b: DVec3, span: Span, out: &mut [f64]) {
        for (row, z) in self.rows.iter().zip(out).skip(self.translational) {
            let turned = row.direction.dot(psi_a - psi_b);
            *z = turned - (row.law.value(span.end) - row.law.value(span.start));
        }
    }

    /// `c'(t)` of every row.
    pub fn rates(&self, time: f64, out: &mut [f64]) {
        for (row, rate) in self.rows.iter().zip(out) {
            *rate = row.law.slope(time);
        }
    }

    /// Whether the row prescribes a motion, so that it may do work.
    pub fn prescribes(&self, row: usize) -> bool {
        !self.rows[row].law.is_constant()
    }

    /// `d(G v)/dq` of every row at fixed velocities, over the placements of A and B (`G^s` of eq. 11).
    pub fn gradient_rate(&self, a: (&Pose, &Twist), b: (&Pose, &Twist), out: &mut Rows) {
        for (row, g) in self.rows.iter().zip(out.iter_mut()) {
            *g = [[0.0; 6]; 2];
            if row.kind == RowKind::Rotation {
                continue;
            }
            let p = self.place(row, a.0, b.0);
            let d = p.direction;
            // d . (w x (dtheta x s)) = dtheta . (s x (d x w)).
            let turn = |arm: DVec3, w: DVec3| arm.cross(d.cross(w));
            let (mut xa, mut ta) = (DVec3::ZERO, turn(p.arm_a, a.1.angular_velocity));
            let mut tb = -turn(p.arm_b, b.1.angular_velocity);
            let mut xb = DVec3::ZERO;
            if row.kind == RowKind::Distance {
                let length = p.between.length();
                let rate = a.1.velocity + a.1.angular_velocity.cross(p.arm_a)
                    - b.1.velocity
                    - b.1.angular_velocity.cross(p.arm_b);
                let across = (rate - d * d.dot(rate)) / length;
                xa += across;
                ta += p.arm_a.cross(across);
                xb -= across;
                tb -= p.arm_b.cross(across);
            }
            if self.grounded() {
                (xb, tb) = (DVec3::ZERO, DVec3::ZERO);
            }
            *g = [join(xa, ta), join(xb, tb)];
        }
    }

    /// `d(G^T lambda)/dq` over the placements: blocks (AA, AB, BA, BB), added to `out`.
    pub fn gradient_stiffness(
        &self,
        a: &Pose,
        b: &Pose,
        lambda: &[f64],
        out: &mut [[Block6; 2]; 2],
    ) {
        for (row, &l) in self.rows.iter().zip(lambda) {
            if row.kind == RowKind::Rotation || l == 0.0 {
                continue;
            }
            let p = self.place(row, a, b);
            let f = l * p.direction;
            // Moment s x f on each side with s turning: d(s x f) = (dtheta x s) x f = -f x (dtheta x s).
            add_block(&mut out[0][0], 1, 1, skew(f) * skew(p.arm_a), 1.0);
            if !self.grounded() {
                add_block(&mut out[1][1], 1, 1, skew(f) * skew(p.arm_b), -1.0);
            }
            if row.kind == RowKind::Distance {
                let length = p.between.length();
                let d = p.direction;
                let across = (l / length) * (DMat3::IDENTITY - outer(d, d));
                // df = across (dx_A + dtheta_A x s_A - dx_B - dtheta_B x s_B), moments s x df.
                let sides = [(p.arm_a, 1.0), (p.arm_b, -1.0)];
                let count = if self.grounded() { 1 } else { 2 };
                for (i, &(si, sign_i)) in sides.iter().enumerate().take(count) {
                    for (j, &(sj, sign_j)) in sides.iter().enumerate().take(count) {
                        lever_blocks(&mut out[i][j], across, si, sj, sign_i * sign_j);
                    }
                }
            }
        }
    }
}

/// Adds what row `r` of a joint gives sphere A with multiplier `lambda`: force at the joint, or moment.
pub fn add_reaction(
    joint: &Joint,
    r: usize,
    row: &[[f64; 6]; 2],
    lambda: f64,
    out: &mut [DVec3; 2],
) {
    let (part, first) = if r < joint.translational {
        (0, 0)
    } else {
        (1, 3)
    };
    let side = &row[0];
    out[part] += lambda * DVec3::new(side[first], side[first + 1], side[first + 2]);
}

/// A dense 6 x 6 block over (translation, rotation) of two bodies.
pub type Block6 = [[f64; 6]; 6];

/// Adds `factor * m` at the 3 x 3 place (row, col) of a block.
pub fn add_block(out: &mut Block6, row: usize, col: usize, m: DMat3, factor: f64) {
    for i in 0..3 {
        for j in 0..3 {
            out[3 * row + i][3 * col + j] += factor * m.col(j)[i];
        }
    }
}

/// Adds a stiffness `k` between points at the end of levers `si`, `sj`: force and moment over translation and rotation.
pub fn lever_blocks(out: &mut Block6, k: DMat3, si: DVec3, sj: DVec3, factor: f64) {
    add_block(out, 0, 0, k, factor);
    add_block(out, 0, 1, k * skew(sj), -factor);
    add_block(out, 1, 0, skew(si) * k, factor);
    add_block(out, 1, 1, skew(si) * k * skew(sj), -factor);
}

/// `a x` as a matrix.
pub fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(0.0, a.z, -a.y),
        DVec3::new(-a.z, 0.0, a.x),
        DVec3::new(a.y, -a.x, 0.0),
    )
}

/// `a b^T`.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[inline]
fn join(v: DVec3, w: DVec3) -> [f64; 6] {
    [v.x, v.y, v.z, w.x, w.y, w.z]
}

/// Turns the rotational part of gradient rows from the rotation to the increment `psi` (`T(psi)^T` of section 7).
pub fn over_increment(rows: &mut [[[f64; 6]; 2]], psi_a: DVec3, psi_b: DVec3) {
    for row in rows {
        for (side, psi) in row.iter_mut().zip([psi_a, psi_b]) {
            let w = rotation::transposed_left_jacobian(psi, DVec3::new(side[3], side[4], side[5]));
            side[3..6].copy_from_slice(&w.to_array());
        }
    }
}
