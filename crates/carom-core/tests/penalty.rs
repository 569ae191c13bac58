//! Method `penalty`: closed forms of one collision, published values of several, order in the substep, bits.

mod common;

use carom_core::options::{Method, PenaltyFriction, PenaltyLaw};
use carom_core::penalty::elastic::Elastic;
use carom_core::penalty::laws;
use carom_core::{ModelInput, Options, Outcome, Simulation, Value};
use common::{advance, balls, bits, compile, on_floor, rack, simulation, G, MASS, R};
use std::f64::consts::SQRT_2;

fn options(step: f64) -> Options {
    Options {
        step,
        method: Method::Penalty,
        ..Options::default()
    }
}

fn close(a: f64, b: f64, bound: f64) {
    assert!(
        (a - b).abs() <= bound,
        "{a:e} and {b:e} differ by {:e}",
        a - b
    );
}

/// Ball 0 comes along x at `speed` to others at rest, from a gap that is no multiple of anything.
fn line(count: usize, e: f64, speed: f64) -> ModelInput {
    let mut position: Vec<[f64; 3]> = (0..count).map(|i| [2.0 * R * i as f64, 0.0, 0.0]).collect();
    position[0][0] -= 0.01234;
    let mut input = ModelInput {
        laws: vec![(0, 0, [0.0, e, 0.0, 0.0, 0.0])],
        ..balls(&position, &[])
    };
    input.velocity[0][0] = speed;
    input
}

fn run(input: &ModelInput, o: Options, until: f64) -> Simulation {
    let steps = (until / o.step).round() as u64;
    let mut s = simulation(input, o);
    assert!(advance(&mut s, steps).is_none());
    s
}

