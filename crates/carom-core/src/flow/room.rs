//! Which places near a region are taken: balls by cells as wide as the largest pair.

use super::Inflow;
use crate::model::Model;
use crate::state::State;
use carom_geom::Periodic;
use glam::DVec3;
use std::collections::HashMap;

/// Number (1) of the last cell either way, below what an integer and the mantissa hold: balls beyond share it, which parts no
/// two that touch. Larger, numbers of cells saturate, and a ball is let in where another is.
const FAR: f64 = (1u64 << 40) as f64;
/// Cells are wider than needed by this share (1): covers the rounding of their numbers up to [`FAR`]. With 0 balls that touch
/// may lie two cells apart, and one is let in that overlaps.
const MARGIN: f64 = 1.0 / 256.0;

/// Balls in and around the region of an inflow.
pub struct Room {
    periodic: Periodic,
    /// Width of a cell, m, along axes that are not periodic.
    width: f64,
    /// Cells along each periodic axis, which are a whole number and may be wider, 0 along the others.
    repeat: DVec3,
    cells: HashMap<[i64; 3], Vec<(DVec3, f64)>>,
}

impl Room {
    /// The present balls that a ball of this inflow could overlap.
    pub fn new(model: &Model, state: &State, flow: &Inflow) -> Room {
        let largest = model.radius.iter().copied().fold(0.0, f64::max);
        let width = 2.0 * largest * (1.0 + MARGIN);
        let length = model.periodic.length();
        let repeats = length.cmpgt(DVec3::ZERO);
        let cells = (length / width).floor();
        let cells = cells.clamp(DVec3::ONE, DVec3::splat(FAR));
        let mut room = Room {
            periodic: model.periodic,
            width,
            repeat: DVec3::select(repeats, cells, DVec3::ZERO),
            cells: HashMap::new(),
        };
        let margin = DVec3::splat(2.0 * largest);
        let [low, high] = flow.region.bounds();
        let balls = &state.position[..model.balls()];
        for (i, (&x, &r)) in balls.iter().zip(&model.radius).enumerate() {
            // Along periodic axes the region may be anywhere.
            let near = (x.cmpge(low - margin) & x.cmple(high + margin)) | repeats;
            if state.present[i] && near.all() {
                room.add(x, r);
            }
        }
        room
    }

    fn cell(&self, x: DVec3) -> [i64; 3] {
        let length = self.periodic.length();
        std::array::from_fn(|k| match self.repeat[k] {
            0.0 => (x[k] / self.width).floor().clamp(-FAR, FAR) as i64,
            // The remainder is exact however many lengths away the ball is.
            cells => (x[k].rem_euclid(length[k]) / length[k] * cells) as i64,
        })
    }

    fn wrap(&self, cell: [i64; 3]) -> [i64; 3] {
        std::array::from_fn(|k| match self.repeat[k] as i64 {
            0 => cell[k],
            cells => cell[k].rem_euclid(cells),
        })
    }

    pub fn add(&mut self, x: DVec3, r: f64) {
        let cell = self.wrap(self.cell(x));
        self.cells.entry(cell).or_default().push((x, r));
    }

    /// Whether a ball at `x` overlaps none.
    pub fn is_free(&self, x: DVec3, r: f64) -> bool {
        let [i, j, k] = self.cell(x);
        (-1..=1).all(|a| {
            (-1..=1).all(|b| {
                (-1..=1).all(|c| {
                    let cell = self.wrap([i + a, j + b, k + c]);
                    let mut others = self.cells.get(&cell).into_iter().flatten();
                    others.all(|&(other, s)| self.periodic.sphere_sphere(x, r, other, s).gap >= 0.0)
                })
            })
        })
    }
}
