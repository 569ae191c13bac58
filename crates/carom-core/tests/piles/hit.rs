//! Large piles that are hit everywhere at once, for which the position level goes its own way: starts, rough rounds.

use super::*;
use crate::common::bits;
use crate::common::{simulation, R};
use scenes::drop;

const TOLERANCE: f64 = 1e-3;

/// Balls that are thrown at the floor, one layer after the other.
fn thrown(threads: u32) -> Simulation {
    let mut input = drop(7_000, 16, [0.5, 0.3], 7);
    for v in &mut input.velocity {
        v[2] -= 4.0;
    }
    let o = Options {
        threads,
        contacts_per_thread: 1_024,
        max_problems: 50,
        ..options(1e-3, TOLERANCE)
    };
    simulation(&input, o)
}

#[test]
fn what_is_solved_roughly_first_overlaps_no_more_in_the_end() {
    let mut whole = thrown(1);
    let mut reports = converge(&mut whole, 60);
    let kept = whole.state.clone();
    reports.extend(converge(&mut whole, 40));
    // Enough contacts, and rounds in which pairs have joined.
    let rough = |r: &&StepReport| r.candidates > 10_000 && r.relisted > 0;
    let count = reports.iter().filter(rough).count();
    let seen: Vec<_> = reports
        .iter()
        .map(|r| (r.largest_island, r.relisted))
        .collect();
    assert!(count > 20, "{seen:?}");
    for r in &reports {
        let many = (f64::from(r.candidates) / 2_500.0).powf(0.75).max(1.0);
        let bound = (0.9 * many * TOLERANCE).min(1.8 * TOLERANCE) * R;
        assert!(r.penetration <= (1.0 + 1e-6) * bound, "{r:?}");
        assert!(r.residual_position < TOLERANCE && r.residual_velocity < TOLERANCE);
    }
    // Sequences that were cut before they had all their problems, since they did not die out.
    let early = |r: &&StepReport| r.truncated > 0 && r.impact_problems < 50;
    assert!(reports.iter().filter(early).count() > 10, "{seen:?}");
    let scale = whole.monitors.energy_scale;
    assert!(whole.monitors.energy_max_rise < 2e-6 * scale);

    // The same bits on two threads, and from a state in the midst of it.
    let end = bits(&whole);
    let mut two = thrown(2);
    converge(&mut two, 100);
    assert!(end == bits(&two));
    let mut resumed = thrown(1);
    resumed.state = kept;
    converge(&mut resumed, 40);
    assert!(end == bits(&resumed));
}
