//! What sweeps keep: symmetry, momentum, warm starts; and what they refuse.

use super::*;

#[test]
fn exchanged_sides_are_the_same_contact() {
    let p = heap(31, 30, 0.5);
    let mut q = heap(31, 30, 0.5);
    for c in &mut q.contacts {
        (c.a, c.b) = (c.b, c.a);
        c.normal = scaled(-1.0, c.normal);
        c.slip = scaled(-1.0, c.slip);
    }
    let (mut s, mut t) = (sweeps(&p, 1), sweeps(&q, 1));
    s.sweep(20);
    t.sweep(20);
    for (x, y) in s.velocities().concat().iter().zip(t.velocities().concat()) {
        assert!((x - y).abs() < 1e-12);
    }
    for (r, o) in s.impulses().concat().iter().zip(t.impulses().concat()) {
        assert!((r + o).abs() < 1e-12);
    }
}

#[test]
fn momentum_is_conserved_and_fixed_bodies_stay() {
    let mut p = heap(41, 60, 0.4);
    let fixed = p.bodies.len() - 1;
    p.contacts
        .retain(|c| c.a != WORLD && c.b != WORLD && c.a as usize != fixed && c.b as usize != fixed);
    // Lever arms that meet: r_a + r_b is the distance, so that angular momentum is conserved too.
    for c in &mut p.contacts {
        let d = [0, 1, 2].map(|k| p.places[c.a as usize][k] - p.places[c.b as usize][k]);
        c.normal = scaled(1.0 / dot(d, d).sqrt(), d);
    }
    let mut s = sweeps(&p, 1);
    s.sweep(30);
    let (mut momentum, mut size) = ([0.0; 3], 0.0f64);
    for (b, u) in p
        .bodies
        .iter()
        .zip(s.velocities())
        .filter(|(b, _)| b.inv_mass > 0.0)
    {
        for k in 0..3 {
            momentum[k] += u[k] / b.inv_mass;
            size += u[k].abs() / b.inv_mass;
        }
    }
    assert!(
        size > 1.0 && dot(momentum, momentum).sqrt() < 1e-13 * size,
        "{momentum:?} of {size}"
    );
    let with = heap(41, 60, 0.4);
    let mut s = sweeps(&with, 1);
    s.sweep(30);
    assert_eq!(s.velocities()[fixed], [0.0; 6]);
}

/// Two balls that just touch: also the angular momentum about the origin is that of before.
#[test]
fn angular_momentum_is_conserved() {
    let mut rng = Rng(5);
    let places = [[0.3, -0.2, 0.1], [0.3, 0.7, 0.1]];
    let bodies = [0.4, 0.5].map(|radius| Body {
        inv_mass: 1.0,
        inv_inertia: 2.5 / (radius * radius),
        radius,
    });
    let contact = touch(&mut rng, 0, 1, [0.0, -1.0, 0.0], 0.3);
    let mut s = Sweeps::new(&bodies, &[contact], Some(&places), 1).expect("a good problem");
    s.sweep(1);
    let mut moment = [0.0; 3];
    for ((b, x), u) in bodies.iter().zip(places).zip(s.velocities()) {
        let orbit = cross(x, [u[0], u[1], u[2]]);
        for k in 0..3 {
            moment[k] += orbit[k] / b.inv_mass + u[3 + k] / b.inv_inertia;
        }
    }
    assert!(s.impulses()[0][0].abs() > 1e-3, "no friction");
    assert!(dot(moment, moment).sqrt() < 1e-15, "{moment:?}");
}

#[test]
fn friction_zero_gives_normal_impulses() {
    let p = heap(51, 40, 0.0);
    let mut s = sweeps(&p, 1);
    s.sweep(40);
    for (c, r) in p.contacts.iter().zip(s.impulses()) {
        let across = [0, 1, 2].map(|k| r[k] - dot(r, c.normal) * c.normal[k]);
        assert!(dot(across, across).sqrt() <= 1e-15 * (1.0 + dot(r, r)));
        assert!(dot(r, c.normal) >= 0.0);
    }
}

