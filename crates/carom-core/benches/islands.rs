//! `cargo bench -p carom-core --bench islands -- [groups] [steps] [threads,threads,...]`: many small islands, shared out.
//!
//! Groups of 4 to 10 balls fall and come apart. Per number of threads: wall time per step, time by phase, the hash of the state.

mod scenes;

use carom_core::{Options, Recording};
use std::time::{Duration, Instant};

fn main() {
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let text = |k: usize, default: &str| given.get(k).map_or(default, |a| a).to_owned();
    let number = |text: &str| text.parse::<u32>().expect("a number");
    let (groups, steps) = (number(&text(0, "3000")), number(&text(1, "100")));
    let recording = Recording {
        frame_every: 0,
        contacts: false,
    };
    for threads in text(2, "1,2,1,2").split(',').map(number) {
        let options = Options {
            step: 1e-3,
            threads,
            ..Options::default()
        };
        let mut s = scenes::heaps(groups as usize, options);
        let begin = Instant::now();
        let outcome = s.advance(u64::from(steps), recording, Duration::MAX);
        let wall = begin.elapsed().as_secs_f64();
        assert!(outcome.is_none(), "{outcome:?}");
        let block = s.take_block();
        let mean = |f: &dyn Fn(&carom_core::StepReport) -> u32| {
            block.steps.iter().map(|r| f64::from(f(r))).sum::<f64>() / f64::from(steps)
        };
        println!(
            "{threads} threads {:>9.3} ms/step, {:.0} balls, {:.0} islands, {:.0} contacts, {} impacts, {} halvings; {:016x}",
            1e3 * wall / f64::from(steps),
            s.state.position.len(),
            mean(&|r| r.islands),
            mean(&|r| r.contacts),
            block.impacts.len(),
            s.monitors.halvings,
            scenes::hash(&s)
        );
        for (phase, time) in s.timers.estimate() {
            print!("{phase} {:.3} ms  ", 1e3 * time / f64::from(steps));
        }
        println!();
    }
}
