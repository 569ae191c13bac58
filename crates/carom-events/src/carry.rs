//! One ball between two events: how it sets off, on a level surface or through the air, and where it has come to.

use crate::check::is_level;
use crate::foresee::FLIGHT;
use crate::motion::{Motion, Support};
use crate::step::{Run, JOINS};
use carom_core::rotation;
use glam::DVec3;

/// Steps (1) of the place at which a surface is asked for: a share of the radius ahead, so that a ball at its edge has left it.
const AHEAD: f64 = 1e-9;

impl Run<'_> {
    /// The motion of ball `i` from its state at `now` on: on a surface with a gap (m) to it, or through the air.
    pub fn set_off(&mut self, i: usize, now: f64, on: Option<(Support, f64)>) {
        let [v, w] = [self.state.velocity[i], self.state.angular_velocity[i]];
        let g = match self.state.present[i] {
            true => self.model.gravity,
            false => DVec3::ZERO,
        };
        let x = self.state.position[i] - on.map_or(DVec3::ZERO, |(s, gap)| gap * s.normal);
        let carried = on.and_then(|(support, _)| {
            let rises = support.normal.dot(v);
            if rises != 0.0 {
                let impulse = -self.model.mass[i] * rises;
                self.events.sums.add_rest(i, &support, impulse);
            }
            Motion::supported(self.model, i, support, now, x, [v, w])
        });
        // Without a form on its surface it would fall into it, and so presses it.
        let motion = carried.unwrap_or_else(|| Motion::flight(now, x, [v, w], g));
        let ends = motion.start + motion.holds;
        self.events.motions[i] = Motion { ends, ..motion };
    }

    /// The level surface that carries ball `i` in its present state, and the gap (m) to it.
    pub fn support(&self, i: usize) -> Option<(Support, f64)> {
        let (model, x, v) = (self.model, self.state.position[i], self.state.velocity[i]);
        let r = model.radius[i];
        if !self.state.present[i] {
            return None;
        }
        let ahead = x + AHEAD * r * v.normalize_or_zero();
        let walls = model.walls.iter().enumerate();
        walls.into_iter().find_map(|(w, wall)| {
            if wall.shape.clearance(x, r) > JOINS * r {
                return None;
            }
            let met = wall.shape.meet(x, r)?;
            let n = met.normal;
            let g = -model.gravity.dot(n);
            // What comes down meets it first; what has hardly left it has not.
            let rises = v.dot(n);
            let stays = 2.0 * rises <= FLIGHT * g && rises >= -self.nothing(r).speed;
            let flat = wall.shape.meet(ahead, r)?.curvature == 0.0 && met.curvature == 0.0;
            if !(g > 0.0 && is_level(n, model.gravity) && stays && flat) {
                return None;
            }
            let (wall, law) = (
                (model.bodies() + w) as u32,
                model.law_of(i, model.bodies() + w)?,
            );
            let support = Support {
                wall,
                normal: n,
                g,
                law,
            };
            Some((support, met.gap))
        })
    }

    fn nothing(&self, r: f64) -> crate::meet::Nothing {
        crate::foresee::nothing(self.model, self.fastest, r)
    }

    /// Writes the state of ball `i` at a time, and what carried it until then.
    pub fn bring(&mut self, i: usize, t: f64) {
        let motion = &self.events.motions[i];
        let given = self.events.sums.add_support(self.model, i, motion, t);
        if let (true, Some(support)) = (self.model.record_walls, motion.support) {
            // Forces that do not vary, along a parabola: Simpson's rule is exact.
            let wall = support.wall as usize - self.model.bodies();
            let lever = |t| {
                motion.place(t)
                    - self.model.walls[wall].shape.place()
                    - self.model.radius[i] * support.normal
            };
            let middle = 0.5 * (motion.start + t);
            let mean = (lever(motion.start) + 4.0 * lever(middle) + lever(t)) / 6.0;
            let out = &mut self.scratch.wall_impulse[wall];
            out[0] -= given.impulse;
            out[1] -= mean.cross(given.impulse) + given.moment;
        }
        let state = &mut *self.state;
        state.position[i] = motion.place(t);
        [state.velocity[i], state.angular_velocity[i]] = motion.velocities(t);
        if motion.w[0] != DVec3::ZERO || motion.w[1] != DVec3::ZERO {
            for turn in motion.turns(motion.start, t) {
                state.orientation[i] = rotation::advance(turn, state.orientation[i]);
            }
        }
    }
}
