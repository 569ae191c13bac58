//! `cargo bench -p carom-core --bench pile -- [N] [seed] [threads] [steps] [tolerance] [option=value ...]`: the scene `scenarios/pile.toml` without Python.
//!
//! N grains fall from a jittered lattice into an open box that they fill about as high as it is wide. Per 100 steps: time by phase,
//! sweeps, impact problems, residual, overlap, energy; at the end the hash of the state and the five steps in which the energy rose most. `rolling=0.1` and `spinning=0.1` are friction too,
//! over the radius.

use carom_core::{Model, ModelInput, Options, Recording, Simulation, Value};
use std::f64::consts::PI;
use std::time::{Duration, Instant};

const RADIUS: f64 = 5e-3;

fn scene(count: usize, seed: u64, [rho, delta]: [f64; 2], options: Options) -> Simulation {
    let side = (count as f64 * 4.0 / 3.0 * PI * RADIUS.powi(3) / 0.6).cbrt();
    let row = ((side / (2.38 * RADIUS)) as usize).max(1);
    let spacing = side / row as f64;
    let jitter = 0.45 * (spacing - 2.0 * RADIUS);
    let mut word = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut random = || {
        // SplitMix64, to (-1, 1).
        word = word.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = word;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        2.0 * (((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64) - 1.0
    };
    let mass = 2500.0 * 4.0 / 3.0 * PI * RADIUS.powi(3);
    let mut input = ModelInput {
        gravity: [0.0, 0.0, -9.8],
        radius: vec![RADIUS; count],
        mass: vec![mass; count],
        inertia: vec![0.4 * mass * RADIUS * RADIUS; count],
        material: vec![0; count],
        position: Vec::new(),
        orientation: vec![[1.0, 0.0, 0.0, 0.0]; count],
        velocity: vec![[0.0; 3]; count],
        angular_velocity: vec![[0.0; 3]; count],
        plane_point: vec![
            [0.0; 3],
            [0.0; 3],
            [side, 0.0, 0.0],
            [0.0; 3],
            [0.0, side, 0.0],
        ],
        plane_normal: vec![
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
        ],
        plane_material: vec![0; 5],
        laws: vec![(0, 0, [0.5, 0.3, 0.0, rho * RADIUS, delta * RADIUS])],
        ..ModelInput::default()
    };
    for i in 0..count {
        let cell = [i % row, i / row % row, i / (row * row)];
        input
            .position
            .push(cell.map(|k| (k as f64 + 0.5) * spacing + jitter * random()));
    }
    let (model, initial) = Model::new(&input, options).expect("a valid scene");
    Simulation::new(model, initial)
}

fn hash(s: &Simulation) -> u64 {
    let all = s.state.position.iter().chain(&s.state.velocity);
    all.flat_map(|x| x.to_array().map(f64::to_bits))
        .fold(0xcbf2_9ce4_8422_2325, |h, bits| {
            (h ^ bits).wrapping_mul(0x0100_0000_01b3)
        })
}

fn main() {
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let number = |k: usize, default: f64| {
        given
            .get(k)
            .map_or(default, |a| a.parse().expect("a number"))
    };
    let (count, seed) = (number(0, 1000.0) as usize, number(1, 1.0) as u64);
    let mut options = Options {
        step: 1e-3,
        threads: number(2, 1.0) as u32,
        pile_tolerance: number(4, 1e-4),
        ..Options::default()
    };
    // Further options as name=value.
    let mut moments = [0.0; 2];
    for pair in given.iter().skip(5) {
        let (name, value) = pair.split_once('=').expect("name=value");
        if let Some(k) = ["rolling", "spinning"].iter().position(|n| *n == name) {
            moments[k] = value.parse().expect("a number");
            continue;
        }
        let value = match (value.parse::<u64>(), value.parse::<f64>()) {
            (Ok(i), _) => Value::Int(i),
            (_, Ok(x)) => Value::Float(x),
            _ => Value::Text(value.to_owned()),
        };
        options.set(name, &value).expect("an option of the core");
    }
    let steps = number(3, 1000.0) as u64;
    let mut s = scene(count, seed, moments, options);
    let recording = Recording {
        frame_every: 0,
        contacts: false,
    };
    let begin = Instant::now();
    let mut step = 0;
    // Rise, step, kinetic energy after it, impact problems.
    let mut rises: Vec<(f64, u64, f64, u32)> = Vec::new();
    let mut energy = f64::INFINITY;
    while step < steps {
        let batch = (steps - step).min(100.min(steps / 4).max(1));
        let start = Instant::now();
        let outcome = s.advance(batch, recording, Duration::MAX);
        let wall = start.elapsed().as_secs_f64();
        let block = s.take_block();
        let mean = |f: &dyn Fn(&carom_core::StepReport) -> f64| {
            block.steps.iter().map(f).sum::<f64>() / block.steps.len() as f64
        };
        let most = |f: &dyn Fn(&carom_core::StepReport) -> f64| {
            block.steps.iter().map(f).fold(0.0, f64::max)
        };
        for (k, r) in block.steps.iter().enumerate() {
            let now = r.energy_kinetic + r.energy_potential;
            let rise = now - energy - r.energy_work;
            rises.push((
                rise,
                step + k as u64 + 1,
                r.energy_kinetic,
                r.impact_problems,
            ));
            energy = now;
        }
        rises.sort_by(|a, b| b.0.total_cmp(&a.0));
        rises.truncate(5);
        step += batch;
        println!(
            "{step:>6} {:>8.3} ms/step contacts {:>7.0} sweeps p {:>5.0} ({:>5.0}) v {:>5.0} ({:>5.0}) problems {:>4.1} truncated {:>3} fallbacks {:>4} unconverged {} overlap {:.1e} residual {:.0e} {:.0e} T {:.3e} impacts {}",
            1e3 * wall / batch as f64,
            mean(&|r| f64::from(r.contacts)),
            mean(&|r| f64::from(r.sweeps_position)),
            most(&|r| f64::from(r.sweeps_position)),
            mean(&|r| f64::from(r.sweeps_velocity)),
            most(&|r| f64::from(r.sweeps_velocity)),
            mean(&|r| f64::from(r.impact_problems)),
            block.steps.iter().map(|r| r.truncated).sum::<u32>(),
            block.steps.iter().map(|r| r.fallbacks).sum::<u32>(),
            block.steps.iter().map(|r| r.unconverged).sum::<u32>(),
            most(&|r| r.penetration_relative),
            most(&|r| r.residual_position),
            most(&|r| r.residual_velocity),
            block.steps.last().map_or(0.0, |r| r.energy_kinetic),
            block.impacts.len(),
        );
        if let Some(outcome) = outcome {
            println!("{outcome:?}");
            break;
        }
    }
    println!(
        "total {:.3} s, largest energy rise {:.1e} of {:.1e} J, {} rises; {:016x}",
        begin.elapsed().as_secs_f64(),
        s.monitors.energy_max_rise,
        s.monitors.energy_scale,
        s.monitors.energy_rises,
        hash(&s)
    );
    for (rise, step, kinetic, problems) in rises {
        println!("rise of {rise:.1e} J in step {step}: T {kinetic:.3e} J, {problems} problems");
    }
    for (phase, time) in s.timers.estimate() {
        print!("{phase} {time:.3} s  ");
    }
    println!();
}
