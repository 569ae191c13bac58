//! Target `state`: saved states with damage, read and gone on from.

use crate::draw::Draw;
use crate::scene::{scene_of, simulation_of, Judge};
use carom_core::state::{Touch, Warm};
use carom_core::{Recording, State};
use glam::DQuat;
use std::time::Duration;

/// One thing of a state made another.
fn damage(draw: &mut Draw, state: &mut State) {
    let body = draw.below(state.position.len().max(1));
    match draw.below(16) {
        0 => state.step = u64::from_le_bytes(std::array::from_fn(|_| draw.byte())) >> 1,
        1 => drop(state.position.pop()),
        2 if body < state.position.len() => state.position[body] = draw.vector(1.0),
        3 if body < state.velocity.len() => {
            state.velocity[body] = draw.one_of(&[1.0, 1e6, 1e13]) * draw.vector(1.0)
        }
        4 if body < state.angular_velocity.len() => state.angular_velocity[body] = draw.vector(1e3),
        5 if body < state.orientation.len() => {
            let v = draw.vector(1.0);
            state.orientation[body] = DQuat::from_xyzw(v.x, v.y, v.z, draw.number(-1.0, 1.0));
        }
        6 if body < state.pseudo.len() => state.pseudo[body] = [draw.vector(1e3), draw.vector(1e3)],
        7 if body < state.acceleration.len() => {
            state.acceleration[body] = [draw.vector(1e3), draw.vector(1e3)]
        }
        8 => drop(state.reaction.pop()),
        9 => state.warm.push(Warm {
            key: (draw.below(9) as u32, draw.byte().into()),
            impulse: draw.vector(1.0),
            moment: draw.vector(1.0),
        }),
        10 => {
            for w in &mut state.warm {
                w.impulse = draw.size(1.0, 9.0) * w.impulse;
                w.moment = draw.vector(1.0);
            }
        }
        11 => state.warm_step = draw.size(1e-3, 6.0),
        12 => state.touches.push(Touch {
            key: (draw.below(9) as u32, draw.byte().into()),
            approach: draw.number(-1.0, 1.0),
            age: draw.number(0.0, 1.0),
            spring: draw.vector(1e-3),
            impulse: draw.vector(1.0),
            moment: draw.vector(1.0),
        }),
        13 => {
            for t in &mut state.touches {
                (t.approach, t.age) = (draw.number(-1.0, 1.0), draw.number(0.0, 1.0));
                t.spring = draw.vector(1e-3);
            }
        }
        14 if body < state.present.len() => state.present[body] ^= true,
        _ => state
            .entered
            .iter_mut()
            .for_each(|k| *k = draw.byte().into()),
    }
}

/// A state is refused by its check, or a run goes on from it as from any other.
pub fn state(data: &[u8]) {
    let mut draw = Draw::new(data);
    // The damage comes first: it is what is to be varied, over scenes that the end of the bytes describes.
    let damages: Vec<u8> = (0..24).map(|_| draw.byte()).collect();
    let count = draw.below(4);
    let (input, options) = scene_of(&mut draw);
    let Some(mut simulation) = simulation_of(&input, options) else {
        return;
    };
    let recording = Recording {
        frame_every: 1,
        contacts: true,
    };
    simulation.advance(2, recording, Duration::MAX);
    simulation.take_block();
    let whole = simulation.state.clone();
    assert_eq!(
        whole.check(&simulation.model),
        Ok(()),
        "what a run leaves can be gone on from"
    );
    let mut state = whole;
    let mut of_damage = Draw::new(&damages);
    for _ in 0..count {
        damage(&mut of_damage, &mut state);
    }
    if state.check(&simulation.model).is_err() {
        return;
    }
    simulation.state = state;
    let mut judge = Judge::new(&simulation);
    judge.gone_on();
    judge.advance(&mut simulation, 2);
}
