//! A model and its options from bytes: few bodies, every kind of part, sizes as they occur and extreme ones.

use super::parts;
use crate::draw::Draw;
use crate::walls::shape;
use carom_core::flow::{Inflow, Outlet, Region};
use carom_core::options::{
    Impact, Method, OnNonconvergence, PenaltyFriction, PenaltyLaw, Solver, Value,
};
use carom_core::{ModelInput, Options};
use glam::DVec3;

const MOST_SPHERES: usize = 8;
/// Upper bounds of what multiplies the work of a step: a step that is only long is no finding.
const MOST_HALVINGS: u32 = 4;
const MOST_PROBLEMS: u32 = 60;

/// Options that take any positive number.
const POSITIVE: [&str; 10] = [
    "tolerance",
    "pile_tolerance",
    "tolerance_floor",
    "gap_tolerance",
    "touching_tolerance",
    "closing_tolerance_load",
    "closing_tolerance_speed",
    "penalty_scale",
    "proximal_shift",
    "penalty_slip_speed",
];

fn options(draw: &mut Draw) -> Options {
    let mut o = Options {
        step: draw.one_of(&[1e-3, 1e-3, 1e-4, 1e-2, 0.1]) * draw.size(1.0, 0.3),
        method: draw.one_of(&[
            Method::Nsga,
            Method::Nsga,
            Method::MoreauJean,
            Method::Penalty,
        ]),
        impact: draw.one_of(&[
            Impact::Sequence,
            Impact::Sequence,
            Impact::SequencePaper,
            Impact::OneShot,
        ]),
        solver: draw.one_of(&[Solver::Auto, Solver::Newton]),
        max_halvings: draw.below(MOST_HALVINGS as usize + 1) as u32,
        max_problems: MOST_PROBLEMS,
        position_projection: draw.below(2) == 1,
        on_nonconvergence: draw.one_of(&[OnNonconvergence::Stop, OnNonconvergence::Warn]),
        ..Options::default()
    };
    if draw.below(4) == 1 {
        o.spectral_radius = draw.number(0.0, 1.0);
        o.theta = draw.number(0.0, 1.0);
        o.restitution_threshold = draw.number(0.0, 0.5);
        o.energy_safeguard = draw.below(2) == 0;
        o.line_search = draw.below(2) == 0;
        o.dense_contacts = draw.below(12) as u32;
        o.pile_contacts = draw.one_of(&[100, 0, 3, 10]);
        o.max_iterations = 1 + draw.below(50) as u32;
        o.max_problems = 1 + draw.below(MOST_PROBLEMS as usize) as u32;
        o.max_line_search = draw.below(11) as u32;
        o.gauss_seidel_sweeps = draw.below(16) as u32;
    }
    if draw.rarely(8) {
        let name = draw.one_of(&POSITIVE);
        let value = Value::Float(draw.size(1e-6, 6.0));
        o.set(name, &value).expect("an option with a number");
    }
    if o.method == Method::Penalty {
        penalty(draw, &mut o);
    }
    o
}

/// Few substeps, so that a case stays short: contacts as soft as a step of some milliseconds asks for.
fn penalty(draw: &mut Draw, o: &mut Options) {
    o.step = 1e-4;
    // Extremes mostly mean a million substeps, and so say little for their time.
    draw.tame = !draw.rarely(8);
    o.penalty_resolution = 4 + draw.below(16) as u32;
    o.penalty_young_modulus = 10f64.powf(draw.real(4.0, 8.0));
    o.penalty_friction = draw.one_of(&[PenaltyFriction::Regularised, PenaltyFriction::Spring]);
    o.penalty_law = draw.one_of(&[
        PenaltyLaw::HuntCrossley,
        PenaltyLaw::HerbertMcWhannell,
        PenaltyLaw::LeeWang,
        PenaltyLaw::LankaraniNikravesh,
        PenaltyLaw::Gonthier,
        PenaltyLaw::ZhiyingQishao,
        PenaltyLaw::Flores,
        PenaltyLaw::HuGuo,
        PenaltyLaw::Exact,
    ]);
    if draw.rarely(4) {
        o.penalty_stiffness = draw.size(1e5, 3.0);
        o.penalty_exponent = draw.number(1.0, 4.0);
        o.penalty_poisson_ratio = draw.number(-1.0, 0.5);
    }
}

