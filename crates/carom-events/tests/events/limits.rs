//! The limit of the steps of `nsga`.

use crate::common::{rack, R};
use crate::invariants::{draws, table};
use crate::{advance, begin, options, run};
use carom_core::options::{Impact, Method};
use carom_core::{Options, Simulation};
use glam::DVec3;

fn apart(a: &Simulation, b: &Simulation) -> f64 {
    let n = a.state.velocity.len();
    (0..n)
        .map(|i| (a.state.velocity[i] - b.state.velocity[i]).length())
        .fold(0.0, f64::max)
}

/// A break of a rack that touches, with bounces on the table: the error of a step goes with its size.
#[test]
fn steps_converge_to_it() {
    let input = rack();
    let exact = run(&input, 0.01, 1);
    let error = |h: f64| {
        let o = Options {
            method: Method::Nsga,
            ..options(h)
        };
        let mut s = begin(&input, o);
        assert!(advance(&mut s, (0.01 / h).round() as u64).is_none());
        apart(&s, &exact)
    };
    // The impact lies at other parts of the steps: means over steps that have it everywhere.
    let mean = |h: f64| {
        (0..12)
            .map(|k| error(0.01 / (0.01 / h + k as f64).round()).ln())
            .sum::<f64>()
            / 12.0
    };
    let (coarse, fine) = (mean(1e-5), mean(1e-6));
    let order = (coarse - fine) / 10f64.ln();
    assert!((0.75..1.25).contains(&order), "order {order}");
    assert!(fine.exp() < 2e-4, "{}", fine.exp());
}

/// Random shots on a table with cushions: three balls, one of them struck with any spin at another.
#[test]
fn steps_converge_in_random_shots() {
    let mut draw = draws(7);
    let laws = [
        [0.06, 0.93, 0.0, 0.0, 0.0],
        [0.2, 0.5, 0.0, 4e-4, 3e-4],
        [0.14, 0.85, 0.0, 0.0, 0.0],
    ];
    let (until, steps) = (0.5, [2e-4, 2e-5]);
    let (mut orders, mut worst) = (Vec::new(), 0.0f64);
    for _ in 0..SHOTS {
        let aimed = [draw(0.9, 1.6), draw(0.3, 0.9), R];
        let cue = [draw(0.3, 0.6), draw(0.3, 0.9), R];
        let mut input = table(&[cue, aimed, [2.0, draw(0.3, 0.9), R]], [2.54, 1.27], laws);
        let to = DVec3::from(aimed) - DVec3::from(cue);
        let off = draw(-1.5, 1.5) * R / to.length();
        let v = draw(1.5, 4.0) * (to.normalize() + off * DVec3::Z.cross(to.normalize()));
        input.velocity[0] = v.to_array();
        input.angular_velocity[0] = [0; 3].map(|_| draw(-60.0, 60.0));
        let exact = run(&input, until, 1);
        let error = |h: f64| {
            let o = Options {
                method: Method::Nsga,
                ..options(h)
            };
            let mut s = begin(&input, o);
            assert!(advance(&mut s, (until / h).round() as u64).is_none());
            apart(&s, &exact)
        };
        let [coarse, fine] = steps.map(error);
        worst = worst.max(fine);
        orders.push((coarse / fine).ln() / (steps[0] / steps[1]).ln());
    }
    let mean = orders.iter().sum::<f64>() / SHOTS as f64;
    println!("order {mean:.3} in {SHOTS} shots; largest error of the finer step {worst:.1e} m/s");
    assert!((0.9..1.1).contains(&mean), "{mean} {orders:?}");
    assert!(worst < 0.05, "{worst}");
}

const SHOTS: usize = 100;

/// The law of a group is that of the step: one step whose impact lies where it begins makes the same velocities, for every law.
#[test]
fn the_law_of_a_group_is_that_of_the_step() {
    for &impact in Impact::ALL {
        let mut input = rack();
        // In contact at the start.
        input.position[0][0] = -2.0 * crate::common::R;
        let h = 1e-9;
        let [mut exact, mut step] = [Method::Events, Method::Nsga].map(|method| {
            let o = Options {
                method,
                impact,
                // As fine as that of the exact method: what closes more slowly is no impact.
                closing_tolerance_speed: 1e-10,
                ..options(h)
            };
            begin(&input, o)
        });
        assert!(advance(&mut exact, 1).is_none() && advance(&mut step, 1).is_none());
        let apart = apart(&exact, &step);
        assert!(apart < 5e-7, "{impact:?}: {apart:e}");
        assert!(exact.state.velocity[0].x < 0.0, "{impact:?}");
    }
}
