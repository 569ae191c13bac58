//! Where bodies press one another the default scheme takes over, and gives back.

use crate::common::{balls, on_floor, G, R};
use crate::{advance, begin, near, options, run};
use carom_core::options::Method;
use carom_core::record::TimedImpact;
use carom_core::transition::{Kind, Mode, Transition};
use carom_core::wall::{Disc, Rectangle, Shape};
use carom_core::{ModelInput, Options, Simulation};
use glam::DVec3;

fn stepped(input: &ModelInput, until: f64, pressing_step: f64) -> Simulation {
    let o = Options {
        pressing_step,
        ..options(until)
    };
    let mut s = begin(input, o);
    let outcome = advance(&mut s, 1);
    assert!(outcome.is_none(), "{outcome:?}");
    s
}

/// Two balls at a cushion, one of them turning so that it climbs on the other: they press until its spin is lost.
fn at_a_cushion() -> ModelInput {
    let planes = [
        ([0.0; 3], [0.0, 0.0, 1.0]),
        ([R, 0.0, 0.0], [-1.0, 0.0, 0.0]),
    ];
    let mut input = balls(
        &[[0.0, 0.0, R], [-2.0 * R, 0.0, R], [-0.5, 0.3, R]],
        &planes,
    );
    input.gravity = [0.0, 0.0, -G];
    input.plane_material = vec![1, 2];
    let cushion = [0.14, 0.85, 0.0, 0.0, 0.0];
    input.laws = vec![
        (0, 0, [0.06, 0.93, 0.0, 0.0, 0.0]),
        (0, 1, [0.2, 0.5, 0.0, 0.0, 0.0]),
        (0, 2, cushion),
    ];
    input.angular_velocity[1] = [0.0, 50.0, 0.0];
    input.velocity[2] = [0.0, -0.2, 0.0];
    input
}

fn rows(s: &mut Simulation) -> Vec<Transition> {
    s.take_block().transitions
}

/// The steps that take over converge to one motion, with order 1, and `nsga` alone converges to the same.
#[test]
fn steps_take_over_and_give_back() {
    let (input, until) = (at_a_cushion(), 0.5);
    let ends = |s: &Simulation| s.state.position.clone();
    let mut finest = stepped(&input, until, 1e-6);
    let apart = |a: &[DVec3]| {
        let exact = ends(&finest);
        let far = a.iter().zip(&exact).map(|(a, b)| (*a - *b).length());
        far.fold(0.0, f64::max)
    };
    let [coarse, fine] = [1e-3, 1e-4].map(|h| apart(&ends(&stepped(&input, until, h))));
    assert!(fine < 0.3 * coarse && coarse < 1e-3, "{coarse:e} {fine:e}");
    let o = Options {
        method: Method::Nsga,
        ..options(1e-5)
    };
    let mut alone = begin(&input, o);
    assert!(advance(&mut alone, 50_000).is_none());
    assert!(apart(&ends(&alone)) < 1e-5, "{:e}", apart(&ends(&alone)));
    let m = finest.monitors.clone();
    assert!(
        m.handovers >= 1 && m.stepped > 0.01 && m.stepped < 0.4,
        "{m:?}"
    );
    let rows = rows(&mut finest);
    let of = |kind: Kind| rows.iter().filter(|t| t.kind == kind).collect::<Vec<_>>();
    let press = of(Kind::Press)[0];
    assert_eq!((press.time, press.modes[1]), (0.0, Mode::Stepped));
    let time: f64 = of(Kind::Release).last().expect("it ends").time;
    assert!((time - m.stepped).abs() < 1e-2, "{time} {}", m.stepped);
}

/// What presses elsewhere changes nothing of a ball, whenever reports are due: neither its rows nor its way.
#[test]
fn others_go_on_exactly() {
    let input = at_a_cushion();
    let mut alone = on_floor([0.2, 0.5, 0.0, 0.0, 0.0]);
    (alone.position[0], alone.velocity[0]) = (input.position[2], input.velocity[2]);
    let place = run(&alone, 0.5, 1).state.position[0];
    let slip_ends = 2.0 / 7.0 * 0.2 / (0.2 * G);
    for reports in [1, 3, 50, 2500, 5000] {
        let mut s = run(&input, 0.5, reports);
        assert!(s.monitors.stepped > 0.01 && s.monitors.handovers == 1);
        assert!((s.state.position[2] - place).length() < 1e-13, "{reports}");
        let rows = rows(&mut s);
        let own: Vec<_> = rows.iter().filter(|row| row.body == 2).collect();
        let [row] = own[..] else {
            panic!("{reports}: {own:?}")
        };
        assert_eq!(
            (row.kind, row.modes),
            (Kind::SlipEnd, [Mode::Slide, Mode::Roll])
        );
        assert!(
            (row.time - slip_ends).abs() < 1e-14,
            "{reports}: {}",
            row.time
        );
    }
}

