//! Which places near a region are taken: balls by cells as wide as the largest pair.

use super::Inflow;
use crate::model::Model;
use crate::state::State;
use carom_geom::Periodic;
use glam::DVec3;
use std::collections::HashMap;

/// Balls in and around the region of an inflow.
pub struct Room {
    periodic: Periodic,
    /// Width of a cell along each axis, m: a whole number of cells in a periodic length.
    width: DVec3,
    /// Cells along each periodic axis, 0 along the others.
    repeat: [i64; 3],
    cells: HashMap<[i64; 3], Vec<(DVec3, f64)>>,
}

impl Room {
    /// The present balls that a ball of this inflow could overlap.
    pub fn new(model: &Model, state: &State, flow: &Inflow) -> Room {
        let largest = model.radius.iter().copied().fold(0.0, f64::max);
        let length = model.periodic.length();
        let cells = (length / (2.0 * largest)).floor().max(DVec3::ONE);
        let repeats = length.cmpgt(DVec3::ZERO);
        let mut room = Room {
            periodic: model.periodic,
            width: DVec3::select(repeats, length / cells, DVec3::splat(2.0 * largest)),
            repeat: std::array::from_fn(|k| if repeats.test(k) { cells[k] as i64 } else { 0 }),
            cells: HashMap::new(),
        };
        let margin = DVec3::splat(2.0 * largest);
        let [low, high] = flow.region.bounds();
        for (i, (&x, &r)) in state.position.iter().zip(&model.radius).enumerate() {
            // Along periodic axes the region may be anywhere.
            let near = (x.cmpge(low - margin) & x.cmple(high + margin)) | repeats;
            if state.present[i] && near.all() {
                room.add(x, r);
            }
        }
        room
    }

    fn cell(&self, x: DVec3) -> [i64; 3] {
        let cell = (self.periodic.wrap(x) / self.width).floor();
        std::array::from_fn(|k| cell[k] as i64)
    }

    fn wrap(&self, cell: [i64; 3]) -> [i64; 3] {
        std::array::from_fn(|k| match self.repeat[k] {
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
