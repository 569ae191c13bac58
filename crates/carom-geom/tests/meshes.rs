//! Meshes: what of them a sphere meets, against all triangles; flat pieces, edges, corners, slits.

use carom_geom::{same_contact, DVec3, Displacement, Mesh, NeighbourList, Proximity, Shape};
use glam::DQuat;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// The walls that a sphere may touch within `reach`, each once, with gap and normal.
fn met(mesh: &Mesh, placed: &[Shape], x: DVec3, r: f64, reach: f64) -> Vec<(usize, f64, DVec3)> {
    let mut found: Vec<usize> = (0..mesh.triangles())
        .filter_map(|t| mesh.met(placed, t, x, r, reach))
        .collect();
    found.sort_unstable();
    found.dedup();
    let mut kept: Vec<(usize, Proximity)> = Vec::new();
    for wall in found {
        let at = placed[wall].meet(x, r);
        if !kept.iter().any(|k| same_contact(&k.1, &at, r)) {
            kept.push((wall, at));
        }
    }
    kept.into_iter()
        .map(|(wall, at)| (wall, at.gap, at.normal))
        .collect()
}

/// A grid of `n x n` unit squares in the plane z = 0, each of two triangles, cut along either diagonal, in any order of corners.
fn floor(n: u32, seed: u64) -> Mesh {
    let mut state = seed;
    let mut draw = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) as u32
    };
    let mut points = Vec::new();
    for i in 0..=n {
        points.extend((0..=n).map(|j| DVec3::new(f64::from(i), f64::from(j), 0.0)));
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] =
                [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(p, q)| (i + p) * (n + 1) + j + q);
            let cut = if draw() % 2 == 0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            };
            for [p, q, s] in cut {
                triangles.push(if draw() % 2 == 0 {
                    [p, q, s]
                } else {
                    [q, p, s]
                });
            }
        }
    }
    Mesh::new(&points, &triangles).expect("a mesh")
}

fn cube() -> Mesh {
    let points: Vec<DVec3> = (0..8u32)
        .map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)))
        .collect();
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles: Vec<[u32; 3]> = sides
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    Mesh::new(&points, &triangles).expect("a mesh")
}

#[test]
fn flat_pieces_have_no_edges_within() {
    let mesh = floor(5, 1);
    let walls = mesh.walls();
    let count = |f: fn(&Shape) -> bool| walls.iter().filter(|s| f(s)).count();
    assert_eq!(count(|s| matches!(s, Shape::Triangle(_))), 50);
    assert_eq!(count(|s| matches!(s, Shape::Sheet(_))), 1);
    assert_eq!(count(|s| matches!(s, Shape::Line(_))), 20);
    assert_eq!(count(|s| matches!(s, Shape::Ball(_))), 20);
    let cube = cube();
    // Triangle, and what of it: a plane, an edge, a corner.
    for (wall, shape) in cube.walls().iter().enumerate() {
        let (t, what) = (cube.part(wall) as usize / 7, cube.part(wall) as usize % 7);
        let Shape::Triangle(of) = cube.walls()[t] else {
            panic!("{t}")
        };
        match *shape {
            Shape::Triangle(_) => assert_eq!((t, what), (wall, 0)),
            Shape::Sheet(s) => assert!(what == 0 && s.normal == of.normal),
            Shape::Line(l) => {
                let ends = [of.corners[what - 1], of.corners[what % 3]];
                let away = ends.map(|end| (end - l.point).cross(l.along).length());
                assert_eq!(away, [0.0; 2]);
            }
            Shape::Ball(b) => assert_eq!(b.centre, of.corners[what - 4]),
            _ => panic!("{shape:?}"),
        }
    }
    let walls = cube;
    let count = |f: fn(&Shape) -> bool| walls.walls().iter().filter(|s| f(s)).count();
    assert_eq!(count(|s| matches!(s, Shape::Sheet(_))), 6);
    assert_eq!(count(|s| matches!(s, Shape::Line(_))), 12);
    assert_eq!(count(|s| matches!(s, Shape::Ball(_))), 8);
}

