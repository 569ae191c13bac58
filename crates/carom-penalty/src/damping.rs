//! Damping of the contact force `F = K d^n (1 + chi d'/v_in)`: chi from the restitution, and back.
//!
//! `d` is the indentation, `v_in` the speed at which the contact closed. For every `n`, `K` and mass a free collision
//! under this force separates with the share `e` of its approach speed that solves
//!
//! ```text
//! chi (1 + e) = ln((1 + chi)/(1 - chi e))
//! ```
//!
//! (from `v dv/dd = -(K/m) d^n (1 + chi v/v_in)`, whose two sides separate). [`PenaltyLaw::Exact`] solves it for chi; the
//! published laws approximate that root, most of them near e = 1, and [`restitution`] tells what each gives instead.

use carom_core::options::PenaltyLaw;

/// Largest chi for which the series stands for the relation, whose two sides agree in too many digits there. Ten times more,
/// and the terms left out (0.5^12/14) are seen; ten times less, and rounding is.
const SERIES: f64 = 0.05;
/// Halvings of an interval at most; some 60 reach neighbouring numbers, and with fewer than that chi is inexact.
const BISECTIONS: u32 = 200;

/// chi for the restitution `e` in [0, 1]. Laws with `chi -> infinity` as `e -> 0` read `e` as at least `least`: a force
/// needs a finite chi, and a rebound of 1 % of the speed carries 0.01 % of the energy.
pub fn chi(law: PenaltyLaw, e: f64, least: f64) -> f64 {
    let bounded = e.max(least);
    let loss = 1.0 - e;
    match law {
        PenaltyLaw::HuntCrossley => 1.5 * loss,
        PenaltyLaw::HerbertMcWhannell => 6.0 * loss / ((2.0 * e - 1.0).powi(2) + 3.0),
        PenaltyLaw::LeeWang => 0.75 * loss,
        PenaltyLaw::LankaraniNikravesh => 0.75 * (1.0 - e * e),
        PenaltyLaw::Gonthier => (1.0 - bounded * bounded) / bounded,
        PenaltyLaw::ZhiyingQishao => 0.75 * (1.0 - e * e) * (2.0 * loss).exp(),
        PenaltyLaw::Flores => 1.6 * (1.0 - bounded) / bounded,
        PenaltyLaw::HuGuo => 1.5 * (1.0 - bounded) / bounded,
        PenaltyLaw::Exact => exact(bounded),
    }
}

/// The root chi > 0 of the relation for `e` in (0, 1]; 0 for 1.
fn exact(e: f64) -> f64 {
    // `mismatch` is above 0 left of the root and falls to -infinity towards 1/e.
    bisect(0.0, 1.0 / e, |chi| mismatch(chi, e) > 0.0)
}

/// Restitution of a free collision with the damping `chi`.
pub fn restitution(chi: f64) -> f64 {
    if chi == 0.0 {
        return 1.0;
    }
    // At a given chi the mismatch falls with e, to -infinity at 1/chi.
    bisect(0.0, (1.0 / chi).min(1.0), |e| mismatch(chi, e) > 0.0)
}

/// `(chi (1 + e) - ln((1 + chi)/(1 - chi e)))/chi^2`.
fn mismatch(chi: f64, e: f64) -> f64 {
    if chi >= SERIES {
        return (chi * (1.0 + e) - chi.ln_1p() + (-chi * e).ln_1p()) / (chi * chi);
    }
    // sum over k >= 2 of chi^(k-2) ((-1)^k - e^k)/k; the terms left out are below 0.05^12/14.
    let (mut sum, mut power, mut share, mut sign) = (0.0, 1.0, e * e, 1.0);
    for k in 2..14u32 {
        sum += power * (sign - share) / f64::from(k);
        (power, share, sign) = (power * chi, share * e, -sign);
    }
    sum
}

/// Where `left` changes from true to false between `low` and `high`.
fn bisect(mut low: f64, mut high: f64, left: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if left(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
