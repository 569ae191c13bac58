//! Generalized-alpha, eqs. 6 and 7 and lines 5-9, 41 of Algorithm 1.
//!
//! Symbols: alpha_m, alpha_f, gamma, beta (eq. 7); a: pseudo acceleration; the smooth Newton correction `dv` of the
//! velocity changes the acceleration by `s dv`, `s = (1 - alpha_m)/((1 - alpha_f) gamma h)`, and the position by `(h beta/gamma) dv`.
//! Departure: eq. 6c is read with accelerations on its right side (erratum E11).

use glam::DVec3;

/// Coefficients for one step size.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients {
    pub h: f64,
    alpha_m: f64,
    alpha_f: f64,
    gamma: f64,
    beta: f64,
}

/// Prediction of one body: translation or rotation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Prediction {
    /// v-check_{n+1}.
    pub velocity: DVec3,
    /// q-check_{n+1} - q_n, or the rotation increment psi-check (spatial).
    pub displacement: DVec3,
    /// a_{n+1} before line 41.
    pub pseudo: DVec3,
    /// v-dot-check_{n+1}.
    pub acceleration: DVec3,
}

impl Coefficients {
    /// From the spectral radius at infinity rho_inf in [0, 1) and the step h (eq. 7).
    pub fn new(spectral_radius: f64, h: f64) -> Self {
        let alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0);
        let alpha_f = spectral_radius / (spectral_radius + 1.0);
        let gamma = 0.5 + alpha_f - alpha_m;
        let beta = 0.25 * (gamma + 0.5) * (gamma + 0.5);
        Coefficients {
            h,
            alpha_m,
            alpha_f,
            gamma,
            beta,
        }
    }

    /// Lines 5-9 with v-dot-check_{n+1} = 0.
    #[inline]
    pub fn predict(&self, velocity: DVec3, pseudo: DVec3, acceleration: DVec3) -> Prediction {
        let Coefficients {
            h,
            alpha_m,
            alpha_f,
            gamma,
            beta,
        } = *self;
        let new = (alpha_f * acceleration - alpha_m * pseudo) / (1.0 - alpha_m);
        Prediction {
            velocity: velocity + h * (1.0 - gamma) * pseudo + h * gamma * new,
            displacement: h * velocity + h * h * (0.5 - beta) * pseudo + h * h * beta * new,
            pseudo: new,
            acceleration: DVec3::ZERO,
        }
    }

    /// d(v-dot-check)/d(v-check) of a smooth Newton correction.
    #[inline]
    pub fn acceleration_per_velocity(&self) -> f64 {
        (1.0 - self.alpha_m) / ((1.0 - self.alpha_f) * self.gamma * self.h)
    }

    /// Lines 16-18: applies a velocity correction.
    #[inline]
    pub fn correct(&self, p: &mut Prediction, dv: DVec3) {
        p.velocity += dv;
        p.acceleration += self.acceleration_per_velocity() * dv;
        p.displacement += self.h * self.beta / self.gamma * dv;
    }

    /// Line 41: a_{n+1}.
    #[inline]
    pub fn finish(&self, p: &Prediction) -> DVec3 {
        p.pseudo + (1.0 - self.alpha_f) / (1.0 - self.alpha_m) * p.acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A constant acceleration is integrated exactly for every spectral radius (theory 1.3).
    #[test]
    fn constant_acceleration_is_exact() {
        let (g, h) = (DVec3::new(0.0, 0.0, -9.8), 1e-3);
        for rho in [0.0, 0.3, 0.8, 0.99] {
            let c = Coefficients::new(rho, h);
            let v = DVec3::new(1.0, 2.0, 3.0);
            let mut p = c.predict(v, g, g);
            let dv = g / c.acceleration_per_velocity();
            c.correct(&mut p, dv);
            assert!((p.velocity - (v + h * g)).length() < 1e-15);
            assert!((p.displacement - (h * v + 0.5 * h * h * g)).length() < 1e-17);
            assert!((c.finish(&p) - g).length() < 1e-13);
        }
    }
}
