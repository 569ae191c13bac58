//! Damping as a function of restitution.

use carom_core::options::PenaltyLaw;
use carom_core::{Options, Value};
use carom_penalty::damping::{chi, restitution};

#[test]
fn the_exact_law_has_the_published_roots() {
    for (e, root) in [
        (0.1, 9.998),
        (0.3, 3.087),
        (0.5, 1.4328),
        (0.7, 0.6348),
        (0.85, 0.2640),
        (0.93, 0.1128),
        (0.95, 0.0789),
    ] {
        let found = chi(PenaltyLaw::Exact, e, 1e-2);
        assert!((found - root).abs() < 5e-4 * root.max(0.1), "{e}: {found}");
    }
    assert_eq!(chi(PenaltyLaw::Exact, 1.0, 1e-2), 0.0);
}

#[test]
fn restitution_inverts_the_exact_law() {
    for e in [1e-2, 0.1, 0.5, 0.9, 0.96, 0.97, 0.999, 1.0 - 1e-9] {
        let found = restitution(chi(PenaltyLaw::Exact, e, 1e-3));
        // Near 1 the root of a double zero: e is known to the rounding of 1 - e times a few.
        assert!((found - e).abs() < 1e-11, "{e}: {found}");
    }
    assert_eq!(restitution(0.0), 1.0);
}

#[test]
fn laws_without_a_finite_value_at_zero_are_bounded() {
    for name in PenaltyLaw::NAMES {
        let mut options = Options::default();
        let value = Value::Text((*name).to_owned());
        options.set("penalty_law", &value).unwrap();
        let found = chi(options.penalty_law, 0.0, 1e-2);
        assert!(
            found.is_finite() && found > 0.0 && found < 161.0,
            "{name}: {found}"
        );
        assert_eq!(chi(options.penalty_law, 1.0, 1e-2), 0.0);
    }
}
