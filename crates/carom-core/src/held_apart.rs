//! Pairs of spheres of one clump, and those whose joints keep their centres at one distance, or join them where they touch. They have no contact:
//! joints hold its normal already, so that nothing would determine its force (`docs/theory/algorithm.md`, section 7).

use crate::clump::body::Clump;
use crate::joint::{outer, Joint, JointRow, RowKind};
use carom_laws::Scalar;
use carom_solve::clusters::{apart, Forest};
use glam::{DMat3, DVec3};

/// Volume (1) that three unit axes span from which they are three. Too small: axes in a plane count as three, and a hinge as a clump.
const THREE: f64 = 1e-6;

/// How far beyond the surfaces (1, of the sum of the radii) a ball joint may be that still joins two spheres where they touch. At 0 rounding
/// decides; large, spheres with room between them pass through one another.
const AT_SURFACE: f64 = 1e-3;

/// These pairs, of a model.
#[derive(Clone, Debug, Default)]
pub struct HeldApart {
    /// The lowest sphere of the clump, given or made by joints, that each sphere belongs to; empty without joints and clumps.
    clump: Vec<u32>,
    /// Pairs that a rod or a ball joint holds, in their order.
    pairs: Vec<(u32, u32)>,
    /// Whether each sphere has a joint; empty without joints.
    jointed: Vec<bool>,
}

impl HeldApart {
    pub fn new(joints: &[Joint], radius: &[f64], clumps: &[Clump]) -> HeldApart {
        let spheres = radius.len();
        if joints.is_empty() && clumps.is_empty() {
            return HeldApart::default();
        }
        let key = |j: &Joint| (j.a.min(j.b), j.a.max(j.b));
        let mut sorted: Vec<&Joint> = joints.iter().filter(|j| !j.grounded()).collect();
        sorted.sort_by_key(|j| key(j));
        let (mut clump, mut pairs) = (apart(spheres), Vec::new());
        for same in sorted.chunk_by(|a, b| key(a) == key(b)) {
            let sum = radius[same[0].a as usize] + radius[same[0].b as usize];
            if same.iter().any(|j| keeps_apart(j, sum)) {
                pairs.push(key(same[0]));
            }
            let rows = same.iter().flat_map(|j| &j.rows);
            if same.iter().any(|j| spans_space(&j.rows, RowKind::Point))
                && spans_space(rows, RowKind::Rotation)
            {
                clump.join(same[0].a, same[0].b);
            }
        }
        for balls in clumps.iter().map(|c| &c.balls) {
            let first = balls.start as u32;
            (balls.start + 1..balls.end).for_each(|ball| clump.join(first, ball as u32));
        }
        let clump = (0..spheres as u32).map(|i| clump.root(i)).collect();
        let mut jointed = vec![false; spheres];
        for body in joints.iter().flat_map(|j| [j.a, j.b]) {
            if let Some(of) = jointed.get_mut(body as usize) {
                *of = true;
            }
        }
        for balls in clumps.iter().map(|c| c.balls.clone()) {
            let of_any = jointed[balls.clone()].contains(&true);
            jointed[balls].fill(of_any);
        }
        HeldApart {
            clump,
            pairs,
            jointed,
        }
    }

    /// Whether a joint holds a body; bodies behind the spheres are walls.
    #[inline]
    pub fn has_joint(&self, body: usize) -> bool {
        self.jointed.get(body) == Some(&true)
    }

    /// Whether joints hold the spheres of a pair, the lower one first, at one distance.
    #[inline]
    pub fn holds(&self, pair: (u32, u32)) -> bool {
        let Some(clump) = self.clump.get(pair.0 as usize) else {
            return false;
        };
        self.clump.get(pair.1 as usize) == Some(clump) || self.pairs.binary_search(&pair).is_ok()
    }
}

/// A rod of constant length between the centres, or a common point that is the centre of one of both or where their surfaces touch; `sum` of
/// the radii.
fn keeps_apart(joint: &Joint, sum: f64) -> bool {
    let first = &joint.rows[0];
    let arms = [first.arm_a, first.arm_b].map(DVec3::length);
    let rod = first.kind == RowKind::Distance && is_constant(first) && arms == [0.0, 0.0];
    let at_centre = arms.contains(&0.0);
    let at_surface = arms[0] + arms[1] <= (1.0 + AT_SURFACE) * sum;
    rod || (at_centre || at_surface) && spans_space(&joint.rows, RowKind::Point)
}

