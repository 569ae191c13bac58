//! In which order contacts are swept, by how many threads, and who is named first: the same bits, or the same solution.

use super::*;

#[test]
fn the_bits_do_not_depend_on_threads_or_instructions() {
    let p = pile(21, 10, 1.0);
    let mut first = sweeps(&p, 1);
    let shape = first.shape();
    assert!(
        shape.chunks > 4 && shape.stages > 2 && shape.between > 100,
        "{shape:?}"
    );
    first.sweep(7);
    let expected = bits(&first);
    let left = residual(&first);
    assert!(left > 1e-6 && left.is_finite());
    for threads in 2..=8 {
        let mut s = sweeps(&p, threads);
        s.sweep(3);
        s.sweep(4);
        assert!(bits(&s) == expected, "{threads} threads");
        assert_eq!(residual(&s).to_bits(), left.to_bits());
    }
    for threads in [1, 3] {
        let mut s = sweeps(&p, threads);
        s.instructions = Instructions::Scalar;
        s.sweep(7);
        assert!(bits(&s) == expected, "scalar, {threads} threads");
    }
    // With impulses scaled on the way.
    let settle = |threads, instructions: Option<Instructions>, rescale| {
        let mut s = sweeps(&p, threads);
        s.instructions = instructions.unwrap_or(s.instructions);
        s.settle(&Goal {
            tolerance: 1e-12,
            floor: 0.0,
            scale: 0.0,
            closing: 1e-12,
            worst: 1.0,
            penalty_scale: 0.5,
            patience: usize::MAX,
            most: 24,
            had: 0,
            rescale,
            weighed: false,
            calm: 1.0,
        });
        bits(&s)
    };
    let scaled = settle(1, None, 6);
    assert!(scaled != settle(1, None, usize::MAX));
    for (threads, instructions) in [(3, None), (8, None), (3, Some(Instructions::Scalar))] {
        let found = settle(threads, instructions, 6);
        assert!(found == scaled, "{threads} threads, {instructions:?}");
    }
}

/// Blocks between chunks: the whole still converges to a solution, and names of bodies and contacts do not matter for it.
#[test]
fn a_pile_in_many_chunks_is_solved_whatever_the_names() {
    let p = pile(22, 8, 0.4);
    let mut s = sweeps(&p, 2);
    assert!(s.shape().between > 0);
    let (_, left) = solve(&mut s, 1e-13, 100, 2000);
    assert!(left <= 1e-13, "{left:e}");
    let mut q = Problem {
        bodies: p.bodies.iter().rev().copied().collect(),
        places: p.places.iter().rev().copied().collect(),
        contacts: p.contacts.iter().rev().copied().collect(),
    };
    let last = p.bodies.len() as u32 - 1;
    for c in &mut q.contacts {
        for body in [&mut c.a, &mut c.b] {
            if *body != WORLD {
                *body = last - *body;
            }
        }
    }
    // The solution under the other names has no residual there.
    let mut renamed = sweeps(&q, 2);
    let mut impulses = s.impulses();
    impulses.reverse();
    renamed.warm_start(&impulses);
    let left = residual(&renamed);
    assert!(left < 1e-12, "{left:e}");
    // Without places the order of the sweep is another one, the residual of the solution is the same.
    let mut plain = Sweeps::new(&p.bodies, &p.contacts, None, 2).expect("a good problem");
    plain.warm_start(&s.impulses());
    assert!(residual(&plain) < 1e-12);
}

/// A problem of many contacts, and the same with the sides of some exchanged.
fn exchanged() -> [Problem; 2] {
    let [one, mut other] = [0; 2].map(|_| pile(23, 8, 1.0));
    let inner = other.contacts.iter_mut().filter(|c| c.b != WORLD);
    for c in inner.step_by(3) {
        std::mem::swap(&mut c.a, &mut c.b);
        (c.normal, c.slip) = (scaled(-1.0, c.normal), scaled(-1.0, c.slip));
    }
    [one, other]
}