/// On lines and points of the grid and within rounding of them too, from both sides: one contact, the plane's own, in all bits.
#[test]
fn a_flat_piece_is_a_plane_without_slits() {
    let mesh = floor(6, 7);
    let steps = [0.0, 1e-17, -1e-17, 1e-16, -3e-16, 1e-12, 1e-9, 0.25, 0.5];
    for (i, j) in (1..6).flat_map(|i| (1..6).map(move |j| (i, j))) {
        for (dx, dy) in steps.iter().flat_map(|a| steps.iter().map(move |b| (a, b))) {
            for side in [1.0, -1.0] {
                let x = DVec3::new(f64::from(i) + dx, f64::from(j) + dy, side * 0.3);
                let found = met(&mesh, mesh.walls(), x, 0.25, 1.0);
                let [(_, gap, normal)] = found[..] else {
                    panic!("{x} {found:?}")
                };
                assert_eq!((gap, normal), (0.3 - 0.25, DVec3::new(0.0, 0.0, side)));
            }
        }
    }
}

#[test]
fn a_cube_is_met_from_outside_and_from_inside() {
    let mesh = cube();
    let met = |x: [f64; 3], reach| met(&mesh, mesh.walls(), DVec3::from(x), 0.1, reach);
    // Over a face, over an edge, over a corner.
    let [(_, gap, normal)] = met([0.3, 0.4, 1.1], 0.05)[..] else {
        panic!()
    };
    assert!(gap.abs() < 1e-15 && normal == DVec3::Z);
    let [(_, gap, normal)] = met([1.1, 0.4, 1.1], 0.05)[..] else {
        panic!()
    };
    assert!((gap - (0.1 * 2f64.sqrt() - 0.1)).abs() < 1e-15);
    assert!((normal - DVec3::new(1.0, 0.0, 1.0).normalize()).length() < 1e-15);
    let [(_, gap, _)] = met([1.05, 1.05, 1.05], 0.05)[..] else {
        panic!()
    };
    assert!((gap - (0.05 * 3f64.sqrt() - 0.1)).abs() < 1e-15);
    // Inside, in an edge and in a corner: two faces, three.
    assert_eq!(met([0.1, 0.4, 0.1], 0.01).len(), 2);
    assert_eq!(met([0.1, 0.9, 0.1], 0.01).len(), 3);
    // Outside, over one face and beside another: no contact but that.
    assert_eq!(
        met([0.99, 0.5, 1.1], 10.0)
            .iter()
            .filter(|m| m.1 < 0.5)
            .count(),
        1
    );
}

#[test]
fn bad_triangles_are_named() {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, 2.0 * DVec3::X];
    let bad = |t: [u32; 3]| Mesh::new(&points, &[[0, 1, 2], t]).expect_err("bad");
    assert_eq!((bad([0, 1, 3]).triangle, bad([0, 1, 9]).triangle), (1, 1));
    assert!(
        bad([0, 1, 1]).why.contains("one line"),
        "{:?}",
        bad([0, 1, 1])
    );
    assert!(
        bad([0, 1, 9]).why.contains("there are 4"),
        "{:?}",
        bad([0, 1, 9])
    );
}