/// A ball that turns pushes two frozen ones: all three press from the start until all roll, whenever reports are due.
#[test]
fn rows_of_what_presses_do_not_depend_on_reports() {
    let row = [0.0, 2.0 * R, 4.0 * R].map(|x| [x, 0.0, R]);
    let mut input = balls(&row, &[([0.0; 3], [0.0, 0.0, 1.0])]);
    input.gravity = [0.0, 0.0, -G];
    input.laws = vec![
        (0, 0, [0.06, 0.93, 0.0, 0.0, 0.0]),
        (0, 1, [0.2, 0.5, 0.0, 0.0, 0.0]),
    ];
    input.angular_velocity[0] = [0.0, 100.0, 0.0];
    let told = [1, 4, 50, 5000, 10000].map(|reports| {
        let rows = rows(&mut run(&input, 1.0, reports));
        let times: Vec<_> = rows.iter().map(|row| row.time).collect();
        let told: Vec<_> = rows
            .iter()
            .map(|row| (row.kind, row.body, row.modes))
            .collect();
        (told, times)
    });
    let press = |body| (Kind::Press, body, Mode::Stepped);
    let first: Vec<_> = told[0].0[..3]
        .iter()
        .map(|&(kind, body, modes)| (kind, body, modes[1]))
        .collect();
    assert_eq!(first, [press(0), press(1), press(2)]);
    assert_eq!(told[0].1[..3], [0.0; 3]);
    for (other, times) in &told[1..] {
        assert_eq!(*other, told[0].0);
        for (a, b) in times.iter().zip(&told[0].1) {
            assert!((a - b).abs() < 2e-4, "{a} {b}");
        }
    }
}

/// A ball hits one that presses another: from the time at which they touch it is stepped too, and the finer the steps the better all is known.
#[test]
fn what_presses_is_hit_when_it_is_met() {
    let mut input = at_a_cushion();
    input.position[2] = [-0.5, 0.02, R];
    input.velocity[2] = [3.0, 0.0, 0.0];
    let found = [1e-3, 1e-4, 1e-6].map(|h| {
        let mut s = stepped(&input, 0.2, h);
        assert!(
            s.monitors.penetration_relative < 1e-9,
            "{:e}",
            s.monitors.penetration_relative
        );
        let place = s.state.position[2];
        let block = s.take_block();
        let mut rows = block.transitions.iter();
        let met = rows.find(|row| row.kind == Kind::Press && row.body == 2);
        let met = met.expect("it meets one that presses");
        assert_eq!(met.other, Some(1));
        let hit = |row: &&TimedImpact| (row.impact.a, row.impact.b) == (1, 2);
        let late = block.impacts.iter().find(hit).expect("it hits").time - met.time;
        assert!(late > 0.0 && late <= h, "{late:e} {h:e}");
        (met.time, place)
    });
    let [coarse, fine, exact] = found;
    let apart = |a: &(f64, DVec3)| ((a.0 - exact.0).abs(), (a.1 - exact.1).length());
    let (coarse, fine) = (apart(&coarse), apart(&fine));
    assert!(
        fine.0 < 0.3 * coarse.0 + 1e-9 && fine.1 < 0.3 * coarse.1 + 1e-8,
        "{coarse:?} {fine:?}"
    );
}

/// A ball falls on one that lies on a bed, level or hardly not: stepped or exact, the bed answers in the same impact.
#[test]
fn what_presses_answers_with_what_holds_it() {
    for e in [0.0, 0.5, 0.9] {
        let [level, tilted] = [0.0f64, 1e-6].map(|tilt| {
            let (sin, cos) = tilt.sin_cos();
            let n = [sin, 0.0, cos];
            let on = DVec3::from(n) * R;
            let over = on + DVec3::new(0.6 * R, 0.1 * R, 3.0 * R);
            let mut input = balls(&[on.to_array(), over.to_array()], &[([0.0; 3], n)]);
            input.gravity = [0.0, 0.0, -G];
            input.laws = vec![
                (0, 0, [0.06, 0.9, 0.0, 0.0, 0.0]),
                (0, 1, [0.2, e, 0.0, 0.0, 0.0]),
            ];
            stepped(&input, 0.12, 1e-5).state.velocity[1]
        });
        assert!((level - tilted).length() < 1e-3, "{e}: {level} {tilted}");
    }
}