fn energies(s: &mut Simulation) -> Vec<f64> {
    let block = s.take_block();
    let total = |r: &carom_core::StepReport| r.energy_kinetic + r.energy_potential;
    block.steps.iter().map(total).collect()
}

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
            let impact = impact[0].impact;
            close(impact.approach, -1.0, 1e-12);
            close(impact.separation, found, 1e-12);
            close(impact.impulse.x, -0.5 * MASS * (1.0 + found), 1e-12 * MASS);
            // The table has three digits, and what the law says has all.
            close(found, e_out, 8e-4);
            let exact = laws::restitution(laws::damping(law_of(name), e_in, 1e-2));
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
    let order = |errors: &[f64]| (errors[0] / errors[4]).log2() / 4.0;
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
    for e in [0.5, 0.1] {
        let damped = resolutions.map(|resolution| {
            let o = Options {
                penalty_resolution: resolution,
                ..options(1e-3)
            };
            let v = run(&line(2, e, 1.0), o, 0.03).state.velocity;
            (v[1].x - v[0].x - e).abs()
        });
        assert!(order(&damped) > 1.5, "{e}: {damped:?}");
        assert!(damped[1] < 1e-4 && damped[4] < 2e-6, "{e}: {damped:?}");
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
fn friction_is_coulombs_in_an_oblique_impact() {
    let mu = 0.1;
    for friction in [PenaltyFriction::Regularised, PenaltyFriction::Spring] {
        for (angle, slides) in [(0.05f64, false), (0.2, false), (0.6, true), (1.2, true)] {
            let mut input = ModelInput {
                laws: vec![(0, 1, [mu, 0.8, 0.0, 0.0, 0.0])],
                ..balls(&[[0.0, 0.0, 1.5 * R]], &[([0.0; 3], [0.0, 0.0, 1.0])])
            };
            let v = [2.0 * angle.sin(), 0.0, -2.0 * angle.cos()];
            input.velocity[0] = v;
            let o = Options {
                penalty_friction: friction,
                ..options(1e-3)
            };
            let mut s = run(&input, o, 0.03);
            let block = s.take_block();
            let p = block.impacts[0].impact.impulse;
            close(p.z, MASS * 1.8 * 2.0 * angle.cos(), 1e-3 * MASS);
            assert!(p.x.abs() <= mu * p.z * (1.0 + 1e-12));
            let after = s.state.velocity[0];
            let slip = after.x - R * s.state.angular_velocity[0].y;
            if slides {
                close(p.x, -mu * p.z, 2e-3 * mu * p.z);
            } else if friction == PenaltyFriction::Regularised {
                // The slip ends: 2/7 of it goes into the impulse.
                close(p.x, -MASS * v[0] * 2.0 / 7.0, 2e-3 * MASS);
                close(slip, 0.0, 2e-3);
            }
            let lost = 0.5 * MASS * 4.0 - s.monitors.energy_final;
            let work: f64 = block.contacts.iter().flat_map(|c| c.work).sum();
            close(-work, lost, 1e-12);
        }
    }
}

#[test]
fn a_sliding_ball_comes_to_roll_at_five_sevenths() {
    let (mu, v0) = (0.25, 2.0);
    for friction in [PenaltyFriction::Regularised, PenaltyFriction::Spring] {
        for e in [0.0, 0.8] {
            let mut input = on_floor([mu, e, 0.0, 0.0, 0.0]);
            input.velocity[0] = [v0, 0.0, 0.0];
            let o = Options {
                penalty_friction: friction,
                ..options(1e-3)
            };
            let end = 2.0 * v0 / (7.0 * mu * G);
            let mut s = run(&input, o, (0.5 * end / 1e-3).round() * 1e-3);
            let t = s.time();
            close(s.state.velocity[0].x, v0 - mu * G * t, 1e-3 * v0);
            assert!(advance(&mut s, (end / 1e-3) as u64).is_none());
            close(s.state.velocity[0].x, 5.0 / 7.0 * v0, 1e-3 * v0);
            close(s.state.angular_velocity[0].y * R, 5.0 / 7.0 * v0, 1e-3 * v0);
            // The floor carries the weight, without chatter: in every step, not only on average.
            let block = s.take_block();
            assert!(block.impacts.is_empty(), "{}", block.impacts.len());
            let late = &block.contacts[block.contacts.len() - 200..];
            let sum: f64 = late.iter().map(|c| c.impulse.z).sum();
            close(sum, 200.0 * MASS * G * 1e-3, 2e-2 * MASS * G * 0.2);
            if e == 0.0 {
                assert!(late.iter().all(|c| c.impulse.z > 0.5 * MASS * G * 1e-3));
            }
            close(s.state.position[0].z, R, 1e-5);
        }
    }
}

#[test]
fn a_ball_at_rest_stays_and_its_substep_follows_its_own_oscillation() {
    let mut s = run(&on_floor([0.3, 0.0, 0.0, 1e-3, 1e-3]), options(1e-3), 1.0);
    assert!(s.state.velocity[0].length() < 1e-4);
    assert!(s.state.position[0].truncate().length() < 1e-12);
    let block = s.take_block();
    assert!(block.impacts.is_empty());
    // Half a period of the linear oscillation about the load, and Hertz's contact time of the same energy, are alike.
    let k = Elastic::new(&Options::default()).stiffness(1.0 / R);
    let depth = (MASS * G / k).powf(2.0 / 3.0);
    let half_period = std::f64::consts::PI / (1.5 * G / depth).sqrt();
    let last = block.steps.last().unwrap();
    close(last.penetration, depth, 0.02 * depth);
    let substep = 1e-3 / f64::from(last.substeps);
    assert!(
        (0.5..2.0).contains(&(50.0 * substep / half_period)),
        "{substep:e}"
    );
}

#[test]
fn rolling_and_spinning_resistance_brake() {
    let (rho, delta) = (1e-3, 5e-4);
    let mut input = on_floor([0.3, 0.0, 0.0, rho, delta]);
    input.velocity[0] = [1.0, 0.0, 0.0];
    input.angular_velocity[0] = [0.0, 1.0 / R, 30.0];
    let s = run(&input, options(1e-3), 0.5);
    // a = rho g/(r (1 + kappa)); w_z' = delta m g/I.
    close(s.state.velocity[0].x, 1.0 - 0.5 * rho * G / (1.4 * R), 2e-3);
    let spin = 30.0 - 0.5 * delta * G / (0.4 * R * R);
    close(s.state.angular_velocity[0].z, spin, 2e-3 * 30.0);
}

#[test]
fn the_substep_follows_from_the_contact_time() {
    let inv_mass = 2.0 / MASS;
    for (speed, resolution) in [(0.1, 50), (1.0, 50), (10.0, 50), (1.0, 200)] {
        let o = Options {
            penalty_resolution: resolution,
            ..options(1e-3)
        };
        let elastic = Elastic::new(&o);
        let k = elastic.stiffness(2.0 / R);
        let time = elastic.contact_time(k, inv_mass, speed, 1.0);
        let mut s = run(&line(2, 1.0, speed), o, 0.02 / speed + 0.005);
        let block = s.take_block();
        let found = s.monitors.substep_min;
        let expected = time / f64::from(resolution);
        assert!(found <= expected * (1.0 + 1e-9), "{found:e} {expected:e}");
        assert!(
            found > 0.9 * expected || found > 0.8 * 1e-3 / (1e-3 / expected).ceil(),
            "{found:e} {expected:e}"
        );
        let total: u64 = block.steps.iter().map(|r| u64::from(r.substeps)).sum();
        assert_eq!(s.monitors.substeps, total);
        // Free flight takes whole steps.
        assert_eq!(block.steps[0].substeps, 1);
        assert_eq!(block.steps.last().unwrap().substeps, 1);
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

#[test]
fn the_same_bits_twice_and_after_a_restart() {
    for friction in [PenaltyFriction::Regularised, PenaltyFriction::Spring] {
        let o = Options {
            penalty_friction: friction,
            ..options(1e-4)
        };
        let whole = run(&rack(), o.clone(), 0.03);
        let again = run(&rack(), o.clone(), 0.03);
        assert_eq!(all_bits(&whole), all_bits(&again));
        // In the middle of the break contacts are open, closed and strained.
        for first in [0.0022, 0.0061, 0.0063, 0.0069, 0.02] {
            let part = run(&rack(), o.clone(), first);
            let mut rest = simulation(&rack(), o.clone());
            rest.state = part.state.clone();
            assert!(advance(&mut rest, 300 - part.state.step).is_none());
            assert_eq!(all_bits(&whole), all_bits(&rest), "{first}");
        }
    }
}

fn all_bits(s: &Simulation) -> Vec<u64> {
    let mut out = bits(s);
    for t in &s.state.touches {
        out.extend([u64::from(t.key.0), u64::from(t.key.1)]);
        out.extend([t.approach, t.age].map(f64::to_bits));
        for v in [t.spring, t.impulse, t.moment] {
            out.extend(v.to_array().map(f64::to_bits));
        }
    }
    out
}

#[test]
fn contacts_and_impacts_hold_the_momentum() {
    let mut s = run(&rack(), options(1e-3), 0.2);
    let block = s.take_block();
    let mut momentum = [[0.0f64; 3]; 4];
    for c in &block.contacts {
        for k in 0..3 {
            momentum[c.key.0 as usize][k] += c.impulse[k];
            if c.key.1 < 4 {
                momentum[c.key.1 as usize][k] -= c.impulse[k];
            }
        }
    }
    let start = rack().velocity;
    for i in 0..4 {
        for k in 0..3 {
            let weight = if k == 2 { MASS * G * 0.2 } else { 0.0 };
            let gained = MASS * (s.state.velocity[i][k] - start[i][k]) + weight;
            close(momentum[i][k], gained, 1e-12);
        }
    }
    let work: f64 = block.contacts.iter().flat_map(|c| c.work).sum();
    let first =
        0.5 * MASS * 25.01 + 0.2 * MASS * R * R * (9.0 + 1600.0 + 400.0) + 4.0 * MASS * G * R;
    let elastic = s.monitors.energy_final - first - work;
    // What is stored in the four contacts with the floor.
    assert!((0.0..1e-4).contains(&elastic), "{elastic:e}");
}

#[test]
fn unusable_input_is_refused() {
    let refuse = |change: &dyn Fn(&mut Options), law: [f64; 5]| {
        let mut o = options(1e-3);
        change(&mut o);
        compile(&on_floor(law), o).err().map(|e| e.to_string())
    };
    let plain = [0.1, 0.5, 0.0, 0.0, 0.0];
    assert_eq!(refuse(&|_| (), plain), None);
    let e_t = refuse(&|_| (), [0.1, 0.5, 0.3, 0.0, 0.0]).unwrap();
    assert!(
        e_t.contains("tangential_restitution") && e_t.contains("spring"),
        "{e_t}"
    );
    let spring = |o: &mut Options| o.penalty_friction = PenaltyFriction::Spring;
    assert_eq!(refuse(&spring, [0.1, 0.5, 0.3, 0.0, 0.0]), None);
    assert!(refuse(&spring, [0.1, 0.5, -0.3, 0.0, 0.0]).is_some());
    let n = refuse(&|o| o.penalty_exponent = 2.0, plain).unwrap();
    assert!(n.contains("penalty_stiffness"), "{n}");
    assert!(refuse(&|o| o.penalty_poisson_ratio = 0.6, plain).is_some());
    assert!(refuse(&|o| o.penalty_young_modulus = 0.0, plain).is_some());
    assert!(refuse(&|o| o.penalty_resolution = 3, plain).is_some());
    assert!(refuse(&|o| o.penalty_slip_speed = f64::NAN, plain).is_some());
}

#[test]
fn a_step_of_too_many_substeps_ends_in_an_outcome() {
    let o = Options {
        penalty_stiffness: 1e22,
        ..options(1.0)
    };
    let mut s = simulation(&on_floor([0.0, 0.5, 0.0, 0.0, 0.0]), o);
    let before = bits(&s);
    let outcome = advance(&mut s, 1);
    assert!(
        matches!(outcome, Some(Outcome::TooManySubsteps { step: 1, .. })),
        "{outcome:?}"
    );
    assert_eq!(before, bits(&s));
}
