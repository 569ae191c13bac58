//! Impulses of chunks, scaled on the way: what it is good for.

use super::*;

include!("towers.rs");

/// A goal that is content with impulses that lift the towers is not, where they are weighed.
#[test]
fn what_is_too_large_everywhere_is_found_where_all_else_is_reached() {
    for weighed in [false, true] {
        let Towers {
            mut sweeps,
            holding,
        } = towers(1, 0.5);
        let start: Vec<[f64; 3]> = holding.iter().map(|r| r.map(|x| 1.2 * x)).collect();
        sweeps.warm_start(&start);
        let goal = Goal {
            tolerance: 1.0,
            closing: 1.0,
            weighed,
            ..GOAL
        };
        assert!(sweeps.judge(&goal, 0).converged);
        let progress = sweeps.settle(&goal);
        assert!(progress.converged);
        assert_eq!(progress.sweeps > 0, weighed);
        let found = sweeps.impulses();
        let off = found
            .iter()
            .zip(&holding)
            .map(|(r, held)| (r[2] / held[2] - 1.0).abs());
        let worst = off.fold(0.0, f64::max);
        assert_eq!(worst < 0.02, weighed, "{worst}");
    }
}

/// Factors lead to the same solution sooner.
#[test]
fn fewer_sweeps_for_the_same_solution_and_the_same_bits_for_any_threads() {
    let mut sweeps_of = Vec::new();
    let mut bits: Vec<Vec<[f64; 3]>> = Vec::new();
    for (threads, rescale) in [(1, usize::MAX), (1, 8), (2, 8), (3, 8)] {
        let Towers {
            mut sweeps,
            holding,
        } = towers(threads, 0.5);
        // Each tower off by nearly the same factor, and across.
        let start: Vec<[f64; 3]> = holding
            .iter()
            .enumerate()
            .map(|(i, r)| {
                [
                    0.1 * r[2],
                    0.0,
                    r[2] * (2.0 + 0.001 * (i / HIGH % 7) as f64),
                ]
            })
            .collect();
        sweeps.warm_start(&start);
        let progress = sweeps.settle(&Goal { rescale, ..GOAL });
        assert!(progress.converged, "{progress:?}");
        for (found, r) in sweeps.impulses().iter().zip(&holding) {
            let off = glam::DVec3::from(*found) - glam::DVec3::from(*r);
            assert!(off.length() < 1e-4 * r[2], "{found:?} instead of {r:?}");
        }
        sweeps_of.push(progress.sweeps);
        bits.push(sweeps.impulses());
    }
    assert!(sweeps_of[1] < sweeps_of[0], "{sweeps_of:?}");
    assert!(bits[1] == bits[2] && bits[1] == bits[3]);
}
