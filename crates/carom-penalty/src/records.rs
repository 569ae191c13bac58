//! What a step tells of a pair.

use crate::elastic::Elastic;
use crate::pair::Pair;
use carom_core::contact::{Contact, WorldImpulse};
use carom_solve::Bounds;

impl Pair {
    /// Whether anything happened to it in this step.
    pub fn has_record(&self) -> bool {
        self.closed || self.step.weighed_normal != glam::DVec3::ZERO
    }

    /// Ends the step: its sums are complete, and a contact that stays closed remembers its impulses.
    pub fn end_step(&mut self) {
        if self.closed {
            self.touch.impulse += self.now.impulse;
            self.touch.moment += self.now.moment;
        }
        self.end_sums();
    }

    /// Stored energy, J.
    pub fn energy(&self, elastic: &Elastic) -> f64 {
        if !self.closed || self.gap >= 0.0 {
            return 0.0;
        }
        let slope = elastic.tangential_slope(self.force, -self.gap);
        let sheared = slope * self.touch.spring.length_squared();
        elastic.energy(self.force, -self.gap) + 0.5 * sheared
    }

    /// The step's impulses as a contact of the step.
    ///
    /// Friction acts on the lever of the mean normal, also where elastic and damping impulses cancel: the direction of their
    /// sum is that of rounding errors then. Without friction only the row along the sum holds what acted.
    pub fn contact(&self, law: u32) -> Contact {
        let along = if self.constants.slides {
            self.step.weighed_normal
        } else {
            self.step.impulse
        };
        let n = along.normalize_or(self.normal);
        let (t1, t2) = carom_geom::tangent_frame(n);
        // The rows are there although the law may give 0 just now.
        let sliding = if self.constants.slides {
            self.friction.max(f64::MIN_POSITIVE)
        } else {
            0.0
        };
        let contact = Contact {
            a: self.a,
            b: self.b,
            law,
            n0: n,
            t1,
            t2,
            n1: n,
            gap_start: self.gap,
            gap_check: self.gap,
            gap: self.gap,
            bounds: Bounds {
                sliding,
                ..self.constants.bounds
            },
            length: self.length,
            work: self.step.work,
            closed: self.closed,
            status: self.status(),
            ..Contact::default()
        };
        let world = WorldImpulse {
            impulse: self.step.impulse,
            moment: self.step.moment,
        };
        let mut lambda = [0.0; 6];
        contact.to_rows(&world, &mut lambda);
        Contact { lambda, ..contact }
    }
}
