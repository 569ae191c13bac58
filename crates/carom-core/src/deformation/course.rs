//! A periodic box over a step.

use super::law::{step_of, Strain};
use crate::contact::CANDIDATE_MARGIN;
use crate::model::Model;
use crate::outcome::{within_bounds, FASTEST};
use crate::stepper::Span;
use carom_geom::Periodic;
use glam::{DVec3, IVec3};

/// The least length of a periodic box over the largest radius and its margin: two images of one sphere must not be candidates for a contact with
/// another at the same time.
const LEAST_RADII: f64 = 4.0;

/// The least length of a periodic box for spheres of these radii, m.
pub(crate) fn least_period(radii: impl Iterator<Item = f64>) -> f64 {
    LEAST_RADII * (1.0 + 2.0 * CANDIDATE_MARGIN) * radii.fold(0.0, f64::max)
}

/// A periodic box over a step. One that does not deform is the same at all times.
#[derive(Clone, Copy, Debug, Default)]
pub struct BoxCourse {
    pub deforms: bool,
    /// At t_n, at the time of the gaps, and at t_{n+1}.
    pub start: Periodic,
    pub now: Periodic,
    end: Periodic,
    /// In this step.
    rate: Strain,
}

impl BoxCourse {
    pub fn new(model: &Model) -> BoxCourse {
        BoxCourse {
            deforms: model.deformation.is_some(),
            start: model.periodic,
            now: model.periodic,
            end: model.periodic,
            ..BoxCourse::default()
        }
    }

    /// Takes the box to a step. What is wrong with its law there, if anything is.
    pub fn begin(&mut self, model: &Model, span: Span) -> Result<(), String> {
        let Some(law) = &model.deformation else {
            return Ok(());
        };
        let h = model.options.step;
        let at = |t: f64| law.periodic(&model.periodic, t, h);
        (self.start, self.end) = (at(span.start), at(span.end));
        self.now = self.end;
        self.rate = law.rate_of(step_of(span.start, h), h);
        let [stretch, shear] = [self.rate.stretch, DVec3::splat(self.rate.shear)];
        let slow = within_bounds(stretch * model.periodic.length(), shear);
        if !(slow && self.rate.is_finite()) {
            return Err(format!(
                "the deformation of the periodic box is not finite, or faster than {FASTEST:e} m/s, by t = {} s",
                span.end
            ));
        }
        let least = least_period(model.radius[..model.balls()].iter().copied());
        let lengths = self.end.length().to_array();
        match lengths.iter().position(|l| *l != 0.0 && *l < least) {
            None => Ok(()),
            Some(axis) => Err(format!(
                "the periodic box is {} m long along {} by t = {} s; it must keep {least} m, four of the largest radii and a margin",
                lengths[axis],
                ["x", "y", "z"][axis],
                span.end
            )),
        }
    }

    /// Puts the box of the gaps to another time of the step.
    pub fn place(&mut self, model: &Model, time: f64) {
        if let Some(law) = &model.deformation {
            self.now = law.periodic(&model.periodic, time, model.options.step);
        }
    }

    /// How many images of the box lie between two centres that meet, `d` (m) apart at t_n.
    #[inline]
    pub fn images_away(&self, d: DVec3) -> IVec3 {
        match self.deforms {
            true => self.start.images_away(d).as_ivec3(),
            false => IVec3::ZERO,
        }
    }

    /// Velocity of an image in this step.
    #[inline]
    pub fn velocity(&self, model: &Model, count: DVec3) -> DVec3 {
        let law = model.deformation.as_ref();
        law.map_or(DVec3::ZERO, |law| {
            law.velocity(&model.periodic, &self.rate, count)
        })
    }

    /// Displacement of an image over the step.
    #[inline]
    pub fn way(&self, count: DVec3) -> DVec3 {
        self.end.image(count) - self.start.image(count)
    }

    /// The displacement `d` over the step of what was at `x`, against the mean flow.
    #[inline]
    pub fn own_way(&self, x: DVec3, d: DVec3) -> DVec3 {
        match self.deforms {
            true => d - self.way(self.start.share(x)),
            false => d,
        }
    }

    /// The same until the time of the gaps.
    #[inline]
    pub fn own_way_now(&self, x: DVec3, d: DVec3) -> DVec3 {
        if !self.deforms {
            return d;
        }
        let share = self.start.share(x);
        d - (self.now.image(share) - self.start.image(share))
    }

    /// How far (m) a distance of `length` changes at most over the step.
    #[inline]
    pub fn change(&self, length: f64) -> f64 {
        match self.deforms {
            true => length * (self.start.lengthening(&self.end) - 1.0),
            false => 0.0,
        }
    }
}
