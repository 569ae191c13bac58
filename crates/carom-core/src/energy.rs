//! Kinetic energy, and that of the weight and of loads, of a state.

use crate::force::total::{motion_of, weight_potential};
use crate::model::Model;
use crate::state::State;

/// Kinetic and potential energy of a body, a clump with its balls, J.
pub(crate) fn of_body(model: &Model, state: &State, i: usize) -> [f64; 2] {
    let (v, w) = (state.velocity[i], state.angular_velocity[i]);
    let clump = model.as_clump(i as u32).map(|k| &model.clumps[k]);
    let beyond = clump.map_or(0.0, |c| c.energy_beyond(state.orientation[i], w));
    [
        model.kinetic(i, v, w) + beyond,
        weight_potential(model, i, state.position[i]),
    ]
}

/// Adds both energies.
pub(crate) fn add(sum: &mut [f64; 2], part: [f64; 2]) {
    sum[0] += part[0];
    sum[1] += part[1];
}

/// Those of all bodies that are there at a time (s), and of loads.
pub(crate) fn total(model: &Model, state: &State, time: f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for i in (0..model.bodies()).filter(|&i| state.present[i]) {
        add(&mut sum, of_body(model, state, i));
    }
    let at = motion_of(state, time);
    sum[1] += model.loads.iter().map(|l| l.potential(&at)).sum::<f64>();
    sum
}
