//! Contact updates per second of projected Gauss-Seidel: `cargo bench -p carom-solve --bench sweeps`.

use carom_solve::spheres::{Body, Contact, Instructions, Place, Sweeps};
use std::time::Instant;

fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *seed;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

struct Scene {
    bodies: Vec<Body>,
    contacts: Vec<Contact>,
    places: Vec<Place>,
}

/// `side^3` balls on a jittered cubic lattice, neighbours nearer than a limit touch; bodies and contacts in random order.
fn packing(side: usize, shuffle: bool) -> Scene {
    let seed = &mut 7;
    let count = side * side * side;
    let mut name: Vec<u32> = (0..count as u32).collect();
    if shuffle {
        for i in (1..count).rev() {
            name.swap(i, (random(seed) * (i + 1) as f64) as usize);
        }
    }
    let at = |x: usize, y: usize, z: usize| (x * side + y) * side + z;
    let mut places = vec![[0.0; 3]; count];
    for x in 0..side {
        for y in 0..side {
            for z in 0..side {
                let mut jitter = |c: usize| c as f64 + 0.3 * (random(seed) - 0.5);
                places[name[at(x, y, z)] as usize] = [jitter(x), jitter(y), jitter(z)];
            }
        }
    }
    let bodies = (0..count)
        .map(|_| {
            let radius = 0.45 + 0.1 * random(seed);
            let mass = radius * radius * radius;
            Body {
                inv_mass: 1.0 / mass,
                inv_inertia: 2.5 / (mass * radius * radius),
                radius,
            }
        })
        .collect();
    let mut contacts = Vec::new();
    for x in 0..side {
        for y in 0..side {
            for z in 0..side {
                let a = name[at(x, y, z)];
                if z == 0 {
                    contacts.push(contact(a, u32::MAX, [0.0, 0.0, 1.0], seed));
                }
                for other in [
                    [1, 0, 0],
                    [0, 1, 0],
                    [0, 0, 1],
                    [1, 1, 0],
                    [1, 0, 1],
                    [0, 1, 1],
                    [1, 1, 1],
                ] {
                    let (p, q, r) = (x + other[0], y + other[1], z + other[2]);
                    if p.max(q).max(r) >= side {
                        continue;
                    }
                    let b = name[at(p, q, r)];
                    let (pa, pb) = (places[a as usize], places[b as usize]);
                    let d = [pa[0] - pb[0], pa[1] - pb[1], pa[2] - pb[2]];
                    let l = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                    if l < 1.175 {
                        contacts.push(contact(a, b, d.map(|x| x / l), seed));
                    }
                }
            }
        }
    }
    if shuffle {
        for i in (1..contacts.len()).rev() {
            contacts.swap(i, (random(seed) * (i + 1) as f64) as usize);
        }
    }
    Scene {
        bodies,
        contacts,
        places,
    }
}

fn contact(a: u32, b: u32, normal: [f64; 3], seed: &mut u64) -> Contact {
    let slip = [0, 1, 2].map(|k| 0.3 * (random(seed) - 0.5) - 0.5 * normal[k]);
    Contact {
        a,
        b,
        normal,
        slip,
        friction: 0.5,
    }
}

/// Processor time of this thread, s, where the system tells: on a busy machine the only fair clock.
fn own_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split(' ').next()?.parse::<f64>().ok()? * 1e-9)
}

fn report(name: &str, scene: &Scene, threads: usize, instructions: Instructions) {
    let made = || {
        Sweeps::new(&scene.bodies, &scene.contacts, Some(&scene.places), threads)
            .expect("a good problem")
    };
    let mut sweeps = made();
    let mut build = f64::INFINITY;
    for _ in 0..5 {
        let clock = Instant::now();
        sweeps = made();
        build = build.min(clock.elapsed().as_secs_f64());
    }
    sweeps.instructions = instructions;
    let count = scene.contacts.len();
    let repeat = (100_000 / count).max(1);
    let mut best = f64::INFINITY;
    sweeps.sweep(1);
    let started = Instant::now();
    let (own, mut done) = (own_seconds(), 0);
    while started.elapsed().as_secs_f64() < 2.0 {
        let clock = Instant::now();
        sweeps.sweep(repeat);
        done += repeat;
        best = best.min(clock.elapsed().as_secs_f64() / repeat as f64);
    }
    let own = own
        .zip(own_seconds())
        .map(|(a, b)| (b - a) / done as f64)
        .unwrap_or(f64::NAN);
    println!(
        "{name:<15} {threads} threads {:<8} contacts {count:>8} {:>8.3e} updates/s (cpu {:>8.3e})  {:>9.3} ms a sweep  build {:>8.2} ms = {:>4.1} sweeps {:?}",
        format!("{instructions:?}"),
        count as f64 / best,
        count as f64 / own,
        best * 1e3,
        build * 1e3,
        build / best,
        sweeps.shape(),
    );
}

fn main() {
    let sides: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let sides = if sides.is_empty() {
        vec![10, 46, 100]
    } else {
        sides
    };
    for side in sides {
        for (order, shuffle) in [("cells", false), ("random", true)] {
            let scene = packing(side, shuffle);
            let name = format!("{} {order}", side * side * side);
            for threads in [1, 2] {
                report(&name, &scene, threads, Instructions::Widest);
            }
            if !shuffle {
                report(&name, &scene, 1, Instructions::Scalar);
            }
        }
    }
}
