//! Sweeps until a goal is reached.

use super::goal::{Goal, Progress, Projection, LENIENCE};
use super::momentum::Change;
use super::sweeps::Sweeps;

/// Sweeps (1) before the first look.
const FIRST: usize = 4;
/// Sweeps (1) between two looks at least: a look costs about one.
const LEAST_BETWEEN: usize = 3;
/// Sweeps (1) between two looks at most: so many are made in vain at worst.
const MOST_BETWEEN: usize = 64;
/// How far below the goal the changes of a sweep must promise to be before it is looked at (1).
const LIKELY: f64 = 0.9;
/// Sweeps (1) after which the momentum is bounded by the next of [`CAPS`], in turn. Small, slower piles; infinite, some go
/// round in circles for ever.
const TIRED: usize = 250;
/// Bounds of the momentum (1): 1 is none.
const CAPS: [f64; 2] = [1.0, 0.5];
/// Sweeps (1) after which a problem may be given up that has no solution, and between two such looks.
const LONG: usize = 1_000;
/// No change is as small.
const NEVER: Change = Change {
    squared: -1.0,
    closing: -1.0,
};

impl Sweeps {
    /// Runs `count` sweeps without momentum.
    pub fn sweep(&mut self, count: usize) {
        self.restart();
        self.accelerated(count, 0.0, NEVER);
    }

    /// Where the present impulses stand after so many sweeps.
    pub fn judge(&mut self, goal: &Goal, sweeps: usize) -> Progress {
        let norms = match self.norms {
            // Nothing has changed since.
            Some((scale, norms)) if scale == goal.penalty_scale => norms,
            _ => self.norms(goal.penalty_scale),
        };
        self.norms = Some((goal.penalty_scale, norms));
        goal.judge(&norms, sweeps)
    }

    /// [`Sweeps::settle`] on the convex companion, from the present impulses; the residual is that of Coulomb's law.
    pub fn settle_companion(&mut self, goal: &Goal) -> Progress {
        (self.law, self.norms) = (Projection::Companion, None);
        let found = self.settle(&Goal {
            weighed: false,
            rescale: usize::MAX,
            ..*goal
        });
        (self.law, self.norms) = (Projection::Discs, None);
        Progress {
            residual: self.judge(goal, 0).residual,
            ..found
        }
    }

    /// Sweeps until the goal is met or its sweeps are used up. When to look follows from what the sweeps change.
    pub fn settle(&mut self, goal: &Goal) -> Progress {
        let mut now = self.judge(goal, 0);
        let (mut most, mut enough) = (FIRST, Change::default());
        self.restart();
        let mut rescale = if self.scales() {
            goal.rescale
        } else {
            usize::MAX
        };
        let mut weighed = !(goal.weighed && self.scales());
        let mut before = Progress {
            closing: f64::INFINITY,
            ..now
        };
        while now.sweeps < goal.most && now.residual.is_finite() {
            if now.converged {
                if std::mem::replace(&mut weighed, true) || !self.rescale() {
                    break;
                }
                (most, enough) = (FIRST, Change::default());
            } else if now.sweeps >= rescale {
                if self.rescale() {
                    (most, enough) = (FIRST, Change::default());
                }
                rescale = 2 * now.sweeps.max(1);
            }
            let until = goal.most.min(rescale.max(now.sweeps + 1)) - now.sweeps;
            let least = LEAST_BETWEEN.min(until);
            let count = (most.min(until)).max(least);
            let calm = now.residual <= 0.5 * goal.tolerance;
            let most_now = if calm { goal.calm } else { 1.0 };
            let cap = momentum_cap(goal.had + now.sweeps).min(most_now);
            let done = if self.guided_bodies.iter().any(|g| g.shared) {
                self.plain(count, enough)
            } else {
                self.accelerated(least, cap, NEVER);
                least + self.accelerated(count - least, cap, enough)
            };
            now = self.judge(goal, now.sweeps + done);
            if now.sweeps >= before.sweeps + LONG {
                if hopeless(goal, &before, &now) {
                    break;
                }
                before = now;
            }
            most = MOST_BETWEEN;
            enough = likely(&self.memory.last, &now, goal);
        }
        now
    }
}

impl Sweeps {
    /// Up to `count` sweeps without momentum, each with a step of the shared bodies behind it, until one changes no more than `enough`; how many there
    /// were. Momentum swings up where many contacts share a body.
    fn plain(&mut self, count: usize, enough: Change) -> usize {
        for done in 1..=count {
            self.accelerated(1, 0.0, NEVER);
            let last = self.memory.last;
            self.settle_guided();
            if last.squared <= enough.squared && last.closing <= enough.closing {
                return done;
            }
        }
        count
    }
}

/// Largest `beta` after so many sweeps: where contacts stick, slip and open in turn it may be the momentum that drives them.
pub(crate) fn momentum_cap(sweeps: usize) -> f64 {
    CAPS[sweeps / TIRED % CAPS.len()]
}

/// Whether contacts go on closing although forces grow: at this pace they close when all sweeps are used up. Newton's law asks for
/// velocities that wedged spheres cannot have.
fn hopeless(goal: &Goal, before: &Progress, now: &Progress) -> bool {
    let left = (goal.most - now.sweeps) as f64 / (now.sweeps - before.sweeps) as f64;
    let least = now.closing * (now.closing / before.closing).powf(left);
    now.residual < goal.tolerance && least > LENIENCE * goal.closing
}

/// The change of a sweep after which the goal is likely met: residuals are proportional to changes, closing measures at the end of a
/// sweep to those that it met.
fn likely(last: &Change, now: &Progress, goal: &Goal) -> Change {
    let share = |goal: f64, now: f64| {
        if now > 0.0 {
            LIKELY * goal / now
        } else {
            f64::INFINITY
        }
    };
    Change {
        squared: last.squared * share(goal.tolerance, now.residual).powi(2),
        closing: last.closing * share(goal.bound(now.sweeps), now.closing),
    }
}
