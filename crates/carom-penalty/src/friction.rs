//! Dry friction within a substep, with the normal impulse given: exact flows, so that no stiffness limits the substep.
//!
//! Regularised friction `F = -mu F_N tanh(u/v_s)` on a slip speed u with `u' = D F` (D the inverse mass of the row) has
//! the solution
//!
//! ```text
//! sinh(u(t)/v_s) = sinh(u(0)/v_s) exp(-D mu F_N t/v_s)
//! ```
//!
//! It never reverses the slip and never creates energy, however large the exponent: explicit steps would chatter, since a
//! billiard impact stops a slip of v_s within some 1e-8 s.

use glam::DVec3;

/// From this argument on sinh is half an exponential to rounding (e^-40); at 2 it is not, and at 800 it overflows.
const LARGE: f64 = 20.0;

/// Slip speed after friction that would take `drop = D mu P_N` (m/s) from a fast slip, with slip scale `scale` (m/s).
#[inline]
pub fn slowed(speed: f64, drop: f64, scale: f64) -> f64 {
    let (y, x) = (speed / scale, drop / scale);
    if y <= LARGE {
        return scale * (y.sinh() * (-x).exp()).asinh();
    }
    // ln sinh y = y - ln 2 here.
    let left = y - x;
    if left > LARGE {
        scale * left
    } else {
        scale * (0.5 * left.exp()).asinh()
    }
}

/// Tangential spring of a contact over one sweep.
#[derive(Clone, Copy, Debug)]
pub struct TangentialSpring {
    /// k_T, N/m, and the share of critical damping.
    pub stiffness: f64,
    pub damping_ratio: f64,
    /// 1/m_T of the contact, 1/kg.
    pub inv_mass: f64,
}

impl TangentialSpring {
    /// Impulse on A over a time `tau` from the elongation `spring` (m) and the slip `slip` (m/s), at most `bound` (N s); and
    /// whether it slips. The elongation of a spring that slips is cut to what the bound holds.
    pub fn impulse(&self, spring: &mut DVec3, slip: DVec3, bound: f64, tau: f64) -> (DVec3, bool) {
        let pull = self.stiffness * tau * *spring;
        let rate = 2.0 * self.damping_ratio * (self.stiffness * self.inv_mass).sqrt();
        // The dashpot alone would leave exp(-rate tau) of the slip.
        let trial = -pull + ((-rate * tau).exp_m1() / self.inv_mass) * slip;
        let size = trial.length();
        if size <= bound {
            return (trial, false);
        }
        let pulled = pull.length();
        if pulled > bound {
            *spring *= bound / pulled;
        }
        (trial * (bound / size), true)
    }
}

/// Share of critical damping with which a free half-oscillation returns the share `e` of its speed; 1 for e = 0.
pub fn damping_ratio(e: f64) -> f64 {
    if e <= 0.0 {
        return 1.0;
    }
    let loss = -e.ln();
    loss / loss.hypot(std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flow_solves_its_equation() {
        let scale = 1e-3;
        for (speed, drop) in [
            (5e-4, 1e-4),
            (1e-2, 8e-3),
            (0.03, 0.0299),
            (10.0, 9.98),
            (10.0, 1.0),
        ] {
            let mut u: f64 = speed;
            let steps = 400_000;
            for _ in 0..steps {
                // Midpoint rule.
                let half = u - 0.5 * drop / f64::from(steps) * (u / scale).tanh();
                u -= drop / f64::from(steps) * (half / scale).tanh();
            }
            let found = slowed(speed, drop, scale);
            assert!(
                (found - u).abs() < 1e-9 * speed,
                "{speed} {drop}: {found} {u}"
            );
        }
    }

    #[test]
    fn slip_falls_to_nothing_and_never_turns() {
        for speed in [0.0, 1e-300, 1e-9, 1e-3, 0.0199, 0.02, 0.0201, 1.0, 1e3] {
            for drop in [0.0, 1e-9, 1e-3, 0.02, 1.0, 1e6] {
                let found = slowed(speed, drop, 1e-3);
                assert!(
                    (0.0..=speed * (1.0 + 1e-15)).contains(&found),
                    "{speed} {drop} {found}"
                );
                assert!(
                    found >= speed - drop - 1e-12 * speed,
                    "{speed} {drop} {found}"
                );
            }
        }
        assert_eq!(slowed(1.0, 1e6, 1e-3), 0.0);
    }

    #[test]
    fn a_damping_ratio_returns_its_share() {
        for e in [0.1f64, 0.5, 0.9] {
            let zeta = damping_ratio(e);
            let half = -std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt();
            assert!((half.exp() - e).abs() < 1e-14);
        }
        assert_eq!(damping_ratio(0.0), 1.0);
        assert_eq!(damping_ratio(1.0), 0.0);
    }

    #[test]
    fn a_spring_holds_up_to_its_bound() {
        let spring = TangentialSpring {
            stiffness: 1e6,
            damping_ratio: 0.0,
            inv_mass: 10.0,
        };
        let mut elongation = DVec3::new(1e-6, 0.0, 0.0);
        let (held, slips) = spring.impulse(&mut elongation, DVec3::ZERO, 1.0, 0.5);
        assert!(!slips && (held.x + 0.5).abs() < 1e-15);
        let (held, slips) = spring.impulse(&mut elongation, DVec3::ZERO, 0.1, 0.5);
        assert!(slips && (held.x + 0.1).abs() < 1e-15);
        assert!((elongation.x - 2e-7).abs() < 1e-20);
    }
}
