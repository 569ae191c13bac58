//! Space that repeats itself: every body has an image at each multiple of the box's lengths.
//!
//! Positions are never wrapped: a body that crosses the border goes on beyond it. Two bodies meet by their nearest images,
//! whose difference `d - L round(d/L)` does not change when one of them moves by a length of the box. In a sheared box the
//! image one length up along the gradient lies off along the flow: `docs/theory/algorithm.md` section 16.

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
    shear: Option<Shear>,
}

/// Which images a shear has moved, and how far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shear {
    /// Axes (0 to 2), which both repeat: the one along which images move, and the one across which they do.
    pub flow: usize,
    pub gradient: usize,
    /// Displacement along the flow of the image one length up along the gradient, m; of any size.
    pub offset: f64,
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
            shear: None,
        }
    }

    /// The same box, sheared.
    pub fn sheared(self, shear: Shear) -> Self {
        let shear = Some(shear);
        Self { shear, ..self }
    }

    /// How many images away along each axis `d` (m) ends, so that [`Self::image`] of it is taken off for the shortest.
    #[inline]
    pub fn images_away(&self, d: DVec3) -> DVec3 {
        let mut count = (d * self.inverse).round();
        if let Some(s) = self.shear {
            let along = d[s.flow] - count[s.gradient] * s.offset;
            count[s.flow] = (along * self.inverse[s.flow]).round();
        }
        count
    }

    /// Where `x` (m) lies from the middle of the box, in lengths of it along its edges; 0 along axes that do not repeat.
    #[inline]
    pub fn share(&self, x: DVec3) -> DVec3 {
        let y = x - self.origin - 0.5 * self.length;
        let mut share = y * self.inverse;
        if let Some(s) = self.shear {
            let along = y[s.flow] - share[s.gradient] * s.offset;
            share[s.flow] = along * self.inverse[s.flow];
        }
        share
    }

    /// Where a place (m) comes to as this box deforms to `other`, whose middle is the same.
    #[inline]
    pub fn carried(&self, x: DVec3, other: &Periodic) -> DVec3 {
        let share = self.share(x);
        x + (other.image(share) - self.image(share))
    }

    /// How much longer (1) any distance gets at most as this box deforms to `other`: a bound, 1 or more.
    pub fn lengthening(&self, other: &Periodic) -> f64 {
        let repeats = self.length.cmpgt(DVec3::ZERO);
        let ratio = DVec3::select(repeats, other.length * self.inverse, DVec3::ONE);
        let offset = |of: &Periodic| of.shear.map_or(0.0, |shear| shear.offset);
        // A box that is not sheared yet has no shear.
        let across = other.shear.or(self.shear).map_or(0.0, |to| {
            (offset(other) - offset(self) * ratio[to.flow]) * self.inverse[to.gradient]
        });
        1.0 + (ratio - 1.0).abs().max_element() + across.abs()
    }

    /// Displacement (m) of the image so many lengths away along each axis.
    #[inline]
    pub fn image(&self, count: DVec3) -> DVec3 {
        let mut by = self.length * count;
        if let Some(shear) = self.shear {
            by[shear.flow] += count[shear.gradient] * shear.offset;
        }
        by
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

    /// The middle of the box (m).
    pub fn middle(&self) -> DVec3 {
        self.origin + 0.5 * self.length
    }

    /// Displacement (m) along the flow of the image one length up along the gradient.
    pub fn offset(&self) -> f64 {
        self.shear.map_or(0.0, |shear| shear.offset)
    }

    /// The shortest of the differences of position (m) of all images.
    #[inline]
    pub fn nearest(&self, d: DVec3) -> DVec3 {
        if !self.any {
            return d;
        }
        d - self.image(self.images_away(d))
    }

    /// The image in the box itself.
    pub fn wrap(&self, mut x: DVec3) -> DVec3 {
        if let Some(s) = self.shear {
            let up = ((x - self.origin) * self.inverse)[s.gradient].floor();
            x[s.flow] -= up * s.offset;
        }
        x - self.length * ((x - self.origin) * self.inverse).floor()
    }

    /// Of a box that is not sheared: whether `x` or an image of it lies between two corners (m), which count. A length or more covers an axis.
    pub fn in_box(&self, x: DVec3, low: DVec3, high: DVec3) -> bool {
        if !self.any {
            return (x.cmpge(low) & x.cmple(high)).all();
        }
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
        let Some(Shear {
            flow,
            gradient,
            offset,
        }) = self.shear
        else {
            self.images_of(x, margin, |step| {
                if step != DVec3::ZERO {
                    visit(x + self.length * step);
                }
            });
            return;
        };
        // Along the gradient first; what a shear has moved out of the box comes in again along the flow.
        let low = x[gradient] - self.origin[gradient];
        let steps = [
            (0.0, true),
            (1.0, low <= margin),
            (-1.0, self.length[gradient] - low <= margin),
        ];
        for (up, _) in steps.into_iter().filter(|(_, near)| *near) {
            let mut base = x;
            base[flow] += up * offset;
            base[flow] = self.wrap_along(base, flow);
            self.images_of(base, margin, |step| {
                if step[gradient] == 0.0 && (up, step) != (0.0, DVec3::ZERO) {
                    let mut by = self.length * step;
                    by[gradient] = up * self.length[gradient];
                    visit(base + by);
                }
            });
        }
    }

    /// A coordinate of the image in the box, of one that moves along this axis alone.
    fn wrap_along(&self, x: DVec3, axis: usize) -> f64 {
        let away = ((x - self.origin) * self.inverse).floor();
        x[axis] - self.length[axis] * away[axis]
    }

    /// Calls `visit` with the steps, along each axis, to images of `x` within `margin` (m) of the box and one length, its own among them.
    fn images_of(&self, x: DVec3, margin: f64, mut visit: impl FnMut(DVec3)) {
        // Per axis, whether the images one length up and down are near.
        let low = x - self.origin;
        let repeats = self.length.cmpgt(DVec3::ZERO);
        let up = repeats & low.cmple(DVec3::splat(margin));
        let down = repeats & (self.length - low).cmple(DVec3::splat(margin));
        let steps = |k: usize| -i32::from(down.test(k))..=i32::from(up.test(k));
        for z in steps(2) {
            for y in steps(1) {
                for x_step in steps(0) {
                    visit(glam::IVec3::new(x_step, y, z).as_dvec3());
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

    /// Repeatable numbers in [-1, 1).
    fn random(seed: &mut u64) -> f64 {
        *seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    #[test]
    fn in_a_sheared_box_every_image_is_the_same_body() {
        let seed = &mut 5;
        for (flow, gradient) in [(0, 1), (0, 2), (1, 0), (2, 1)] {
            for offset in [0.0, 0.3, -1.7, 25.2] {
                let p = Periodic::new(DVec3::new(1.0, 1.25, 1.5), DVec3::new(0.5, -1.0, 0.0));
                let p = p.sheared(Shear {
                    flow,
                    gradient,
                    offset,
                });
                for _ in 0..50 {
                    let d = 0.3 * DVec3::from([(); 3].map(|()| random(seed)));
                    let count = (5.0 * DVec3::from([(); 3].map(|()| random(seed)))).round();
                    let away = d + p.image(count);
                    assert_eq!(p.images_away(away), count);
                    assert!((p.nearest(away) - d).length() < 1e-13);
                    let x = p.wrap(away);
                    assert!((x - p.wrap(d)).length() < 1e-13);
                    let inside = x - p.origin;
                    assert!(inside.cmpge(DVec3::ZERO).all() && inside.cmple(p.length).all());
                }
            }
        }
    }

    #[test]
    fn images_near_a_sheared_box_are_all_found() {
        let seed = &mut 11;
        let p = Periodic::new(DVec3::splat(1.0), DVec3::ZERO);
        for (flow, gradient, offset) in [(0, 1, 0.37), (2, 0, -4.81), (1, 2, 0.0)] {
            let p = p.sheared(Shear {
                flow,
                gradient,
                offset,
            });
            for _ in 0..200 {
                let x = 0.5 * (DVec3::from([(); 3].map(|()| random(seed))) + DVec3::ONE);
                let margin = 0.2;
                let mut found = Vec::new();
                p.images(x, margin, |image| found.push(image));
                // Every image within the margin of the box, by trying them.
                let all = (-7..=7)
                    .flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| (i, j, k))));
                let mut expected = 0;
                for (i, j, k) in all {
                    let mut count = DVec3::ZERO;
                    count[flow] = f64::from(i);
                    count[gradient] = f64::from(j);
                    count[3 - flow - gradient] = f64::from(k);
                    let image = x + p.image(count);
                    let near = image.cmpge(DVec3::splat(-margin)).all()
                        && image.cmple(DVec3::splat(1.0 + margin)).all();
                    if near && count != DVec3::ZERO {
                        expected += 1;
                        assert!(found.iter().any(|f| (*f - image).length() < 1e-12));
                    }
                }
                assert_eq!(found.len(), expected);
            }
        }
    }
}
