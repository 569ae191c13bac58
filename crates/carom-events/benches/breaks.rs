//! `cargo bench -p carom-events`: core time of breaks by the exact method, from start to end in one report, one thread.

#[path = "../../carom-core/benches/scenes/mod.rs"]
mod scenes;

use carom_core::options::Method;
use carom_core::{Model, ModelInput, Options, Recording};
use std::time::{Duration, Instant};

/// Prints the median and the least of many runs, with the number of impacts and the hash of the final state.
fn measure(name: &str, input: &ModelInput, until: f64) {
    let options = Options {
        step: until,
        method: Method::Events,
        ..Options::default()
    };
    let recording = Recording {
        frame_every: 0,
        contacts: false,
    };
    let (mut times, mut told) = (Vec::new(), String::new());
    for _ in 0..101 {
        let (model, initial) = Model::new(input, options.clone()).expect("a bench scene is valid");
        let mut s = carom_events::simulation(model, initial).expect("it can be done");
        let begin = Instant::now();
        let outcome = s.advance(1, recording, Duration::MAX);
        times.push(begin.elapsed().as_secs_f64());
        told = match outcome {
            Some(o) => format!("{} {:?}", o.kind(), o.bodies),
            None => format!("{:016x}", scenes::hash(&s)),
        };
        let block = s.take_block();
        let events: u64 = block.steps.iter().map(|s| u64::from(s.substeps)).sum();
        told = format!(
            "{:>5} impacts {events:>5} events  {told}",
            block.impacts.len()
        );
    }
    times.sort_by(f64::total_cmp);
    let (low, median) = (1e3 * times[0], 1e3 * times[times.len() / 2]);
    println!("{name:<34} {median:>9.4} ms median {low:>9.4} ms min {told}");
}

fn main() {
    measure(
        "break of section 5.6, 3 s",
        &scenes::billiard_break_input(),
        3.0,
    );
    let mut nine = scenes::nine_ball_input();
    measure("nine-ball break, 10 s", &nine, 10.0);
    // Slides that turn, and an end of all motion.
    nine.laws[1].2[3] = 4e-4;
    nine.laws[1].2[4] = 3.3e-4;
    measure("nine-ball break to rest, 15 s", &nine, 15.0);
}
