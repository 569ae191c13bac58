//! Threads change no bit of a solution; another thread can end a solve.

use carom_solve::problem::Problem;
use carom_solve::solver::{by_name, solve, Outcome, Settings};
use carom_solve::{team, Bounds};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Contacts on a square lattice of `side`, coupled with those beside them in every pair of like rows.
fn lattice(side: usize, coupling: f64) -> Problem {
    let contacts = side * side;
    let (mut ptr, mut col, mut values) = (vec![0i64], Vec::new(), Vec::new());
    for i in 0..contacts {
        let (x, y) = (i / side, i % side);
        for r in 0..3 {
            let mut near = vec![(i, 1.0)];
            for (dx, dy) in [(-1isize, 0isize), (0, -1), (0, 1), (1, 0)] {
                let (p, q) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
                if p < side && q < side {
                    near.push((p * side + q, coupling));
                }
            }
            near.sort_by_key(|n| n.0);
            for (j, w) in near {
                col.push((3 * j + r) as i64);
                values.push(w);
            }
            ptr.push(col.len() as i64);
        }
    }
    let q: Vec<f64> = (0..3 * contacts)
        .map(|k| ((k * k + 7 * k) % 1013) as f64 / 1013.0 - 0.6)
        .collect();
    let bounds = vec![
        Bounds {
            sliding: 0.4,
            ..Bounds::default()
        };
        contacts
    ];
    Problem::from_csr(&ptr, &col, &values, &q, 3, &bounds)
        .expect("a good problem")
        .0
}

fn run(problem: &Problem, name: &str, settings: Settings<'_>) -> (Vec<f64>, Outcome) {
    let mut r = vec![0.0; problem.rows()];
    let mut solver = by_name(name).expect("a solver");
    let outcome = solve(problem, solver.as_mut(), settings, &mut r);
    (r, outcome)
}

#[test]
fn threads_change_no_bit() {
    let problem = lattice(70, -0.2);
    for name in ["gauss-seidel", "auto"] {
        let of = |threads| {
            let settings = Settings {
                threads,
                ..Settings::default()
            };
            let (r, outcome) = run(&problem, name, settings);
            assert!(outcome.converged, "{name}: {}", outcome.err);
            let bits: Vec<u64> = r.iter().map(|v| v.to_bits()).collect();
            (bits, outcome.iterations)
        };
        let one = of(1);
        for threads in 2..=8 {
            assert_eq!(one, of(threads), "{name} on {threads} threads");
        }
    }
}

/// No method reaches this.
const NEVER: f64 = 1e-300;

