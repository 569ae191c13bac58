//! Target `scene`: any model, stepped.

mod build;
mod judge;
mod parts;

pub(crate) use build::scene_of;
pub(crate) use judge::Judge;

use crate::draw::Draw;
use carom_core::{Model, Simulation};

/// A scene is refused, or stepped: then all numbers stay finite until the outcome says why they would not.
pub fn scene(data: &[u8]) {
    let mut draw = Draw::new(data);
    let (input, options) = scene_of(&mut draw);
    let steps = 1 + draw.below(6) as u64;
    let Ok((model, initial)) = Model::new(&input, options) else {
        return;
    };
    let mut simulation = Simulation::new(model, initial);
    let judge = Judge::new(&simulation);
    judge.advance(&mut simulation, steps);
}
