//! Force and torque on one sphere as functions of time.

use super::{wrench_power, Dependence, Load, LoadError, Motion};
use carom_laws::Scalar;
use glam::DVec3;

/// Components in fixed axes: force in N, torque in N m.
#[derive(Clone, Debug)]
pub struct Applied {
    pub body: u32,
    pub force: [Scalar; 3],
    pub torque: [Scalar; 3],
}

impl Applied {
    fn wrench(&self, time: f64) -> [DVec3; 2] {
        let vector =
            |s: &[Scalar; 3]| DVec3::new(s[0].value(time), s[1].value(time), s[2].value(time));
        [vector(&self.force), vector(&self.torque)]
    }
}

impl Load for Applied {
    fn dependence(&self) -> Dependence {
        Dependence::Time
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        [Some(self.body), None]
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
        let [f, m] = self.wrench(at.time);
        if !(f.is_finite() && m.is_finite()) {
            let text = format!("force {f} N, torque {m} N m at t = {} s", at.time);
            return Err(LoadError::on(self.body, text));
        }
        let w = &mut wrench[self.body as usize];
        w[0] += f;
        w[1] += m;
        Ok(())
    }

    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let wrench = self.wrench(at.time);
        Ok(wrench_power(&wrench, &at.twist(self.body as usize)))
    }
}
