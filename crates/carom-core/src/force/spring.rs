//! Linear spring and damper between two attachment points: `F = k (l - l_0) + c l'` along the line that joins them.

use super::{coefficient, Dependence, Load, LoadError, Magnitude, Motion, Tangent};
use crate::clump::body::Carrier;
use crate::joint::{add_block, lever_blocks, outer, skew, Pose, Twist, GROUND};
use crate::wall;
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// Between sphere `a` and sphere `b` or the ground.
#[derive(Clone, Copy, Debug)]
pub struct Spring {
    pub a: u32,
    pub b: u32,
    /// Attachment points in the bodies' axes, from their centres; of the ground: the fixed point.
    pub arm_a: DVec3,
    pub arm_b: DVec3,
    /// N/m, N s/m, m.
    pub stiffness: f64,
    pub damping: f64,
    pub rest_length: f64,
}

/// A spring at a motion.
struct PlacedSpring {
    arm_a: DVec3,
    arm_b: DVec3,
    /// Velocity of point A relative to point B.
    rate: DVec3,
    length: f64,
    /// From B to A. Where the points coincide that in which they part, its limit; zero where they stay: then it pulls nothing.
    direction: DVec3,
}

impl Spring {
    fn place(&self, at: &Motion) -> PlacedSpring {
        let point = |body: u32, arm: DVec3| {
            if body == GROUND {
                return (DVec3::ZERO, arm, DVec3::ZERO);
            }
            let (pose, twist): (Pose, Twist) = (at.pose(body as usize), at.twist(body as usize));
            let s = pose.orientation * arm;
            let velocity = twist.velocity + twist.angular_velocity.cross(s);
            (s, pose.position + s, velocity)
        };
        let (arm_a, pa, va) = point(self.a, self.arm_a);
        let (arm_b, pb, vb) = point(self.b, self.arm_b);
        let (between, rate) = (pa - pb, va - vb);
        PlacedSpring {
            arm_a,
            arm_b,
            rate,
            length: between.length(),
            direction: between
                .try_normalize()
                .unwrap_or_else(|| rate.normalize_or_zero()),
        }
    }

    fn ends(&self) -> [Option<u32>; 2] {
        [Some(self.a), (self.b != GROUND).then_some(self.b)]
    }

    /// Pull of spring and of damper, N.
    fn pulls(&self, p: &PlacedSpring) -> (f64, f64) {
        (
            self.stiffness * (p.length - self.rest_length),
            self.damping * p.rate.dot(p.direction),
        )
    }
}

impl Load for Spring {
    fn dependence(&self) -> Dependence {
        let [a, b] = self.ends();
        Dependence::Motion(a.unwrap_or(self.a), b)
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        self.ends()
    }

    fn carried(&self, by: &dyn Fn(u32) -> Option<Carrier>) -> Option<Arc<dyn Load>> {
        let mut spring = *self;
        if let Some(clump) = by(self.a) {
            (spring.a, spring.arm_a) = (clump.body, clump.arm(self.arm_a));
        }
        if let Some(clump) = by(self.b) {
            (spring.b, spring.arm_b) = (clump.body, clump.arm(self.arm_b));
        }
        let moved = (spring.a, spring.b) != (self.a, self.b);
        moved.then(|| Arc::new(spring) as Arc<dyn Load>)
    }

    fn check(&self) -> Result<(), (&'static str, String)> {
        coefficient("stiffness", self.stiffness)?;
        coefficient("damping", self.damping)?;
        coefficient("rest_length", self.rest_length)?;
        wall::length("rest_length", self.rest_length)?;
        if self.a == self.b {
            return Err(("between", "joins a sphere with itself".to_owned()));
        }
        // Where a ball may be, its ends may be: the spring's length is made of squares.
        for arm in [self.arm_a, self.arm_b] {
            wall::place("points", arm)?;
        }
        Ok(())
    }

    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        let p = self.place(at);
        let (elastic, viscous) = self.pulls(&p);
        let f = -(elastic + viscous) * p.direction;
        let a = &mut wrench[self.a as usize];
        a[0] += f;
        a[1] += p.arm_a.cross(f);
        if self.b != GROUND {
            let b = &mut wrench[self.b as usize];
            b[0] -= f;
            b[1] -= p.arm_b.cross(f);
        }
        Ok(())
    }

    fn tangent(&self, at: &Motion, out: &mut Vec<Tangent>) {
        let p = self.place(at);
        if p.length == 0.0 {
            return;
        }
        let (elastic, viscous) = self.pulls(&p);
        let pull = elastic + viscous;
        let d = p.direction;
        let dd = outer(d, d);
        let across = DMat3::IDENTITY - dd;
        let along = d.dot(p.rate);
        // l' = d . rate changes with d too: d(l') = across rate / l . dp.
        let turning = (p.rate - along * d) / p.length;
        let k = self.stiffness * dd + (pull / p.length) * across + self.damping * outer(d, turning);
        let c = self.damping * dd;
        let sides = [(self.a, p.arm_a, 1.0), (self.b, p.arm_b, -1.0)];
        let twist = |body: u32| at.twist(body as usize).angular_velocity;
        for &(of, si, sign_i) in sides.iter().filter(|s| s.0 != GROUND) {
            for &(over, sj, sign_j) in sides.iter().filter(|s| s.0 != GROUND) {
                let mut t = Tangent::new(of, over);
                let sign = -sign_i * sign_j;
                lever_blocks(&mut t.position, k, si, sj, sign);
                lever_blocks(&mut t.velocity, c, si, sj, sign);
                // The lever of `over` turns: d(w x s) = w x (dtheta x s) = -w~ s~ dtheta adds to the rate.
                let swing = c * skew(twist(over)) * skew(sj);
                add_block(&mut t.position, 0, 1, swing, -sign);
                add_block(&mut t.position, 1, 1, skew(si) * swing, -sign);
                if of == over && sign_i == sign_j {
                    // The lever of `of` turns: d(s x f) = (dtheta x s) x f = f~ s~ dtheta.
                    let f = -sign_i * pull * d;
                    add_block(&mut t.position, 1, 1, skew(f) * skew(si), 1.0);
                }
                out.push(t);
            }
        }
    }

    fn potential(&self, at: &Motion) -> f64 {
        let stretch = self.place(at).length - self.rest_length;
        0.5 * self.stiffness * stretch * stretch
    }

    fn magnitude(&self, at: &Motion) -> Magnitude {
        let p = self.place(at);
        let (elastic, viscous) = self.pulls(&p);
        // The length is a difference of coordinates, its rate one of velocities.
        let far = at.position[self.a as usize].abs().max_element() + p.length;
        let fast = at.velocity[self.a as usize].length() + p.rate.length();
        let lever = 1.0 + (p.arm_a.length() + p.arm_b.length()) / p.length.max(f64::MIN_POSITIVE);
        Magnitude {
            parts: elastic.abs() + viscous.abs(),
            rounding: f64::EPSILON
                * lever.min(1e3)
                * (self.stiffness * (far + self.rest_length) + self.damping * fast),
        }
    }

    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let p = self.place(at);
        let rate = p.rate.dot(p.direction);
        Ok(-self.damping * rate * rate)
    }
}
