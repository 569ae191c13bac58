//! Target `neighbours`: the neighbour list over some moves, and the overlaps, against brute force.

use crate::draw::Draw;
use crate::walls::shape;
use carom_core::wall::checked;
use carom_geom::{overlaps, DVec3, NeighbourList, Periodic, Shape};

/// Above the number up to which the list tries all pairs.
const MOST: usize = 96;

struct Scene {
    x: Vec<DVec3>,
    radius: Vec<f64>,
    need: Vec<f64>,
    walls: Vec<Shape>,
    periodic: Periodic,
}

/// Whether every pair within its needs is listed, and no other comes from `within`.
fn check(scene: &Scene, list: &NeighbourList) {
    let Scene {
        x,
        radius,
        need,
        walls,
        periodic,
    } = scene;
    let listed = list.pairs();
    assert!(listed.windows(2).all(|p| p[0] < p[1]) && listed.iter().all(|p| p.0 < p.1));
    let within: Vec<(u32, u32)> = (list.within(x, radius, walls, need))
        .map(|m| (m.a, m.b))
        .collect();
    assert!(within.windows(2).all(|p| p[0] < p[1]));
    if list.is_truncated() {
        return;
    }
    let mut wanted = Vec::new();
    for a in 0..x.len() {
        if need[a] < 0.0 {
            continue;
        }
        for b in a + 1..x.len() {
            let reach = radius[a] + radius[b] + (need[a] + need[b]);
            let between = periodic.nearest(x[a] - x[b]);
            if need[b] >= 0.0 && between.length_squared() <= reach * reach {
                wanted.push((a as u32, b as u32));
            }
        }
        for (w, wall) in walls.iter().enumerate() {
            if wall.meet(x[a], radius[a]).gap <= need[a] {
                wanted.push((a as u32, (x.len() + w) as u32));
            }
        }
    }
    assert_eq!(
        within, wanted,
        "{x:?}\n{radius:?}\n{need:?}\n{walls:?}\n{periodic:?}"
    );
}

/// The list is complete and exact over moves, whatever the sizes; extreme numbers only have to do no harm.
pub fn neighbours(data: &[u8]) {
    let mut draw = Draw::new(data);
    let n = usize::from(draw.byte()) % MOST;
    let decades = draw.one_of(&[0.0, 0.3, 1.0, 3.0, 6.0]);
    let spread = draw.one_of(&[0.1, 1.0, 3.0, 30.0, 1e6]);
    let wild = draw.rarely(4);
    let number = |low: f64, high: f64, draw: &mut Draw| match wild {
        true => draw.number(low, high),
        false => draw.real(low, high),
    };
    let length = draw.one_of(&[0.0, 0.0, 1.0]) * spread;
    let mut scene = Scene {
        x: Vec::new(),
        radius: Vec::new(),
        need: Vec::new(),
        walls: Vec::new(),
        periodic: Periodic::default(),
    };
    for _ in 0..n {
        let place = std::array::from_fn(|_| number(-spread, spread, &mut draw));
        scene.x.push(DVec3::from_array(place));
        scene
            .radius
            .push(0.1 * 10f64.powf(number(-decades, 0.0, &mut draw)));
        let need = number(0.0, 0.1, &mut draw);
        let absent = draw.rarely(16);
        scene.need.push(if absent {
            NeighbourList::absent(scene.radius[scene.radius.len() - 1])
        } else {
            need
        });
    }
    for _ in 0..draw.below(3) {
        // Walls of another scale than the spheres are a matter of rounding, not of the search.
        if let Ok(wall) = checked(&shape(&mut draw, 1.0)) {
            if wall.place().abs().max_element() < 1e3 {
                scene.walls.push(wall);
            }
        }
    }
    // A box is admitted where it holds four of the largest radii: so says the model.
    let largest = (scene.radius.iter().zip(&scene.need))
        .map(|(r, need)| r + need)
        .fold(0.0, f64::max);
    if length > 4.1 * largest {
        scene.periodic = Periodic::new(DVec3::new(length, 0.0, length), DVec3::ZERO);
    }
    let mut list = NeighbourList::new();
    list.set_periodic(scene.periodic);
    list.set_threads(1 + draw.below(2));
    for _ in 0..1 + draw.below(4) {
        list.refresh(&scene.x, &scene.radius, &scene.walls, &scene.need);
        // Squares of more do not fit, and rounding is larger than the spheres.
        let sane = |v: &f64| v.is_finite() && v.abs() < 1e9;
        let places = scene.x.iter().all(|x| x.to_array().iter().all(sane));
        let sizes = scene.radius.iter().all(|r| *r > 0.0 && sane(r));
        if places && sizes && scene.need.iter().all(sane) {
            check(&scene, &list);
        }
        let step = draw.size(0.01, 2.0);
        for x in &mut scene.x {
            *x += step * draw.direction();
        }
    }
    let Scene {
        x,
        radius,
        walls,
        periodic,
        ..
    } = &scene;
    let found = overlaps(x, radius, walls, Vec::new(), periodic, 1e-9, 50);
    assert!(found.len() <= 50 && found.iter().all(|o| o.gap < 0.0 && o.a < o.b));
}