#[test]
fn a_warm_start_goes_on_where_it_was_left() {
    let p = heap(61, 50, 0.5);
    let mut s = sweeps(&p, 1);
    s.sweep(25);
    let mut warm = sweeps(&p, 2);
    warm.warm_start(&s.impulses());
    for (x, y) in s
        .velocities()
        .concat()
        .iter()
        .zip(warm.velocities().concat())
    {
        assert!((x - y).abs() < 1e-13, "{x} and {y}");
    }
    assert!((residual(&s) - residual(&warm)).abs() < 1e-13);
    // `set_contacts` with the numbers of another problem on the same pairs: what a new one has.
    let mut other = heap(61, 50, 0.2);
    for c in &mut other.contacts {
        c.slip = scaled(0.5, c.slip);
    }
    s.warm_start(&vec![[0.0; 3]; p.contacts.len()]);
    s.set_contacts(&other.contacts).expect("the same pairs");
    let mut new = sweeps(&other, 1);
    s.sweep(9);
    new.sweep(9);
    assert!(bits(&s) == bits(&new));
}

#[test]
fn nothing_is_no_problem() {
    let p = heap(81, 5, 0.5);
    let none: [Contact; 0] = [];
    for bodies in [&p.bodies[..], &p.bodies[5..], &[]] {
        let mut s = Sweeps::new(bodies, &none, None, 4).expect("a good problem");
        s.sweep(3);
        s.refresh();
        assert_eq!(solve(&mut s, 0.0, 1, 10), (0, 0.0));
        assert_eq!(s.velocities(), vec![[0.0; 6]; bodies.len()]);
        assert!(s.impulses().is_empty());
    }
}

#[test]
fn bad_input_is_named() {
    let p = heap(91, 20, 0.5);
    let last = p.bodies.len() as u32 - 1;
    let with = |change: &dyn Fn(&mut Problem)| {
        let mut q = heap(91, 20, 0.5);
        change(&mut q);
        Sweeps::new(&q.bodies, &q.contacts, Some(&q.places), 2).map(|_| ())
    };
    assert_eq!(with(&|_| ()), Ok(()));
    assert_eq!(
        with(&|q| q.bodies[3].inv_mass = -1.0),
        Err(SpheresError::Body { body: 3 })
    );
    assert_eq!(
        with(&|q| q.bodies[2].radius = f64::NAN),
        Err(SpheresError::Body { body: 2 })
    );
    assert_eq!(
        with(&|q| q.bodies[2].inv_mass = 0.0),
        Err(SpheresError::Body { body: 2 })
    );
    assert_eq!(
        with(&|q| q.places[4][1] = f64::NAN),
        Err(SpheresError::Places { body: 4 })
    );
    assert_eq!(
        with(&|q| q.places.truncate(3)),
        Err(SpheresError::Places { body: 3 })
    );
    let index = SpheresError::Index {
        contact: 2,
        body: 99,
    };
    assert_eq!(with(&|q| q.contacts[2].b = 99), Err(index));
    for (a, b) in [(3, 3), (last, WORLD), (WORLD, WORLD), (last, last)] {
        let change = |q: &mut Problem| (q.contacts[1].a, q.contacts[1].b) = (a, b);
        assert_eq!(with(&change), Err(SpheresError::Immovable { contact: 1 }));
    }
    assert_eq!(
        with(&|q| q.contacts[0].normal[0] += 0.1),
        Err(SpheresError::Contact { contact: 0 })
    );
    assert_eq!(
        with(&|q| q.contacts[0].slip[2] = f64::INFINITY),
        Err(SpheresError::Contact { contact: 0 })
    );
    assert_eq!(
        with(&|q| q.contacts[5].friction = -0.1),
        Err(SpheresError::Contact { contact: 5 })
    );
    assert!(SpheresError::Index {
        contact: 2,
        body: 99
    }
    .to_string()
    .contains("no body 99"));
    let mut s = sweeps(&p, 1);
    let changed = SpheresError::Changed { contact: 1 };
    assert_eq!(s.set_contacts(&p.contacts[..1]), Err(changed));
}
