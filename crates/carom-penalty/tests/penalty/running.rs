//! What a run tells and keeps: substeps, bits, momentum, loads; what it refuses.

use crate::common::{advance, balls, bits, on_floor, rack, simulation, G, MASS, R};
use crate::{close, line, options, refusal, run};
use carom_core::force::drag::Drag;
use carom_core::force::spring::Spring;
use carom_core::joint::{Joint, JointRow, RowKind};
use carom_core::options::PenaltyFriction;
use carom_core::outcome::Failure;
use carom_core::{Options, Simulation};
use carom_laws::Scalar;
use carom_penalty::elastic::Elastic;
use glam::DVec3;
use std::sync::Arc;

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
        let mut collisions = 0;
        for first in [0.0022, 0.0031, 0.0032, 0.0033, 0.0034, 0.02] {
            let part = run(&rack(), o.clone(), first);
            collisions += part.state.touches.iter().filter(|t| t.key.1 < 4).count();
            let mut rest = simulation(&rack(), o.clone());
            rest.state = part.state.clone();
            assert!(advance(&mut rest, 300 - part.state.step).is_none());
            assert_eq!(all_bits(&whole), all_bits(&rest), "{first}");
        }
        assert!(collisions > 2, "{collisions}");
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
fn loads_act_between_and_during_contacts() {
    // A damped spring to the ground beside a drag, in free flight: second order in the step, which is the substep
    // there (the loads admit 7 ms).
    let input = || {
        let mut input = balls(&[[0.1, 0.0, 0.0], [0.0, 1.0, 0.0]], &[]);
        input.velocity[1] = [1.0, 0.0, 0.0];
        input.angular_velocity[1] = [0.0, 2.0, 0.0];
        let spring = Spring {
            a: 0,
            b: u32::MAX,
            arm_a: DVec3::ZERO,
            arm_b: DVec3::new(-0.1, 0.0, 0.0),
            stiffness: 25.0,
            damping: 0.5,
            rest_length: 0.15,
        };
        let drag = Drag {
            body: 1,
            arm: DVec3::ZERO,
            translation: 0.3,
            rotation: 1e-4,
        };
        input.loads = vec![Arc::new(spring), Arc::new(drag)];
        input
    };
    // x = 0.05 + c(t) with c'' = -w^2 c - 2 z w c', c(0) = 0.05.
    let (w, damping, t) = (10.0f64, 1.0f64, 0.7f64);
    let wd = (w * w - damping * damping).sqrt();
    let c = 0.05 * (-damping * t).exp() * ((wd * t).cos() + damping / wd * (wd * t).sin());
    let inertia = 0.4 * MASS * R * R;
    let errors: Vec<[f64; 3]> = [0.004, 0.002, 0.001]
        .into_iter()
        .map(|h| {
            let s = run(&input(), options(h), t);
            [
                (s.state.position[0].x - 0.05 - c).abs(),
                (s.state.velocity[1].x - (-0.3 * t / MASS).exp()).abs(),
                (s.state.angular_velocity[1].y - 2.0 * (-1e-4 * t / inertia).exp()).abs(),
            ]
        })
        .collect();
    for k in 0..3 {
        assert!(errors[2][k] < 1e-4, "{errors:?}");
        let order = (errors[0][k] / errors[2][k]).log2() / 2.0;
        assert!((1.8..2.2).contains(&order), "{k}: {order} {errors:?}");
    }
    // What the drag and the dashpot take is told as work.
    let s = run(&input(), options(1e-3), t);
    let lost = s.monitors.energy_final - s.monitors.energy_initial;
    close(s.monitors.energy_work, lost, 1e-5);
}

#[test]
fn joints_are_refused() {
    let mut input = line(2, 1.0, 1.0);
    input.joints = vec![Joint {
        a: 0,
        b: 1,
        rows: vec![JointRow {
            kind: RowKind::Rotation,
            direction: DVec3::X,
            arm_a: DVec3::ZERO,
            arm_b: DVec3::ZERO,
            law: Scalar::zero(),
        }],
        translational: 0,
        length: R,
    }];
    let error = refusal(&input, options(1e-3)).unwrap();
    assert!(
        error.contains("joints") && error.contains("nsga"),
        "{error}"
    );
}

#[test]
fn unusable_input_is_refused() {
    let refuse = |change: &dyn Fn(&mut Options), law: [f64; 5]| {
        let mut o = options(1e-3);
        change(&mut o);
        refusal(&on_floor(law), o)
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
        matches!(&outcome, Some(o) if o.step == 1 && o.failure == Failure::TooManySubsteps),
        "{outcome:?}"
    );
    assert_eq!(before, bits(&s));
}

/// The scheme is explicit in loads: substeps resolve a stiff spring and a strong drag, whatever the step.
#[test]
fn stiff_loads_shorten_the_substep() {
    let mut input = balls(&[[0.1, 0.0, 0.0], [0.0, 1.0, 0.0]], &[]);
    input.velocity = vec![[1.0, 0.0, 0.0]; 2];
    input.loads = vec![
        Arc::new(Spring {
            a: 0,
            b: u32::MAX,
            arm_a: DVec3::ZERO,
            arm_b: DVec3::new(-0.1, 0.0, 0.0),
            stiffness: 1e7 * MASS,
            damping: 0.0,
            rest_length: 0.2,
        }),
        Arc::new(Drag {
            body: 1,
            arm: DVec3::ZERO,
            translation: 1e4 * MASS,
            rotation: 0.0,
        }),
    ];
    let s = run(&input, options(1e-3), 0.1);
    let w = 1e7f64.sqrt();
    assert!((s.state.position[0].x - 0.1).abs() < 1.02 / w);
    assert!(s.state.velocity[1].x.abs() < 1e-9);
    let start = s.monitors.energy_initial;
    assert!((s.monitors.energy_final - 0.5 * start).abs() < 2e-2 * start);
}
