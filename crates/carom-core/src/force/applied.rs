//! Force and torque on one body as functions of time.

use super::{wrench_power, Dependence, Load, LoadError, Motion};
use crate::clump::body::Carrier;
use carom_laws::Scalar;
use glam::DVec3;
use std::sync::Arc;

/// Components in fixed axes: force in N, torque in N m.
#[derive(Clone, Debug)]
pub struct Applied {
    pub body: u32,
    /// Where the force acts, from the centre of the body in its axes, m.
    pub arm: DVec3,
    pub force: [Scalar; 3],
    pub torque: [Scalar; 3],
}

impl Applied {
    fn given(&self, time: f64) -> [DVec3; 2] {
        [&self.force, &self.torque].map(|s| DVec3::from_array([0, 1, 2].map(|k| s[k].value(time))))
    }

    fn wrench(&self, at: &Motion) -> [DVec3; 2] {
        let [force, torque] = self.given(at.time);
        let arm = at.orientation[self.body as usize] * self.arm;
        [force, torque + arm.cross(force)]
    }
}

impl Load for Applied {
    /// (Its moment hangs on the orientation, weakly: the smooth sub-problem iterates it.)
    fn dependence(&self) -> Dependence {
        Dependence::Time
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        [Some(self.body), None]
    }

    fn carried(&self, by: &dyn Fn(u32) -> Option<Carrier>) -> Option<Arc<dyn Load>> {
        let clump = by(self.body)?;
        Some(Arc::new(Applied {
            body: clump.body,
            arm: clump.arm(self.arm),
            ..self.clone()
        }))
    }

    fn check(&self) -> Result<(), (&'static str, String)> {
        for (name, laws) in [("force", &self.force), ("torque", &self.torque)] {
            for law in laws {
                law.check_at_start().map_err(|text| (name, text))?;
            }
        }
        Ok(())
    }

    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        let [f, m] = self.wrench(at);
        if !(f.is_finite() && m.is_finite()) {
            let [f, m] = self.given(at.time);
            let text = format!("force {f} N, torque {m} N m at t = {} s", at.time);
            return Err(LoadError::on(self.body, text));
        }
        let w = &mut wrench[self.body as usize];
        w[0] += f;
        w[1] += m;
        Ok(())
    }

    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let wrench = self.wrench(at);
        Ok(wrench_power(&wrench, &at.twist(self.body as usize)))
    }
}
