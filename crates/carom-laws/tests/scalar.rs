//! Laws of one variable: values, slopes to both sides, refusals.

use carom_laws::{Expression, Scalar};

fn table() -> Scalar {
    Scalar::Table(vec![[0.0, 1.0], [2.0, 5.0], [3.0, 4.0]])
}

fn expression(text: &str) -> Scalar {
    Scalar::Expression(Expression::parse(text).unwrap())
}

#[test]
fn polynomial_by_rising_powers() {
    let p = Scalar::Polynomial(vec![1.0, -2.0, 3.0]);
    assert_eq!(p.value(2.0), 9.0);
    assert_eq!(p.slope(2.0), 10.0);
    assert_eq!(Scalar::Polynomial(vec![4.0]).slope(7.0), 0.0);
}

#[test]
fn table_is_linear_between_constant_outside_and_right_continuous() {
    let values = [
        (-1.0, 1.0),
        (0.0, 1.0),
        (0.5, 2.0),
        (2.0, 5.0),
        (2.5, 4.5),
        (3.0, 4.0),
        (9.0, 4.0),
    ];
    let slopes = [
        (-1.0, 0.0),
        (0.0, 2.0),
        (1.9, 2.0),
        (2.0, -1.0),
        (3.0, 0.0),
        (9.0, 0.0),
    ];
    for (x, y) in values {
        assert_eq!(table().value(x), y, "value at {x}");
    }
    for (x, y) in slopes {
        assert_eq!(table().slope(x), y, "slope at {x}");
    }
}

#[test]
fn slopes_to_the_left_differ_at_kinks_alone() {
    let kink = expression("min(0, 2*(0.15 - t))");
    let smooth = expression("sin(3*t)");
    for (x, left, right) in [
        (0.0, 0.0, 2.0),
        (1.0, 2.0, 2.0),
        (2.0, 2.0, -1.0),
        (3.0, -1.0, 0.0),
    ] {
        assert_eq!((table().slope_before(x), table().slope(x)), (left, right));
    }
    // As steps of 1e-3 reach it.
    for x in [0.15, 0.149 + 1e-3, 150.0 * 1e-3] {
        assert_eq!((kink.slope_before(x), kink.slope(x)), (0.0, -2.0), "{x:e}");
    }
    let late = expression("max(0, t - 0.03)");
    assert_eq!(late.slope_before(0.029 + 1e-3), 0.0);
    let sum = expression("max(0, t - 0.1 - 0.05)");
    assert_eq!((sum.slope_before(0.15), sum.slope(0.15)), (0.0, 1.0));
    let early = 5.0 * 3e-4;
    assert!(early < 0.0015);
    assert_eq!(expression("max(0, t - 0.0015)").slope(early), 1.0);
    // Formulas that end at 1, and that begin there.
    let ends = expression("(1 - t)^1.5").slope(1.0);
    let begins = expression("(t - 1)^1.5").slope_before(1.0);
    assert_eq!((ends, begins), (0.0, 0.0));
    for third in [0.1 + 0.2, 0.3] {
        let table = Scalar::Table(vec![[0.0, 0.0], [0.3, 0.0], [1.0, 0.7]]);
        assert_eq!((table.slope_before(third), table.slope(third)), (0.0, 1.0));
    }
    for x in [0.1, 0.2, 5.0] {
        let apart = (smooth.slope_before(x) - smooth.slope(x)).abs();
        assert!(apart < 9.0 * 2.1 * 8.0 * f64::EPSILON * x, "{apart:e}");
        let p = Scalar::Polynomial(vec![1.0, -2.0, 3.0]);
        assert_eq!(p.slope_before(x), p.slope(x));
    }
}

#[test]
fn constant_is_seen_from_the_form() {
    assert!(Scalar::zero().is_constant() && Scalar::zero().value(3.0) == 0.0);
    assert!(Scalar::Polynomial(vec![2.0, 0.0]).is_constant());
    assert!(!Scalar::Polynomial(vec![2.0, 1.0]).is_constant());
    assert!(Scalar::Table(vec![[1.0, 2.0]]).is_constant());
    assert!(!table().is_constant());
    assert!(expression("2*pi").is_constant());
    assert!(!expression("0*t").is_constant());
}

#[test]
fn the_variable_may_have_any_name() {
    assert_eq!(expression("20*t").value(0.5), 10.0);
    assert_eq!(expression("20*v").slope(0.5), 20.0);
    assert_eq!(expression("3").value(0.5), 3.0);
    assert_eq!(expression("3").slope(0.5), 0.0);
}

#[test]
fn unusable_laws_are_refused_with_the_cure() {
    let refused = [
        (Scalar::Constant(f64::NAN), "not a finite number"),
        (Scalar::Polynomial(vec![]), "at least [c0]"),
        (
            Scalar::Polynomial(vec![0.0, f64::INFINITY]),
            "coefficient 2",
        ),
        (Scalar::Table(vec![]), "at least [[x, y]]"),
        (Scalar::Table(vec![[0.0, f64::NAN]]), "point 1"),
        (Scalar::Table(vec![[0.0, 1.0], [0.0, 2.0]]), "x must rise"),
        (Scalar::Table(vec![[1.0, 1.0], [0.0, 2.0]]), "point 2"),
        (
            Scalar::Table(vec![[0.0, -1e308], [1.0, 1e308]]),
            "too steeply",
        ),
        (expression("t + v"), "t and v"),
    ];
    for (law, part) in refused {
        let message = law.check().unwrap_err();
        assert!(message.contains(part), "{message}");
    }
    for law in [
        table(),
        expression("t"),
        Scalar::zero(),
        Scalar::Polynomial(vec![1.0]),
    ] {
        assert_eq!(law.check(), Ok(()));
    }
}