#[test]
fn a_solve_is_ended_from_another_thread() {
    let problem = lattice(70, -0.249);
    for name in ["gauss-seidel", "admm", "auto"] {
        let flag = AtomicBool::new(false);
        let settings = Settings {
            tolerance: NEVER,
            cancel: Some(&flag),
            threads: 2,
            ..Settings::default()
        };
        let wait = Duration::from_millis(100);
        let (began, (r, outcome)) = std::thread::scope(|scope| {
            let began = Instant::now();
            let solving = scope.spawn(|| run(&problem, name, settings));
            std::thread::sleep(wait);
            flag.store(true, Ordering::Relaxed);
            (began, solving.join().expect("no panic"))
        });
        assert!(
            began.elapsed() < Duration::from_secs(5),
            "{name}: {:?}",
            began.elapsed()
        );
        assert!(began.elapsed() >= wait && !outcome.converged);
        assert!(outcome.err.is_finite() && r.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn what_is_cancelled_before_it_begins_does_nothing() {
    let problem = lattice(70, -0.2);
    let flag = AtomicBool::new(true);
    for name in ["gauss-seidel", "auto"] {
        let settings = Settings {
            cancel: Some(&flag),
            ..Settings::default()
        };
        let (r, outcome) = run(&problem, name, settings);
        assert!(!outcome.converged && r.iter().all(|v| *v == 0.0));
    }
}

#[test]
fn a_time_limit_ends_a_round_of_sweeps() {
    let problem = lattice(70, -0.249);
    let began = Instant::now();
    let settings = Settings {
        tolerance: NEVER,
        time_limit: Some(Duration::from_millis(100)),
        ..Settings::default()
    };
    let (_, outcome) = run(&problem, "gauss-seidel", settings);
    assert!(!outcome.converged);
    assert!(began.elapsed() < Duration::from_secs(5));
}

/// Stages follow each other whatever thread takes which task, and rounds end where they are told to.
#[test]
fn stages_wait_for_the_tasks_before_them() {
    let stages = [0, 5, 5, 6, 14];
    for threads in 1..=8 {
        let done = AtomicUsize::new(0);
        let work = |round: usize, task: usize| {
            let first = [0, 5, 6][usize::from(task >= 5) + usize::from(task >= 6)];
            let before = done.load(Ordering::SeqCst);
            assert!(
                before >= 14 * round + first,
                "{task} of round {round} after {before}"
            );
            if task == 2 {
                std::thread::sleep(Duration::from_millis(1));
            }
            done.fetch_add(1, Ordering::SeqCst);
        };
        let rounds = team::run_until(threads, 20, &stages, work, |round| round == 6);
        assert_eq!(
            (rounds, done.into_inner()),
            (7, 7 * 14),
            "{threads} threads"
        );
    }
}

/// A team within the tasks of a team is one thread: a thread that waited within its task was given a share in the team that waited for
/// this task, and neither ended (in one of some hundred rounds on three threads and more).
#[test]
fn teams_within_teams_end() {
    let expected: Vec<usize> = (0..16).map(|k| 4 * 4950 * k).collect();
    for round in 0..2_000 {
        let threads = 2 + round % 5;
        let sums = team::map(threads, (0..16).collect(), |k: usize| {
            let sum = AtomicUsize::new(0);
            team::run(threads, 4, &[0, 10, 50, 100], |i| {
                sum.fetch_add(i * k, Ordering::Relaxed);
            });
            sum.into_inner()
        });
        assert_eq!(sums, expected);
    }
}

/// A task that panics ends the team, and the panic is that of the task or of a thread that heard of it.
#[test]
fn a_panic_ends_the_team() {
    for threads in [1, 2, 4] {
        let outcome = std::panic::catch_unwind(|| {
            team::run(threads, 3, &[0, 8, 16], |task| {
                assert!(task != 11, "task 11")
            });
        });
        assert!(outcome.is_err(), "{threads} threads");
    }
    // The pool is none the worse.
    assert_eq!(team::map(4, vec![1, 2, 3], |x| 2 * x), [2, 4, 6]);
}

#[test]
fn shares_reach_every_place_once_and_join_in_their_order() {
    for count in [0, 1, 2_048, 2_049, 10_000] {
        let given: Vec<f64> = (0..count).map(|k| 1.0 / f64::from(k + 1)).collect();
        let of = |threads| {
            let mut seen = vec![0usize; count as usize];
            let whole = (&mut seen[..], (&given[..], &given[..]));
            let work = |first, (seen, (given, same)): (&mut [usize], (&[f64], &[f64]))| {
                for (k, place) in seen.iter_mut().enumerate() {
                    *place += first + k + 1;
                }
                assert_eq!(given, same);
                (vec![first], given.iter().sum::<f64>())
            };
            let join = |mut a: (Vec<usize>, f64), b: (Vec<usize>, f64)| {
                a.0.extend(b.0);
                (a.0, a.1 + b.1)
            };
            let (firsts, sum) = team::reduce(threads, count as usize, whole, work, join);
            assert!(firsts.is_sorted() && seen.iter().enumerate().all(|(k, s)| *s == k + 1));
            (firsts, sum.to_bits())
        };
        let one = of(1);
        assert!([2, 3, 8].iter().all(|&threads| of(threads) == one));
    }
}