/// Read by one thread and by three, into memory of another problem.
#[test]
fn impulses_come_back_in_the_order_of_the_contacts() {
    let [_, p] = exchanged();
    let mut rng = Rng(24);
    let given: Vec<[f64; 3]> = p.contacts.iter().map(|_| rng.vector(1.0)).collect();
    for threads in [1, 3] {
        let mut s = sweeps(&p, threads);
        s.warm_start(&given);
        let (mut impulses, mut velocities) = (vec![[9.0; 3]; 5], vec![[9.0; 6]; 100_000]);
        s.impulses_into(&mut impulses);
        s.velocities_into(&mut velocities);
        assert!(impulses == given);
        assert_eq!(velocities.len(), p.bodies.len());
        // Momentum of the contacts with the world alone: the others give and take.
        for k in 0..3 {
            let sum: f64 = velocities
                .iter()
                .zip(&p.bodies)
                .map(|(u, b)| u[k] / b.inv_mass)
                .sum();
            let outer = p.contacts.iter().zip(&given).filter(|(c, _)| c.b == WORLD);
            let expected: f64 = outer.map(|(_, r)| r[k]).sum();
            assert!((sum - expected).abs() < 1e-9, "{sum} and {expected}");
        }
        // Made with what it starts from: the same.
        let mut made = sweeps(&heap(62, 50, 0.3), threads);
        made.renew_from(&p.bodies, &p.contacts, Some(&p.places), &given)
            .expect("a good problem");
        assert!(bits(&made) == bits(&s));
        made.sweep(3);
        s.sweep(3);
        assert!(bits(&made) == bits(&s));
    }
}

#[test]
fn which_side_is_named_first_changes_no_motion() {
    let [one, other] = exchanged();
    let (mut s, mut t) = (sweeps(&one, 1), sweeps(&other, 1));
    s.sweep(9);
    t.sweep(9);
    assert!(s.velocities() == t.velocities());
    let both = one.contacts.iter().zip(&other.contacts);
    for ((c, d), (x, y)) in both.zip(s.impulses().into_iter().zip(t.impulses())) {
        assert!(x == if c.a == d.a { y } else { scaled(-1.0, y) });
    }
}

/// One ball with more contacts than groups can be open at a time.
#[test]
fn a_hub_of_many_contacts() {
    let mut rng = Rng(71);
    let small = Body {
        inv_mass: 1.0,
        inv_inertia: 40.0,
        radius: 0.25,
    };
    let hub = Body {
        inv_mass: 1e-2,
        inv_inertia: 1e-3,
        radius: 5.0,
    };
    let bodies: Vec<Body> = std::iter::once(hub)
        .chain((0..200).map(|_| small))
        .collect();
    let contacts: Vec<Contact> = (1..=200)
        .map(|b| {
            let n = rng.unit();
            touch(&mut rng, 0, b, n, 0.3)
        })
        .collect();
    let mut s = Sweeps::new(&bodies, &contacts, None, 1).expect("a good problem");
    let (_, left) = solve(&mut s, 1e-14, 20, 5000);
    assert!(left <= 1e-14, "{left:e}");
    let mut other = Sweeps::new(&bodies, &contacts, None, 1).expect("a good problem");
    other.instructions = Instructions::Scalar;
    s.warm_start(&vec![[0.0; 3]; 200]);
    s.sweep(5);
    other.sweep(5);
    assert!(bits(&s) == bits(&other));
}

/// The memory of another problem, also after an error, changes nothing.
#[test]
fn renewed_sweeps_are_new_ones() {
    let (p, q) = (pile(22, 8, 0.4), heap(62, 50, 0.3));
    let mut s = sweeps(&p, 3);
    s.sweep(2);
    for other in [&q, &p, &q] {
        let mut bad = other.contacts.clone();
        bad[1].friction = -1.0;
        let places = Some(&other.places[..]);
        let none = vec![[0.0; 3]; bad.len()];
        let refused = s.renew_from(&other.bodies, &bad, places, &none);
        assert_eq!(refused, Err(SpheresError::Contact { contact: 1 }));
        s.sweep(1);
        assert_eq!(residual(&s), 0.0);
        assert_eq!(
            (s.impulses().len(), s.velocities().len(), s.shape().stages),
            (0, 0, 0)
        );
        s.renew_from(&other.bodies, &other.contacts, places, &none)
            .expect("a good problem");
        let mut new = sweeps(other, 1);
        s.sweep(4);
        new.sweep(4);
        assert!(bits(&s) == bits(&new));
    }
}
