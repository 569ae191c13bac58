//! Roots are neither missed nor invented: polynomials whose roots are known without rounding, and dips of all depths.

use carom_events::roots::{falls, first_fall, value};
use proptest::prelude::*;

/// `lead (t - r_0) (t - r_1) ...`; exact where all products fit the mantissa.
fn of_roots<const N: usize>(lead: f64, roots: &[f64]) -> [f64; N] {
    let mut c = [0.0; N];
    c[0] = lead;
    for (k, r) in roots.iter().enumerate() {
        for i in (0..=k + 1).rev() {
            let below = if i > 0 { c[i - 1] } else { 0.0 };
            c[i] = below - r * c[i];
        }
    }
    c
}

/// Rounding of what is added up in a polynomial at `t`.
fn noise<const N: usize>(c: &[f64; N], t: f64) -> f64 {
    32.0 * f64::EPSILON * value(&c.map(f64::abs), t)
}

/// Where such a polynomial goes from above zero to below, after 0 and by more than rounding on both sides: from the signs between its roots.
fn expected(c: &[f64; 5], lead: f64, roots: &[f64], end: f64) -> Vec<f64> {
    let mut places: Vec<f64> = roots
        .iter()
        .copied()
        .filter(|&r| r > 0.0 && r < end)
        .collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    let exact = |t: f64| roots.iter().fold(lead, |v, r| v * (t - r));
    let mut found = Vec::new();
    for (k, &r) in places.iter().enumerate() {
        let low = if k == 0 { 0.0 } else { places[k - 1] };
        let high = places.get(k + 1).copied().unwrap_or(end);
        let (before, after) = (0.5 * (low + r), 0.5 * (r + high));
        if exact(before) > noise(c, r) && exact(after) < -noise(c, high) {
            found.push(r);
        }
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Roots are multiples of 2^-10, alike in many cases: all coefficients are exact.
    #[test]
    fn quartics_with_exact_roots(
        k in proptest::array::uniform4(-1024i32..2048),
        same in 0u8..16,
        near in 0u8..16,
        up in any::<bool>(),
        end in 0.25f64..4.0,
    ) {
        let mut k = k;
        for i in 1..4 {
            if same & (1 << i) != 0 { k[i] = k[i - 1]; }
            if near & (1 << i) != 0 { k[i] = k[i - 1] + 1; }
        }
        let roots = k.map(|k| f64::from(k) / 1024.0);
        let lead = if up { 1.0 } else { -1.0 };
        let c: [f64; 5] = of_roots(lead, &roots);
        let exact = expected(&c, lead, &roots, end);
        let found: Vec<f64> = falls(c, end).collect();
        // The nearest root is the one: others are 2^-10 away, and what is found is one but for rounding.
        let exactly = |t: f64| roots.iter().fold(lead, |v, r| v * (t - r));
        for r in &exact {
            prop_assert!(found.iter().any(|f| (f - r).abs() < 0.5 / 1024.0), "{roots:?}: {exact:?} {found:?}");
        }
        for f in &found {
            prop_assert!(exactly(*f).abs() <= noise(&c, *f), "{roots:?}: {exact:?} {found:?}");
        }
    }

    /// Dips of all depths down to rounding: what is deeper is found, where it is; nothing before it is deep.
    #[test]
    fn dips_are_found(
        at in 0.01f64..0.99,
        depth in -15.5f64..0.0,
        curve in -3.0f64..3.0,
        tilt in proptest::array::uniform2(-1.0f64..1.0),
        end in prop::sample::select(vec![1.0, 1.5, 20.0]),
    ) {
        let (depth, curve) = (10f64.powf(depth), 10f64.powf(curve));
        // (curve (t - at)^2 - depth) (1 + s t + s' t^2) with a factor that stays above zero.
        let [s, q] = [0.3 * tilt[0] / end, 0.3 * tilt[1] / (end * end)];
        let a = [curve * at * at - depth, -2.0 * curve * at, curve];
        let b = [1.0, s, q];
        let mut c = [0.0; 5];
        for i in 0..3 { for j in 0..3 { c[i + j] += a[i] * b[j]; } }
        let size: f64 = c.iter().enumerate().map(|(k, c)| c.abs() * f64::powi(end, k as i32)).sum();
        let root = at - (depth / curve).sqrt();
        let found = first_fall(&c, end);
        let noise = 32.0 * f64::EPSILON * size;
        if root > 1e-6 && depth > noise {
            let near = noise / (2.0 * (curve * depth).sqrt());
            prop_assert!(found.is_some_and(|t| (t - root).abs() <= near + 4.0 * f64::EPSILON * root), "{found:?} {root}");
        }
        if let Some(t) = found {
            prop_assert!(value(&c, t).abs() <= noise);
            for k in 0..64 {
                let before = t * f64::from(k) / 64.0;
                prop_assert!(root < 1e-6 || value(&c, before) >= -noise);
            }
        }
    }

    /// Random coefficients: before the fall nothing is deep below zero where it had been above, and the fall is one.
    #[test]
    fn random_polynomials(c in proptest::array::uniform9(-1.0f64..1.0), zero in 0usize..7, end in 0.1f64..3.0) {
        let mut c = c;
        for k in 0..zero { c[8 - k] = 0.0; }
        let size: f64 = c.iter().enumerate().map(|(k, c)| c.abs() * f64::powi(end, k as i32)).sum();
        let noise = 32.0 * f64::EPSILON * size;
        let found = first_fall(&c, end);
        let mut above = c[0] > 0.0;
        let last = found.unwrap_or(end);
        for k in 0..=500 {
            let t = last * f64::from(k) / 500.0;
            let v = value(&c, t);
            prop_assert!(!(above && v < -noise), "missed before {t}: {c:?}");
            above |= v > noise;
        }
        if let Some(t) = found {
            prop_assert!(value(&c, t).abs() <= noise);
        }
    }
}
