//! Block Gauss-Seidel: every contact solved exactly in turn, in an order that follows from the problem alone.

use carom_solve::problem::{natural, BlockMatrix, Problem, RowGroup};
use carom_solve::solver::solve_contact;
use carom_solve::solver::sweep::{ConeSweeps, Order};
use carom_solve::spheres::Instructions;
use carom_solve::Bounds;

fn random(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6364136223846793005)
        .wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// Contacts on a cubic lattice, with their numbers shuffled where asked, each feeling its six neighbours; blocks symmetric,
/// loads of both signs. Kinds: Coulomb with diagonal or any blocks, and, where `mixed`, frictionless contacts, joints and
/// contacts with rolling and spinning rows.
fn problem(side: usize, mixed: bool, shuffle: bool) -> Problem {
    let seed = &mut 5;
    let count = side * side * side;
    let mut name: Vec<usize> = (0..count).collect();
    if shuffle {
        for i in (1..count).rev() {
            name.swap(i, (random(seed) * (i + 1) as f64) as usize);
        }
    }
    let mut row = 0;
    let groups: Vec<RowGroup> = (0..count)
        .map(|_| {
            let kind = if mixed {
                (6.0 * random(seed)) as u32
            } else {
                0
            };
            let on = |yes: bool| if yes { 0.3 } else { 0.0 };
            let bounds = Bounds {
                sliding: on(kind != 1),
                rolling: on(kind >= 4),
                spinning: on(kind == 5),
            };
            let bilateral = kind == 2;
            let dim = if bilateral { 3 } else { bounds.dim() };
            row += dim;
            RowGroup {
                row: row - dim,
                dim,
                bounds: if bilateral { Bounds::default() } else { bounds },
                least: 0.0,
                bilateral,
            }
        })
        .collect();
    let at = |x: usize, y: usize, z: usize| name[(x * side + y) * side + z];
    let mut lists: Vec<Vec<u32>> = (0..count as u32).map(|i| vec![i]).collect();
    for x in 0..side {
        for y in 0..side {
            for z in 0..side {
                for (p, q, r) in [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)] {
                    if p.max(q).max(r) < side {
                        let (i, j) = (at(x, y, z), at(p, q, r));
                        lists[i].push(j as u32);
                        lists[j].push(i as u32);
                    }
                }
            }
        }
    }
    let (mut ptr, mut col) = (vec![0], Vec::new());
    for list in &mut lists {
        list.sort_unstable();
        col.extend_from_slice(list);
        ptr.push(col.len());
    }
    let mut w = BlockMatrix::zeros(&groups, ptr, col);
    for i in 0..count {
        for k in w.ptr[i]..w.ptr[i + 1] {
            let j = w.col[k] as usize;
            let (rows, cols) = (groups[i].dim, groups[j].dim);
            if i == j {
                let coupled = random(seed) < 0.5;
                let block = w.block_mut(i, k);
                for r in 0..rows {
                    block[r * rows + r] = 1.0;
                    for c in 0..r {
                        let value = if coupled {
                            0.1 * (random(seed) - 0.5)
                        } else {
                            0.0
                        };
                        (block[r * rows + c], block[c * rows + r]) = (value, value);
                    }
                }
            } else if i < j {
                let values: Vec<f64> = (0..rows * cols)
                    .map(|_| 0.08 * (random(seed) - 0.5))
                    .collect();
                w.block_mut(i, k).copy_from_slice(&values);
                let other = w.find(j, i).expect("a symmetric pattern");
                let transposed: Vec<f64> = (0..cols * rows)
                    .map(|m| values[(m % rows) * cols + m / rows])
                    .collect();
                w.block_mut(j, other).copy_from_slice(&transposed);
            }
        }
    }
    let q = (0..row).map(|_| random(seed) - 0.6).collect();
    Problem { groups, w, q }
}

fn swept(
    problem: &Problem,
    order: &Order,
    threads: usize,
    how: Instructions,
    count: u32,
) -> Vec<f64> {
    let mut sweeps = ConeSweeps::ordered(problem, threads, order);
    sweeps.instructions = how;
    let mut y = vec![0.0; problem.rows()];
    sweeps.enter(&y);
    for part in [1, 2, count - 3] {
        sweeps.sweep(part, || false);
    }
    sweeps.leave(&mut y);
    y
}

