//! The forces of a pair in the halves of a substep: elastic, damping, friction.

use crate::bodies::Bodies;
use crate::elastic::Elastic;
use crate::friction::{slowed, TangentialSpring};
use crate::law::damping;
use crate::pair::Pair;
use carom_core::model::ContactLaw;
use carom_core::options::{Options, PenaltyFriction};
use carom_core::outcome::Failure;
use carom_core::Model;
use carom_solve::Bounds;
use glam::DVec3;

impl Pair {
    /// Damping and friction over `tau`, the half of a substep; `then_kick`: the half before the kicks, or its mirror image.
    #[inline]
    pub fn dissipate(
        &mut self,
        bodies: &mut Bodies,
        model: &Model,
        elastic: &Elastic,
        tau: f64,
        then_kick: bool,
    ) -> Result<(), Failure> {
        let s = self.closing_speed(bodies);
        self.touch.approach = self.touch.approach.max(s);
        if let Some(law) = self.damping_of_approach(model) {
            law.check_restitution((self.a, self.b), self.damped_at)?;
        }
        let to_middle = if then_kick { 0.5 * tau } else { -0.5 * tau };
        let middle = s + to_middle * self.closing_acceleration(bodies);
        let normal = self.force * tau + self.damp(bodies, s, middle, tau);
        if then_kick {
            self.rub(bodies, model, elastic, normal, tau)?;
            self.resist_turning(bodies, &model.options, normal);
        } else {
            self.resist_turning(bodies, &model.options, normal);
            self.rub(bodies, model, elastic, normal, tau)?;
        }
        Ok(())
    }

