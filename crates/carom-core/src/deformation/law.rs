//! The law by which a periodic box deforms.

use carom_geom::{Periodic, Shear};
use carom_laws::Scalar;
use glam::DVec3;

/// How a periodic box deforms over time.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// Lengths over those given (1); 1 where there is no law.
    pub stretch: [Option<Scalar>; 3],
    /// Shear strain (1): displacement along the flow over the length given along the gradient.
    pub shear: Option<Scalar>,
    /// Axes, 0 to 2.
    pub flow: usize,
    pub gradient: usize,
}

/// A stretch and a shear, or their rates (1/s).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain {
    pub stretch: DVec3,
    pub shear: f64,
}

impl Strain {
    pub(super) fn minus(self, other: Strain) -> Strain {
        Strain {
            stretch: self.stretch - other.stretch,
            shear: self.shear - other.shear,
        }
    }
}

impl Deformation {
    pub(super) fn strain(&self, law: impl Fn(&Scalar) -> f64, without: f64) -> Strain {
        let of = |given: &Option<Scalar>| given.as_ref().map_or(without, &law);
        Strain {
            stretch: DVec3::from(std::array::from_fn(|k| of(&self.stretch[k]))),
            shear: self.shear.as_ref().map_or(0.0, &law),
        }
    }

    pub(super) fn at(&self, t: f64) -> Strain {
        self.strain(|law| law.value(t), 1.0)
    }

    /// The rate at a time; at a kink that after it.
    pub(super) fn rate(&self, t: f64) -> Strain {
        self.strain(|law| law.slope(t), 0.0)
    }

    /// At a kink the rate before it.
    pub(super) fn rate_before(&self, t: f64) -> Strain {
        self.strain(|law| law.slope_before(t), 0.0)
    }

    /// The box at a time, which was `given`.
    pub fn periodic(&self, given: &Periodic, t: f64) -> Periodic {
        let now = self.at(t);
        let length = now.stretch * given.length();
        let shear = Shear {
            flow: self.flow,
            gradient: self.gradient,
            offset: now.shear * given.length()[self.gradient],
        };
        Periodic::new(length, given.middle() - 0.5 * length).sheared(shear)
    }

    /// Velocity (m/s) of what is `count` lengths away along the edges of the box, at a rate of strain.
    #[inline]
    pub(super) fn velocity(&self, given: &Periodic, rate: &Strain, count: DVec3) -> DVec3 {
        let mut v = rate.stretch * given.length() * count;
        v[self.flow] += rate.shear * given.length()[self.gradient] * count[self.gradient];
        v
    }

    /// The mean flow at `x` and a time.
    pub fn flow_at(&self, given: &Periodic, x: DVec3, t: f64) -> DVec3 {
        let share = self.periodic(given, t).share(x);
        self.velocity(given, &self.rate(t), share)
    }
}
