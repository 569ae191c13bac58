//! When an island counts as solved: eq. 44, for rows and for spheres.

/// Most (1) that the absolute floor of a large island counts for, over the terms of eq. 44: the tolerance is never more than
/// ten times what was asked for. Larger, errors of short steps pass as rounding.
const FLOOR_OVER_TERMS: f64 = 9.0;
/// Share (1) of the floor that stands where there are no terms. With 0 a large island without impulses never converges.
const LEAST_FLOOR: f64 = 1e-3;

/// Where contacts cannot be kept apart, forces without bound make a relative residual as small as one likes, for they are in its denominator.
/// Where they are this many times the motion, the residual must come below the second number over the motion alone.
pub(crate) const RUNAWAY: f64 = 1e3;
pub(crate) const EXPLAINED: f64 = 1e-3;

/// Norms of eq. 44, in the unit of the multipliers: that of the residual, the sum of those of its terms, and of what moves and drives.
#[derive(Clone, Copy, Debug, Default)]
pub struct Terms {
    pub residual: f64,
    pub terms: f64,
    pub motion: f64,
}

impl Terms {
    /// `|r| / (sum |r_k| + floor)`: converged below tol_r, with the floor `tol_f`.
    ///
    /// In large islands callers give a floor of lengths (decision record 011), far above rounding where steps are short: there it may
    /// count for [`FLOOR_OVER_TERMS`] times the terms, so the tolerance is never more than ten times what was asked for.
    pub fn relative(&self, mut floor: f64, large: bool) -> f64 {
        if large {
            floor = floor.min(FLOOR_OVER_TERMS * self.terms.max(LEAST_FLOOR * floor));
        }
        if self.residual == 0.0 {
            return 0.0; // all terms may be 0 too: a ball at rest, with drag, on a floor without gravity
        }
        self.residual / (self.terms + floor)
    }

    /// Whether forces ran away: what they leave of the motion is no solution, however small it is beside them.
    pub fn ran_away(&self) -> bool {
        self.terms > RUNAWAY * self.motion && self.residual > EXPLAINED * self.motion
    }
}