    /// Takes the damping of the present approach speed; the law by which, where it is another than before.
    #[inline]
    pub fn damping_of_approach<'m>(&mut self, model: &'m Model) -> Option<&'m ContactLaw> {
        if !self.constants.varies || self.damped_at == self.touch.approach {
            return None;
        }
        let law = &model.laws[self.law? as usize];
        self.damped_at = self.touch.approach;
        self.constants.damping = damping(&model.options, law, self.damped_at);
        Some(law)
    }

    /// Half a kick: the elastic impulse over `tau`.
    #[inline]
    pub fn push(&mut self, bodies: &mut Bodies, tau: f64) {
        let s = self.closing_speed(bodies);
        self.apply_normal(bodies, self.force * tau, s);
    }

    /// By elastic forces and loads, m/s^2.
    #[inline]
    fn closing_acceleration(&self, bodies: &Bodies) -> f64 {
        let x = &bodies.acceleration;
        self.normal.dot(x[self.b as usize] - x[self.a as usize])
    }

    /// Damping over `tau` at the closing speed `s`, the flow of `s' = -D chi F s/v_in`. Returns its impulse, N s.
    ///
    /// The flow is that of the speed in the `middle` of the kick beside it: with that of either end one half of a substep
    /// would push too much and the other pull, which cancels in the normal impulse and not in the friction that it holds. It
    /// takes no more than the elastic impulse gives, so that the force never pulls.
    #[inline]
    fn damp(&mut self, bodies: &mut Bodies, s: f64, middle: f64, tau: f64) -> f64 {
        if self.constants.damping == 0.0 || self.touch.approach == 0.0 {
            return 0.0;
        }
        let rate = self.constants.damping * self.force * self.inv_mass / self.touch.approach;
        let full = -middle * (-rate * tau).exp_m1() / self.inv_mass;
        let impulse = full.max(-self.force * tau);
        self.apply_normal(bodies, impulse, s);
        impulse
    }

    #[inline]
    fn apply_normal(&mut self, bodies: &mut Bodies, impulse: f64, closing: f64) {
        let vector = impulse * self.normal;
        let (a, b) = (self.a as usize, self.b as usize);
        bodies.motion[a][0] += bodies.inv_mass[a] * vector;
        bodies.motion[b][0] -= bodies.inv_mass[b] * vector;
        self.drive(bodies, vector, DVec3::ZERO, DVec3::ZERO);
        self.now.impulse += vector;
        self.now.weighed_normal += impulse.abs() * self.normal;
        self.now.work[0] += impulse * (0.5 * impulse * self.inv_mass - closing);
    }

    /// Sliding friction under the normal impulse `normal`, with mu at the slip of this substep.
    fn rub(
        &mut self,
        bodies: &mut Bodies,
        model: &Model,
        elastic: &Elastic,
        normal: f64,
        tau: f64,
    ) -> Result<(), Failure> {
        let (true, Some(law)) = (self.constants.slides, self.law) else {
            return Ok(());
        };
        let slip = self.slip(bodies);
        let of = (self.a, self.b);
        self.friction = model.laws[law as usize].checked_friction(of, slip.length())?;
        let bound = self.friction * normal;
        if bound <= 0.0 {
            self.touch.spring = DVec3::ZERO;
            return Ok(());
        }
        let o = &model.options;
        let impulse = match o.penalty_friction {
            PenaltyFriction::Regularised => {
                let speed = slip.length();
                if speed == 0.0 {
                    return Ok(());
                }
                let drop = bound * self.inv_mass_sliding;
                let slowed = slowed(speed, drop, o.penalty_slip_speed);
                self.slips = speed - slowed > 0.9 * drop;
                slip * ((slowed - speed) / (speed * self.inv_mass_sliding))
            }
            PenaltyFriction::Spring => {
                let spring = TangentialSpring {
                    stiffness: elastic.tangential_slope(self.force, -self.gap),
                    damping_ratio: self.constants.damping_ratio,
                    inv_mass: self.inv_mass_sliding,
                };
                let (impulse, slips) = spring.impulse(&mut self.touch.spring, slip, bound, tau);
                self.slips = slips;
                impulse
            }
        };
        let (a, b) = (self.a as usize, self.b as usize);
        let turn = self.normal.cross(impulse);
        bodies.motion[a][0] += bodies.inv_mass[a] * impulse;
        bodies.motion[b][0] -= bodies.inv_mass[b] * impulse;
        bodies.motion[a][1] -= (bodies.inv_inertia[a] * self.radii[0]) * turn;
        bodies.motion[b][1] -= (bodies.inv_inertia[b] * self.radii[1]) * turn;
        self.drive(bodies, DVec3::ZERO, impulse, DVec3::ZERO);
        self.now.impulse += impulse;
        self.now.work[1] += impulse.dot(slip + 0.5 * self.inv_mass_sliding * impulse);
        Ok(())
    }

    /// Rolling and spinning friction under the normal impulse `normal`, regularised at the angular speed `v_s/r_c`.
    fn resist_turning(&mut self, bodies: &mut Bodies, o: &Options, normal: f64) {
        let Bounds {
            rolling, spinning, ..
        } = self.constants.bounds;
        if (rolling <= 0.0 && spinning <= 0.0) || normal <= 0.0 {
            return;
        }
        let (rolling, spinning) = (rolling * normal, spinning * normal);
        let scale = o.penalty_slip_speed / self.length;
        let (a, b) = (self.a as usize, self.b as usize);
        let [wall, _] = self.wall_motion(bodies);
        let w = bodies.motion[a][1] - wall.spin;
        let spin = self.normal.dot(w) * self.normal;
        for (kind, rate, bound) in [(2, w - spin, rolling), (3, spin, spinning)] {
            let speed = rate.length();
            if bound == 0.0 || speed == 0.0 {
                continue;
            }
            let slowed = slowed(speed, bound * self.inv_inertia, scale);
            let moment = rate * ((slowed - speed) / (speed * self.inv_inertia));
            bodies.motion[a][1] += bodies.inv_inertia[a] * moment;
            bodies.motion[b][1] -= bodies.inv_inertia[b] * moment;
            self.drive(bodies, DVec3::ZERO, DVec3::ZERO, moment);
            self.now.moment += moment;
            self.now.work[kind] += moment.dot(rate + 0.5 * self.inv_inertia * moment);
        }
    }
}
