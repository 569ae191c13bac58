//! Scenes shared by benches: built in code, so that a bench needs neither Python nor files.
#![allow(dead_code)] // each bench uses its part

use carom_core::{Model, ModelInput, Options, Simulation};

const R: f64 = 0.028575;

fn base(positions: Vec<[f64; 3]>, velocities: Vec<[f64; 3]>, spins: Vec<[f64; 3]>) -> ModelInput {
    let n = positions.len();
    ModelInput {
        gravity: [0.0, 0.0, -9.8],
        radius: vec![R; n],
        mass: vec![0.17; n],
        inertia: vec![5.5e-5; n],
        material: vec![0; n],
        position: positions,
        orientation: vec![[1.0, 0.0, 0.0, 0.0]; n],
        velocity: velocities,
        angular_velocity: spins,
        plane_point: vec![
            [0.0; 3],
            [2.54, 0.0, 0.0],
            [0.0; 3],
            [0.0; 3],
            [0.0, 1.27, 0.0],
        ],
        plane_normal: vec![
            [0.0, 0.0, 1.0],
            [-1.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
        ],
        plane_material: vec![1, 2, 2, 2, 2],
        laws: vec![
            (0, 0, [0.06, 0.93, 0.0, 0.0, 0.0]),
            (0, 1, [0.2, 0.0, 0.0, 0.0, 0.0]),
            (0, 2, [0.0, 0.85, 0.0, 0.0, 0.0]),
        ],
        ..ModelInput::default()
    }
}

/// Hash of all bits of positions and velocities.
pub fn hash(s: &Simulation) -> u64 {
    let mut h = 0xcbf2_9ce4_8422_2325u64;
    for x in s
        .state
        .position
        .iter()
        .chain(&s.state.velocity)
        .chain(&s.state.angular_velocity)
    {
        for bits in x.to_array().map(f64::to_bits) {
            h = (h ^ bits).wrapping_mul(0x0100_0000_01b3);
        }
    }
    h
}

fn build(input: &ModelInput, options: Options) -> Simulation {
    let (model, initial) = Model::new(input, options).expect("a bench scene is valid");
    Simulation::new(model, initial)
}

/// Section 5.6 of the paper.
pub fn billiard_break(options: Options) -> Simulation {
    build(&billiard_break_input(), options)
}

pub fn billiard_break_input() -> ModelInput {
    let s = 3f64.sqrt() * R;
    let positions = vec![
        [0.635, 0.635, R],
        [1.905, 0.635, R],
        [1.905 + s, 0.635 + R, R],
        [1.905 + s, 0.635 - R, R],
    ];
    let mut velocities = vec![[0.0; 3]; 4];
    velocities[0] = [10.729, 0.0, 0.0];
    base(positions, velocities, vec![[0.0; 3]; 4])
}

/// A diamond of nine balls with gaps of about 0.1 mm, each another one, and the cue ball that breaks it; on the table of section 5.6.
pub fn nine_ball_input() -> ModelInput {
    let mut positions = vec![[0.635, 0.64, R]];
    let pitch = 2.0 * R + 1e-4;
    for row in 0..5 {
        let across = row.min(4 - row);
        for k in 0..=across {
            let jitter = |n: usize| 4e-6 * ((7 * row + 3 * k + n) % 11) as f64;
            let y = (k as f64 - 0.5 * across as f64) * pitch;
            let x = 1.905 + 0.75f64.sqrt() * pitch * row as f64;
            positions.push([x + jitter(0), 0.635 + y + jitter(5), R]);
        }
    }
    let mut velocities = vec![[0.0; 3]; 10];
    velocities[0] = [8.94, 0.0, 0.0];
    let mut spins = vec![[0.0; 3]; 10];
    spins[0] = [0.0, 30.0, 0.0];
    base(positions, velocities, spins)
}

/// Four balls in pure rolling, slow enough not to meet a cushion within the bench.
pub fn rolling(options: Options) -> Simulation {
    let positions: Vec<[f64; 3]> = (0..4)
        .map(|i| [0.5 + 0.4 * f64::from(i), 0.635, R])
        .collect();
    let speeds = [0.002, -0.001, 0.003, -0.002];
    let velocities = speeds.iter().map(|&v| [0.0, v, 0.0]).collect();
    let spins = speeds.iter().map(|&v| [-v / R, 0.0, 0.0]).collect();
    build(&base(positions, velocities, spins), options)
}

/// `groups` of 4 to 10 balls, each a loose column that falls on the floor and comes apart, too far from one another to meet:
/// islands without end.
pub fn heaps(groups: usize, options: Options) -> Simulation {
    let (row, pitch, wide) = ((groups as f64).sqrt().ceil() as usize, 14.0 * R, 2.05 * R);
    let mut positions = Vec::new();
    for group in 0..groups {
        let corner = [group % row, group / row].map(|k| k as f64 * pitch);
        for k in 0..4 + group % 7 {
            // Two by two in each layer, each a little off the one below, groups unlike one another.
            let off = |n: usize| 0.02 * R * ((7 * group + 3 * k + n) % 11) as f64;
            positions.push([
                corner[0] + wide * (k % 2) as f64 + off(0),
                corner[1] + wide * (k / 2 % 2) as f64 + off(5),
                1.05 * R + wide * (k / 4) as f64,
            ]);
        }
    }
    let zeros = vec![[0.0; 3]; positions.len()];
    let mut input = base(positions, zeros.clone(), zeros);
    input.plane_point.truncate(1);
    input.plane_normal.truncate(1);
    input.plane_material = vec![0];
    input.laws = vec![(0, 0, [0.3, 0.4, 0.0, 0.0, 0.0])];
    build(&input, options)
}
