//! Surfaces of triangles: flat ones like planes, boxes like boxes, edges like those of rectangles, moved like any wall.

use super::*;
use crate::common::{balls, G, MASS};
use carom_core::record::ContactRecord;
use carom_core::wall::{Mesh, Rectangle};
use std::sync::Arc;

/// Numbers from 0 to 1 that follow from a seed.
fn draws(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A rectangle in the plane z = 0 of `2 n^2` triangles: a grid with points that are moved within the plane, cut at random.
fn floor(low: [f64; 2], high: [f64; 2], n: u32, seed: u64) -> Mesh {
    let mut draw = draws(seed);
    let mut points = Vec::new();
    let inner = |k: u32| f64::from(u8::from(k > 0 && k < n));
    for i in 0..=n {
        for j in 0..=n {
            let at = |k: u32, axis: usize, shift: f64| {
                let share = (f64::from(k) + 0.6 * inner(k) * (shift - 0.5)) / f64::from(n);
                low[axis] + (high[axis] - low[axis]) * share
            };
            points.push(DVec3::new(at(i, 0, draw()), at(j, 1, draw()), 0.0));
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] =
                [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(p, q)| (i + p) * (n + 1) + j + q);
            match draw() < 0.5 {
                true => triangles.extend([[a, b, c], [a, c, d]]),
                false => triangles.extend([[a, b, d], [b, c, d]]),
            }
        }
    }
    Mesh::new(&points, &triangles).expect("a mesh")
}

fn add_mesh(input: &mut ModelInput, mesh: Mesh) -> u32 {
    input.meshes.push((Arc::new(mesh), DVec3::ZERO, 1));
    (input.plane_point.len() + input.walls.len() + input.meshes.len() - 1) as u32
}

fn box_mesh(low: DVec3, high: DVec3) -> Mesh {
    let points: Vec<DVec3> = (0..8u32)
        .map(|k| DVec3::select(glam::BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), high, low))
        .collect();
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let cut = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let triangles: Vec<[u32; 3]> = sides.into_iter().flat_map(cut).collect();
    Mesh::new(&points, &triangles).expect("a mesh")
}

/// The planes of a box, from inside.
fn box_planes(low: DVec3, high: DVec3) -> Vec<([f64; 3], [f64; 3])> {
    let axes = DVec3::AXES.into_iter();
    axes.flat_map(|n| {
        [
            (low.to_array(), n.to_array()),
            (high.to_array(), (-n).to_array()),
        ]
    })
    .collect()
}

/// A ball that rolls over ten thousand triangles of one plane keeps its velocity, and moves as on the plane.
#[test]
fn a_ball_that_rolls_does_not_feel_the_triangles() {
    for seed in 0..4 {
        let mut input = balls(&[[-1.9, -0.031 * f64::from(seed as u32), R]], &[]);
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![(0, 1, [0.4, 0.7, 0.0, 0.0, 0.0])];
        input.velocity[0] = [2.0, 0.1, 0.0];
        input.angular_velocity[0] = [-0.1 / R, 2.0 / R, 0.0];
        add_mesh(&mut input, floor([-2.0, -0.5], [2.0, 0.5], 71, seed));
        let s = run(&input, options(1e-3), 1.9);
        let kept = (s.state.velocity[0] - DVec3::new(2.0, 0.1, 0.0)).length();
        assert!(kept < 1e-12, "{kept:e}");
        close(s.state.position[0].z, R, 1e-12 * R);
    }
}

/// Slipping, spinning and bouncing the same as on a plane.
#[test]
fn a_flat_mesh_is_a_plane() {
    let start = |input: &mut ModelInput| {
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![(0, 1, [0.2, 0.8, 0.1, 1e-4, 1e-4])];
        input.velocity[0] = [1.5, -0.3, 0.7];
        input.angular_velocity[0] = [20.0, -30.0, 40.0];
    };
    let mut plane = balls(&[[-1.0, 0.1, 2.0 * R]], &[([0.0; 3], [0.0, 0.0, 1.0])]);
    let mut mesh = balls(&[[-1.0, 0.1, 2.0 * R]], &[]);
    start(&mut plane);
    start(&mut mesh);
    add_mesh(&mut mesh, floor([-2.0, -1.0], [2.0, 1.0], 40, 5));
    let [a, b] = [plane, mesh].map(|input| run(&input, options(1e-3), 1.0));
    for (x, y) in [
        (a.state.position[0], b.state.position[0]),
        (a.state.velocity[0], b.state.velocity[0]),
        (
            a.state.angular_velocity[0] * R,
            b.state.angular_velocity[0] * R,
        ),
    ] {
        assert!((x - y).length() < 1e-12, "{x} {y}");
    }
}