fn bits(y: &[f64]) -> Vec<u64> {
    y.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn neither_threads_nor_instructions_change_a_bit() {
    for (mixed, shuffle) in [(false, false), (true, false), (true, true)] {
        let problem = problem(16, mixed, shuffle);
        for size in [1, 17, 64] {
            let order = Order::coloured(&problem.w, size);
            let one = bits(&swept(&problem, &order, 1, Instructions::Scalar, 10));
            for threads in 1..=8 {
                let many = swept(&problem, &order, threads, Instructions::Widest, 10);
                assert_eq!(one, bits(&many), "{threads} threads, chunks of {size}");
            }
        }
    }
}

/// Each contact in turn by the exact step alone, products row by row.
fn plain(problem: &Problem, order: &Order, count: u32) -> Vec<f64> {
    let mut y = vec![0.0; problem.rows()];
    for _ in 0..count {
        for &i in &order.contacts {
            let i = i as usize;
            let group = &problem.groups[i];
            let mut r = y[group.rows()].to_vec();
            y[group.rows()].fill(0.0);
            let mut b = problem.q[group.rows()].to_vec();
            problem.w.add_row_product(i, &y, &mut b);
            solve_contact(group, problem.w.block(i, problem.w.diagonal[i]), &b, &mut r);
            y[group.rows()].copy_from_slice(&r);
        }
    }
    y
}

#[test]
fn a_sweep_is_the_exact_step_of_every_contact_in_turn() {
    for (mixed, size) in [(false, 0), (false, 20), (true, 0), (true, 20)] {
        let problem = problem(6, mixed, true);
        let order = match size {
            0 => Order::natural(problem.groups.len()),
            _ => Order::coloured(&problem.w, size),
        };
        let fast = swept(&problem, &order, 2, Instructions::Widest, 5);
        for (x, y) in fast.iter().zip(plain(&problem, &order, 5)) {
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
    }
}

#[test]
fn sweeps_in_any_order_find_the_solution() {
    let problem = problem(9, true, true);
    let natural = swept(
        &problem,
        &Order::natural(problem.groups.len()),
        1,
        Instructions::Widest,
        60,
    );
    let mut u = vec![0.0; problem.rows()];
    assert!(natural::residual(&problem, &natural, &mut u) < 1e-13);
    let coloured = swept(
        &problem,
        &Order::coloured(&problem.w, 40),
        3,
        Instructions::Widest,
        60,
    );
    assert!(natural::residual(&problem, &coloured, &mut u) < 1e-13);
}

/// Few contacts are swept as they come, many in chunks, which are those of any number of threads.
#[test]
fn the_order_hangs_on_the_problem_alone() {
    for (side, chunks) in [(13, true), (5, false)] {
        let problem = problem(side, false, true);
        let own = |threads| {
            let mut sweeps = ConeSweeps::new(&problem, threads);
            let mut y = vec![0.0; problem.rows()];
            sweeps.sweep(6, || false);
            sweeps.leave(&mut y);
            bits(&y)
        };
        assert_eq!(own(1), own(8));
        let natural = Order::natural(problem.groups.len());
        let plain = swept(&problem, &natural, 1, Instructions::Widest, 6);
        assert_eq!(own(1) != bits(&plain), chunks);
    }
}

#[test]
fn a_sweep_that_is_stopped_ends_in_the_midst() {
    let problem = problem(13, false, true);
    let mut sweeps = ConeSweeps::new(&problem, 2);
    let mut y = vec![0.0; problem.rows()];
    sweeps.enter(&y);
    let chunks = std::sync::atomic::AtomicUsize::new(0);
    sweeps.sweep(1000, || {
        chunks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= 3
    });
    sweeps.leave(&mut y);
    let moved = y.iter().filter(|v| **v != 0.0).count();
    assert!(moved > 0 && moved < problem.rows() / 2);
}

#[test]
fn a_problem_without_contacts_is_swept() {
    let empty = Problem::default();
    let mut sweeps = ConeSweeps::new(&empty, 4);
    sweeps.sweep(3, || false);
    sweeps.leave(&mut []);
}

/// Contacts on a square lattice, each feels those within `reach`.
fn lattice(side: usize, reach: usize) -> BlockMatrix {
    let groups: Vec<RowGroup> = (0..side * side)
        .map(|row| RowGroup {
            row,
            dim: 1,
            ..RowGroup::default()
        })
        .collect();
    let (mut ptr, mut col) = (vec![0], Vec::new());
    for i in 0..side * side {
        let near = |j: &usize| {
            (i / side).abs_diff(j / side) <= reach && (i % side).abs_diff(j % side) <= reach
        };
        col.extend((0..side * side).filter(near).map(|j| j as u32));
        ptr.push(col.len());
    }
    BlockMatrix::zeros(&groups, ptr, col)
}

#[test]
fn chunks_of_a_stage_do_not_feel_each_other() {
    for (side, reach, size) in [(1, 0, 4), (7, 1, 1), (20, 1, 16), (20, 2, 9), (13, 0, 5)] {
        let w = lattice(side, reach);
        let order = Order::coloured(&w, size);
        let mut all = order.contacts.clone();
        all.sort_unstable();
        assert!(all.iter().enumerate().all(|(i, &j)| i == j as usize));
        assert_eq!(*order.stages.last().unwrap(), order.chunks.len() - 1);
        for stage in order.stages.windows(2) {
            let mut chunk_of = vec![None; w.len()];
            for c in stage[0]..stage[1] {
                let chunk = &order.contacts[order.chunks[c]..order.chunks[c + 1]];
                assert!(!chunk.is_empty() && chunk.len() <= size);
                assert!(chunk.windows(2).all(|x| x[0] < x[1]));
                chunk.iter().for_each(|&i| chunk_of[i as usize] = Some(c));
            }
            for i in 0..w.len() {
                for &j in &w.col[w.ptr[i]..w.ptr[i + 1]] {
                    let (a, b) = (chunk_of[i], chunk_of[j as usize]);
                    assert!(a == b || a.is_none() || b.is_none());
                }
            }
        }
    }
}

#[test]
fn contacts_that_feel_nothing_make_one_stage() {
    let order = Order::coloured(&lattice(10, 0), 8);
    assert_eq!(order.stages, [0, 13]);
    assert_eq!(
        Order::coloured(&BlockMatrix::default(), 8).contacts,
        [0u32; 0]
    );
}
