//! Weight, pistons, cones of friction and overlaps.

use super::*;
use crate::common::{simulation, G, MASS, R};
use carom_core::wall::WallMotion;
use carom_core::ModelInput;
use carom_laws::Scalar;
use glam::DVec3;
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

/// Impulses along z on the floor (wall 0), and on all walls, since records were last taken. Rough walls carry a share.
fn vertical(s: &mut Simulation) -> [f64; 2] {
    let count = s.model.walls.len();
    let walls = s.take_block().walls;
    let z = |w: &[f64]| w.iter().skip(2).step_by(6).sum::<f64>();
    let steps = walls.chunks(6 * count);
    [steps.clone().map(|w| w[2]).sum(), steps.map(z).sum()]
}

fn momentum(s: &Simulation) -> f64 {
    MASS * s.state.velocity.iter().map(|v| v.z).sum::<f64>()
}

#[test]
fn a_settled_heap_weighs_what_its_balls_weigh() {
    let h = 1e-3;
    let (_, mut s) = settled(h);
    s.take_block();
    let before = momentum(&s);
    let reports = converge(&mut s, 1000);
    // One pile throughout; often the impulses of the last step are within the tolerance and no sweep is due.
    assert!(reports.iter().all(|r| r.largest_island > 100));
    assert!(reports.iter().any(|r| r.sweeps_velocity > 0));
    let gained = momentum(&s) - before;
    let [floor, all] = vertical(&mut s);
    let weight = BALLS as f64 * MASS * G;
    close(-all, weight + gained, 1e-9 * weight);
    assert!(-floor > 0.9 * weight);
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
    let before = momentum(&s);
    let reports = converge(&mut s, 1000);
    let gained = momentum(&s) - before;
    // One pile throughout; often the impulses of the last step are within the tolerance and no sweep is due.
    assert!(reports.iter().all(|r| r.largest_island > 100));
    assert!(reports.iter().any(|r| r.sweeps_velocity > 0));
    let [floor, all] = vertical(&mut s);
    let weight = BALLS as f64 * MASS * G;
    close(-all, weight + gained, 1e-9 * weight);
    // The floor alone moves. What it gives lifts the heap; friction at the walls takes the rest.
    close(s.monitors.energy_work, -floor * up, 1e-9 * weight * up);
    let rise = s.monitors.energy_final - s.monitors.energy_initial;
    close(rise, weight * up, 1e-2 * weight * up);
    assert!(rise < s.monitors.energy_work + 1e-6 * s.monitors.energy_scale);
}

/// Overlap stays below what is asked; impulses lie in their cones to rounding and none pulls.
#[test]
fn contacts_overlap_and_pull_no_more_than_is_allowed() {
    // A rattler makes a second island: of several piles some are whole.
    let [used, slipping, pulled] = (11..29)
        .map(records_in_cones)
        .fold([0; 3], |sum, own| [0, 1, 2].map(|k| sum[k] + own[k]));
    assert!(used > 500 && slipping > 100, "{used} {slipping}");
    assert!(pulled < used / 100, "{pulled} of {used}");
}

/// Checks one pile; the records of steps in which all contacts are one island, how many of them slip, and how many that have opened pull.
fn records_in_cones(seed: u64) -> [u32; 3] {
    let (mu, count, h, tolerance) = (0.4, 100, 5e-4, 1e-5);
    let input = drop(count, 4, [mu, 0.3], seed);
    let mut s = simulation(&input, options(h, tolerance));
    let reports = converge(&mut s, 1000);
    let worst = reports.iter().map(|r| r.penetration).fold(0.0, f64::max);
    assert!(worst < 0.5 * tolerance * R, "{worst:e}");
    let block = s.take_block();
    let (mut used, mut slipping, mut pulled, mut first) = (0, 0, 0, 0);
    for ((r, end), step) in reports.iter().zip(&block.contact_end).zip(1u64..) {
        let records = &block.contacts[first..*end as usize];
        first = *end as usize;
        // Steps in which all contacts are one pile, and loads alone act: along normals half-way between both ends.
        let hit = block.impacts.iter().any(|i| i.step == step);
        if r.islands != 1 || r.sweeps_velocity == 0 || hit || step < 2 {
            continue;
        }
        let start = &block.position[(step as usize - 2) * 3 * count..][..3 * count];
        for c in records {
            // Sides have no friction.
            let mu = if c.key.1 > count as u32 { 0.0 } else { mu };
            let at = |body: u32| DVec3::from_slice(&start[3 * body as usize..]);
            let middle = if c.key.1 < count as u32 {
                ((at(c.key.0) - at(c.key.1)).normalize() + c.normal).normalize()
            } else {
                c.normal
            };
            let normal = c.impulse.dot(middle);
            let across = c.impulse.reject_from_normalized(middle).length();
            let moved = c.position_impulse;
            // What has opened since lost its normal part along a normal that had turned.
            let pulls = moved.dot(middle) < -1e-5 * moved.length();
            assert!(normal >= 0.0 && (!pulls || c.gap > 1e-6 * R));
            assert!(moved.dot(middle) >= -1e-2 * moved.length());
            pulled += u32::from(pulls);
            assert!(across <= mu * normal + 1e-14 * normal, "{c:?}");
            used += 1;
            slipping += u32::from(mu > 0.0 && normal > 0.0 && across > 0.999 * mu * normal);
        }
    }
    [used, slipping, pulled]
}
