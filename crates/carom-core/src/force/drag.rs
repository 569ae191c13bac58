//! Viscous drag on one sphere, which may be one of a clump: `f = -c v` at its centre, `m = -c_r w`.

use super::{coefficient, wrench_power, Dependence, Load, LoadError, Motion, Tangent};
use crate::clump::body::Carrier;
use crate::joint::{add_block, lever_blocks, skew};
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// Coefficients in N s/m and N m s.
#[derive(Clone, Copy, Debug)]
pub struct Drag {
    pub body: u32,
    /// The centre of the sphere, from that of the body in its axes, m.
    pub arm: DVec3,
    pub translation: f64,
    pub rotation: f64,
}

impl Drag {
    fn arm(&self, at: &Motion) -> DVec3 {
        at.orientation[self.body as usize] * self.arm
    }

    fn wrench(&self, at: &Motion) -> [DVec3; 2] {
        let (twist, arm) = (at.twist(self.body as usize), self.arm(at));
        let w = twist.angular_velocity;
        let force = -self.translation * (twist.velocity + w.cross(arm));
        [force, arm.cross(force) - self.rotation * w]
    }
}

impl Load for Drag {
    fn dependence(&self) -> Dependence {
        Dependence::Motion(self.body, None)
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        [Some(self.body), None]
    }

    fn holds(&self) -> bool {
        false
    }

    fn carried(&self, by: &dyn Fn(u32) -> Option<Carrier>) -> Option<Arc<dyn Load>> {
        let clump = by(self.body)?;
        Some(Arc::new(Drag {
            body: clump.body,
            arm: clump.arm(self.arm),
            ..*self
        }))
    }

    fn check(&self) -> Result<(), (&'static str, String)> {
        coefficient("translation", self.translation)?;
        coefficient("rotation", self.rotation)
    }

    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        let [f, m] = self.wrench(at);
        let w = &mut wrench[self.body as usize];
        w[0] += f;
        w[1] += m;
        Ok(())
    }

    fn tangent(&self, at: &Motion, out: &mut Vec<Tangent>) {
        let mut t = Tangent::new(self.body, self.body);
        let (arm, c) = (self.arm(at), DMat3::IDENTITY * self.translation);
        lever_blocks(&mut t.velocity, c, arm, arm, -1.0);
        add_block(&mut t.velocity, 1, 1, DMat3::IDENTITY, -self.rotation);
        // The lever turns: d(w x s) = -w~ s~ dtheta, and d(s x f) = f~ s~ dtheta beside.
        let swing = c * skew(at.angular_velocity[self.body as usize]) * skew(arm);
        let [force, _] = self.wrench(at);
        add_block(&mut t.position, 0, 1, swing, 1.0);
        add_block(
            &mut t.position,
            1,
            1,
            skew(arm) * swing + skew(force) * skew(arm),
            1.0,
        );
        out.push(t);
    }

    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let twist = at.twist(self.body as usize);
        Ok(wrench_power(&self.wrench(at), &twist))
    }
}
