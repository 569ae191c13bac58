//! One contact in closed form.

use carom_solve::single::SingleContact;
use proptest::prelude::*;

fn length(v: [f64; 2]) -> f64 {
    v[0].hypot(v[1])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// The result satisfies the law: measures after the impulse vanish in stick and oppose it in slip.
    #[test]
    fn solution_satisfies_the_law(
        z in prop::array::uniform6(-1.0f64..1.0), mu in 0.0f64..0.8, rho in 0.0f64..0.3, delta in 0.0f64..0.3,
        radius in 0.3f64..2.0, kappa in 0.2f64..1.0,
    ) {
        let (rho, delta) = (rho * radius, delta * radius);
        let inv_i = 1.0 / (kappa * radius * radius);
        let s = SingleContact {
            z_normal: z[0], z_sliding: [z[1], z[2]], z_rolling: [z[3], z[4]], z_spinning: z[5],
            d_normal: 1.0, d_sliding: 1.0 + radius * radius * inv_i, d_turn: inv_i, d_coupling: radius * inv_i,
            mu, rho, delta,
        };
        let x = s.solve();
        let tol = 1e-12 * (1.0 + inv_i);
        prop_assert!(x.normal >= 0.0 && (x.normal == 0.0) == (z[0] >= 0.0));
        let after = |k: usize| (
            s.z_sliding[k] + s.d_sliding * x.sliding[k] + s.d_coupling * x.rolling[k],
            s.z_rolling[k] + s.d_coupling * x.sliding[k] + s.d_turn * x.rolling[k],
        );
        let (u, w) = ([after(0).0, after(1).0], [after(0).1, after(1).1]);
        for (l, v, limit) in [(x.sliding, u, mu * x.normal), (x.rolling, w, rho * x.normal)] {
            prop_assert!(length(l) <= limit * (1.0 + 1e-12) + 1e-15);
            if limit == 0.0 { continue; }
            if length(l) < limit * (1.0 - 1e-9) {
                prop_assert!(length(v) < tol, "stick moves: {v:?}");
            } else {
                let cross = l[0] * v[1] - l[1] * v[0];
                prop_assert!(cross.abs() < tol && l[0] * v[0] + l[1] * v[1] <= tol, "slip not opposed: {l:?} {v:?}");
            }
        }
    }
}
