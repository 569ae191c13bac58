//! Overlaps of a start, and nearest images in a periodic box.

use carom_geom::{overlaps, DVec3, Overlap, Periodic, Shape};

/// At most `cap` overlaps, without meshes and images.
fn found(x: &[DVec3], radius: &[f64], walls: &[Shape], cap: usize) -> Vec<Overlap> {
    overlaps(
        x,
        radius,
        walls,
        Vec::new(),
        &Periodic::default(),
        1e-9,
        cap,
    )
}

#[test]
fn touching_is_not_overlapping_and_all_overlaps_are_named() {
    let x = [
        DVec3::new(0.0, 0.0, 1.0),
        DVec3::new(2.0, 0.0, 1.0),
        DVec3::new(3.9, 0.0, 0.5),
    ];
    let walls = [Shape::HalfSpace {
        point: DVec3::ZERO,
        normal: DVec3::Z,
    }];
    let all = found(&x, &[1.0; 3], &walls, 10);
    assert_eq!(
        all.iter().map(|o| (o.a, o.b)).collect::<Vec<_>>(),
        [(1, 2), (2, 3)]
    );
    assert_eq!(all[1].gap, -0.5);
    assert_eq!(found(&x, &[1.0; 3], &walls, 1).len(), 1);
    assert!(found(&x, &[1.0; 3], &walls, 0).is_empty());
    assert!(found(&x[..2], &[1.0 + 1e-10; 2], &walls, 10).is_empty());
}

#[test]
fn a_heap_of_coincident_balls_stops_at_the_cap() {
    let n = 50_000;
    let found = found(&vec![DVec3::ONE; n], &vec![0.03; n], &[], 20);
    assert_eq!(found.len(), 20);
    assert!(found
        .windows(2)
        .all(|w| (w[0].a, w[0].b) < (w[1].a, w[1].b)));
}

#[test]
fn images_in_a_box() {
    let p = Periodic::new(DVec3::new(0.3, 0.0, 0.0), DVec3::ZERO);
    let lies = |x: f64, low: f64, high: f64| {
        let corner = |x| DVec3::new(x, -1.0, f64::NEG_INFINITY);
        let high = DVec3::new(high, 1.0, f64::INFINITY);
        p.in_box(DVec3::new(x, 0.5, 7.0), corner(low), high)
    };
    for k in [-1e6, -3.0, 0.0, 1.0, 20.0] {
        let shift = 0.3 * k;
        for x in [0.26, 0.32, 0.02, -0.02] {
            assert!(lies(x + shift, 0.25, 0.35), "{x} {k}");
        }
        for x in [0.06, 0.24, -0.06] {
            assert!(!lies(x + shift, 0.25, 0.35), "{x} {k}");
            assert!(lies(x + shift, 7.1, 7.4), "{x} {k}: as long as the period");
            assert!(lies(x + shift, f64::NEG_INFINITY, f64::INFINITY));
        }
    }
    assert!(lies(0.25, 0.25, 0.35) && lies(0.35, 0.25, 0.35));
    let (x, corner) = (DVec3::new(0.3, 2.0, 0.0), DVec3::ONE);
    assert!(!p.in_box(x, -corner, corner), "other axes do not repeat");
    assert!(Periodic::default().in_box(corner, -corner, corner));
    assert!(!Periodic::default().in_box(1.1 * corner, -corner, corner));
}