/// On a slope nothing has a closed form here: the whole run is steps, and the ball rolls down as it should.
#[test]
fn a_slope_is_stepped() {
    let mut input = on_floor([0.4, 0.5, 0.0, 0.0, 0.0]);
    let (sin, cos) = 0.3f64.sin_cos();
    input.plane_normal[0] = [sin, 0.0, cos];
    input.position[0] = [sin * R, 0.0, cos * R];
    let mut s = stepped(&input, 1.0, 1e-4);
    let way = 0.5 * G * sin / 1.4;
    let x = s.state.position[0] - DVec3::new(sin, 0.0, cos) * R;
    assert!(
        (x.length() - way).abs() < 1e-3 * way,
        "{} {way}",
        x.length()
    );
    assert!((s.monitors.stepped - 1.0).abs() < 1e-12);
    assert_eq!(rows(&mut s)[0].other, Some(1));
}

/// More rolling resistance than friction can balance: the ball slides to rest by friction alone, without turning.
#[test]
fn a_ball_that_skids_is_stepped() {
    let (mu, v) = (0.05, 0.5);
    let input = {
        let mut input = on_floor([mu, 0.5, 0.0, 0.2 * R, 0.0]);
        input.velocity[0] = [v, 0.0, 0.0];
        input.angular_velocity[0] = [0.0, v / R, 0.0];
        input
    };
    let s = stepped(&input, 2.0, 1e-4);
    assert!(s.monitors.stepped > 0.0);
    assert_eq!(s.state.velocity[0].length(), 0.0);
    // Turning ends first, at 0.2 g r/(kappa r^2) less friction's part; the way is that of friction alone.
    let way = v * v / (2.0 * mu * G);
    assert!(
        (s.state.position[0].x - way).abs() < 2e-3 * way,
        "{} {way}",
        s.state.position[0].x
    );
}

/// A ball that comes over an edge slowly, or stands just over it, tips and falls as by `nsga`: face and edge are both closed to the tolerance of gaps.
#[test]
fn a_ball_tips_over_an_edge() {
    let (centre, normal) = (DVec3::ZERO, DVec3::Z);
    let disc = |radius, hole| Disc {
        centre,
        normal,
        radius,
        hole,
    };
    let plate = Rectangle {
        centre,
        normal,
        side: DVec3::X,
        half: [0.5, 0.5],
    };
    // With the place of the edge, and the way out over it.
    let walls = [
        (Shape::Rectangle(plate), 0.5, 1.0),
        (Shape::Disc(disc(0.25 * R, 0.0)), 0.25 * R, 1.0),
        (Shape::Disc(disc(0.5, 2.0 * R)), 2.0 * R, -1.0),
    ];
    for (wall, edge, out) in walls {
        for (over, speed) in [(1e-10, 0.0), (1e-8, 0.0), (-1e-7, 1e-6), (-1e-6, 1e-5)] {
            let mut input = balls(&[[edge + out * over, 0.0, R]], &[]);
            input.gravity = [0.0, 0.0, -G];
            input.laws = vec![(0, 1, [0.3, 0.3, 0.0, 0.0, 0.0])];
            input.walls = vec![(wall, 1)];
            input.velocity[0] = [out * speed, 0.0, 0.0];
            input.angular_velocity[0] = [0.0, out * speed / R, 0.0];
            let ends = [Method::Events, Method::Nsga].map(|method| {
                let mut s = begin(
                    &input,
                    Options {
                        method,
                        ..options(5e-4)
                    },
                );
                assert!(advance(&mut s, 3000).is_none(), "{method:?} {wall:?}");
                s.state.position[0]
            });
            let far = (ends[0] - ends[1]).length();
            assert!(
                ends[1].z < -0.1 && far < 1e-3 * ends[1].length(),
                "{wall:?} {over:e} {speed:e}: {far:e} {ends:?}"
            );
        }
    }
}

/// A small ball on a slope is hit as the run begins: its weight holds it there, in whatever order balls are named and however near the other one is.
#[test]
fn what_is_hit_at_once_knows_its_weight() {
    let hit = |first: usize, gap: f64| {
        let (small, far) = (0.6 * R, [0.0, 1.0, R]);
        let big = -2.0 * (R * small).sqrt() - gap;
        let mut places = vec![[big, 0.0, R], [0.0, 0.0, small]];
        places.insert(2 * (1 - first), far);
        let mut input = balls(&places, &[([0.0; 3], [0.0, 0.0, 1.0])]);
        input.gravity = [0.1 * G, 0.0, -G];
        let laws = [[0.0, 1.0], [0.5, 0.5]].map(|[mu, e]| [mu, e, 0.0, 0.0, 0.0]);
        input.laws = vec![(0, 0, laws[0]), (0, 1, laws[1])];
        input.radius[first + 1] = small;
        input.velocity[first] = [2.0, 0.0, 0.0];
        let s = stepped(&input, 0.01, 1e-5);
        [s.state.velocity[first], s.state.velocity[first + 1]]
    };
    let expected = hit(1, 0.0);
    for found in [hit(0, 0.0), hit(0, 1e-12), hit(1, 1e-12)] {
        for (a, b) in found.into_iter().zip(expected) {
            near(a, b, 1e-9);
        }
    }
}
