//! The walls about a ball: those farther off are not asked, until it has come some way.

use carom_core::Model;
use glam::DVec3;

/// How far a list reaches beyond what is asked, over the radius (1). Larger: it holds more walls; smaller: it is made anew more often.
const AHEAD: f64 = 2.0;
/// Share (1) of its reach up to which a list is trusted: the rest is for rounding, far from the origin too.
const TRUSTED: f64 = 0.9;

/// Walls about a place, in the order of their numbers. A distance grows by no more than the way of the ball.
#[derive(Clone, Debug, Default)]
pub struct Near {
    at: DVec3,
    reach: f64,
    walls: Vec<usize>,
}

impl Near {
    /// All walls that may be nearer than `reach` (m) to a ball of radius `r` at `x`, and others.
    pub fn walls(&mut self, model: &Model, x: DVec3, r: f64, reach: f64) -> &[usize] {
        let is_known = (x - self.at).length() + reach <= TRUSTED * self.reach;
        if !is_known {
            (self.at, self.reach) = (x, (reach + AHEAD * r) / TRUSTED);
            let is_near = |&w: &usize| model.walls[w].shape.clearance(x, r) <= self.reach;
            self.walls.clear();
            self.walls.extend((0..model.walls.len()).filter(is_near));
        }
        &self.walls
    }
}
