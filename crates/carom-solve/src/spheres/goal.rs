//! Sweeps until the residual of eq. 44 and the worst closing measure are small enough.

use super::accelerate::Change;
use super::Sweeps;

/// See [`Goal::patience`].
pub const LENIENCE: f64 = 10.0;
/// Sweeps in which the bound becomes as wide.
const WIDENED: f64 = 3_000.0;
/// Sweeps before the first look, and between two looks at least and at most.
const FIRST: usize = 4;
const LEAST_BETWEEN: usize = 3;
const MOST_BETWEEN: usize = 64;
/// How far below the goal the changes of a sweep must promise to be before it is looked at.
const LIKELY: f64 = 0.9;
/// Sweeps after which the momentum is bounded by the next of these, in turn.
const TIRED: usize = 250;
const CAPS: [f64; 2] = [1.0, 0.5];
/// No change is as small.
const NEVER: Change = Change {
    squared: -1.0,
    closing: -1.0,
};
/// Most that the absolute floor counts for, over the terms of eq. 44; and the share of it that stands where there are none (as in
/// `newton`).
const FLOOR_OVER_TERMS: f64 = 9.0;
const LEAST_FLOOR: f64 = 1e-3;

/// Norms of eq. 44 with `p = penalty_scale / w`, in the unit of the impulses, and the worst violation of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Norms {
    pub residual: f64,
    pub terms: f64,
    /// Largest `-z_N` of all contacts, at least 0: overlap or closing speed that is left.
    pub closing: f64,
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// tol_r of eq. 44 and its absolute floor (tol_r tol_f), in the unit of the impulses.
    pub tolerance: f64,
    pub floor: f64,
    /// Terms of what is solved already and to which this is an addition, in the unit of the impulses.
    pub scale: f64,
    /// Bound of [`Norms::closing`].
    pub closing: f64,
    pub penalty_scale: f64,
    /// Sweeps from which on the bound of the worst contact widens, up to [`LENIENCE`] times: now and then a contact goes round in
    /// circles (stick, slip and open in turn) while all others have long agreed.
    pub patience: usize,
    /// Sweeps at most.
    pub most: usize,
    /// Sweeps that the same problem, linearised elsewhere, has had already.
    pub had: usize,
    /// Sweeps after which the impulses of chunks are scaled for the first time (`coarse`); `usize::MAX`: never.
    pub rescale: usize,
    /// Whether they are looked at once more where all else is reached: the norm of eq. 44 is mild with what is too large everywhere.
    pub weighed: bool,
    /// Largest `beta` of the momentum (`accelerate`) once the residual is at most half of what is asked.
    pub calm: f64,
}

/// What was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    pub sweeps: usize,
    /// Relative residual of eq. 44.
    pub residual: f64,
    pub closing: f64,
    pub converged: bool,
    /// Converged by the wider bound of the worst contact alone.
    pub lenient: bool,
}

impl Goal {
    /// `|r| / (sum |r_k| + tol_f)`.
    pub fn relative(&self, norms: &Norms) -> f64 {
        let floor = self.floor / self.tolerance;
        let terms = norms.terms + self.scale;
        let floor = floor.min(FLOOR_OVER_TERMS * terms.max(LEAST_FLOOR * floor));
        let sum = terms + floor;
        if sum > 0.0 {
            norms.residual / sum
        } else {
            0.0
        }
    }

    fn judge(&self, norms: &Norms, sweeps: usize) -> Progress {
        let residual = self.relative(norms);
        let strict = norms.closing <= self.closing;
        // The bound widens slowly: what is close to it after so long need not wait, and what is far from it may still come.
        let late = sweeps.saturating_sub(self.patience) as f64 / WIDENED;
        let lenient =
            sweeps >= self.patience && norms.closing <= LENIENCE.powf(late.min(1.0)) * self.closing;
        Progress {
            sweeps,
            residual,
            closing: norms.closing,
            converged: residual < self.tolerance && (strict || lenient),
            lenient: !strict && lenient,
        }
    }
}

impl Sweeps {
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
            let cap = momentum(goal.had + now.sweeps).min(most_now);
            self.accelerated(least, cap, NEVER);
            let done = least + self.accelerated(count - least, cap, enough);
            now = self.judge(goal, now.sweeps + done);
            most = MOST_BETWEEN;
            enough = likely(&self.memory.last, &now, goal);
        }
        now
    }
}

/// Largest `beta` after so many sweeps: where contacts stick, slip and open in turn it may be the momentum that drives them.
fn momentum(sweeps: usize) -> f64 {
    CAPS[sweeps / TIRED % CAPS.len()]
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
        closing: last.closing * share(goal.closing, now.closing),
    }
}
