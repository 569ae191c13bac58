//! Collisions without friction against closed forms and published values.

use crate::common::{advance, balls, simulation, MASS, R};
use crate::{close, energies, line, options, run};
use carom_core::options::PenaltyLaw;
use carom_core::{ModelInput, Options, Value};
use carom_penalty::damping;
use carom_penalty::elastic::Elastic;
use std::f64::consts::SQRT_2;

fn law_of(name: &str) -> PenaltyLaw {
    let mut o = Options::default();
    o.set("penalty_law", &Value::Text(name.to_owned())).unwrap();
    o.penalty_law
}

/// The table of restitutions that come out, against those that go in.
#[test]
fn every_law_has_its_restitution() {
    const E_IN: [f64; 7] = [0.1, 0.3, 0.5, 0.7, 0.85, 0.93, 0.95];
    let table = [
        (
            "hunt-crossley",
            [0.516, 0.581, 0.663, 0.768, 0.869, 0.935, 0.952],
        ),
        (
            "herbert-mcwhannell",
            [0.491, 0.520, 0.594, 0.723, 0.853, 0.930, 0.950],
        ),
        (
            "lee-wang",
            [0.687, 0.739, 0.799, 0.869, 0.930, 0.966, 0.976],
        ),
        (
            "lankarani-nikravesh",
            [0.665, 0.684, 0.725, 0.796, 0.878, 0.937, 0.954],
        ),
        (
            "gonthier",
            [0.101, 0.304, 0.488, 0.670, 0.821, 0.912, 0.936],
        ),
        (
            "zhiying-qishao",
            [0.218, 0.327, 0.483, 0.680, 0.842, 0.928, 0.949],
        ),
        ("flores", [0.069, 0.256, 0.470, 0.683, 0.841, 0.926, 0.947]),
        ("hu-guo", [0.074, 0.271, 0.488, 0.697, 0.850, 0.930, 0.950]),
        ("exact", E_IN),
    ];
    assert_eq!(table.len(), PenaltyLaw::NAMES.len());
    for (name, row) in table {
        for (e_in, e_out) in E_IN.into_iter().zip(row) {
            let o = Options {
                penalty_law: law_of(name),
                ..options(1e-3)
            };
            let mut s = run(&line(2, e_in, 1.0), o, 0.03);
            let v = &s.state.velocity;
            let found = v[1].x - v[0].x;
            let impact = &s.take_block().impacts;
            assert_eq!(impact.len(), 1);
            let impact = impact[0].impact.clone();
            close(impact.normal_before, -1.0, 1e-12);
            close(impact.separation, found, 1e-12);
            close(impact.impulse.x, -0.5 * MASS * (1.0 + found), 1e-12 * MASS);
            // The table has three digits, and what the law says has all.
            close(found, e_out, 8e-4);
            let exact = damping::restitution(damping::chi(law_of(name), e_in, 1e-2));
            close(exact, e_out, 6e-4);
            close(found, exact, 2e-4);
        }
    }
}

#[test]
fn the_exact_law_holds_for_any_force_and_mass() {
    for (exponent, stiffness, ratio, speed) in [
        (1.0, 1e5, 1.0, 0.3),
        (1.5, 1e7, 20.0, 2.0),
        (2.0, 1e10, 0.01, 1.0),
        (3.0, 1e14, 3.0, 7.0),
    ] {
        for e in [0.2, 0.6, 0.93, 1.0] {
            let o = Options {
                penalty_exponent: exponent,
                penalty_stiffness: stiffness,
                ..options(1e-3)
            };
            let mut input = line(2, e, speed);
            input.mass[1] *= ratio;
            let s = run(&input, o, 0.01234 / speed + 0.1);
            let v = &s.state.velocity;
            close(v[1].x - v[0].x, e * speed, 1e-3 * speed);
            close(
                v[0].x + ratio * v[1].x,
                speed,
                1e-13 * speed * ratio.max(1.0),
            );
        }
    }
}

#[test]
fn contact_time_and_indentation_are_hertz() {
    let (v, inv_mass) = (1.7, 2.0 / MASS);
    let k = Elastic::new(&Options::default()).stiffness(2.0 / R);
    let deepest = (5.0 * v * v / (4.0 * k * inv_mass)).powf(0.4);
    let time = 2.943_275_184_3 * deepest / v;
    // A grid so fine that it shows when the contact opened.
    let h = time / 2000.0;
    let o = Options {
        penalty_resolution: 400,
        ..options(h)
    };
    let mut s = run(&line(2, 1.0, v), o, 0.01234 / v + 1.2 * time);
    let block = s.take_block();
    let largest = block
        .steps
        .iter()
        .map(|r| r.penetration)
        .fold(0.0, f64::max);
    close(largest, deepest, 1e-3 * deepest);
    let steps = block.steps.iter().filter(|r| r.penetration > 0.0).count();
    close(steps as f64 * h, time, 1e-3 * time);
    assert_eq!(s.monitors.penetration, largest);
}

#[test]
fn touching_lines_transmit_hertz_waves() {
    for (count, expected) in [
        (3, vec![-0.0710, 0.0764, 0.9945]),
        (4, vec![-0.0711, -0.0296, 0.1097, 0.9910]),
        (5, vec![-0.0711, -0.0303, -0.0145, 0.1270, 0.9888]),
    ] {
        let s = run(&line(count, 1.0, 1.0), options(1e-3), 0.1);
        for (v, x) in s.state.velocity.iter().zip(expected) {
            close(v.x, x, 1e-3);
        }
    }
    let linear = Options {
        penalty_exponent: 1.0,
        penalty_stiffness: 1e6,
        ..options(1e-3)
    };
    let s = run(&line(3, 1.0, 1.0), linear, 0.1);
    for (v, x) in s.state.velocity.iter().zip([-0.1303, 0.1502, 0.9800]) {
        close(v.x, x, 1e-3);
    }
}

