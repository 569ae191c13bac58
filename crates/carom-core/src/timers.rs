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

/// One step in so many (1) is timed: reading the clock in each makes few balls slower by a third, one in thousands makes the
/// report of a short run a guess.
const SAMPLE: u64 = 32;
/// Steps (1) at the beginning that are all timed and count once: caches are cold then. With 0 a slow first step stands for
/// [`SAMPLE`] others.
const WARM_UP: u64 = 64;

#[derive(Clone, Debug, Default)]
pub struct Timers {
    /// Of the timed steps: those that count once, and those that stand for others.
    exact: [f64; 7],
    seconds: [f64; 7],
    steps: u64,
    /// Steps beyond the exact ones, and how many of them were timed.
    sampling: u64,
    sampled: u64,
    once: bool,
    last: Option<Instant>,
}

impl Timers {
    /// Starts a step; those of large systems are all timed.
    #[inline]
    pub fn start(&mut self, always: bool) {
        self.last = None;
        self.once = always || self.steps < WARM_UP;
        if !self.once {
            self.sampling += 1;
        }
        if self.once || self.steps % SAMPLE == 0 {
            self.sampled += u64::from(!self.once);
            self.last = Some(Instant::now());
        }
        self.steps += 1;
    }

    /// Ends a phase.
    #[inline]
    pub fn mark(&mut self, phase: Phase) {
        if let Some(last) = self.last {
            let now = Instant::now();
            let seconds = if self.once {
                &mut self.exact
            } else {
                &mut self.seconds
            };
            seconds[phase as usize] += (now - last).as_secs_f64();
            self.last = Some(now);
        }
    }

    /// Estimated seconds by phase.
    pub fn estimate(&self) -> Vec<(&'static str, f64)> {
        let factor = if self.sampled == 0 {
            0.0
        } else {
            self.sampling as f64 / self.sampled as f64
        };
        let seconds = self
            .exact
            .iter()
            .zip(self.seconds)
            .map(|(e, s)| e + factor * s);
        PHASES.iter().copied().zip(seconds).collect()
    }
}
