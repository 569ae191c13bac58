//! `cargo bench -p carom-core --bench break_shot`: core time of the billiard break and of rolling balls, one thread.
//!
//! A plain harness: minimum and median over repetitions, with the hash of the final state, so that speed is never
//! bought with another answer.

mod scenes;

use carom_core::{Options, Recording, Simulation};
use std::time::{Duration, Instant};

/// Runs `make().advance(steps)` repeatedly; prints and returns the median seconds.
fn measure(name: &str, steps: u64, every: u64, make: impl Fn() -> Simulation) {
    let recording = Recording {
        frame_every: every,
        contacts: every > 0,
    };
    let mut times = Vec::new();
    let mut final_hash = 0;
    for _ in 0..15 {
        let mut s = make();
        let begin = Instant::now();
        let outcome = s.advance(steps, recording, Duration::MAX);
        times.push(begin.elapsed().as_secs_f64());
        assert!(outcome.is_none(), "{outcome:?}");
        final_hash = scenes::hash(&s);
    }
    times.sort_by(f64::total_cmp);
    let (low, median) = (times[0], times[times.len() / 2]);
    println!(
        "{name:<34} {:>9.3} ms median {:>9.3} ms min {:>8.3} us/step  {final_hash:016x}",
        1e3 * median,
        1e3 * low,
        1e6 * median / steps as f64
    );
}

fn main() {
    let step = |h: f64| Options {
        step: h,
        ..Options::default()
    };
    measure("break, 3000 steps", 3000, 0, || {
        scenes::billiard_break(step(1e-3))
    });
    measure("break, 3000 steps, 1000 frames", 3000, 3, || {
        scenes::billiard_break(step(1e-3))
    });
    measure("break, 30000 steps of 1e-4 s", 30_000, 0, || {
        scenes::billiard_break(step(1e-4))
    });
    measure("four rolling balls, 20000 steps", 20_000, 0, || {
        scenes::rolling(step(1e-3))
    });
}
