//! Phase timers that sample: reading the clock costs as much as a ball.

use std::time::Instant;

/// Phases of a step, in the words of `docs/theory/algorithm.md` and `step.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Predict,
    Broad,
    Meet,
    Position,
    Velocity,
    Finish,
    Record,
}

/// Names of the phases, in order. `predict` includes the smooth sub-problem.
pub const PHASES: [&str; 7] = [
    "predict", "broad", "meet", "position", "velocity", "finish", "record",
];

/// One step in so many is timed.
const SAMPLE: u64 = 32;

#[derive(Clone, Debug)]
pub struct Timers {
    seconds: [f64; 7],
    steps: u64,
    sampled: u64,
    last: Option<Instant>,
}

impl Default for Timers {
    fn default() -> Self {
        Timers {
            seconds: [0.0; 7],
            steps: 0,
            sampled: 0,
            last: None,
        }
    }
}

impl Timers {
    /// Starts a step; large systems are timed in every step.
    #[inline]
    pub fn start(&mut self, always: bool) {
        self.last = None;
        if always || self.steps % SAMPLE == 0 {
            self.sampled += 1;
            self.last = Some(Instant::now());
        }
        self.steps += 1;
    }

    /// Ends a phase.
    #[inline]
    pub fn mark(&mut self, phase: Phase) {
        if let Some(last) = self.last {
            let now = Instant::now();
            self.seconds[phase as usize] += (now - last).as_secs_f64();
            self.last = Some(now);
        }
    }

    /// Estimated seconds by phase.
    pub fn estimate(&self) -> Vec<(&'static str, f64)> {
        let factor = if self.sampled == 0 {
            0.0
        } else {
            self.steps as f64 / self.sampled as f64
        };
        PHASES
            .iter()
            .zip(self.seconds)
            .map(|(&name, s)| (name, factor * s))
            .collect()
    }
}
