//! Scenes of the tests of the core.
#![allow(dead_code)] // each test file uses its part

use carom_core::{InitialState, Model, ModelError, ModelInput, Options, Outcome};
use carom_core::{Recording, Simulation};
use std::time::Duration;

pub const G: f64 = 9.8;
/// Powers of two, so that products with them do not round.
pub const R: f64 = 0.03125;
pub const MASS: f64 = 0.25;

/// Balls of material 0 and planes of material 1, at rest, homogeneous, without gravity or laws.
pub fn balls(position: &[[f64; 3]], planes: &[([f64; 3], [f64; 3])]) -> ModelInput {
    let n = position.len();
    ModelInput {
        gravity: [0.0; 3],
        radius: vec![R; n],
        mass: vec![MASS; n],
        inertia: vec![0.4 * MASS * R * R; n],
        material: vec![0; n],
        position: position.to_vec(),
        orientation: vec![[1.0, 0.0, 0.0, 0.0]; n],
        velocity: vec![[0.0; 3]; n],
        angular_velocity: vec![[0.0; 3]; n],
        plane_point: planes.iter().map(|p| p.0).collect(),
        plane_normal: planes.iter().map(|p| p.1).collect(),
        plane_material: vec![1; planes.len()],
        ..ModelInput::default()
    }
}

/// One ball that touches the floor z = 0; law of mu, e_N, e_T, rho, delta.
pub fn on_floor(law: [f64; 5]) -> ModelInput {
    ModelInput {
        gravity: [0.0, 0.0, -G],
        laws: vec![(0, 1, law)],
        ..balls(&[[0.0, 0.0, R]], &[([0.0; 3], [0.0, 0.0, 1.0])])
    }
}

/// A rack of three hit by a fourth ball on a floor: eight contacts, sticking and slipping, one more than independent.
pub fn rack() -> ModelInput {
    let s = 3f64.sqrt() * R;
    let mut input = ModelInput {
        gravity: [0.0, 0.0, -G],
        laws: vec![
            (0, 0, [0.06, 0.93, 0.0, 0.0, 0.0]),
            (0, 1, [0.2, 0.5, 0.0, 1e-4, 1e-4]),
        ],
        ..balls(
            &[[-2.5 * R, 0.0, R], [0.0, 0.0, R], [s, R, R], [s, -R, R]],
            &[([0.0; 3], [0.0, 0.0, 1.0])],
        )
    };
    input.velocity[0] = [5.0, 0.1, 0.0];
    input.angular_velocity[0] = [3.0, 40.0, 20.0];
    input
}

pub fn compile(input: &ModelInput, options: Options) -> Result<(Model, InitialState), ModelError> {
    Model::new(input, options)
}

pub fn simulation(input: &ModelInput, options: Options) -> Simulation {
    let (model, initial) = compile(input, options).expect("the scene is valid");
    carom_penalty::simulation(model, initial).expect("the method can honour it")
}

/// Advances with every step a frame and contacts recorded.
pub fn advance(simulation: &mut Simulation, steps: u64) -> Option<Outcome> {
    let recording = Recording {
        frame_every: 1,
        contacts: true,
    };
    simulation.advance(steps, recording, Duration::from_secs(600))
}

/// Every number of the state, as bits.
pub fn bits(s: &Simulation) -> Vec<u64> {
    let state = &s.state;
    let mut out = vec![state.step, state.warm_step.to_bits()];
    let mut put = |v: &[f64]| out.extend(v.iter().map(|x| x.to_bits()));
    for i in 0..state.position.len() {
        put(&state.position[i].to_array());
        put(&state.orientation[i].to_array());
        put(&state.velocity[i].to_array());
        put(&state.angular_velocity[i].to_array());
        for pair in [&state.pseudo[i], &state.acceleration[i]] {
            put(&pair[0].to_array());
            put(&pair[1].to_array());
        }
    }
    for w in &state.warm {
        put(&[f64::from(w.key.0), f64::from(w.key.1)]);
        put(&w.impulse.to_array());
        put(&w.moment.to_array());
    }
    out
}

/// The message with which a ball on a floor, changed, is refused.
pub fn refusal(change: impl Fn(&mut ModelInput)) -> String {
    let mut input = on_floor([0.2, 0.5, 0.0, 1e-3, 1e-3]);
    change(&mut input);
    match compile(&input, Options::default()) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    }
}
