//! How long finding neighbours takes: `cargo bench -p carom-geom`. Best of several runs, one thread.

use carom_geom::{overlaps, DVec3, NeighbourList, Periodic, Shape};
use std::hint::black_box;
use std::time::Instant;

struct Scene {
    x: Vec<DVec3>,
    radius: Vec<f64>,
    walls: Vec<Shape>,
    need: Vec<f64>,
}

/// Uniform numbers in [0, 1): repeatable, and good enough to scatter balls.
fn random(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// `n` balls at random (overlapping) with a packing fraction of 0.6, radii from 1 to `ratio`, in a box of 5 planes.
fn heap(n: usize, ratio: f64) -> Scene {
    let seed = &mut 7;
    let radius: Vec<f64> = (0..n).map(|_| 1.0 + (ratio - 1.0) * random(seed)).collect();
    let volume: f64 = radius.iter().map(|r| 4.189 * r * r * r).sum();
    let side = (volume / 0.6).cbrt();
    let mut point = || side * DVec3::new(random(seed), random(seed), random(seed));
    let x = (0..n).map(|_| point()).collect();
    let planes = [
        (DVec3::ZERO, DVec3::Z),
        (DVec3::ZERO, DVec3::X),
        (DVec3::ZERO, DVec3::Y),
        (DVec3::splat(side), -DVec3::X),
        (DVec3::splat(side), -DVec3::Y),
    ];
    let walls = planes
        .map(|(point, normal)| Shape::HalfSpace { point, normal })
        .to_vec();
    Scene {
        x,
        radius,
        walls,
        need: vec![0.01; n],
    }
}

/// A dense packing without overlaps: a face-centred lattice of packing fraction 0.6, jittered by the room it leaves.
/// Bodies are numbered by site, or at random.
fn packing(n: usize, scrambled: bool) -> Scene {
    let seed = &mut 11;
    // Touching spheres have 0.7405; half the gap between sites is free for each of the two.
    let pitch = 2.0 * (0.7405f64 / 0.6).cbrt();
    let side = (n as f64 / 4.0).cbrt().ceil() as usize;
    let edge = pitch * 2f64.sqrt();
    let room = 0.5 * (pitch - 2.0) / 3f64.sqrt();
    let mut x = Vec::with_capacity(n);
    for cell in 0..side * side * side {
        let corner = [cell % side, cell / side % side, cell / side / side];
        for site in [
            [0.0, 0.0, 0.0],
            [0.5, 0.5, 0.0],
            [0.5, 0.0, 0.5],
            [0.0, 0.5, 0.5],
        ] {
            let at = |k: usize, jitter: f64| {
                edge * (corner[k] as f64 + site[k]) + room * (2.0 * jitter - 1.0) + 1.1
            };
            x.push(DVec3::new(
                at(0, random(seed)),
                at(1, random(seed)),
                at(2, random(seed)),
            ));
        }
    }
    x.truncate(n);
    if scrambled {
        for i in (1..n).rev() {
            x.swap(i, (random(seed) * (i + 1) as f64) as usize);
        }
    }
    Scene {
        x,
        radius: vec![1.0; n],
        walls: vec![Shape::HalfSpace {
            point: DVec3::ZERO,
            normal: DVec3::Z,
        }],
        need: vec![0.01; n],
    }
}

/// The scene of [`heap`] with other radii, in a box of packing fraction 0.6.
fn sized(radius: Vec<f64>) -> Scene {
    let mut scene = heap(radius.len(), 1.0);
    let volume: f64 = radius.iter().map(|r| r * r * r).sum();
    let scale = (volume / radius.len() as f64).cbrt();
    for x in &mut scene.x {
        *x *= scale;
    }
    // Those through the origin stay where they are.
    scene.walls.truncate(3);
    scene.need = radius.iter().map(|r| 0.01 * r).collect();
    scene.radius = radius;
    scene
}

/// Two sizes, ratio 1:20, equal volumes: one large to 8000 small.
fn two_sizes(n: usize) -> Scene {
    let seed = &mut 3;
    let large = |u: f64| if u < 1.0 / 8001.0 { 20.0 } else { 1.0 };
    sized((0..n).map(|_| large(random(seed))).collect())
}

/// Lognormal radii between 1 and 20, median 4.5.
fn lognormal(n: usize) -> Scene {
    let seed = &mut 5;
    let mut normal = || {
        let radius = (-2.0 * (1.0 - random(seed)).ln()).sqrt();
        radius * (std::f64::consts::TAU * random(seed)).cos()
    };
    sized(
        (0..n)
            .map(|_| (4.5 * (0.6 * normal()).exp()).clamp(1.0, 20.0))
            .collect(),
    )
}

/// `giants` bodies of radius 100 among dust of radius 1.
fn giants_in_dust(n: usize, giants: usize) -> Scene {
    let radius = (0..n).map(|i| if i < giants { 100.0 } else { 1.0 });
    sized(radius.collect())
}

/// A set-up line of balls at rest on a floor, as in the paper's multiple impacts.
fn row(n: usize) -> Scene {
    let mut scene = heap(n, 1.0);
    for (i, x) in scene.x.iter_mut().enumerate() {
        *x = DVec3::new(5.0 + 2.5 * i as f64, 5.0, 1.0);
    }
    scene
}

/// Seconds of the fastest of `runs`, each of which repeats `f` `times`.
fn best(runs: usize, times: usize, mut f: impl FnMut()) -> f64 {
    let once = |f: &mut dyn FnMut()| {
        let clock = Instant::now();
        (0..times).for_each(|_| f());
        clock.elapsed().as_secs_f64() / times as f64
    };
    (0..runs)
        .map(|_| once(&mut f))
        .fold(f64::INFINITY, f64::min)
}

fn report(name: &str, scene: &Scene, runs: usize, times: usize) {
    report_threads(name, scene, runs, times, 1);
}

fn report_threads(name: &str, scene: &Scene, runs: usize, times: usize, threads: usize) {
    let Scene {
        x,
        radius,
        walls,
        need,
    } = scene;
    let mut list = NeighbourList::new();
    list.set_skin(0.3);
    list.set_threads(threads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let rebuild = pool.expect("threads").install(|| {
        best(runs, times, || {
            list.invalidate();
            black_box(list.refresh(x, radius, walls, need));
        })
    });
    let times = times.max(1_000_000 / x.len() / 10);
    let refresh = best(runs, times, || {
        black_box(list.refresh(black_box(x), radius, walls, need));
    });
    let mut meetings = 0;
    let within = best(runs, times, || {
        meetings = list
            .within(black_box(x), radius, walls, need)
            .inspect(|m| {
                black_box(m.proximity.gap);
            })
            .count();
    });
    println!(
        "{name:<24} pairs {:>9}  rebuild {:>12.3} us ({:>6.1} ns a ball)  refresh {:>10.4} us ({:.2} ns a ball)  within {:>10.4} us ({meetings})",
        list.pairs().len(),
        rebuild * 1e6,
        rebuild * 1e9 / x.len() as f64,
        refresh * 1e6,
        refresh * 1e9 / x.len() as f64,
        within * 1e6,
    );
}

/// Largest memory of this process so far, MB; `None` where the system does not tell.
fn memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1e3)
}

