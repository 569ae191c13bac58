//! Scaling that leaves the cones cones: what solvers see has diagonals near 1 and loads near 1.

use super::Problem;

/// A problem in scaled unknowns, `r = size S y`: `u_y = S u / size`, with one factor for the normal and sliding rows of
/// a contact (so a Coulomb cone stays as it is) and one for each further disc (whose bound changes with it).
#[derive(Clone, Debug, Default)]
pub struct Scaled {
    pub problem: Problem,
    /// `S` of each row.
    pub factor: Vec<f64>,
    /// Scale of `q`.
    pub size: f64,
}

/// Diagonals (1/kg and the like) beyond these are taken for them: of the roots of others there are no quotients. Beyond, scaled
/// problems are NaN.
const LEAST: f64 = 1e-200;
const MOST: f64 = 1e200;

impl Scaled {
    pub fn new(source: &Problem) -> Scaled {
        let mut problem = source.clone();
        let mut factor = vec![1.0; source.rows()];
        for (i, group) in problem.groups.iter_mut().enumerate() {
            let k = source.w.diagonal[i];
            let diagonal = |r: usize| source.w.block(i, k)[r * group.dim + r];
            let root = |rows: std::ops::Range<usize>| {
                let mean = rows.clone().map(diagonal).sum::<f64>() / rows.len() as f64;
                if mean > 0.0 {
                    1.0 / mean.clamp(LEAST, MOST).sqrt()
                } else {
                    1.0
                }
            };
            if group.bilateral {
                for r in 0..group.dim {
                    factor[group.row + r] = root(r..r + 1);
                }
                continue;
            }
            let head = if group.bounds.sliding > 0.0 { 3 } else { 1 };
            let normal = root(0..head);
            factor[group.row..group.row + head].fill(normal);
            let mut at = head;
            for (bound, dim) in [
                (&mut group.bounds.rolling, 2),
                (&mut group.bounds.spinning, 1),
            ] {
                if *bound > 0.0 {
                    let turn = root(at..at + dim);
                    factor[group.row + at..group.row + at + dim].fill(turn);
                    // |y_b| turn <= bound y_N normal.
                    // Finite: an infinite bound times no impulse would be NaN.
                    *bound = (*bound * (normal / turn)).min(f64::MAX);
                    at += dim;
                }
            }
        }
        for i in 0..problem.groups.len() {
            let (row, dim) = problem.w.shape(i);
            for k in problem.w.ptr[i]..problem.w.ptr[i + 1] {
                let (col, width) = problem.w.shape(problem.w.col[k] as usize);
                for (at, w) in problem.w.block_mut(i, k).iter_mut().enumerate() {
                    *w *= factor[row + at / width] * factor[col + at % width];
                }
            }
            debug_assert!(dim > 0);
        }
        let mut size = 0.0f64;
        for (q, f) in problem.q.iter_mut().zip(&factor) {
            *q *= f;
            size = size.max(q.abs());
        }
        if size == 0.0 {
            size = 1.0;
        }
        // A q that is infinite when scaled has no solution here; what is given back is finite all the same.
        size = size.min(f64::MAX);
        problem.q.iter_mut().for_each(|q| *q /= size);
        for group in &mut problem.groups {
            group.least /= factor[group.row] * size;
        }
        Scaled {
            problem,
            factor,
            size,
        }
    }

    /// `y` of `r`.
    pub fn enter(&self, r: &[f64], y: &mut [f64]) {
        for (y, (r, f)) in y.iter_mut().zip(r.iter().zip(&self.factor)) {
            *y = r / (f * self.size);
        }
    }

    /// `r` of `y`.
    pub fn leave(&self, y: &[f64], r: &mut [f64]) {
        for (r, (y, f)) in r.iter_mut().zip(y.iter().zip(&self.factor)) {
            *r = y * f * self.size;
        }
    }
}
