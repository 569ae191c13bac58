//! Contact updates per second of projected Gauss-Seidel: `cargo bench -p carom-solve --bench sweeps`.

use carom_solve::problem::Problem;
use carom_solve::rows::RowSystem;
use carom_solve::solver::sweep;
use carom_solve::spheres::{Body, Contact, Instructions, Place, Sweeps};
use carom_solve::Bounds;
use glam::DVec3;
use std::time::Instant;

/// Balls along an edge up to which the local form is made: it takes 0.9 kB for each contact.
const LOCAL_SIDE: usize = 50;

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

/// Seconds of one call of `f`: the fastest batch of at least a millisecond within two seconds, and the processor time of all.
fn clock(mut f: impl FnMut(usize)) -> [f64; 2] {
    let started = Instant::now();
    f(1);
    let once = started.elapsed().as_secs_f64();
    let batch = (1e-3 / once).ceil().max(1.0) as usize;
    let (own, mut done, mut best) = (own_seconds(), 0, f64::INFINITY);
    while started.elapsed().as_secs_f64() < 2.0 || done == 0 {
        let clock = Instant::now();
        f(batch);
        best = best.min(clock.elapsed().as_secs_f64() / batch as f64);
        done += batch;
    }
    let own = own
        .zip(own_seconds())
        .map_or(f64::NAN, |(a, b)| (b - a) / done as f64);
    [best, own]
}

fn report(name: &str, scene: &Scene, threads: usize, instructions: Instructions) {
    let places = Some(&scene.places[..]);
    let clocked = Instant::now();
    let mut sweeps =
        Sweeps::new(&scene.bodies, &scene.contacts, places, threads).expect("a good problem");
    let new = clocked.elapsed().as_secs_f64();
    let none = vec![[0.0; 3]; scene.contacts.len()];
    let mut renewed = f64::INFINITY;
    for _ in 0..5 {
        let clocked = Instant::now();
        sweeps
            .renew_from(&scene.bodies, &scene.contacts, places, &none)
            .expect("a good problem");
        renewed = renewed.min(clocked.elapsed().as_secs_f64());
    }
    sweeps.instructions = instructions;
    let count = scene.contacts.len() as f64;
    let [best, own] = clock(|n| sweeps.sweep(n));
    // Processor time of one thread says nothing about two.
    let own = if threads == 1 {
        format!("{:9.2e}", count / own)
    } else {
        "        -".into()
    };
    let shape = sweeps.shape();
    println!(
        "{name:<15} {threads} {:<9} {:>9.2e} {own} {:>9.3} {:>7.1} {:>9.1} {:>9.1} = {:>4.1} sweeps; {} chunks, {} stages, {:.1} % between",
        format!("{instructions:?}"),
        count / best,
        best * 1e3,
        sweeps.traffic() as f64 / best * 1e-9,
        new * 1e3,
        renewed * 1e3,
        renewed / best,
        shape.chunks,
        shape.stages,
        100.0 * shape.between as f64 / count,
    );
}

/// The same problem as rows over nodes.
fn rows(scene: &Scene) -> RowSystem {
    let mut system = RowSystem::default();
    for b in &scene.bodies {
        system.push_node(1.0 / b.inv_mass, 1.0 / b.inv_inertia, b.radius);
    }
    for c in &scene.contacts {
        let (n, slip) = (DVec3::from_array(c.normal), DVec3::from_array(c.slip));
        let t1 = n.any_orthonormal_vector();
        let radius = |body: u32| scene.bodies.get(body as usize).map_or(0.0, |b| b.radius);
        let row = |t: DVec3, turn: DVec3| {
            let side = |t: DVec3, w: DVec3| [t.x, t.y, t.z, w.x, w.y, w.z];
            [side(t, radius(c.a) * turn), side(-t, radius(c.b) * turn)]
        };
        let axes = [n, t1, n.cross(t1)];
        let jac = axes.map(|t| row(t, t.cross(n)));
        let bounds = Bounds {
            sliding: c.friction,
            ..Bounds::default()
        };
        system.push_contact(
            c.a,
            c.b,
            bounds,
            1.0,
            c.normal,
            &jac,
            &axes.map(|t| t.dot(slip)),
        );
    }
    system
}

/// The sweeps over the local form `W r + q`, the way of problems that are no spheres.
fn report_local(name: &str, scene: &Scene) {
    let system = rows(scene);
    let problem = Problem::from_rows(&system, &system.z0);
    let count = scene.contacts.len() as f64;
    for (threads, instructions) in [
        (1, Instructions::Widest),
        (2, Instructions::Widest),
        (1, Instructions::Scalar),
    ] {
        let clocked = Instant::now();
        let mut sweeps = sweep::ConeSweeps::new(&problem, threads);
        let new = clocked.elapsed().as_secs_f64();
        sweeps.instructions = instructions;
        let [best, own] = clock(|n| sweeps.sweep(n as u32, || false));
        let own = if threads == 1 {
            format!("{:9.2e}", count / own)
        } else {
            "        -".into()
        };
        let traffic = 8 * problem.w.values.len();
        println!(
            "{name:<15} {threads} local {:<9} {:>9.2e} {own} {:>9.3} {:>7.1} {:>9.1} = {:.1} sweeps; {:.1} blocks per contact",
            format!("{instructions:?}"),
            count / best,
            best * 1e3,
            traffic as f64 / best * 1e-9,
            new * 1e3,
            new / best,
            problem.w.col.len() as f64 / count,
        );
    }
}

/// Arguments that are numbers: edges of the cubes, in balls, in place of 10, 46 and 100.
fn main() {
    let sides: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let sides = if sides.is_empty() {
        vec![10, 46, 100]
    } else {
        sides
    };
    println!("updates: contacts per second of the fastest batch; cpu: per second of processor time; GB/s: least traffic");
    println!("order of bodies and contacts as from cells, or random; threads; instructions");
    println!(
        "                            updates/s     cpu/s  ms/sweep    GB/s    ms new  ms renew"
    );
    for side in sides {
        for (order, shuffle) in [("cells", false), ("random", true)] {
            let scene = packing(side, shuffle);
            let name = format!("{} {order}", side * side * side);
            for threads in [1, 2] {
                report(&name, &scene, threads, Instructions::Widest);
            }
            if !shuffle {
                report(&name, &scene, 1, Instructions::Scalar);
                if side <= LOCAL_SIDE {
                    report_local(&name, &scene);
                }
            }
        }
    }
}
