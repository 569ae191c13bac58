//! Generalized-alpha, eqs. 6 and 7 and lines 5-9, 41 of Algorithm 1.
//!
//! Symbols: alpha_m, alpha_f, gamma, beta (eq. 7); a: pseudo acceleration; the smooth Newton correction `dv` of the
//! velocity changes the acceleration by `s dv`, `s = (1 - alpha_m)/((1 - alpha_f) gamma h)`, and the position by `(h beta/gamma) dv`.
//! Departure: eq. 6c is read with accelerations on its right side (erratum E11).

use glam::DVec3;

/// Coefficients for one step size, as the factors that the update needs.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients {
    pub h: f64,
    /// a_{n+1} = `from_acceleration` v-dot_n - `from_pseudo` a_n (line 7).
    pub(super) from_acceleration: f64,
    pub(super) from_pseudo: f64,
    /// h (1 - gamma), h gamma; h^2 (1/2 - beta), h^2 beta (lines 8 and 9).
    pub(super) velocity_old: f64,
    pub(super) velocity_new: f64,
    pub(super) displacement_old: f64,
    pub(super) displacement_new: f64,
    /// s, and h beta/gamma (lines 17 and 18).
    pub(super) acceleration_per_velocity: f64,
    pub(super) displacement_per_velocity: f64,
    /// (1 - alpha_f)/(1 - alpha_m) (line 41).
    pub(super) finish: f64,
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
            from_acceleration: alpha_f / (1.0 - alpha_m),
            from_pseudo: alpha_m / (1.0 - alpha_m),
            velocity_old: h * (1.0 - gamma),
            velocity_new: h * gamma,
            displacement_old: h * h * (0.5 - beta),
            displacement_new: h * h * beta,
            acceleration_per_velocity: (1.0 - alpha_m) / ((1.0 - alpha_f) * gamma * h),
            displacement_per_velocity: h * beta / gamma,
            finish: (1.0 - alpha_f) / (1.0 - alpha_m),
        }
    }

    /// Lines 5-9 with v-dot-check_{n+1} = 0.
    #[inline]
    pub fn predict(&self, velocity: DVec3, pseudo: DVec3, acceleration: DVec3) -> Prediction {
        let new = self.from_acceleration * acceleration - self.from_pseudo * pseudo;
        Prediction {
            velocity: velocity + self.velocity_old * pseudo + self.velocity_new * new,
            displacement: self.h * velocity
                + self.displacement_old * pseudo
                + self.displacement_new * new,
            pseudo: new,
            acceleration: DVec3::ZERO,
        }
    }

    /// d(v-dot-check)/d(v-check) of a smooth Newton correction.
    #[inline]
    pub fn acceleration_per_velocity(&self) -> f64 {
        self.acceleration_per_velocity
    }

    /// d(q-check)/d(v-check) of a smooth Newton correction.
    #[inline]
    pub fn displacement_per_velocity(&self) -> f64 {
        self.displacement_per_velocity
    }

    /// Lines 16-18: applies a velocity correction.
    #[inline]
    pub fn correct(&self, p: &mut Prediction, dv: DVec3) {
        p.velocity += dv;
        p.acceleration += self.acceleration_per_velocity * dv;
        p.displacement += self.displacement_per_velocity * dv;
    }

    /// Line 41: a_{n+1}.
    #[inline]
    pub fn finish(&self, p: &Prediction) -> DVec3 {
        p.pseudo + self.finish * p.acceleration
    }
}
