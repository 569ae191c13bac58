//! A row of the table of impacts for each problem and contact, where it is asked for.

use super::*;
use crate::common::{bits, simulation};
use carom_core::record::TimedImpact;
use carom_core::ModelInput;
use scenes::drop;
use std::collections::{BTreeMap, BTreeSet};

/// Steps in which all closed contacts are of one pile, and the table of impacts.
fn run(every_impact: bool) -> (Vec<u64>, BTreeSet<u64>, Vec<TimedImpact>) {
    let input = ModelInput {
        every_impact,
        ..drop(60, 4, [0.4, 0.5], 7)
    };
    let mut s = simulation(&input, options(1e-3, 1e-4));
    converge(&mut s, 300);
    let block = s.take_block();
    let alone = |r: &&StepReport| r.islands == 1 && r.largest_island > 10 && r.fallbacks == 0;
    let steps = block.steps.iter().filter(alone).map(|r| r.step).collect();
    (bits(&s), steps, block.impacts)
}

#[test]
fn every_problem_has_its_rows_and_the_motion_keeps_its_bits() {
    let (plain, steps, summed) = run(false);
    let (kept, _, every) = run(true);
    assert!(plain == kept);
    assert!(steps.len() > 20, "{} steps", steps.len());
    let mut rows: BTreeMap<(u64, u32, u32), Vec<&TimedImpact>> = BTreeMap::new();
    for row in every.iter().filter(|row| steps.contains(&row.step)) {
        let pair = (row.step, row.impact.a, row.impact.b);
        rows.entry(pair).or_default().push(row);
    }
    let bound = Options::default().max_problems;
    let (mut several, mut ended, mut loads) = (0, 0, 0);
    for own in rows.values() {
        let numbers: Vec<u32> = own.iter().map(|row| row.impact.problem).collect();
        assert!(numbers.windows(2).all(|w| w[0] < w[1]), "{numbers:?}");
        assert!(*numbers.last().expect("a row") <= bound + 1);
        several += u32::from(numbers.iter().filter(|&&p| p > 0).count() > 1);
        ended += u32::from(numbers.contains(&(bound + 1)));
        loads += u32::from(numbers.contains(&0));
    }
    assert!(
        several > 20 && ended > 0 && loads > 0,
        "{several} {ended} {loads}"
    );
    // A row of the sums is of the first problem in which its contact closed; from there on the impulses add up to it.
    for sum in summed.iter().filter(|row| steps.contains(&row.step)) {
        let own = &rows[&(sum.step, sum.impact.a, sum.impact.b)];
        let same = |row: &&&TimedImpact| {
            row.impact.approach.to_bits() == sum.impact.approach.to_bits() && row.impact.problem > 0
        };
        let first = own
            .iter()
            .find(same)
            .expect("its first problem")
            .impact
            .problem;
        assert!(first == sum.impact.problem || first == bound + 1);
        let total: glam::DVec3 = own
            .iter()
            .filter(|row| row.impact.problem >= first)
            .map(|row| row.impact.impulse)
            .sum();
        let off = (total - sum.impact.impulse).length();
        assert!(off <= 1e-14 * total.length(), "{off:e} of {total}");
    }
}

#[test]
fn a_table_that_is_left_out_stays_empty() {
    let input = ModelInput {
        every_impact: true,
        drop_impacts: true,
        ..drop(60, 4, [0.4, 0.5], 7)
    };
    let mut s = simulation(&input, options(1e-3, 1e-4));
    converge(&mut s, 300);
    assert!(s.take_block().impacts.is_empty());
}
