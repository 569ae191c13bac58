//! A row of the table of impacts for each problem and contact, where it is asked for.

use super::*;
use crate::common::{bits, simulation};
use carom_core::record::TimedImpact;
use carom_core::ModelInput;
use scenes::drop;
use std::collections::BTreeMap;

/// Rows of each contact in each step.
type Rows = BTreeMap<(u64, u32, u32), Vec<TimedImpact>>;

/// Impact problems before a sequence is cut.
const BOUND: u32 = 50;

/// Balls that fall into a box; `rolling` friction in m.
fn run(every_impact: bool, rolling: f64) -> (Vec<u64>, Rows) {
    let mut input = ModelInput {
        every_impact,
        ..drop(60, 4, [0.4, 0.5], 7)
    };
    for (_, _, law) in &mut input.laws {
        law[3] = rolling;
    }
    // Some sequences are cut.
    let o = Options {
        max_problems: BOUND,
        ..options(1e-3, 1e-4)
    };
    let mut s = simulation(&input, o);
    let reports = converge(&mut s, 300);
    let piles = reports.iter().filter(|r| r.largest_island > 10).count();
    assert!(piles > 20, "{piles} steps");
    let mut rows = Rows::new();
    for row in s.take_block().impacts {
        let pair = (row.step, row.impact.a, row.impact.b);
        rows.entry(pair).or_default().push(row);
    }
    (bits(&s), rows)
}

#[test]
fn every_problem_has_its_rows_and_the_motion_keeps_its_bits() {
    for rolling in [0.0, 1e-3] {
        let (plain, summed) = run(false, rolling);
        let (kept, every) = run(true, rolling);
        assert!(plain == kept);
        let (mut several, mut ended, mut loads, mut turned) = (0, 0, 0, 0);
        for (pair, own) in &every {
            let numbers: Vec<u32> = own.iter().map(|row| row.impact.problem).collect();
            assert!(numbers.windows(2).all(|w| w[0] < w[1]), "{numbers:?}");
            assert!(*numbers.last().expect("a row") <= BOUND + 1);
            let sums = summed.get(pair).map_or(0, Vec::len);
            several += u32::from(own.len() > sums + 1);
            ended += u32::from(numbers.contains(&(BOUND + 1)));
            loads += u32::from(numbers[0] == 0 && sums < own.len());
            turned += u32::from(own[0].impact.moment != glam::DVec3::ZERO);
        }
        assert!(
            several > 20 && ended > 0 && loads > 0,
            "{several} {ended} {loads}"
        );
        assert!((turned > 0) == (rolling > 0.0));
        // The row of a pile is of the first problem in which its contact closed; from there on the impulses add up to it.
        for (pair, sums) in &summed {
            let (own, told) = (&every[pair], &sums[0].impact);
            let same = |row: &&TimedImpact| {
                row.impact.normal_before.to_bits() == told.normal_before.to_bits()
                    && row.impact.problem == told.problem
            };
            let first = own
                .iter()
                .find(same)
                .expect("its first problem")
                .impact
                .problem;
            let later = own.iter().filter(|row| row.impact.problem >= first);
            let [mut force, mut moment] = [glam::DVec3::ZERO; 2];
            for row in later {
                force += row.impact.impulse;
                moment += row.impact.moment;
            }
            for row in sums {
                force -= row.impact.impulse;
                moment -= row.impact.moment;
            }
            let size: f64 = own.iter().map(|row| row.impact.impulse.length()).sum();
            assert!(force.length() <= 1e-12 * size, "{force} of {size:e}");
            assert!(moment.length() <= 1e-12 * size, "{moment} of {size:e}");
        }
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