/// A closed surface: points of a sphere moved in and out, joined as a globe.
fn lump(seed: u64, rough: f64) -> Mesh {
    let mut state = seed;
    let mut draw = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let (rings, around) = (5u32, 8u32);
    let mut points = vec![DVec3::Z, -DVec3::Z];
    for i in 1..=rings {
        let polar = TAU / 2.0 * f64::from(i) / f64::from(rings + 1);
        for j in 0..around {
            let (s, c) = (TAU * f64::from(j) / f64::from(around)).sin_cos();
            let radius = 1.0 + rough * (draw() - 0.5);
            points.push(radius * DVec3::new(polar.sin() * c, polar.sin() * s, polar.cos()));
        }
    }
    let at = |i: u32, j: u32| 2 + (i - 1) * around + j % around;
    let mut triangles = Vec::new();
    for j in 0..around {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([1, at(rings, j + 1), at(rings, j)]);
        for i in 1..rings {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Mesh::new(&points, &triangles).expect("a mesh")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// The nearest of all triangles is always met, as near; what is met is at the surface, and nothing is met twice.
    #[test]
    fn the_nearest_triangle_is_met(
        seed in any::<u64>(), rough in 0.0..0.8f64, x in prop::array::uniform3(-1.6..1.6f64), r in 0.01..0.3f64,
        turn in prop::array::uniform3(-3.0..3.0f64), to in prop::array::uniform3(-2.0..2.0f64),
    ) {
        let mesh = lump(seed, rough);
        let by = Displacement { turn: DQuat::from_scaled_axis(turn.into()), about: DVec3::X, shift: to.into() };
        let placed: Vec<Shape> = mesh.walls().iter().map(|w| w.moved(&by)).collect();
        let x = by.point(x.into());
        let found = met(&mesh, &placed, x, r, f64::INFINITY);
        let nearest = placed[..mesh.triangles()].iter().map(|t| t.clearance(x, r)).fold(f64::INFINITY, f64::min);
        let least = found.iter().map(|f| f.1).fold(f64::INFINITY, f64::min);
        prop_assert!((least - nearest).abs() < 1e-12, "{least} {nearest}");
        for (_, gap, normal) in &found {
            let touches = x - (gap + r) * *normal;
            let away = placed[..mesh.triangles()].iter().map(|t| t.clearance(touches, 0.0)).fold(f64::INFINITY, f64::min);
            prop_assert!(away < 1e-7, "{away}");
        }
    }

    /// The list has every triangle within the needs, while spheres and mesh move.
    #[test]
    fn the_list_has_all_triangles_that_are_near(
        seed in any::<u64>(), moves in any::<bool>(), steps in prop::collection::vec(prop::array::uniform3(-0.02..0.02f64), 12),
    ) {
        let mesh = lump(seed, 0.4);
        let n = 40;
        let mut x: Vec<DVec3> = (0..n).map(|i| {
            let (s, c) = f64::from(i).sin_cos();
            (0.8 + 0.01 * f64::from(i)) * DVec3::new(c, s, 0.3 * (3.0 * f64::from(i)).sin())
        }).collect();
        let (radius, need) = (vec![0.05; n as usize], vec![0.03; n as usize]);
        let mut list = NeighbourList::new();
        let plane = Shape::HalfSpace { point: -DVec3::Z, normal: DVec3::Z };
        list.set_meshes(vec![(1..1 + mesh.walls().len(), mesh.triangles())]);
        list.set_fixed_walls(!moves);
        let mut by = Displacement::default();
        for step in steps {
            let step = DVec3::from(step);
            x.iter_mut().enumerate().for_each(|(i, x)| *x += step * (1.0 + 0.1 * i as f64));
            if moves {
                by.shift -= step;
                by.turn = DQuat::from_rotation_z(step.x) * by.turn;
            }
            let walls: Vec<Shape> = [plane].into_iter().chain(mesh.walls().iter().map(|w| w.moved(&by))).collect();
            list.refresh(&x, &radius, &walls, &need);
            prop_assert!(list.pairs().is_sorted());
            for (i, &x) in x.iter().enumerate() {
                for (w, wall) in walls[..1 + mesh.triangles()].iter().enumerate() {
                    if wall.clearance(x, 0.05) <= 0.03 {
                        prop_assert!(list.pairs().contains(&(i as u32, n + w as u32)));
                    }
                }
            }
            prop_assert!(list.pairs().iter().all(|p| p.1 < n + 1 + mesh.triangles() as u32));
        }
    }
}
