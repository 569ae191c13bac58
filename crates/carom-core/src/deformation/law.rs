//! The law by which a periodic box deforms.

use carom_geom::{Periodic, Shear};
use carom_laws::Scalar;
use glam::DVec3;

/// By how much (1) the rate of a step may differ from the slope of its law at the start, in units of both values, to count as that: differences round.
/// Larger: bends of the law are lost.
const STRAIGHT: f64 = 1e-9;
/// Share (1) of a step by which times may be early: they are rounded. Larger: the end of a step counts as the next one.
const ON_TIME: f64 = 1e-6;

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
    pub(super) fn is_finite(self) -> bool {
        self.stretch.is_finite() && self.shear.is_finite()
    }

    pub(super) fn minus(self, other: Strain) -> Strain {
        Strain {
            stretch: self.stretch - other.stretch,
            shear: self.shear - other.shear,
        }
    }
}

impl Deformation {
    fn strain(&self, law: impl Fn(&Scalar) -> f64, without: f64) -> Strain {
        let of = |given: &Option<Scalar>| given.as_ref().map_or(without, &law);
        Strain {
            stretch: DVec3::from(std::array::from_fn(|k| of(&self.stretch[k]))),
            shear: self.shear.as_ref().map_or(0.0, &law),
        }
    }

    /// The rate of step number `step` of size `h`, which is constant: between the times of the grid the box goes the straight way. Where the law ends,
    /// as that of a run may do, it is that of the step before.
    pub(super) fn rate(&self, step: u64, h: f64) -> Strain {
        match (self.rate_of(step, h), step) {
            (rate, 0) => rate,
            (rate, _) if rate.is_finite() => rate,
            _ => self.rate_of(step - 1, h),
        }
    }

    /// The same; no numbers where the law ends.
    pub(super) fn rate_of(&self, step: u64, h: f64) -> Strain {
        let [from, to] = [step, step + 1].map(|n| n as f64 * h);
        let mean = |law: &Scalar| {
            let (mean, slope) = ((law.value(to) - law.value(from)) / h, law.slope(from));
            // Of a straight law without the rounding of a difference.
            let same = (mean - slope).abs() <= STRAIGHT * (slope.abs() + law.value(to).abs());
            if same {
                slope
            } else {
                mean
            }
        };
        self.strain(mean, 0.0)
    }

    /// The box at a time, which was `given`, with steps of size `h`.
    pub fn periodic(&self, given: &Periodic, t: f64, h: f64) -> Periodic {
        let step = step_of(t, h);
        let from = step as f64 * h;
        let (start, rate) = (self.strain(|law| law.value(from), 1.0), self.rate(step, h));
        let stretch = start.stretch + (t - from) * rate.stretch;
        let length = stretch * given.length();
        let shear = Shear {
            flow: self.flow,
            gradient: self.gradient,
            offset: (start.shear + (t - from) * rate.shear) * given.length()[self.gradient],
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

    /// The mean flow at `x` and a time, that of the step that begins there.
    pub fn flow_at(&self, given: &Periodic, x: DVec3, t: f64, h: f64) -> DVec3 {
        let share = self.periodic(given, t, h).share(x);
        self.velocity(given, &self.rate(step_of(t, h), h), share)
    }
}

/// The step in which a time is, or that begins there.
pub(super) fn step_of(t: f64, h: f64) -> u64 {
    (t / h + ON_TIME).floor().max(0.0) as u64
}