fn spheres(draw: &mut Draw, input: &mut ModelInput) {
    let n = 1 + draw.below(MOST_SPHERES);
    let alike = draw.below(4) != 3;
    let mut x: Vec<DVec3> = Vec::new();
    for i in 0..n {
        let radius = if alike { 0.03 } else { draw.size(0.03, 1.0) };
        let mass = if alike { 0.2 } else { draw.size(0.2, 2.0) };
        let inertia = if draw.rarely(16) {
            draw.size(1e-4, 3.0)
        } else {
            0.4 * mass * radius * radius
        };
        // Beside one that is there, or on the floor, so that contacts are the rule.
        let gap = draw.one_of(&[0.0, 0.0, 1e-12, -1e-9, -1e-3, 1e-4, 1e-2, -0.5, 1.0]) * radius;
        let place = match draw.below(4) {
            _ if i == 0 => DVec3::new(0.0, 0.0, radius + gap),
            0 => DVec3::new(draw.number(-0.2, 0.2), draw.number(-0.2, 0.2), radius + gap),
            1 => draw.vector(0.3),
            _ => {
                let k = draw.below(i);
                x[k] + (input.radius[k] + radius + gap) * draw.direction()
            }
        };
        x.push(place);
        input.radius.push(radius);
        input.mass.push(mass);
        input.inertia.push(inertia);
        input.material.push(draw.below(2) as u32);
        input.position.push(place.to_array());
        let q = draw.turn();
        input.orientation.push([q.w, q.x, q.y, q.z]);
        let moves = draw.below(2) == 1;
        let speed = draw.one_of(&[1.0, 0.01, 20.0]);
        input.velocity.push(if moves {
            (speed * draw.vector(1.0)).to_array()
        } else {
            [0.0; 3]
        });
        input.angular_velocity.push(if moves {
            (speed * draw.vector(30.0)).to_array()
        } else {
            [0.0; 3]
        });
    }
}

fn flow(draw: &mut Draw, input: &mut ModelInput) {
    let n = input.radius.len();
    let (low, size) = (draw.vector(0.3), draw.vector(0.3).abs());
    if draw.below(2) == 1 {
        let first = draw.below(n);
        input.inflow.push(Inflow {
            first: first as u32,
            count: draw.below(n - first + 1) as u32,
            region: match draw.below(2) {
                0 => Region::Box {
                    low,
                    high: low + size,
                },
                _ => Region::Disc {
                    centre: low,
                    normal: draw.direction(),
                    radius: draw.number(0.0, 0.3),
                },
            },
            rate: draw.one_of(&[0.0, 1.0]) * draw.size(1000.0, 2.0),
            start: draw.one_of(&[0.0, 1e-3]),
            velocity: draw.vector(1.0),
            spread: draw.one_of(&[0.0, 0.1]),
            turned: false,
            seed: u64::from(draw.byte()),
        });
    }
    if draw.below(2) == 1 {
        input.outlet.push(Outlet {
            low,
            high: low + size,
            inside: draw.below(4) != 3,
        });
    }
}

/// Model and options; most are valid.
pub(crate) fn scene_of(draw: &mut Draw) -> (ModelInput, Options) {
    let options = options(draw);
    let mut input = ModelInput {
        gravity: draw.one_of(&[
            [0.0, 0.0, -9.81],
            [0.0; 3],
            [3.0, 0.0, -9.0],
            [0.0, 0.0, -1e4],
        ]),
        record_walls: draw.below(2) == 1,
        drop_impacts: draw.rarely(8),
        ..ModelInput::default()
    };
    spheres(draw, &mut input);
    for _ in 0..draw.below(3) {
        let place = if draw.rarely(4) {
            draw.vector(0.1)
        } else {
            DVec3::ZERO
        };
        input.plane_point.push(place.to_array());
        let normal = if draw.rarely(64) {
            draw.vector(1.0)
        } else {
            draw.direction()
        };
        input.plane_normal.push(normal.to_array());
        input.plane_material.push(draw.below(2) as u32);
    }
    if draw.below(3) == 1 {
        for _ in 0..1 + draw.below(2) {
            let wall = shape(draw, 0.2);
            input.walls.push((wall, draw.below(2) as u32));
        }
    }
    let walls = input.plane_point.len() + input.walls.len();
    if walls > 0 && draw.below(3) == 1 {
        let wall = draw.below(walls) as u32;
        input.wall_motion.push((wall, parts::wall_motion(draw)));
    }
    for (a, b) in [(0, 0), (0, 1), (1, 1)] {
        if draw.rarely(64) {
            continue;
        }
        let law = parts::contact_law(draw);
        input.laws.push((a, b, law));
    }
    if draw.rarely(8) {
        let count = input.laws.len();
        input.friction_law = (0..count)
            .map(|_| (draw.below(2) == 1).then(|| parts::scalar(draw, 0.3)))
            .collect();
    }
    if draw.below(4) == 1 {
        for _ in 0..1 + draw.below(2) {
            let joint = parts::joint(draw, &input);
            input.joints.push(joint);
        }
    }
    if draw.below(4) == 1 {
        for _ in 0..1 + draw.below(2) {
            let load = parts::load(draw, input.radius.len());
            input.loads.push(load);
        }
    }
    if draw.rarely(8) {
        flow(draw, &mut input);
    }
    if draw.rarely(8) {
        input.periodic = [draw.size(1.0, 0.5), draw.one_of(&[0.0, 1.0]), 0.0];
        input.periodic_origin = draw.vector(0.5).to_array();
    }
    (input, options)
}
