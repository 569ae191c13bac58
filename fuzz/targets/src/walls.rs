//! Target `walls`: how one sphere meets one wall.

use crate::draw::Draw;
use carom_core::wall::{checked, Ball, Cone, Cylinder, Disc, Rectangle, Shape};
use carom_geom::Displacement;

/// A wall of any kind about the origin, before any check; sizes about `size` (m).
pub fn shape(draw: &mut Draw, size: f64) -> Shape {
    let place = draw.vector(size);
    let (normal, inside) = (draw.direction(), draw.below(2) == 1);
    let normal = if draw.rarely(32) {
        draw.vector(1.0)
    } else {
        normal
    };
    let mut length = || draw.size(size, 1.0);
    let (a, b) = (length(), length());
    match draw.below(6) {
        0 => Shape::HalfSpace {
            point: place,
            normal,
        },
        1 => Shape::Rectangle(Rectangle {
            centre: place,
            normal,
            side: draw.direction(),
            half: [a, b],
        }),
        2 => Shape::Disc(Disc {
            centre: place,
            normal,
            radius: a,
            hole: draw.one_of(&[0.0, 0.5 * a, b]),
        }),
        3 => Shape::Cylinder(Cylinder {
            centre: place,
            axis: normal,
            radius: a,
            half: draw.one_of(&[b, f64::INFINITY]),
            inside,
        }),
        4 => Shape::Ball(Ball {
            centre: place,
            radius: a,
            inside,
        }),
        _ => Shape::Cone(Cone {
            point: place,
            axis: normal,
            radius: a,
            radius_end: draw.one_of(&[0.0, a, b]),
            length: b,
            inside,
        }),
    }
}

/// A wall is refused, or met with a unit normal and a gap that changes by no more than the sphere moves.
pub fn walls(data: &[u8]) {
    let mut draw = Draw::new(data);
    let Ok(wall) = checked(&shape(&mut draw, 1.0)) else {
        return;
    };
    let by = Displacement {
        turn: draw.turn(),
        about: draw.vector(1.0),
        shift: draw.vector(1.0),
    };
    let moved = wall.moved(&by);
    let (x, r) = (draw.vector(2.0), draw.size(0.1, 2.0));
    let way = 1e-6 * draw.direction();
    // What a model refuses, and what is out of any scale: nothing is asked of it but to come back.
    let sane = |v: f64| v.is_finite() && v.abs() < 1e6;
    let within = x.to_array().into_iter().all(sane) && (1e-6..1e6).contains(&r);
    let placed = |s: &Shape| s.place().to_array().into_iter().all(sane);
    for wall in [wall, moved] {
        let (here, there) = (wall.meet(x, r), wall.meet(x + way, r));
        let clearance = wall.clearance(x, r);
        if !(within && placed(&wall)) {
            continue;
        }
        let told = format!("{wall:?} at {x}, {r}: {here:?}, {there:?}, {clearance}");
        let scale = 1.0 + x.length() + wall.place().length() + r + clearance.abs();
        assert!(!here.gap.is_nan() && !clearance.is_nan(), "{told}");
        if here.gap.is_finite() && sane(here.gap) {
            assert!((here.normal.length() - 1.0).abs() < 1e-9, "{told}");
            assert!(!here.curvature.is_nan() && here.flat.is_finite(), "{told}");
            // Of a centre behind a face the distance grows again.
            assert!(
                here.gap < -r || clearance <= here.gap + 1e-9 * scale,
                "{told}"
            );
        }
        assert!(
            (wall.clearance(x + way, r) - clearance).abs() <= way.length() + 1e-9 * scale,
            "{told}"
        );
    }
}
