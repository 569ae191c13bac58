//! Laws, joints, loads and motions of walls.

use crate::draw::Draw;
use carom_core::force::applied::Applied;
use carom_core::force::drag::Drag;
use carom_core::force::spring::Spring;
use carom_core::force::Load;
use carom_core::joint::{Joint, JointRow, RowKind, GROUND};
use carom_core::wall::{WallMotion, WallRotation};
use carom_core::ModelInput;
use carom_laws::{Expression, Scalar};
use glam::{DQuat, DVec3};
use std::sync::Arc;

const FORMULAS: [&str; 8] = [
    "sin(100*t)",
    "0.2*exp(-t) + 0.1",
    "sqrt(1e-3 - t)",
    "1/(t - 2e-3)",
    "max(0, 0.5 - t)",
    "exp(exp(1000*t))",
    "sign(t - 1e-3)",
    "ln(t)",
];

/// A law of time or of the slip speed, of values about `size`.
pub fn scalar(draw: &mut Draw, size: f64) -> Scalar {
    match draw.below(5) {
        0 => Scalar::zero(),
        1 => Scalar::Constant(draw.number(-size, size)),
        2 => Scalar::Polynomial(
            (0..draw.below(4))
                .map(|k| size * draw.number(-1.0, 1.0) * 30f64.powi(k as i32))
                .collect(),
        ),
        3 => {
            let mut t = 0.0;
            let mut point = |_| {
                t += draw.size(1e-3, 1.0);
                [t, draw.number(-size, size)]
            };
            Scalar::Table((0..3).map(&mut point).collect())
        }
        _ => Scalar::Expression(Expression::parse(draw.one_of(&FORMULAS)).expect("one of ours")),
    }
}

/// mu, e_N, e_T, rho, delta.
pub fn contact_law(draw: &mut Draw) -> [f64; 5] {
    let mu = match draw.below(8) {
        0 | 1 => 0.0,
        2 => draw.size(10.0, 6.0),
        _ => draw.number(0.0, 1.0),
    };
    let e_t = if draw.rarely(6) {
        draw.number(-1.0, 1.0)
    } else {
        0.0
    };
    let between = draw.real(0.0, 1.0);
    let e_n = draw.one_of(&[0.0, 1.0, 0.5, between]);
    let mut resisting = || {
        if draw.rarely(4) {
            draw.size(1e-3, 2.0)
        } else {
            0.0
        }
    };
    [mu, e_n, e_t, resisting(), resisting()]
}

/// Between two spheres or a sphere and the ground. Its points mostly meet as the spheres stand.
pub fn joint(draw: &mut Draw, input: &ModelInput) -> Joint {
    let n = input.radius.len();
    let a = draw.below(n);
    let b = if n > 1 && draw.below(2) == 1 {
        (a + 1) % n
    } else {
        GROUND as usize
    };
    let (point, turn) = (
        |i: usize| DVec3::from_array(input.position[i]),
        |i: usize| {
            let [w, x, y, z] = input.orientation[i];
            DQuat::from_xyzw(x, y, z, w)
        },
    );
    let world = point(a) + draw.one_of(&[0.0, 0.03, 0.1]) * draw.direction();
    let mut arm_a = turn(a).conjugate() * (world - point(a));
    let mut arm_b = if b < n {
        turn(b).conjugate() * (world - point(b))
    } else {
        world
    };
    if draw.rarely(6) {
        (arm_a, arm_b) = (draw.vector(0.1), draw.vector(0.1));
    }
    let mut rows = Vec::new();
    let mut add = |kind, direction, law| {
        rows.push(JointRow {
            kind,
            direction,
            arm_a,
            arm_b,
            law,
        })
    };
    match draw.below(4) {
        0 => DVec3::AXES
            .into_iter()
            .for_each(|d| add(RowKind::Point, d, Scalar::zero())),
        1 => {
            let between = if b < n {
                point(a) - point(b)
            } else {
                point(a) - world
            };
            let law = if draw.rarely(4) {
                scalar(draw, 0.1)
            } else {
                Scalar::Constant(between.length())
            };
            rows.push(JointRow {
                kind: RowKind::Distance,
                direction: DVec3::X,
                arm_a: DVec3::ZERO,
                arm_b: if b < n { DVec3::ZERO } else { world },
                law,
            });
        }
        2 => {
            let law = if draw.below(2) == 1 {
                scalar(draw, 0.1)
            } else {
                Scalar::zero()
            };
            add(RowKind::Rotation, draw.direction(), law);
        }
        _ => {
            add(RowKind::Point, draw.direction(), Scalar::zero());
            let law = if draw.below(2) == 1 {
                scalar(draw, 0.1)
            } else {
                Scalar::zero()
            };
            add(RowKind::Point, draw.direction(), law);
            add(RowKind::Rotation, draw.direction(), Scalar::zero());
        }
    }
    let translational = rows
        .iter()
        .take_while(|r| r.kind != RowKind::Rotation)
        .count();
    Joint {
        a: a as u32,
        b: b as u32,
        rows,
        translational,
        length: input.radius[a],
    }
}

pub fn load(draw: &mut Draw, spheres: usize) -> Arc<dyn Load> {
    let body = draw.below(spheres) as u32;
    match draw.below(3) {
        0 => Arc::new(Applied {
            body,
            arm: DVec3::ZERO,
            force: std::array::from_fn(|_| scalar(draw, 5.0)),
            torque: std::array::from_fn(|_| scalar(draw, 0.1)),
        }),
        1 => Arc::new(Drag {
            body,
            arm: DVec3::ZERO,
            translation: draw.size(1.0, 3.0),
            rotation: draw.size(1e-3, 3.0),
        }),
        _ => {
            let other = (body + 1) % spheres as u32;
            let ground = other == body || draw.below(2) == 1;
            Arc::new(Spring {
                a: body,
                b: if ground { GROUND } else { other },
                arm_a: draw.vector(0.03),
                arm_b: draw.vector(if ground { 0.3 } else { 0.03 }),
                stiffness: draw.size(1000.0, 3.0),
                damping: draw.one_of(&[0.0, 1.0]) * draw.size(1.0, 2.0),
                rest_length: draw.number(0.0, 0.2),
            })
        }
    }
}

pub fn wall_motion(draw: &mut Draw) -> WallMotion {
    let (kinds, size) = (draw.byte(), draw.one_of(&[0.01, 0.1, 1.0]));
    let has = |bit: u8| kinds & bit != 0;
    WallMotion {
        translation: has(1).then(|| std::array::from_fn(|_| scalar(draw, size))),
        rotation: has(2).then(|| WallRotation {
            axis: draw.direction(),
            point: draw.vector(0.1),
            angle: scalar(draw, size),
        }),
        surface_velocity: if has(4) {
            draw.vector(1.0)
        } else {
            DVec3::ZERO
        },
        surface_rotation: has(8)
            .then(|| (draw.direction(), draw.vector(0.1), draw.number(-10.0, 10.0))),
        until: has(16).then(|| draw.number(1e-3, 0.1)),
    }
}
