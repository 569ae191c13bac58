//! What is asked of sweeps, the residual of eq. 44 and the worst closing measure, and what was reached.

use crate::judge::Terms;

/// See [`Goal::patience`].
pub const LENIENCE: f64 = 10.0;
/// Sweeps (1) in which the bound becomes as wide. Few, contacts are left open that would still have converged.
const WIDENED: f64 = 3_000.0;

/// Sweeps (1) after which the worst contact may be as bad as [`Goal::worst`] says. Few: what nearly rests is left to move. Many: silos of 100 000
/// grains take twice as long.
const WORST_FROM: f64 = 60.0;

/// Norms of eq. 44 with `p = penalty_scale / w`, in the unit of the impulses, and the worst violation of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Norms {
    pub residual: f64,
    pub terms: f64,
    /// Largest `-z_N` of all contacts, at least 0: overlap or closing speed that is left.
    pub closing: f64,
}

/// What sweeps solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// Coulomb's law: friction on the disc that belongs to the normal impulse.
    #[default]
    Discs,
    /// Its convex companion (`crate::companion`).
    Companion,
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
    /// By how much the worst contact may miss it (1) once [`WORST_FROM`] sweeps are made: of very many contacts that flow, sweeps for the last few
    /// are most of all.
    pub worst: f64,
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
        let (residual, terms) = (norms.residual, norms.terms + self.scale);
        Terms {
            residual,
            terms,
            motion: terms,
        }
        .relative(self.floor / self.tolerance, true)
    }

    /// What the worst contact may be left with after so many sweeps.
    pub(super) fn bound(&self, sweeps: usize) -> f64 {
        self.worst.powf((sweeps as f64 / WORST_FROM).min(1.0)) * self.closing
    }

    pub(super) fn judge(&self, norms: &Norms, sweeps: usize) -> Progress {
        let residual = self.relative(norms);
        let strict = norms.closing <= self.bound(sweeps);
        // It widens slowly: what is close to it after so long need not wait, and what is far from it may still come.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_of_many_contacts_may_be_worse_the_longer_it_is_swept() {
        let goal = Goal {
            tolerance: 1e-3,
            floor: 0.0,
            scale: 1.0,
            closing: 1.0,
            worst: 5.0,
            penalty_scale: 0.5,
            patience: 1_000,
            most: 10_000,
            had: 0,
            rescale: usize::MAX,
            weighed: false,
            calm: 1.0,
        };
        let judged = |closing, sweeps| {
            let norms = Norms {
                closing,
                ..Norms::default()
            };
            goal.judge(&norms, sweeps)
        };
        for closing in [1.5, 3.0, 4.9] {
            let met = |sweeps| judged(closing, sweeps).converged;
            assert!(!met(0) && met(60) && !judged(closing, 60).lenient);
            assert!((0..60).all(|sweeps| met(sweeps + 1) || !met(sweeps)));
        }
        assert!(!judged(8.0, 1_000).converged);
        let late = judged(8.0, 4_000);
        assert!(late.converged && late.lenient);
        assert!(!judged(11.0, 4_000).converged);
    }
}