fn is_constant(row: &JointRow) -> bool {
    matches!(row.law, Scalar::Constant(_))
}

/// Whether the constant rows of a kind hold all three directions.
fn spans_space<'j>(rows: impl IntoIterator<Item = &'j JointRow>, kind: RowKind) -> bool {
    let still = rows
        .into_iter()
        .filter(|row| row.kind == kind && is_constant(row));
    let products = still.map(|row| outer(row.direction, row.direction));
    let sum = products.fold(DMat3::ZERO, |sum, product| sum + product);
    sum.determinant() > THREE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::GROUND;

    const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

    fn joint(a: u32, b: u32, kind: RowKind, directions: &[DVec3], arm_a: DVec3) -> Joint {
        let rows = directions.iter().map(|&direction| JointRow {
            kind,
            direction,
            arm_a,
            arm_b: DVec3::ZERO,
            law: Scalar::Constant(0.0),
        });
        Joint {
            a,
            b,
            rows: rows.collect(),
            translational: directions.len() * usize::from(kind != RowKind::Rotation),
            length: 1.0,
        }
    }

    fn beside(a: u32, b: u32) -> Joint {
        let mut joint = joint(a, b, RowKind::Point, &AXES, DVec3::X);
        joint
            .rows
            .iter_mut()
            .for_each(|row| row.arm_b = DVec3::NEG_X);
        joint
    }

    fn touching(a: u32, b: u32) -> Joint {
        let mut joint = beside(a, b);
        joint.rows.iter_mut().for_each(|row| {
            (row.arm_a, row.arm_b) = (0.5 * DVec3::X, 0.5001 * DVec3::NEG_X);
        });
        joint
    }

    #[test]
    fn rods_between_centres_and_clumps_are_held_apart() {
        let lock = |a, b| joint(a, b, RowKind::Rotation, &AXES, DVec3::ZERO);
        let joints = [
            // a chain of three, one of its pairs named the other way around
            beside(0, 1),
            lock(0, 1),
            beside(2, 1),
            lock(1, 2),
            joint(3, 4, RowKind::Distance, &[DVec3::X], DVec3::ZERO),
            joint(6, 5, RowKind::Point, &AXES, DVec3::Y),
            touching(7, 8),
        ];
        let held = HeldApart::new(&joints, &[0.5; 9], &[]);
        for pair in [(0, 1), (1, 2), (0, 2), (3, 4), (5, 6), (7, 8)] {
            assert!(held.holds(pair), "{pair:?}");
        }
        // a wall is behind the spheres
        for pair in [(2, 3), (4, 5), (0, 7), (8, 9)] {
            assert!(!held.holds(pair), "{pair:?}");
        }
    }

    #[test]
    fn what_may_come_closer_is_not() {
        let mut longer = joint(4, 5, RowKind::Distance, &[DVec3::X], DVec3::ZERO);
        longer.rows[0].law = Scalar::Polynomial(vec![1.0, 0.1]);
        let joints = [
            // a ball joint alone, a hinge, a rod that is not between the centres, one that grows, balls that the ground holds
            beside(0, 1),
            beside(2, 3),
            joint(2, 3, RowKind::Rotation, &AXES[..2], DVec3::ZERO),
            longer,
            joint(6, 7, RowKind::Distance, &[DVec3::X], DVec3::X),
            joint(8, GROUND, RowKind::Point, &AXES, DVec3::ZERO),
            joint(9, GROUND, RowKind::Point, &AXES, DVec3::ZERO),
        ];
        let held = HeldApart::new(&joints, &[0.5; 10], &[]);
        for pair in [(0, 1), (2, 3), (4, 5), (6, 7), (8, 9)] {
            assert!(!held.holds(pair), "{pair:?}");
        }
        assert!(!HeldApart::new(&[], &[0.5; 4], &[]).holds((0, 1)));
    }
}
