//! Weight, pistons, cones of friction and overlaps.

use super::*;
use crate::common::{simulation, G, MASS, R};
use carom_core::scalar::Scalar;
use carom_core::wall::WallMotion;
use carom_core::ModelInput;
use scenes::{drop, from_state};

const BALLS: usize = 60;

/// A heap in a box after a second of falling and settling; the scene it came from, and itself at rest.
fn settled(h: f64) -> (ModelInput, Simulation) {
    let mut input = drop(BALLS, 4, [0.4, 0.0], 7);
    input.record_walls = true;
    let mut s = simulation(&input, options(h, 1e-4));
    converge(&mut s, (1.0 / h).round() as u64);
    (input, s)
}

/// Impulse on wall 0 along z of each step.
fn floor(s: &mut Simulation) -> Vec<f64> {
    let count = s.model.walls.len();
    let walls = s.take_block().walls;
    walls.chunks(6 * count).map(|w| w[2]).collect()
}

#[test]
fn a_settled_heap_weighs_what_its_balls_weigh() {
    let h = 1e-3;
    let (_, mut s) = settled(h);
    s.take_block();
    let reports = converge(&mut s, 1000);
    // One pile throughout; often the impulses of the last step are within the tolerance and no sweep is due.
    assert!(reports.iter().all(|r| r.largest_island > 100));
    assert!(reports.iter().any(|r| r.sweeps_velocity > 0));
    let steps = floor(&mut s);
    let weight = BALLS as f64 * MASS * G;
    close(-steps.iter().sum::<f64>(), weight, 1e-3 * weight);
}

/// A floor that rises at constant speed carries the weight and gives m g v t.
#[test]
fn a_piston_lifts_a_heap() {
    let (h, up) = (1e-3, 0.3);
    let (input, s) = settled(h);
    let mut input = from_state(&input, &s);
    for v in &mut input.velocity {
        v[2] += up;
    }
    let lift = WallMotion {
        translation: Some([
            Scalar::zero(),
            Scalar::zero(),
            Scalar::Polynomial(vec![0.0, up]),
        ]),
        ..WallMotion::default()
    };
    input.wall_motion = vec![(0, lift)];
    let mut s = simulation(&input, options(h, 1e-4));
    let reports = converge(&mut s, 1000);
    // One pile throughout; often the impulses of the last step are within the tolerance and no sweep is due.
    assert!(reports.iter().all(|r| r.largest_island > 100));
    assert!(reports.iter().any(|r| r.sweeps_velocity > 0));
    let steps = floor(&mut s);
    let weight = BALLS as f64 * MASS * G;
    let rise = s.monitors.energy_final - s.monitors.energy_initial;
    close(-steps.iter().sum::<f64>(), weight, 1e-3 * weight);
    close(s.monitors.energy_work, weight * up, 1e-3 * weight * up);
    close(rise, weight * up, 1e-3 * weight * up);
}

/// Overlap stays below what is asked; impulses lie in their cones to rounding and none pulls.
#[test]
fn contacts_overlap_and_pull_no_more_than_is_allowed() {
    let (mu, count, h, tolerance) = (0.4, 100, 5e-4, 1e-5);
    let input = drop(count, 4, [mu, 0.3], 11);
    let mut s = simulation(&input, options(h, tolerance));
    let reports = go_on(&mut s, 1000);
    let worst = reports.iter().map(|r| r.penetration).fold(0.0, f64::max);
    assert!(worst < 0.5 * tolerance * R, "{worst:e}");
    let block = s.take_block();
    let (mut used, mut slipping, mut first) = (0, 0, 0);
    for (r, end) in reports.iter().zip(&block.contact_end) {
        let records = &block.contacts[first..*end as usize];
        first = *end as usize;
        // Steps in which all contacts are one pile: small islands have tangents of t_n.
        if r.islands != 1 || r.sweeps_velocity == 0 {
            continue;
        }
        for c in records {
            // Sides have no friction.
            let mu = if c.key.1 > count as u32 { 0.0 } else { mu };
            let normal = c.impulse.dot(c.normal);
            let across = c.impulse.reject_from_normalized(c.normal).length();
            assert!(normal >= 0.0 && c.position_impulse.dot(c.normal) >= 0.0);
            assert!(across <= mu * normal + 1e-14 * normal, "{c:?}");
            used += 1;
            slipping += u32::from(mu > 0.0 && normal > 0.0 && across > 0.999 * mu * normal);
        }
    }
    assert!(used > 1000 && slipping > 100, "{used} {slipping}");
}
