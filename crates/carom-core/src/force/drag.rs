//! Viscous drag on one sphere: `f = -c v`, `m = -c_r w`.

use super::{coefficient, wrench_power, Dependence, Load, LoadError, Motion, Tangent};
use crate::joint::Twist;
use glam::DVec3;

/// Coefficients in N s/m and N m s.
#[derive(Clone, Copy, Debug)]
pub struct Drag {
    pub body: u32,
    pub translation: f64,
    pub rotation: f64,
}

impl Drag {
    fn wrench(&self, twist: &Twist) -> [DVec3; 2] {
        [
            -self.translation * twist.velocity,
            -self.rotation * twist.angular_velocity,
        ]
    }
}

impl Load for Drag {
    fn dependence(&self) -> Dependence {
        Dependence::Motion(self.body, None)
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        [Some(self.body), None]
    }

    fn check(&self) -> Result<(), (&'static str, String)> {
        coefficient("translation", self.translation)?;
        coefficient("rotation", self.rotation)
    }

    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        let [f, m] = self.wrench(&at.twist(self.body as usize));
        let w = &mut wrench[self.body as usize];
        w[0] += f;
        w[1] += m;
        Ok(())
    }

    fn tangent(&self, _at: &Motion, out: &mut Vec<Tangent>) {
        let mut t = Tangent::new(self.body, self.body);
        for k in 0..3 {
            t.velocity[k][k] = -self.translation;
            t.velocity[k + 3][k + 3] = -self.rotation;
        }
        out.push(t);
    }

    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let twist = at.twist(self.body as usize);
        Ok(wrench_power(&self.wrench(&twist), &twist))
    }
}
