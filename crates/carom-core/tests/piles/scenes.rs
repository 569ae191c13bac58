//! Lattices, clusters, boxes and random numbers.

use crate::common::{balls, G, MASS, R};
use carom_core::{ModelInput, Simulation};
use glam::DVec3;

/// Uniform numbers in [-1, 1) (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn vector(&mut self) -> [f64; 3] {
        [self.next(), self.next(), self.next()]
    }
}

/// Touching spheres: square layers of `n` x `n` and of one less each way in turn, every one in the hollows of the last.
pub fn lattice(n: usize, layers: usize) -> Vec<[f64; 3]> {
    let mut out = Vec::new();
    for layer in 0..layers {
        let side = n - layer % 2;
        let low = -R * (side - 1) as f64;
        for i in 0..side {
            for j in 0..side {
                let (x, y) = (low + 2.0 * R * i as f64, low + 2.0 * R * j as f64);
                out.push([x, y, R + 2f64.sqrt() * R * layer as f64]);
            }
        }
    }
    out
}

/// A free cluster hit by a fast, spinning ball with velocity `v`; no gravity, no wall. Law of mu and e_N.
pub fn cluster(friction: f64, restitution: f64, x: [f64; 3], v: [f64; 3]) -> ModelInput {
    let mut position = lattice(4, 4);
    let middle = (R + position.last().expect("balls")[2]) / 2.0;
    for p in &mut position {
        p[2] -= middle;
    }
    position.push(x);
    let mut input = balls(&position, &[]);
    *input.velocity.last_mut().expect("balls") = v;
    input.laws = vec![(0, 0, [friction, restitution, 0.0, 0.0, 0.0])];
    input
}

/// A floor (material 1) and four walls without friction (material 2) around balls of material 0; law of mu, e_N.
pub fn boxed(position: &[[f64; 3]], half: f64, law: [f64; 2]) -> ModelInput {
    let mut input = balls(position, &[([0.0; 3], [0.0, 0.0, 1.0])]);
    for n in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] {
        input.plane_point.push((-half * n).to_array());
        input.plane_normal.push(n.to_array());
        input.plane_material.push(2);
    }
    let [mu, e] = law;
    input.gravity = [0.0, 0.0, -G];
    input.laws = vec![
        (0, 0, [mu, e, 0.0, 0.0, 0.0]),
        (0, 1, [mu, e, 0.0, 0.0, 0.0]),
        (0, 2, [0.0, e, 0.0, 0.0, 0.0]),
    ];
    input
}

/// `count` balls apart in a box, each moved at random: they fall, meet and heap up.
pub fn drop(count: usize, side: usize, law: [f64; 2], seed: u64) -> ModelInput {
    let mut random = Random(seed);
    let wide = 1.15 * 2.0 * R;
    let position: Vec<[f64; 3]> = (0..count)
        .map(|i| {
            let (x, y, z) = (i % side, i / side % side, i / (side * side));
            let at = |k: usize| wide * (k as f64 - 0.5 * (side - 1) as f64);
            let d = random.vector().map(|u| 0.07 * R * u);
            [at(x) + d[0], at(y) + d[1], 1.2 * R + wide * z as f64 + d[2]]
        })
        .collect();
    let mut input = boxed(&position, 0.5 * wide * side as f64, law);
    for v in &mut input.velocity {
        *v = random.vector().map(|u| 0.2 * u);
    }
    input
}

/// The scene as a simulation has left it.
pub fn from_state(input: &ModelInput, s: &Simulation) -> ModelInput {
    let vectors = |v: &[DVec3]| v.iter().map(|x| x.to_array()).collect::<Vec<_>>();
    ModelInput {
        position: vectors(&s.state.position),
        velocity: vectors(&s.state.velocity),
        angular_velocity: vectors(&s.state.angular_velocity),
        ..input.clone()
    }
}

/// Linear and angular momentum about the origin, and kinetic energy.
pub fn momenta(s: &Simulation) -> (DVec3, DVec3, f64) {
    let mut sum = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for i in 0..s.state.position.len() {
        let (x, v, w) = (
            s.state.position[i],
            s.state.velocity[i],
            s.state.angular_velocity[i],
        );
        let inertia = s.model.inertia[i];
        sum.0 += MASS * v;
        sum.1 += MASS * x.cross(v) + inertia * w;
        sum.2 += 0.5 * (MASS * v.length_squared() + inertia * w.length_squared());
    }
    sum
}
