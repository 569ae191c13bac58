//! Target `solve`: contact problems as data, by every solver.

use crate::draw::Draw;
use carom_solve::problem::{natural, Problem};
use carom_solve::solver::{self, Settings};
use carom_solve::Bounds;
use std::time::{Duration, Instant};

const MOST_CONTACTS: usize = 6;
/// Time that a solve is given, and what it may take at most: sanitizers and a busy machine included.
const GIVEN: Duration = Duration::from_millis(50);
const ADMITTED: Duration = Duration::from_secs(10);

/// `W = G D G^T` of random gradients over few nodes: singular where there are more rows than unknowns.
fn delassus(draw: &mut Draw, n: usize) -> Vec<f64> {
    let unknowns = 1 + draw.below(12);
    let g: Vec<f64> = (0..n * unknowns)
        .map(|_| match draw.byte() {
            k @ 0..=127 => [0.0, 1.0, -1.0, 0.5][usize::from(k % 4)],
            k => f64::from(k) / 64.0 - 3.0,
        })
        .collect();
    let inverse: Vec<f64> = (0..unknowns).map(|_| draw.size(1.0, 3.0)).collect();
    let entry = |i: usize, j: usize| -> f64 {
        (0..unknowns)
            .map(|k| g[i * unknowns + k] * inverse[k] * g[j * unknowns + k])
            .sum()
    };
    (0..n * n).map(|k| entry(k / n, k % n)).collect()
}

/// A problem is refused, or solved, or left unsolved with finite forces; what is called converged is.
pub fn solve(data: &[u8]) {
    let mut draw = Draw::new(data);
    let dimension = draw.one_of(&[2, 3, 3, 5, 6, 6, 4]);
    let contacts = draw.below(MOST_CONTACTS + 1);
    let n = contacts * dimension;
    let bounds: Vec<Bounds> = (0..contacts)
        .map(|_| Bounds {
            sliding: draw.one_of(&[0.0, 0.3, 1.0]) * draw.size(1.0, 2.0),
            rolling: draw.one_of(&[0.0, 0.01, 0.1]) * draw.size(1.0, 2.0),
            spinning: draw.one_of(&[0.0, 0.01, 0.1]) * draw.size(1.0, 2.0),
        })
        .collect();
    let w = match draw.below(4) {
        0 => (0..n * n).map(|_| draw.number(-1.0, 1.0)).collect(),
        _ => delassus(&mut draw, n),
    };
    let mut q: Vec<f64> = (0..n).map(|_| draw.number(-1.0, 1.0)).collect();
    // Compressed rows without their zeros.
    let (mut ptr, mut col, mut values) = (vec![0i64], Vec::new(), Vec::new());
    for i in 0..n {
        for j in 0..n {
            if w[i * n + j] != 0.0 {
                col.push(j as i64);
                values.push(w[i * n + j]);
            }
        }
        ptr.push(col.len() as i64);
    }
    if draw.rarely(16) {
        // Damaged as a file may be.
        let wrong = i64::from(draw.byte()) - 8;
        match draw.below(5) {
            0 => ptr[draw.below(n + 1)] = wrong,
            1 if !col.is_empty() => col[draw.below(1.max(values.len().min(255)))] = wrong,
            2 => drop(values.pop()),
            3 => drop(q.pop()),
            _ => drop(ptr.pop()),
        }
    }
    let Ok((problem, map)) = Problem::from_csr(&ptr, &col, &values, &q, dimension, &bounds) else {
        return;
    };
    let start: Vec<f64> = match draw.below(3) {
        0 => (0..q.len()).map(|_| draw.number(-1.0, 1.0)).collect(),
        _ => vec![0.0; q.len()],
    };
    let names: Vec<&str> = solver::SOLVERS.iter().map(|s| s.0).collect();
    let name = draw.one_of(&names);
    let mut method = solver::by_name(name).expect("listed");
    let settings = Settings {
        tolerance: draw.one_of(&[1e-8, 1e-4, 1e-12, 1e-300, 1e-1]),
        max_iterations: draw.one_of(&[0, 1, 7, 50]),
        time_limit: Some(GIVEN),
        cancel: None,
        threads: 1 + draw.below(2),
    };
    let mut r = map.enter(&start);
    let began = Instant::now();
    let outcome = solver::solve(&problem, method.as_mut(), settings, &mut r);
    let told = format!("{name} {settings:?}: {outcome:?}\n{r:?}");
    assert!(began.elapsed() < ADMITTED, "{:?}, {told}", began.elapsed());
    assert!(
        r.iter().all(|v| v.is_finite()) && !outcome.err.is_nan(),
        "{told}"
    );
    let mut u = vec![0.0; problem.rows()];
    let err = natural::residual(&problem, &r, &mut u);
    assert!(
        !outcome.converged || err <= settings.tolerance * (1.0 + 1e-6),
        "{err:e}, {told}"
    );
    let given = map.leave(&r);
    assert!(
        given.len() == n && given.iter().all(|v| v.is_finite()),
        "{told}"
    );
}
