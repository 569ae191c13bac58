//! One ball between two events: how it sets off, on a level surface or through the air, and where it has come to.

use crate::check::is_level;
use crate::foresee::FLIGHT;
use crate::meet::JOINS;
use crate::motion::{Motion, Support};
use crate::step::Run;
use glam::DVec3;

/// Steps (1) of the place at which a surface is asked for: a share of the radius ahead, so that a ball at its edge has left it.
const AHEAD: f64 = 1e-9;

impl Run<'_> {
    /// The motion of ball `i` from its state at `now` on: on a surface with a gap (m) to it, or through the air. A slide that turns may go on.
    pub fn set_off(&mut self, i: usize, now: f64, on: Option<(Support, f64)>, goes_on: bool) {
        let [v, w] = [self.state.velocity[i], self.state.angular_velocity[i]];
        let g = match self.state.present[i] {
            true => self.model.gravity,
            false => DVec3::ZERO,
        };
        let x = self.state.position[i] - on.map_or(DVec3::ZERO, |(s, gap)| gap * s.normal);
        let carried = on.and_then(|(support, _)| {
            let (mut v, mut w, n) = (v, w, support.normal);
            let (m, r) = (self.model.mass[i], self.model.radius[i]);
            let rises = n.dot(v);
            if rises != 0.0 {
                // Of the push that its surface gave too much, the friction is too much as well.
                let slip = v - rises * n + r * n.cross(w);
                let bound = self.model.laws[support.law as usize].bounds.sliding;
                let lessens = rises > 0.0 && slip.length() > rises;
                let share = if lessens { bound * rises } else { 0.0 };
                let friction = m * share * slip.normalize_or_zero();
                let impulse = friction - m * rises * n;
                v += friction / m;
                w += r * friction.cross(n) / self.model.inertia[i];
                let work = friction.dot(slip);
                self.events.sums.add_rest(i, &support, impulse, work);
                self.give_wall(i, &support, impulse);
            }
            Motion::supported(self.model, i, support, now, x, [v, w])
        });
        // Without a form on its surface it would fall into it, and so presses it.
        let mut motion = carried.unwrap_or_else(|| Motion::flight(now, x, [v, w], g));
        motion.follow(&mut self.events.curves[i], self.model.radius[i], goes_on);
        self.events.motions[i] = motion;
    }

    /// What ball `i` got from its surface at one moment is taken from that.
    fn give_wall(&mut self, i: usize, support: &Support, impulse: DVec3) {
        if self.model.record_walls {
            let wall = support.wall as usize - self.model.bodies();
            let place = self.model.walls[wall].shape.place();
            let lever = self.state.position[i] - self.model.radius[i] * support.normal - place;
            let out = &mut self.scratch.wall_impulse[wall];
            out[0] -= impulse;
            out[1] -= lever.cross(impulse);
        }
    }

    /// The level surface that carries ball `i` in its present state, and the gap (m) to it. None where two do by different laws: they share its load.
    pub fn support(&mut self, i: usize) -> Option<(Support, f64)> {
        let (model, x, v) = (self.model, self.state.position[i], self.state.velocity[i]);
        let r = model.radius[i];
        if !self.state.present[i] {
            return None;
        }
        let none = self.nothing(r).speed;
        let ahead = x + AHEAD * r * v.normalize_or_zero();
        let walls = self.events.near[i].walls(model, x, r, JOINS * r);
        let mut carrying = walls.iter().filter_map(|&w| {
            let wall = &model.walls[w];
            if wall.shape.clearance(x, r) > JOINS * r {
                return None;
            }
            let met = wall.shape.meet(x, r);
            let n = met.normal;
            let g = -model.gravity.dot(n);
            // What comes down meets it first; what has hardly left it has not.
            let rises = v.dot(n);
            let stays = rises <= none.max(0.5 * FLIGHT * g) && rises >= -none;
            let flat = wall.shape.meet(ahead, r).curvature == 0.0 && met.curvature == 0.0;
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
        });
        let first = carrying.next()?;
        let bounds = |s: &Support| model.laws[s.law as usize].bounds;
        let all_alike = carrying.all(|(other, _)| bounds(&other) == bounds(&first.0));
        all_alike.then_some(first)
    }

    pub fn nothing(&self, r: f64) -> crate::meet::Nothing {
        crate::foresee::nothing(self.model, self.fastest, r)
    }

    /// Writes the state of ball `i` at a time, and what carried it until then.
    pub fn bring(&mut self, i: usize, t: f64) {
        let (motion, r) = (&self.events.motions[i], self.model.radius[i]);
        let curve = &self.events.curves[i];
        let passage = motion.passage(r, curve, self.state.orientation[i], t);
        if let Some(support) = motion.support {
            let dt = t - motion.start;
            let given =
                (self.events.sums).add_support(self.model, i, motion, &support, (dt, &passage));
            if self.model.record_walls {
                let wall = support.wall as usize - self.model.bodies();
                let from = self.model.walls[wall].shape.place() + r * support.normal;
                // Of the load, which does not vary, about the mean place; of friction the change of what it acts on.
                let [before, after] = [
                    (motion.x[0] - from).cross(motion.x[1]),
                    (passage.place - from).cross(passage.velocities[0]),
                ];
                let friction = self.model.mass[i] * (after - before);
                let out = &mut self.scratch.wall_impulse[wall];
                out[0] -= given.impulse;
                out[1] -= (passage.mean - from).cross(given.along) + friction + given.moment;
            }
        }
        let state = &mut *self.state;
        state.position[i] = passage.place;
        [state.velocity[i], state.angular_velocity[i]] = passage.velocities;
        state.orientation[i] = passage.orientation;
        self.has_speed(i);
    }
}
