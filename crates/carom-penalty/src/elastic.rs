//! The elastic part `K d^n`: Hertz's stiffness, indentation and contact time.
//!
//! ```text
//! Hertz, n = 3/2:   K = 4/3 E* sqrt(R*),   1/E* = 2 (1 - nu^2)/E,   1/R* = 1/r_A + 1/r_B
//! head-on at v:     d_max = ((n + 1) m_e v^2/(2 K))^(1/(n+1)),   t_c = c_n d_max/v,   c_3/2 = 2.9432
//! ```
//!
//! with `1/m_e = 1/m_A + 1/m_B`. All bodies have the same moduli; a plane is a half-space of them.

use carom_core::options::Options;

/// Intervals of Simpson's rule for c_n: contact times of Hertz are right to 3e-10, with a tenth of them to 8e-7.
const INTERVALS: u32 = 256;

/// Elastic law of all contacts of a run.
#[derive(Clone, Copy, Debug)]
pub struct Elastic {
    exponent: f64,
    /// K if given, N/m^n.
    stiffness: Option<f64>,
    /// 4/3 E*, Pa.
    modulus: f64,
    /// c_n.
    time_factor: f64,
    /// Tangential over normal stiffness `dF/dd` of two like bodies (Mindlin), `2 (1 - nu)/(2 - nu)`.
    tangential_ratio: f64,
}

impl Elastic {
    pub fn new(o: &Options) -> Elastic {
        let nu = o.penalty_poisson_ratio;
        Elastic {
            exponent: o.penalty_exponent,
            stiffness: (o.penalty_stiffness > 0.0).then_some(o.penalty_stiffness),
            modulus: 4.0 / 3.0 * o.penalty_young_modulus / (2.0 * (1.0 - nu * nu)),
            time_factor: time_factor(o.penalty_exponent),
            tangential_ratio: 2.0 * (1.0 - nu) / (2.0 - nu),
        }
    }

    /// K of a contact with curvature `1/R* = 1/r_A + 1/r_B` (1/m), N/m^n.
    pub fn stiffness(&self, curvature: f64) -> f64 {
        self.stiffness
            .unwrap_or_else(|| self.modulus / curvature.sqrt())
    }

    /// `K d^n`, N.
    #[inline]
    pub fn force(&self, stiffness: f64, depth: f64) -> f64 {
        if self.exponent == 1.5 {
            stiffness * depth * depth.sqrt()
        } else {
            stiffness * depth.powf(self.exponent)
        }
    }

    /// `dF/dd` where the force is `force`, N/m.
    #[inline]
    pub fn slope(&self, force: f64, depth: f64) -> f64 {
        self.exponent * force / depth
    }

    /// The same of the tangential spring, N/m.
    #[inline]
    pub fn tangential_slope(&self, force: f64, depth: f64) -> f64 {
        self.tangential_ratio * self.slope(force, depth)
    }

    /// Time of an oscillation of the tangential spring over that of the normal one, for these inverse masses.
    pub fn shear_time(&self, inv_mass: f64, inv_mass_sliding: f64) -> f64 {
        (inv_mass / (self.tangential_ratio * inv_mass_sliding)).sqrt()
    }

    /// Stored energy where the force is `force`, J.
    #[inline]
    pub fn energy(&self, force: f64, depth: f64) -> f64 {
        force * depth / (self.exponent + 1.0)
    }

    /// Indentation under the force `force`, m.
    #[inline]
    pub fn indentation(&self, stiffness: f64, force: f64) -> f64 {
        (force / stiffness).powf(1.0 / self.exponent)
    }

    /// d_max of a head-on collision with `energy = m_e v^2/2` (J), m.
    #[inline]
    pub fn deepest(&self, stiffness: f64, energy: f64) -> f64 {
        ((self.exponent + 1.0) * energy / stiffness).powf(1.0 / (self.exponent + 1.0))
    }

    /// t_c of an undamped collision at speed `v` (m/s) with `1/m_e` (1/kg), s; infinite for 0. `force_factor` stands for
    /// a force that is so many times larger.
    #[inline]
    pub fn contact_time(&self, stiffness: f64, inv_mass: f64, v: f64, force_factor: f64) -> f64 {
        if v == 0.0 {
            return f64::INFINITY;
        }
        self.time_factor * self.deepest(stiffness * force_factor, 0.5 * v * v / inv_mass) / v
    }
}

/// `c_n = 2 int_0^1 dx/sqrt(1 - x^(n+1))`, with `x = 1 - y^2` against the root at the end.
fn time_factor(n: f64) -> f64 {
    let integrand = |y: f64| {
        if y == 0.0 {
            2.0 / (n + 1.0).sqrt()
        } else {
            2.0 * y / (-((n + 1.0) * (-y * y).ln_1p()).exp_m1()).sqrt()
        }
    };
    let step = 1.0 / f64::from(INTERVALS);
    let mut sum = integrand(0.0) + integrand(1.0);
    for k in 1..INTERVALS {
        let weight = if k % 2 == 1 { 4.0 } else { 2.0 };
        sum += weight * integrand(f64::from(k) * step);
    }
    2.0 * sum * step / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contact_times_are_the_known_ones() {
        // n = 1: half a period of the harmonic oscillator. n = 3/2: 2 sqrt(pi) Gamma(7/5)/Gamma(9/10).
        assert!((time_factor(1.0) - std::f64::consts::PI).abs() < 1e-9);
        assert!((time_factor(1.5) - 2.943_275_184_3).abs() < 1e-8);
    }
}
