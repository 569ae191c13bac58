//! The cones of path following: scaling, products of Jordan's algebra, step lengths.

/// A vector of one disc: `(mu r_N, r_b)` and its duals; a half-line uses the first entry.
pub(super) type Vec3 = [f64; 3];

/// One cone `Q_b` of a contact.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cone {
    pub group: usize,
    /// Row of the normal, first row of the disc, its rows (0: half-line).
    pub normal: usize,
    pub start: usize,
    pub dim: usize,
    pub bound: f64,
    /// Without the slip shift.
    pub convex: bool,
    /// Primal `A_b r` and dual.
    pub primal: Vec3,
    pub dual: Vec3,
    /// Scaling: `F = eta (..w..)`.
    pub eta: f64,
    pub w: Vec3,
    /// `F^-1 primal = F dual`.
    pub v: Vec3,
    pub d_primal: Vec3,
    pub d_dual: Vec3,
}

impl Cone {
    /// `A_b x`.
    pub fn of(&self, x: &[f64]) -> Vec3 {
        let mut out = [self.bound * x[self.normal], 0.0, 0.0];
        for k in 0..self.dim {
            out[1 + k] = x[self.start + k];
        }
        out
    }

    /// Normal part of the dual with the slip shift taken off, `mu (l_0 - |l_1|^2 / l_0)`, or `mu l_0` without it, and its slope over the dual.
    pub fn closing(&self) -> (f64, Vec3) {
        if self.dim == 0 {
            return (self.dual[0], [1.0, 0.0, 0.0]);
        }
        if self.convex {
            return (self.bound * self.dual[0], [self.bound, 0.0, 0.0]);
        }
        let inverse = 1.0 / self.dual[0];
        let square: f64 = (1..=self.dim)
            .map(|k| (self.dual[k] * inverse).powi(2))
            .sum();
        let mut slope = [self.bound * (1.0 + square), 0.0, 0.0];
        for k in 1..=self.dim {
            slope[k] = -2.0 * self.bound * self.dual[k] * inverse;
        }
        (self.bound * det(&self.dual, self.dim) * inverse, slope)
    }

    pub fn scale(&mut self) {
        let (dp, dd) = (det(&self.primal, self.dim), det(&self.dual, self.dim));
        self.eta = (dp / dd).sqrt().sqrt();
        let (p, d) = (1.0 / dp.sqrt(), 1.0 / dd.sqrt());
        let mut dot = 0.0;
        for k in 0..=self.dim {
            dot += p * self.primal[k] * d * self.dual[k];
        }
        let gamma = (0.5 * (1.0 + dot)).sqrt();
        self.w = [0.0; 3];
        self.w[0] = (p * self.primal[0] + d * self.dual[0]) / (2.0 * gamma);
        for k in 1..=self.dim {
            self.w[k] = (p * self.primal[k] - d * self.dual[k]) / (2.0 * gamma);
        }
        self.v = self.rescale(&self.dual);
    }

    /// `F x`.
    pub fn rescale(&self, x: &Vec3) -> Vec3 {
        hyperbolic(&self.w, x, self.dim, self.eta)
    }

    /// `F^-1 x`.
    pub fn unscale(&self, x: &Vec3) -> Vec3 {
        let mirrored = [self.w[0], -self.w[1], -self.w[2]];
        hyperbolic(&mirrored, x, self.dim, 1.0 / self.eta)
    }
}

/// `scale [w0 w1^T; w1 1 + w1 w1^T / (1 + w0)] x`.
pub(super) fn hyperbolic(w: &Vec3, x: &Vec3, dim: usize, scale: f64) -> Vec3 {
    let dot: f64 = (1..=dim).map(|k| w[k] * x[k]).sum();
    let mut out = [0.0; 3];
    out[0] = scale * (w[0] * x[0] + dot);
    let along = x[0] + dot / (1.0 + w[0]);
    for k in 1..=dim {
        out[k] = scale * (x[k] + along * w[k]);
    }
    out
}

/// Jordan product `x o y = (x.y, x0 y1 + y0 x1)`.
pub(super) fn product(x: &Vec3, y: &Vec3, dim: usize) -> Vec3 {
    let mut out = [0.0; 3];
    out[0] = (0..=dim).map(|k| x[k] * y[k]).sum();
    for k in 1..=dim {
        out[k] = x[0] * y[k] + y[0] * x[k];
    }
    out
}

/// Solves `x o y = b` for `y`.
pub(super) fn divide(x: &Vec3, b: &Vec3, dim: usize) -> Vec3 {
    let d = det(x, dim);
    let dot: f64 = (1..=dim).map(|k| x[k] * b[k]).sum();
    let mut y = [0.0; 3];
    y[0] = (x[0] * b[0] - dot) / d;
    for k in 1..=dim {
        y[k] = (b[k] - y[0] * x[k]) / x[0];
    }
    y
}

/// `x0^2 - |x1|^2`, without cancellation of squares.
pub(super) fn det(x: &Vec3, dim: usize) -> f64 {
    let length = norm(&x[1..=dim]);
    ((x[0] - length) * (x[0] + length)).max(f64::MIN_POSITIVE)
}

pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Longest `length <= bound` with `x + length d` in the cone, `x` inside.
pub(super) fn longest(x: &Vec3, d: &Vec3, dim: usize, bound: f64) -> f64 {
    if dim == 0 {
        return if d[0] < 0.0 {
            bound.min(-x[0] / d[0])
        } else {
            bound
        };
    }
    let a = d[0] * d[0] - (1..=dim).map(|k| d[k] * d[k]).sum::<f64>();
    let b = x[0] * d[0] - (1..=dim).map(|k| x[k] * d[k]).sum::<f64>();
    let c = det(x, dim);
    // First positive root of a t^2 + 2 b t + c, and of x0 + t d0.
    let mut length = bound;
    let disc = b * b - a * c;
    if disc >= 0.0 {
        let root = disc.sqrt();
        for t in [c / (-b + root), c / (-b - root)] {
            if t > 0.0 && t < length {
                length = t;
            }
        }
    }
    if d[0] < 0.0 {
        length = length.min(-x[0] / d[0]);
    }
    length
}
