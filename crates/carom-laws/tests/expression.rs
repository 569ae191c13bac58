//! Expressions: meaning, slopes, messages; no text makes them panic.

use carom_laws::Expression;
use proptest::prelude::*;
use std::f64::consts::PI;

fn read(text: &str) -> Expression {
    Expression::parse(text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn value(text: &str) -> f64 {
    read(text).evaluate(&[])
}

fn refused(text: &str) -> String {
    Expression::parse(text).expect_err(text)
}

#[test]
fn operators_bind_as_in_mathematics() {
    let cases = [
        ("1 + 2*3", 7.0),
        ("(1 + 2)*3", 9.0),
        ("8 - 3 - 2", 3.0),
        ("8 - 3 + 2", 7.0),
        ("8/4/2", 1.0),
        ("8/4*2", 4.0),
        ("2*8/4", 4.0),
        ("-3^2", -9.0),
        ("(-3)^2", 9.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("2**3**2", 512.0),
        ("-2*-3", 6.0),
        ("2 - -3", 5.0),
        ("--+-3", -3.0),
        ("2*3^2", 18.0),
        ("1 - 2^2*3", -11.0),
        ("- 2 + 5", 3.0),
    ];
    for (text, expected) in cases {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn every_floating_point_literal_is_read() {
    for text in [
        "0", "12", "1.5", ".5", "5.", "9.951e-3", "1E5", "1e+5", "2.e3", ".5e-1", "1e-400",
    ] {
        assert_eq!(value(text), text.parse::<f64>().unwrap(), "{text}");
    }
    assert_eq!(value("1e-3*2"), 2e-3);
    assert_eq!(value("9.951e-3 + 0.108*exp(-1.088*0)"), 9.951e-3 + 0.108);
}

#[test]
fn functions_and_constants() {
    let cases = [
        ("sin(0.3)", 0.3f64.sin()),
        ("cos(0.3)", 0.3f64.cos()),
        ("tan(0.3)", 0.3f64.tan()),
        ("asin(0.3)", 0.3f64.asin()),
        ("acos(0.3)", 0.3f64.acos()),
        ("atan(0.3)", 0.3f64.atan()),
        ("atan2(1, -1)", 0.75 * PI),
        ("sqrt(9)", 3.0),
        ("exp(1)", 1f64.exp()),
        ("ln(2)", 2f64.ln()),
        ("log10(1000)", 3.0),
        ("abs(-2)", 2.0),
        ("min(3, max(1, 2), 5)", 2.0),
        ("floor(-1.5) + ceil(1.2)", 0.0),
        ("sign(-3) + sign(0)", -1.0),
        ("2*pi", 2.0 * PI),
        ("2*PI", 2.0 * PI),
    ];
    for (text, expected) in cases {
        assert!(
            (value(text) - expected).abs() <= 4e-16 * expected.abs(),
            "{text} = {}",
            value(text)
        );
    }
}

#[test]
fn variables_come_in_the_order_of_their_appearance() {
    let e = read("b_1 + a*b_1 - e1 + 2e1");
    assert_eq!(e.variables(), ["b_1", "a", "e1"]);
    assert_eq!(e.evaluate(&[2.0, 3.0, 4.0]), 24.0);
}

#[test]
fn slopes_are_exact_to_the_right_of_kinks() {
    let cases = [
        ("t^2", -3.0, -6.0),
        ("t^2", 0.0, 0.0),
        ("(0 - t)^3", 2.0, -12.0),
        ("2^t", 0.0, 2f64.ln()),
        ("t^t", 1.0, 1.0),
        ("abs(t)", 0.0, 1.0),
        ("abs(-2*t)", 0.0, 2.0),
        ("min(t, 2*t)", 0.0, 1.0),
        ("max(t, 2*t)", 0.0, 2.0),
        ("max(0, t - 1)", 1.0, 1.0),
        ("floor(t) + ceil(t) + sign(t)", 0.0, 0.0),
        ("sqrt(0) + t", 0.0, 1.0),
        ("1/t", 2.0, -0.25),
        ("exp(-t^2)", 1.0, -2.0 * (-1f64).exp()),
    ];
    for (text, t, expected) in cases {
        let slope = read(text).slope(&[t], 0);
        assert!((slope - expected).abs() < 1e-15, "{text} at {t}: {slope}");
    }
    assert_eq!(read("a*b").slope(&[2.0, 5.0], 1), 2.0);
    assert_eq!(read("3").slope(&[1.0], 0), 0.0);
}

#[test]
fn messages_give_column_and_cure() {
    let cases = [
        ("", "", "empty"),
        ("   ", "", "empty"),
        ("1 +", "column 4", "ends where a value"),
        (
            "2t",
            "column 2",
            "between \"2\" and \"t\"; to multiply, write *",
        ),
        ("2 (3)", "column 3", "between \"2\" and \"(\""),
        ("(a) b", "column 5", "between \")\" and \"b\""),
        ("f*(1 + 2", "column 3", "never closed"),
        ("1 + 2)", "column 6", "without a \"(\""),
        ("()", "column 1", "nothing stands"),
        ("a < b", "column 3", "do not compare"),
        ("a == b", "column 3", "do not compare"),
        ("1,5", "column 2", "decimals are written with a point"),
        ("1.2.3", "column 1", "1.2.3 is no number"),
        (".", "column 1", "is no number"),
        ("1e999", "column 1", "too large"),
        ("sin", "column 1", "write sin(...)"),
        ("sin()", "column 1", "one value; 0 found"),
        ("1 + atan2(1)", "column 5", "two values"),
        ("max(1)", "column 1", "or more"),
        ("sin(1, 2)", "column 1", "one value; 2 found"),
        ("log(2)", "column 1", "write ln (natural) or log10"),
        ("r(2)", "column 1", "write r*(...)"),
        ("2*/3", "column 3", "missing before \"/\""),
        ("[1]", "column 1", "round parentheses"),
        ("2 \u{d7} 3", "column 3", "write *"),
        ("2 \u{2212} 3", "column 3", "write -"),
        ("r\u{b2}", "column 2", "written with ^"),
        ("5 %", "column 3", "divide by 100"),
        ("a # b", "column 3", "no meaning"),
        ("max(1, )", "column 8", "missing before \")\""),
        ("max(1 2)", "column 7", "between \"1\" and \"2\""),
    ];
    for (text, place, part) in cases {
        let message = refused(text);
        assert!(
            message.starts_with(place) && message.contains(part),
            "{text}: {message}"
        );
    }
}

#[test]
fn the_first_fault_is_named() {
    let e = read("1 + asin(1 - f)/2");
    assert_eq!(e.check_at(&[1.0]), Ok(1.0));
    assert_eq!(
        e.check_at(&[-0.5]).unwrap_err(),
        "column 5: asin(1.5) is not a number"
    );
    assert_eq!(
        read("2/x").check_at(&[0.0]).unwrap_err(),
        "column 2: 2 / 0 is not finite"
    );
    assert_eq!(
        read("x").check_at(&[f64::NAN]).unwrap_err(),
        "column 1: x is not a number"
    );
    assert!(read("min(1, sqrt(0 - x))").evaluate(&[1.0]).is_nan());
}

#[test]
fn long_and_deep_texts_are_refused_or_work() {
    assert!(refused(&"1".repeat(4001)).contains("4000"));
    assert_eq!(value(&format!("1{}", "*1".repeat(1999))), 1.0);
    assert_eq!(
        read(&format!("t{}", "*t".repeat(1999))).slope(&[1.0], 0),
        2000.0
    );
    for unit in [
        "(",
        "-",
        "2^",
        "2^-",
        "sin(",
        "max(1, ",
        "1 + 2*3^(",
        "((((-",
    ] {
        assert!(
            refused(&(unit.repeat(400) + "1")).contains("levels of nesting"),
            "{unit}"
        );
    }
    let deepest = format!("{}1{}", "(1 + 1*".repeat(32), ")".repeat(32));
    assert_eq!(value(&deepest), 33.0);
}

/// Formulas without kinks, defined everywhere near the points used.
fn formula() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("t".to_string()),
        (0.1f64..3.0).prop_map(|x| x.to_string()),
        (1e-3f64..1e-1).prop_map(|x| format!("{x:e}")),
    ];
    leaf.prop_recursive(4, 24, 2, |inner| {
        prop_oneof![
            (inner.clone(), "[-+*]", inner.clone()).prop_map(|(a, o, b)| format!("({a} {o} {b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a})/(2 + ({b})^2)")),
            (inner.clone(), "sin|cos|atan").prop_map(|(a, f)| format!("{f}({a})")),
            inner.clone().prop_map(|a| format!("exp(-({a})^2)")),
            inner.clone().prop_map(|a| format!("ln(1.5 + cos({a}))")),
            inner
                .clone()
                .prop_map(|a| format!("sqrt(2 + tan(sin({a})/2))")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("(1.2 + sin({a}))^cos({b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("atan2({a}, 2 + ({b})^2)")),
            inner
                .clone()
                .prop_map(|a| format!("-asin(sin({a})/2)*acos(cos({a})/2)")),
            inner.prop_map(|a| format!("log10(3 + sin({a}))")),
        ]
    })
}

proptest! {
    #[test]
    fn slopes_equal_finite_differences(text in formula(), t in 0.2f64..2.0) {
        let e = read(&text);
        let f = |t: f64| e.evaluate(&[t]);
        // Central differences of two widths: their distance says how far they can be trusted here.
        let h = 1e-4;
        let wide = (f(t + 2.0 * h) - f(t - 2.0 * h)) / (4.0 * h);
        let narrow = (f(t + h) - f(t - h)) / (2.0 * h);
        let scale = 1.0 + f(t).abs() + narrow.abs();
        prop_assume!((wide - narrow).abs() < 1e-3 * scale);
        let bound = 1e-7 * scale + 2.0 * (wide - narrow).abs();
        let slope = e.slope(&[t], 0);
        prop_assert!((slope - narrow).abs() <= bound, "{text} at {t}: {slope}, differences {narrow}");
    }

    #[test]
    fn no_text_panics(text in r"[-+*/^(),.0-9eE a-d_<=\[\]\u{d7}\u{b2}%]{0,60}|\PC{0,60}|((sin|max|atan2|pi|t|2|\(|\)|,|-|\^| ){1,3}){0,30}") {
        if let Ok(e) = Expression::parse(&text) {
            let values = vec![0.5; e.variables().len()];
            let value = e.evaluate(&values);
            prop_assert!(e.check_at(&values).map_or(true, |x| x == value));
            for k in 0..values.len() {
                e.slope(&values, k);
            }
        }
    }
}
