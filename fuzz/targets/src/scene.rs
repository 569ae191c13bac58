//! Target `scene`: any model, stepped.

mod build;
mod judge;
mod parts;

pub(crate) use build::scene_of;
pub(crate) use judge::Judge;

use crate::draw::Draw;
use carom_core::options::Method;
use carom_core::{Model, ModelInput, Options, Simulation};

/// None: the scene is refused.
pub(crate) fn simulation_of(input: &ModelInput, options: Options) -> Option<Simulation> {
    let (model, initial) = Model::new(input, options).ok()?;
    match model.options.method {
        Method::Events => carom_events::simulation(model, initial).ok(),
        _ => carom_penalty::simulation(model, initial).ok(),
    }
}

/// A scene is refused, or stepped: then all numbers stay finite until the outcome says why they would not.
pub fn scene(data: &[u8]) {
    let mut draw = Draw::new(data);
    let (input, options) = scene_of(&mut draw);
    let steps = 1 + draw.below(6) as u64;
    let Some(mut simulation) = simulation_of(&input, options) else {
        return;
    };
    let judge = Judge::new(&simulation);
    judge.advance(&mut simulation, steps);
}