/// The break in the plane, without friction: the cue ball into the apex of a rack of three.
fn planar_break(e: f64) -> ModelInput {
    let s = 3f64.sqrt() * R;
    let mut input = ModelInput {
        laws: vec![(0, 0, [0.0, e, 0.0, 0.0, 0.0])],
        ..balls(
            &[[-2.5 * R, 0.0, 0.0], [0.0; 3], [s, R, 0.0], [s, -R, 0.0]],
            &[],
        )
    };
    input.velocity[0] = [1.0, 0.0, 0.0];
    input
}

#[test]
fn the_planar_break_has_the_compliant_velocities() {
    let cases = [
        (1.0, PenaltyLaw::Exact, [-0.1236, -0.0870, 0.6053, 0.3496]),
        (0.93, PenaltyLaw::Flores, [-0.1166, -0.0310, 0.5738, 0.3314]),
    ];
    for (e, law, [v2, v3, vx, vy]) in cases {
        let o = Options {
            penalty_law: law,
            ..options(1e-3)
        };
        let s = run(&planar_break(e), o, 0.1);
        let v = &s.state.velocity;
        close(v[0].x, v2, 1e-3);
        close(v[1].x, v3, 1e-3);
        for (ball, sign) in [(2, 1.0), (3, -1.0)] {
            close(v[ball].x, vx, 1e-3);
            close(v[ball].y, sign * vy, 1e-3);
        }
    }
}

#[test]
fn the_order_in_the_substep_is_two() {
    let resolutions = [25, 50, 100, 200, 400];
    let order = |errors: &[f64]| {
        let last = errors.len() - 1;
        (errors[0] / errors[last]).log2() / last as f64
    };
    let velocities = |resolution: u32| {
        let o = Options {
            penalty_resolution: resolution,
            ..options(1e-3)
        };
        run(&planar_break(1.0), o, 0.05).state.velocity
    };
    let fine = velocities(12_800);
    let several = resolutions.map(|resolution| {
        let v = velocities(resolution);
        let squares = v.iter().zip(&fine).map(|(a, b)| (*a - *b).length_squared());
        squares.sum::<f64>().sqrt()
    });
    assert!((1.8..2.3).contains(&order(&several)), "{several:?}");
    // Damping, weak and so strong that it is faster than the motion.
    for e in [0.5, 0.1, 0.01] {
        let damped = resolutions.map(|resolution| {
            let o = Options {
                penalty_resolution: resolution,
                ..options(1e-3)
            };
            let v = run(&line(2, e, 1.0), o, 0.03).state.velocity;
            (v[1].x - v[0].x - e).abs()
        });
        // At 25 the error of e = 0.5 is near a change of its sign.
        assert!(order(&damped[1..]) > 1.8, "{e}: {damped:?}");
        assert!(damped[1] < 5e-5 && damped[4] < 5e-7, "{e}: {damped:?}");
    }
}

#[test]
fn energy_never_rises_beyond_the_order_without_friction() {
    for e in [1.0, 0.93, 0.3] {
        let mut rises = Vec::new();
        for resolution in [50, 100, 200] {
            let o = Options {
                penalty_resolution: resolution,
                ..options(1e-5)
            };
            let mut s = run(&planar_break(e), o, 0.03);
            let energy = energies(&mut s);
            let start = 0.5 * MASS;
            let rise = energy.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
            let above = energy.iter().map(|e| e - start).fold(0.0, f64::max);
            rises.push(rise / start);
            // Within a collision the energy of an explicit scheme sways; after it nothing is left of that.
            assert!(
                above < 2e-3 * start * (50.0 / f64::from(resolution)).powi(2),
                "{e} {above:e}"
            );
            assert!(energy[energy.len() - 1] < start * (1.0 + 1e-4), "{e}");
        }
        println!("{e} {rises:?}");
        assert!(rises[2] < 1e-4);
    }
}

#[test]
fn no_impact_is_stepped_over() {
    // Fifty radii a step, head-on, grazing at 45 degrees, and through a plane.
    let mut input = line(2, 1.0, 1000.0 * R);
    input.position[0][0] = -20.3 * R;
    input.position[1] = [2.0 * R / SQRT_2, 2.0 * R / SQRT_2, 0.0];
    let o = Options {
        penalty_stiffness: 1e14,
        ..options(0.05)
    };
    let mut s = simulation(&input, o.clone());
    assert!(advance(&mut s, 1).is_none());
    let v = &s.state.velocity;
    close(v[0].x, 0.5 * 1000.0 * R, 1e-3 * 1000.0 * R);
    close(v[1].x, 0.5 * 1000.0 * R, 1e-3 * 1000.0 * R);
    let mut input = ModelInput {
        laws: vec![(0, 1, [0.0, 1.0, 0.0, 0.0, 0.0])],
        ..balls(&[[0.0, 0.0, 7.7 * R]], &[([0.0; 3], [0.0, 0.0, 1.0])])
    };
    input.velocity[0] = [0.0, 0.0, -1000.0 * R];
    let mut s = simulation(&input, o);
    assert!(advance(&mut s, 1).is_none());
    close(s.state.velocity[0].z, 1000.0 * R, 1e-3 * 1000.0 * R);
}
