//! Pairs of spheres whose joints keep their centres at one distance. They have no contact: the joints hold its normal in every motion, so that
//! its force would be what nothing determines (`docs/theory/algorithm.md`, section 7).

use crate::joint::{outer, Joint, JointRow, RowKind};
use carom_laws::Scalar;
use carom_solve::clusters::{apart, Forest};
use glam::{DMat3, DVec3};

/// Volume (1) that three unit axes span from which they are three. Too small: axes in a plane count as three, and a hinge as a clump.
const THREE: f64 = 1e-6;

/// These pairs, of a model.
#[derive(Clone, Debug, Default)]
pub struct HeldApart {
    /// The lowest sphere of the clump that each sphere belongs to; empty without joints.
    clump: Vec<u32>,
    /// Pairs that a rod or a ball joint holds, in their order.
    pairs: Vec<(u32, u32)>,
    /// Whether each sphere has a joint; empty without joints.
    jointed: Vec<bool>,
}

impl HeldApart {
    pub fn new(joints: &[Joint], spheres: usize) -> HeldApart {
        if joints.is_empty() {
            return HeldApart::default();
        }
        let key = |j: &Joint| (j.a.min(j.b), j.a.max(j.b));
        let mut sorted: Vec<&Joint> = joints.iter().filter(|j| !j.grounded()).collect();
        sorted.sort_by_key(|j| key(j));
        let (mut clump, mut pairs) = (apart(spheres), Vec::new());
        for same in sorted.chunk_by(|a, b| key(a) == key(b)) {
            if same.iter().any(|j| keeps_distance(j)) {
                pairs.push(key(same[0]));
            }
            let rows = same.iter().flat_map(|j| &j.rows);
            if same.iter().any(|j| spans_space(&j.rows, RowKind::Point))
                && spans_space(rows, RowKind::Rotation)
            {
                clump.join(same[0].a, same[0].b);
            }
        }
        let clump = (0..spheres as u32).map(|i| clump.root(i)).collect();
        let mut jointed = vec![false; spheres];
        for body in joints.iter().flat_map(|j| [j.a, j.b]) {
            if let Some(of) = jointed.get_mut(body as usize) {
                *of = true;
            }
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

/// A rod of constant length between the centres, or a common point that is the centre of one of both.
fn keeps_distance(joint: &Joint) -> bool {
    let at_centre = |arm: DVec3| arm == DVec3::ZERO;
    let rod = joint.rows.iter().any(|row| {
        let centres = at_centre(row.arm_a) && at_centre(row.arm_b);
        row.kind == RowKind::Distance && is_constant(row) && centres
    });
    let first = &joint.rows[0];
    let pivot = at_centre(first.arm_a) || at_centre(first.arm_b);
    rod || pivot && spans_space(&joint.rows, RowKind::Point)
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
        ];
        let held = HeldApart::new(&joints, 8);
        for pair in [(0, 1), (1, 2), (0, 2), (3, 4), (5, 6)] {
            assert!(held.holds(pair), "{pair:?}");
        }
        // a wall is behind the spheres
        for pair in [(2, 3), (4, 5), (0, 7), (7, 8)] {
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
        let held = HeldApart::new(&joints, 10);
        for pair in [(0, 1), (2, 3), (4, 5), (6, 7), (8, 9)] {
            assert!(!held.holds(pair), "{pair:?}");
        }
        assert!(!HeldApart::new(&[], 4).holds((0, 1)));
    }
}
