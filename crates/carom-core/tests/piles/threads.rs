//! The same bits whatever the number of threads, and after a restored state.

use super::*;
use crate::common::{bits, simulation};
use carom_core::ModelInput;
use scenes::{boxed, drop, lattice, Random};

/// Touching balls that begin to press on each other and on the floor, every one with its own small velocity: eight chunks of the
/// sweeps, for eight threads.
pub fn large() -> ModelInput {
    let mut input = boxed(&lattice(20, 22), 10.0, [0.4, 0.3]);
    let mut random = Random(3);
    for v in &mut input.velocity {
        *v = random.vector().map(|u| 1e-5 * u);
    }
    input
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let run = |threads| {
        let o = Options {
            threads,
            contacts_per_thread: 2_048,
            ..options(1e-3, 1e-4)
        };
        let mut s = simulation(&large(), o);
        let reports = go_on(&mut s, 2);
        assert!(
            reports.iter().all(|r| r.largest_island >= 8 * 2_048),
            "{:?}",
            reports.iter().map(|r| r.largest_island).collect::<Vec<_>>()
        );
        assert!(reports.iter().any(|r| r.sweeps_position > 0));
        assert!(reports.iter().any(|r| r.sweeps_velocity > 4));
        bits(&s)
    };
    let one = run(1);
    for threads in [3, 8] {
        assert!(one == run(threads), "{threads} threads");
    }
}

#[test]
fn a_restored_state_goes_on_with_the_same_bits() {
    let input = drop(80, 4, [0.4, 0.3], 5);
    let o = options(5e-4, 1e-7);
    let mut whole = simulation(&input, o.clone());
    go_on(&mut whole, 400);
    let state = whole.state.clone();
    let kept = state.warm.iter().filter(|w| w.impulse.z != 0.0).count();
    assert!(kept > 20, "warm starts: {kept}");
    go_on(&mut whole, 50);
    let resume = |forget: bool| {
        let mut s = simulation(&input, o.clone());
        s.state = state.clone();
        if forget {
            s.state.warm.clear();
        }
        go_on(&mut s, 50);
        bits(&s)
    };
    let end = bits(&whole);
    assert!(end == resume(false));
    // The warm starts are used: without them the bits differ.
    assert!(end != resume(true));
}
