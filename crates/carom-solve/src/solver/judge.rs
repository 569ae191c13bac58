//! What all solvers share: when to stop, the trait, and the judge that keeps the best iterate.

use crate::judge::{EXPLAINED, RUNAWAY};
use crate::problem::{natural, Problem, Scaled};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Natural-map residual `err` that counts as solved, of the problem as given and of the scaled one.
    pub tolerance: f64,
    /// Iterations (sweeps, Newton steps); 0: as many as the method takes by itself.
    pub max_iterations: u32,
    /// Time after which the best iterate is returned.
    pub time_limit: Option<Duration>,
    /// Another thread sets it and the best iterate is returned.
    pub cancel: Option<&'a AtomicBool>,
    /// Threads for what can use them; they change no bit of the result.
    pub threads: usize,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Settings {
            tolerance: 1e-8,
            max_iterations: 0,
            time_limit: None,
            cancel: None,
            threads: 1,
        }
    }
}

/// Tells when to give up, from any thread.
#[derive(Clone, Copy, Debug)]
pub struct Clock<'a> {
    began: Instant,
    time_limit: Option<Duration>,
    cancel: Option<&'a AtomicBool>,
}

impl Clock<'_> {
    /// Out of time, or cancelled.
    pub fn late(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
            || self
                .time_limit
                .is_some_and(|limit| self.began.elapsed() > limit)
    }
}

/// One stretch of work of one method.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Checkpoint of `auto`, or the method's name.
    pub name: &'static str,
    /// Method.
    pub solver: &'static str,
    pub iterations: u32,
    /// `err` of the best iterate so far, when the stage ended.
    pub err: f64,
    pub seconds: f64,
    /// Why it was taken, in words.
    pub why: String,
}

/// What came out.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Whether both residuals are within the tolerance.
    pub converged: bool,
    /// Natural-map residual of the problem as given.
    pub err: f64,
    /// That of the scaled problem, which units do not change; of forces that ran away what they leave of the velocities.
    pub err_scaled: f64,
    pub iterations: u32,
    pub stages: Vec<Stage>,
}

/// A method that improves `r`.
pub trait ConeSolver {
    /// Name by which it is chosen.
    fn name(&self) -> &'static str;

    /// Works on the scaled problem of `judge` from `judge.start`, tells the judge about iterates worth keeping, and returns the
    /// iterations. Stops when the judge says so.
    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32;
}

/// Keeps the best iterate, measures every candidate by the natural map, and knows when to stop.
pub struct Judge<'a> {
    pub source: &'a Problem,
    pub scaled: &'a Scaled,
    settings: Settings<'a>,
    clock: Clock<'a>,
    /// Best scaled iterate so far; methods start from it.
    pub best: Vec<f64>,
    /// Its `err`: the larger of the two below.
    pub best_err: f64,
    /// `err` of the problem as given, at the best iterate.
    pub best_given: f64,
    /// The same of the scaled one; of forces that ran away what they leave of the velocities.
    pub best_scaled: f64,
    r: Vec<f64>,
    u: Vec<f64>,
    pub stages: Vec<Stage>,
    done: u32,
    number: u64,
}

/// Solves begun in this process.
static SOLVES: AtomicU64 = AtomicU64::new(0);

impl<'a> Judge<'a> {
    pub fn new(
        source: &'a Problem,
        scaled: &'a Scaled,
        start: &[f64],
        settings: Settings<'a>,
    ) -> Judge<'a> {
        let n = source.rows();
        let mut judge = Judge {
            source,
            scaled,
            settings,
            clock: Clock {
                began: Instant::now(),
                time_limit: settings.time_limit,
                cancel: settings.cancel,
            },
            best: vec![0.0; n],
            best_err: f64::INFINITY,
            best_given: f64::INFINITY,
            best_scaled: f64::INFINITY,
            r: vec![0.0; n],
            u: vec![0.0; n],
            stages: Vec::new(),
            done: 0,
            number: SOLVES.fetch_add(1, Ordering::Relaxed),
        };
        let mut y = vec![0.0; n];
        judge.see(&y.clone());
        scaled.enter(start, &mut y);
        judge.see(&y);
        judge
    }

    /// Measures a scaled iterate, keeps it if it is the best, and returns its `err`; of forces that ran away what they
    /// leave of the velocities.
    pub fn see(&mut self, y: &[f64]) -> f64 {
        let [scaled, map, closing] = natural::residuals(&self.scaled.problem, y, &mut self.u);
        self.scaled.leave(y, &mut self.r);
        let given = natural::residual(self.source, &self.r, &mut self.u);
        let (tolerance, share) = (self.settings.tolerance, map.max(closing));
        // Whatever the forces, velocities that close stay where there is no solution.
        let ran_away = share > EXPLAINED && share > RUNAWAY * scaled
            || scaled <= tolerance && closing > EXPLAINED.max(tolerance.sqrt());
        // No tolerance takes those that ran away.
        let least = tolerance * (1.0 + f64::EPSILON);
        let scaled = if ran_away { share.max(least) } else { scaled };
        let err = scaled.max(given);
        if err < self.best_err {
            self.best_err = err;
            (self.best_given, self.best_scaled) = (given, scaled);
            self.best.copy_from_slice(y);
        }
        err
    }

    /// The best iterate is good enough.
    #[inline]
    pub fn solved(&self) -> bool {
        self.best_err <= self.settings.tolerance
    }

    #[inline]
    pub fn threads(&self) -> usize {
        self.settings.threads
    }

    /// A number of this solve alone: methods know by it what they may keep from stage to stage.
    #[inline]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// What tells when to give up, for other threads and inner loops.
    #[inline]
    pub fn clock(&self) -> Clock<'a> {
        self.clock
    }

    /// Solved, out of time, or cancelled.
    pub fn stop(&self) -> bool {
        self.solved() || self.late()
    }

    /// Out of time, or cancelled.
    pub fn late(&self) -> bool {
        self.clock.late()
    }

    /// Runs a method and writes down what it did.
    pub fn stage(
        &mut self,
        name: &'static str,
        solver: &mut dyn ConeSolver,
        max_iterations: u32,
        why: String,
    ) -> bool {
        let began = Instant::now();
        let max = match self.settings.max_iterations {
            0 => max_iterations,
            cap => max_iterations.min(cap.saturating_sub(self.done)),
        };
        if max == 0 {
            return self.solved(); // the settings' iterations are used up
        }
        let iterations = solver.run(self, max);
        self.done += iterations;
        self.stages.push(Stage {
            name,
            solver: solver.name(),
            iterations,
            err: self.best_given,
            seconds: began.elapsed().as_secs_f64(),
            why,
        });
        self.solved()
    }
}
