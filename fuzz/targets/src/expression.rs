//! Target `expression`: text as a law of one variable.

use carom_laws::{Expression, Scalar};

/// Longest message of an error, characters: it is shown in one line.
const LONGEST: usize = 500;

/// Text is an expression that can be asked anywhere, or refused in a line.
pub fn expression(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let read = match Expression::parse(&text) {
        Ok(read) => read,
        Err(message) => {
            let length = message.chars().count();
            assert!((1..=LONGEST).contains(&length), "{length} characters");
            assert!(!message.contains('\n'), "{message:?}");
            return;
        }
    };
    let variables = read.variables().len();
    for x in [0.0, 1.0, -1.0, 0.5, 1e300, f64::INFINITY, f64::NAN] {
        let values = vec![x; variables];
        let value = read.evaluate(&values);
        for index in 0..variables {
            read.slope(&values, index);
        }
        assert_eq!(value.to_bits(), read.evaluate(&values).to_bits());
    }
    let again = Expression::parse(&read.to_string()).expect("its own text");
    assert_eq!(again.variables(), read.variables());
    let law = Scalar::Expression(read);
    if law.check_slope_at_start().is_ok() {
        assert!(variables <= 1 && law.value(0.0).is_finite() && law.slope(0.0).is_finite());
    }
}