/// Many balls thrown about in a box of twelve triangles, and of six planes.
#[test]
fn a_box_of_triangles_is_a_box() {
    let (low, high) = (DVec3::new(-0.2, -0.15, 0.0), DVec3::new(0.2, 0.15, 0.3));
    let places: Vec<[f64; 3]> = (0..8)
        .map(|k| {
            [
                0.09 * f64::from(k % 2) - 0.1,
                0.08 * f64::from(k / 2 % 2) - 0.04,
                0.05 + 0.09 * f64::from(k / 4),
            ]
        })
        .collect();
    let start = |mut input: ModelInput| {
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![
            (0, 1, [0.3, 0.6, 0.0, 0.0, 0.0]),
            (0, 0, [0.3, 0.6, 0.0, 0.0, 0.0]),
        ];
        let mut draw = draws(3);
        for v in &mut input.velocity {
            *v = [(); 3].map(|()| 2.0 * draw() - 1.0);
        }
        input
    };
    let mut mesh = start(balls(&places, &[]));
    add_mesh(&mut mesh, box_mesh(low, high));
    let planes = start(balls(&places, &box_planes(low, high)));
    let [a, b] = [planes, mesh].map(|input| run(&input, options(1e-3), 0.25));
    for (x, y) in a.state.position.iter().zip(&b.state.position) {
        assert!((*x - *y).length() < 1e-9, "{x} {y}");
    }
}

/// In a corner a ball lies on three faces; each gives what it has to.
#[test]
fn a_ball_in_a_corner_touches_three_faces() {
    let mut input = balls(&[[R, R, R]], &[]);
    input.gravity = [-1.0, -2.0, -3.0];
    input.laws = vec![(0, 1, [0.0, 0.5, 0.0, 0.0, 0.0])];
    add_mesh(&mut input, box_mesh(DVec3::ZERO, DVec3::splat(0.3)));
    let mut s = run(&input, options(1e-3), 0.01);
    assert!((s.state.position[0] - DVec3::splat(R)).length() < 1e-12);
    assert!(s.state.velocity[0].length() < 1e-12);
    let block = s.take_block();
    let last = &block.contacts[block.contacts.len() - 3..];
    let mut forces: Vec<f64> = last
        .iter()
        .map(|c| c.impulse.length() / 1e-3 / MASS)
        .collect();
    forces.sort_by(f64::total_cmp);
    for (force, expected) in forces.iter().zip([1.0, 2.0, 3.0]) {
        close(*force, expected, 1e-9);
    }
    let outside = |c: &ContactRecord| (s.model.outside(c.key.0), s.model.outside(c.key.1));
    assert!(
        last.iter().all(|c| outside(c) == (0, 1)),
        "one wall outside"
    );
}

/// Over a convex edge it rolls as over that of a rectangle, where the edge is the same.
#[test]
fn over_an_edge_it_turns_as_at_a_rectangle() {
    let start = |mut input: ModelInput| {
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![(0, 1, [5.0, 0.0, 0.0, 0.0, 0.0])];
        input.velocity[0] = [0.1, 0.0, 0.0];
        input.angular_velocity[0] = [0.0, 0.1 / R, 0.0];
        input
    };
    let at = [-0.02, 0.013, R];
    let mut sheet = start(balls(&[at], &[]));
    add_wall(
        &mut sheet,
        Shape::Rectangle(Rectangle {
            centre: DVec3::new(-0.5, 0.0, 0.0),
            normal: DVec3::Z,
            side: DVec3::X,
            half: [0.5, 0.5],
        }),
    );
    let mut solid = start(balls(&[at], &[]));
    add_mesh(
        &mut solid,
        box_mesh(DVec3::new(-1.0, -0.5, -0.3), DVec3::new(0.0, 0.5, 0.0)),
    );
    let [a, b] = [sheet, solid].map(|input| run(&input, options(1e-4), 0.33).state);
    assert!((a.position[0] - b.position[0]).length() < 1e-12 * R);
    // Turned about the edge, not yet off it: energy tells the speed.
    let x = b.position[0];
    assert!(x.x > 0.3 * R && x.x < 0.7 * R, "{x}");
    close(x.x.hypot(x.z), R, 1e-6 * R);
    let (inertia, fall) = (1.4, 2.0 * G * (R - x.z));
    let expected = 0.01 * inertia + fall;
    close(
        inertia * b.velocity[0].length_squared(),
        expected,
        2e-3 * expected,
    );
}

/// A mesh moves and turns as a plane that does; the impulse on it is that on the plane.
#[test]
fn a_mesh_moves_like_any_wall() {
    let motion = || rotation(DVec3::Y, DVec3::new(-0.4, 0.0, 0.0), law("0.2*sin(3*t)"));
    let start = |mut input: ModelInput| {
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![(0, 1, [0.5, 0.4, 0.0, 0.0, 0.0])];
        input.velocity[0] = [0.3, 0.2, 0.0];
        input
    };
    let at = [[0.1, 0.05, R]];
    let mut plane = start(balls(&at, &[([-0.4, 0.0, 0.0], [0.0, 0.0, 1.0])]));
    plane.wall_motion.push((0, motion()));
    let mut mesh = start(balls(&at, &[]));
    let index = add_mesh(&mut mesh, floor([-1.0, -1.0], [1.0, 1.0], 30, 9));
    mesh.meshes[0].1 = DVec3::new(-0.4, 0.0, 0.0);
    mesh.wall_motion.push((index, motion()));
    let [a, b] = [plane, mesh].map(|input| run(&input, options(1e-3), 0.8));
    assert!((a.state.position[0] - b.state.position[0]).length() < 1e-9);
    let (a, b) = (a.recorder.block.walls, b.recorder.block.walls);
    assert_eq!(a.len(), b.len());
    for (x, y) in a.iter().zip(&b) {
        close(*x, *y, 1e-9);
    }
}
