//! Space that repeats itself: every body has an image at each multiple of the box's lengths.
//!
//! Positions are never wrapped: a body that crosses the border goes on beyond it. Two bodies meet by their nearest images,
//! whose difference `d - L round(d/L)` does not change when one of them moves by a length of the box.

use crate::pair::{sphere_sphere, Proximity};
use glam::DVec3;

/// A box with up to three periodic axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Periodic {
    /// Length along each axis (m), 0 where it does not repeat.
    length: DVec3,
    origin: DVec3,
    inverse: DVec3,
    any: bool,
}

impl Periodic {
    /// A box with its low corner at `origin` (m), which nothing but the search depends on, and the given lengths (m); axes
    /// with a length of 0 do not repeat.
    pub fn new(length: DVec3, origin: DVec3) -> Self {
        let repeats = length.cmpgt(DVec3::ZERO);
        Self {
            length: DVec3::select(repeats, length, DVec3::ZERO),
            origin,
            inverse: DVec3::select(repeats, length.recip(), DVec3::ZERO),
            any: repeats.any(),
        }
    }

    /// Whether no axis repeats.
    #[inline]
    pub fn is_none(&self) -> bool {
        !self.any
    }

    /// Lengths (m), 0 where an axis does not repeat.
    pub fn length(&self) -> DVec3 {
        self.length
    }

    /// The shortest of the differences of position (m) of all images.
    #[inline]
    pub fn nearest(&self, d: DVec3) -> DVec3 {
        if !self.any {
            return d;
        }
        d - self.length * (d * self.inverse).round()
    }

    /// The image in the box itself.
    pub fn wrap(&self, x: DVec3) -> DVec3 {
        x - self.length * ((x - self.origin) * self.inverse).floor()
    }

    /// Whether `x` or an image of it lies between two corners (m), which count. A length or more covers an axis.
    pub fn in_box(&self, x: DVec3, low: DVec3, high: DVec3) -> bool {
        // The lowest image that is not below the box.
        let first = x - self.length * ((x - low) * self.inverse).floor();
        let repeats = self.length.cmpgt(DVec3::ZERO);
        let x = DVec3::select(repeats, first, x);
        // Of a box without end there is no such image; and rounding leaves gaps between boxes of one length.
        let covered = repeats & (high - low).cmpge(self.length);
        (covered | (x.cmpge(low) & x.cmple(high))).all()
    }

    /// How two spheres meet by their nearest images; see [`sphere_sphere`].
    #[inline]
    pub fn sphere_sphere(&self, xa: DVec3, ra: f64, xb: DVec3, rb: f64) -> Proximity {
        if !self.any {
            return sphere_sphere(xa, ra, xb, rb);
        }
        sphere_sphere(self.nearest(xa - xb), ra, DVec3::ZERO, rb)
    }

    /// Calls `visit` with every other image of `x`, which lies in the box, within `margin` (m) of the box and one length.
    pub(crate) fn images(&self, x: DVec3, margin: f64, mut visit: impl FnMut(DVec3)) {
        // Per axis, whether the images one length up and down are near.
        let low = x - self.origin;
        let repeats = self.length.cmpgt(DVec3::ZERO);
        let up = repeats & low.cmple(DVec3::splat(margin));
        let down = repeats & (self.length - low).cmple(DVec3::splat(margin));
        if !(up | down).any() {
            return;
        }
        let steps = |k: usize| -i32::from(down.test(k))..=i32::from(up.test(k));
        for z in steps(2) {
            for y in steps(1) {
                for x_step in steps(0) {
                    if (x_step, y, z) != (0, 0, 0) {
                        visit(x + self.length * glam::IVec3::new(x_step, y, z).as_dvec3());
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_images_and_wrapping() {
        let p = Periodic::new(DVec3::new(4.0, 0.0, 2.0), DVec3::new(1.0, 0.0, 0.0));
        assert!(!p.is_none() && Periodic::default().is_none());
        let d = DVec3::new(3.0, 7.0, -1.5);
        assert_eq!(p.nearest(d), DVec3::new(-1.0, 7.0, 0.5));
        assert_eq!(p.nearest(-d), -p.nearest(d));
        assert_eq!(p.nearest(d + DVec3::new(-40.0, 0.0, 6.0)), p.nearest(d));
        assert_eq!(Periodic::default().nearest(d), d);
        let x = DVec3::new(0.5, -3.0, 4.25);
        assert_eq!(p.wrap(x), DVec3::new(4.5, -3.0, 0.25));
        let mut images = Vec::new();
        p.images(p.wrap(x), 0.5, |x| images.push(x));
        assert_eq!(
            images,
            [
                DVec3::new(0.5, -3.0, 0.25),
                DVec3::new(0.5, -3.0, 2.25),
                DVec3::new(4.5, -3.0, 2.25)
            ]
        );
    }
}
