//! The projection on the cone of one contact, and its tangent.

use carom_solve::cone::{project, tangent, Bounds, MAX_ROWS};
use proptest::prelude::*;

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn bounds() -> impl Strategy<Value = Bounds> {
    (0usize..8, 0.05f64..1.5, 0.05f64..1.5, 0.05f64..1.5).prop_map(|(mask, mu, rho, delta)| {
        Bounds {
            sliding: if mask & 1 != 0 { mu } else { 0.0 },
            rolling: if mask & 2 != 0 { rho } else { 0.0 },
            spinning: if mask & 4 != 0 { delta } else { 0.0 },
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Given the normal, each disc gets the nearest point of its disc.
    #[test]
    fn projection_is_feasible_and_nearest(b in bounds(), xi in prop::array::uniform6(-1.0f64..1.0),
                                          other in prop::array::uniform6(-1.0f64..1.0)) {
        let dim = b.dim();
        let (xi, mut phi) = (&xi[..dim], [0.0; MAX_ROWS]);
        project(&b, xi, &mut phi[..dim]);
        prop_assert!(phi[0] >= 0.0);
        for disc in b.discs() {
            let rows = disc.start..disc.start + disc.dim;
            let radius = disc.bound * xi[0].max(0.0);
            prop_assert!(norm(&phi[rows.clone()]) <= radius * (1.0 + 1e-15));
            if xi[0] <= 0.0 { continue; }
            let scale = radius / norm(&other[..disc.dim]).max(radius);
            let d = |p: &dyn Fn(usize) -> f64| rows.clone()
                .map(|r| (xi[r] - p(r)).powi(2)).sum::<f64>();
            let mine = d(&|r| phi[r]);
            let any = d(&|r| scale * other[r - disc.start]);
            prop_assert!(mine <= any + 1e-14);
        }
    }

    /// The tangent equals central differences wherever the status does not change.
    #[test]
    fn tangent_matches_finite_differences(b in bounds(), xi in prop::array::uniform6(-1.0f64..1.0)) {
        let dim = b.dim();
        let step = 1e-6;
        let kink = |x: &[f64]| -> bool {
            if x[0].abs() < 1e-3 { return true; }
            b.discs().any(|d| {
                let l = norm(&x[d.start..d.start + d.dim]);
                (l - d.bound * x[0]).abs() < 1e-3 || l < 1e-2
            })
        };
        prop_assume!(!kink(&xi[..dim]));
        let mut block = [[0.0; MAX_ROWS]; MAX_ROWS];
        tangent(&b, &xi[..dim], &mut block);
        for col in 0..dim {
            let (mut plus, mut minus) = (xi, xi);
            plus[col] += step;
            minus[col] -= step;
            let (mut fp, mut fm) = ([0.0; MAX_ROWS], [0.0; MAX_ROWS]);
            project(&b, &plus[..dim], &mut fp[..dim]);
            project(&b, &minus[..dim], &mut fm[..dim]);
            for row in 0..dim {
                let fd = (fp[row] - fm[row]) / (2.0 * step);
                prop_assert!((fd - block[row][col]).abs() < 1e-7, "row {row} col {col}: {fd} {}", block[row][col]);
            }
        }
    }
}
