//! What the tests of single contacts share.

use crate::problem::natural::natural_part;
use crate::problem::RowGroup;
use crate::Bounds;

pub fn group(sliding: f64, rolling: f64, spinning: f64) -> RowGroup {
    let bounds = Bounds {
        sliding,
        rolling,
        spinning,
    };
    RowGroup {
        dim: bounds.dim(),
        bounds,
        ..RowGroup::default()
    }
}

/// Size of the natural map at `r`, over that of `b`.
pub fn miss(group: &RowGroup, a: &[f64], b: &[f64], r: &[f64]) -> f64 {
    let n = group.dim;
    let u: Vec<f64> = (0..n)
        .map(|i| b[i] + (0..n).map(|j| a[i * n + j] * r[j]).sum::<f64>())
        .collect();
    let f = natural_part(group, r, &u);
    let size = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    size(&f[..n]) / size(&b[..n])
}