fn main() {
    report("4 balls, 5 planes", &row(4), 20, 100_000);
    report("16 balls, 5 planes", &row(16), 20, 20_000);
    report("32 balls, 5 planes", &row(32), 20, 20_000);
    report("33 balls, 5 planes", &row(33), 20, 20_000);
    for (n, runs, times) in [
        (1_000, 20, 100),
        (10_000, 20, 10),
        (100_000, 10, 1),
        (1_000_000, 3, 1),
    ] {
        report(&format!("packing of {n}"), &packing(n, false), runs, times);
    }
    if let Some(most) = memory() {
        println!("memory with the list of 1e6: {most:.0} MB, of which 40 MB are the scene");
    }
    report_threads(
        "packing of 1e6, 2 threads",
        &packing(1_000_000, false),
        3,
        1,
        2,
    );
    report("1e5, numbered at random", &packing(100_000, true), 10, 1);
    report("1e6, numbered at random", &packing(1_000_000, true), 3, 1);
    report("1e5, two sizes 1:20", &two_sizes(100_000), 5, 1);
    report("1e5, lognormal 1:20", &lognormal(100_000), 5, 1);
    report("1e5, 5 giants 1:100", &giants_in_dust(100_000, 5), 5, 1);
    report("1e5, radius ratio 5", &heap(100_000, 5.0), 5, 1);
    let mut escaped = heap(100_000, 1.2);
    escaped.x[5] = DVec3::new(1e9, 1e9, 1e9);
    report("1e5, one 1e9 away", &escaped, 10, 1);
    let scene = packing(100_000, false);
    let seconds = best(5, 1, || {
        black_box(overlaps(
            &scene.x,
            &scene.radius,
            &scene.walls,
            Vec::new(),
            &Periodic::default(),
            1e-9,
            usize::MAX,
        ));
    });
    println!("overlaps of 1e5: {:.1} ms", seconds * 1e3);
}
