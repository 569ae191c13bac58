//! Walls of all shapes are met when the geometry of the step says that they are reached: by sampling, which knows nothing of roots.

use crate::common::{balls, G, R};
use crate::{advance, begin, options};
use carom_core::wall::{Ball, Cylinder, Disc, Rectangle, Shape};
use glam::DVec3;

fn draws(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut x = 0x9e37_79b9_7f4a_7c15u64 ^ (seed + 1).wrapping_mul(0xd134_2543_de82_ef95);
    move |low, high| {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        low + (high - low) * (x >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A wall near the origin, of the size of a few balls.
fn shape(number: u64, draw: &mut impl FnMut(f64, f64) -> f64) -> Shape {
    let mut unit = || DVec3::from([0; 3].map(|_| draw(-1.0, 1.0))).normalize();
    let (normal, other) = (unit(), unit());
    let side = (other - normal * normal.dot(other)).normalize();
    let centre = 0.02 * unit();
    match number % 6 {
        0 => Shape::Rectangle(Rectangle {
            centre,
            normal,
            side,
            half: [draw(0.01, 0.1), draw(0.01, 0.1)],
        }),
        1 => Shape::Disc(Disc {
            centre,
            normal,
            radius: draw(0.05, 0.12),
            hole: 0.0,
        }),
        2 => Shape::Disc(Disc {
            centre,
            normal,
            radius: 0.12,
            hole: draw(0.01, 0.1),
        }),
        3 => Shape::Ball(Ball {
            centre,
            radius: draw(0.02, 0.1),
            inside: false,
        }),
        4 => Shape::Cylinder(Cylinder {
            centre,
            axis: normal,
            radius: draw(0.04, 0.1),
            half: f64::INFINITY,
            inside: false,
        }),
        _ => Shape::Cylinder(Cylinder {
            centre,
            axis: normal,
            radius: draw(0.04, 0.1),
            half: draw(0.02, 0.1),
            inside: true,
        }),
    }
}

#[test]
fn walls_are_met_where_they_are() {
    let (mut met, until, samples) = (0, 0.3, 60_000);
    for number in 0..600 {
        let mut draw = draws(number);
        let wall = shape(number, &mut draw);
        let from = 0.35 * DVec3::from([0; 3].map(|_| draw(-1.0, 1.0))).normalize();
        let aim = DVec3::from([0; 3].map(|_| draw(-0.08, 0.08)));
        let g = DVec3::new(0.0, 0.0, -G);
        let v = (aim - from) / 0.15 - 0.075 * g;
        let gap = |t: f64| wall.meet(from + t * (v + 0.5 * t * g), R).gap;
        let mut input = balls(&[from.to_array()], &[]);
        input.gravity = g.to_array();
        input.laws = vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])];
        input.walls = vec![(wall, 1)];
        input.velocity[0] = v.to_array();
        if gap(0.0) < 0.0 {
            continue;
        }
        let at = |k: i32| until * f64::from(k) / f64::from(samples);
        let first = (1..=samples).find(|&k| gap(at(k)) < 0.0);
        let mut s = begin(&input, options(until));
        let outcome = advance(&mut s, 1);
        assert!(outcome.is_none(), "{number}: {outcome:?}");
        let found = s.take_block().impacts.first().map(|i| i.time);
        let Some(k) = first else {
            // What samples do not see is a graze.
            assert!(
                found.is_none_or(|t| gap(t).abs() < 1e-12 * R),
                "{number}: {found:?}"
            );
            continue;
        };
        let (mut low, mut high) = (at(k - 1), at(k));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if gap(middle) < 0.0 {
                high = middle
            } else {
                low = middle
            }
        }
        let found = found.expect("it was met");
        // Grazing hits are known to the root of the rounding.
        assert!(
            (found - low).abs() < 1e-8 && gap(found).abs() < 1e-12 * R,
            "{number}: {found} {low}"
        );
        met += 1;
    }
    assert!(met > 250, "{met}");
}

/// A ball that falls along the axis of a hole smaller than itself meets all of its rim at once.
#[test]
fn the_rim_of_a_hole_smaller_than_a_ball_is_met_on_its_axis() {
    let ring = Disc {
        centre: DVec3::ZERO,
        normal: DVec3::Z,
        radius: 10.0 * R,
        hole: 0.6 * R,
    };
    for beside in [0.0, 1e-13, 1e-9, 1e-4] {
        let mut input = balls(&[[beside * R, 0.0, 2.0 * R]], &[]);
        input.gravity = [0.0, 0.0, -G];
        input.laws = vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])];
        input.walls = vec![(Shape::Disc(ring), 1)];
        // It stands on the rim at 0.8 R.
        let time = (2.0 * 1.2 * R / G).sqrt();
        let mut s = begin(&input, options(1.01 * time));
        assert!(advance(&mut s, 1).is_none());
        let found = s.take_block().impacts[0].time;
        assert!(
            (found - time).abs() < 1e-3 * time && s.state.position[0].z > 0.8 * R,
            "{beside:e}: {found} {time}"
        );
    }
}

/// However far it comes from, a ball meets the rim of a disc smaller than itself, or of a hole, where its nearest point is.
#[test]
fn rims_are_met_at_the_end_of_long_flights() {
    for (radius, hole, beside, to_rim) in [(0.5, 0.0, 1.2, 0.7), (10.0, 0.6, 0.3, 0.3)] {
        for away in [5.0, 50.0, 500.0, 5000.0, 50_000.0] {
            let wall = Disc {
                centre: DVec3::ZERO,
                normal: DVec3::Z,
                radius: radius * R,
                hole: hole * R,
            };
            let mut input = balls(&[[beside * R, 0.0, away * R]], &[]);
            input.gravity = [0.0; 3];
            input.laws = vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])];
            input.walls = vec![(Shape::Disc(wall), 1)];
            input.velocity[0] = [0.0, 0.0, -2.0 * away * R];
            let time = 0.5 * (1.0 - f64::sqrt(1.0 - to_rim * to_rim) / away);
            let mut s = begin(&input, options(1.0));
            assert!(advance(&mut s, 1).is_none());
            let found = s.take_block().impacts[0].time;
            assert!(
                (found - time).abs() < 1e-12,
                "{radius} {away}: {found} {time}"
            );
        }
    }
}
