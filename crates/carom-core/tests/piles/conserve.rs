//! Momentum, energy and mirror images of piles without walls and weight.

use super::*;
use crate::common::{simulation, MASS, R};
use scenes::{cluster, momenta};

const SPEED: f64 = 3.0;

fn hit(friction: f64, restitution: f64, h: f64, until: f64) -> Simulation {
    let v = [0.9 * SPEED, 0.3 * SPEED, -0.1 * SPEED];
    let mut input = cluster(friction, restitution, [-6.5 * R, 0.1 * R, 0.3 * R], v);
    *input.angular_velocity.last_mut().expect("balls") = [20.0, -30.0, 10.0];
    let mut s = simulation(&input, options(h, 1e-8));
    let reports = go_on(&mut s, (until / h).round() as u64);
    assert!(until == 0.0 || reports.iter().any(|r| r.sweeps_velocity > 0));
    s
}

/// Impulses balance to rounding. The position correction U of an impact, up to v h, turns x by as much: |dL| <= m v^2 h.
#[test]
fn free_piles_keep_their_momentum_and_gain_no_energy() {
    for restitution in [0.0, 0.3, 0.9] {
        for friction in [0.0, 0.3] {
            for h in [4e-4, 2.5e-5] {
                let (p0, l0, t0) = momenta(&hit(friction, restitution, h, 0.0));
                let s = hit(friction, restitution, h, 0.06);
                let (p, l, t) = momenta(&s);
                close((p - p0).length(), 0.0, 1e-14 * p0.length());
                close((l - l0).length(), 0.0, 2.0 * t0 * h);
                // Rule R4 admits 1e-10 of the kinetic energy per problem.
                assert!(s.monitors.energy_max_rise <= 1e-10 * t0);
                assert!(t < 0.95 * t0, "{t} {t0}");
            }
        }
    }
}

/// A scene that is its own mirror image about y = 0 stays so.
#[test]
fn a_symmetric_pile_stays_symmetric() {
    for restitution in [0.0, 0.5] {
        for tolerance in [1e-7, 1e-9] {
            let input = cluster(
                0.3,
                restitution,
                [-6.5 * R, 0.0, 0.2 * R],
                [SPEED, 0.0, 0.0],
            );
            let mut s = simulation(&input, options(2e-4, tolerance));
            go_on(&mut s, 300);
            let image = |i: usize| {
                let [x, y, z] = input.position[i];
                (0..input.position.len())
                    .find(|&k| {
                        let p = input.position[k];
                        (p[0] - x).abs() + (p[1] + y).abs() + (p[2] - z).abs() < 0.1 * R
                    })
                    .expect("a mirror image")
            };
            let mut worst = 0.0f64;
            for i in 0..input.position.len() {
                let (v, k) = (s.state.velocity[i], s.state.velocity[image(i)]);
                worst = worst.max((v.x - k.x).abs() + (v.y + k.y).abs() + (v.z - k.z).abs());
            }
            // Of the whole run: some hundred problems, each to the tolerance. And one half may have an impact as slow as the closing tolerance
            // that the other one is spared.
            let slowest = s.model.options.closing_tolerance_speed;
            let bound = (100.0 * tolerance).max(slowest) * SPEED;
            assert!(worst < bound, "{worst:e}");
        }
    }
}

/// Newton's cradle as one island of 60 contacts: one ball in, one ball out.
#[test]
fn a_long_cradle_throws_one_ball() {
    for count in [60u32, 150] {
        let mut position: Vec<[f64; 3]> = (0..count)
            .map(|i| [2.0 * R * f64::from(i), 0.0, 0.0])
            .collect();
        position.push([-2.5 * R, 0.0, 0.0]);
        let mut input = crate::common::balls(&position, &[]);
        input.laws = vec![(0, 0, [0.0, 1.0, 0.0, 0.0, 0.0])];
        input.velocity[count as usize] = [SPEED, 0.0, 0.0];
        let o = options(1e-4, 1e-7);
        let mut s = simulation(&input, o);
        let reports = go_on(&mut s, 300);
        let v = &s.state.velocity;
        let energy: f64 = v.iter().map(|v| 0.5 * MASS * v.length_squared()).sum();
        let problems = reports.iter().map(|r| r.impact_problems).max();
        assert_eq!(problems, Some(count));
        assert!(reports.iter().any(|r| r.sweeps_velocity > 0));
        let last = v[count as usize - 1].x;
        let rest = v
            .iter()
            .enumerate()
            .filter(|(i, _)| *i != count as usize - 1);
        let rest = rest.map(|(_, v)| v.length()).fold(0.0, f64::max);
        close(last, SPEED, 1e-9 * SPEED);
        close(rest, 0.0, 1e-9 * SPEED);
        close(
            energy,
            0.5 * MASS * SPEED * SPEED,
            1e-9 * MASS * SPEED * SPEED,
        );
    }
}
