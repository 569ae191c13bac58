//! How long finding neighbours takes: `cargo bench -p carom-geom`. Best of several runs, one thread.

use carom_geom::{overlaps, DVec3, NeighbourList, Shape};
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
    let Scene {
        x,
        radius,
        walls,
        need,
    } = scene;
    let mut list = NeighbourList::new();
    let rebuild = best(runs, times, || {
        list.invalidate();
        black_box(list.refresh(x, radius, walls, need));
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
        "{name:<24} pairs {:>9}  rebuild {:>12.3} us  refresh {:>10.4} us ({:.2} ns a ball)  within {:>10.4} us ({meetings})",
        list.pairs().len(),
        rebuild * 1e6,
        refresh * 1e6,
        refresh * 1e9 / x.len() as f64,
        within * 1e6,
    );
}

fn main() {
    report("4 balls, 5 planes", &row(4), 20, 100_000);
    report("16 balls, 5 planes", &row(16), 20, 20_000);
    report("32 balls, 5 planes", &row(32), 20, 20_000);
    report("33 balls, 5 planes", &row(33), 20, 20_000);
    report("1e3, radius ratio 1", &heap(1_000, 1.0), 20, 100);
    report("1e5, radius ratio 1.2", &heap(100_000, 1.2), 10, 1);
    report("1e5, radius ratio 5", &heap(100_000, 5.0), 10, 1);
    report("1e5, ratio 100", &heap(100_000, 100.0), 5, 1);
    let mut escaped = heap(100_000, 1.2);
    escaped.x[5] = DVec3::new(1e9, 1e9, 1e9);
    report("1e5, one 1e9 away", &escaped, 10, 1);
    report("1e6, radius ratio 1.2", &heap(1_000_000, 1.2), 3, 1);
    let scene = heap(100_000, 1.2);
    let seconds = best(5, 1, || {
        black_box(overlaps(
            &scene.x,
            &scene.radius,
            &scene.walls,
            1e-9,
            usize::MAX,
        ));
    });
    println!("overlaps of 1e5: {:.1} ms", seconds * 1e3);
}
