//! One contact of a sphere with a plane (or any contact whose normal row is decoupled from its discs): solved
//! exactly, without iteration except where the sliding and the rolling disc are both saturated.
//!
//! The one-contact Delassus block of a sphere couples only sliding and rolling: `T1` with `R2`, `T2` with `R1`
//! (a turn about `t2` moves the contact point along `t1`). With `w1 = -R2`, `w2 = R1` the block over `(T, w)` is
//! `[[a, b], [b, c]]` times the 2 x 2 identity.

/// Data of one decoupled contact. Measures `z` include the restitution terms.
#[derive(Clone, Copy, Debug)]
pub struct SingleContact {
    pub z_normal: f64,
    pub z_sliding: [f64; 2],
    /// In the turned basis `(w1, w2) = (-R2, R1)`.
    pub z_rolling: [f64; 2],
    pub z_spinning: f64,
    /// Diagonals of the Delassus block: 1/m; 1/m + r^2/I; 1/I (rolling and spinning); coupling r/I.
    pub d_normal: f64,
    pub d_sliding: f64,
    pub d_turn: f64,
    pub d_coupling: f64,
    pub mu: f64,
    pub rho: f64,
    pub delta: f64,
}

/// Multipliers of one contact, rolling in the turned basis.
#[derive(Clone, Copy, Debug, Default)]
pub struct SingleSolution {
    pub normal: f64,
    pub sliding: [f64; 2],
    pub rolling: [f64; 2],
    pub spinning: f64,
    /// The sliding disc is saturated.
    pub slip: bool,
}

#[inline]
fn length(v: [f64; 2]) -> f64 {
    (v[0] * v[0] + v[1] * v[1]).sqrt()
}

/// `-z` scaled to the disc: the minimiser of `d/2 |l|^2 + z . l` over `|l| <= radius`. Returns it and "saturated".
#[inline]
fn disc(z: [f64; 2], d: f64, radius: f64) -> ([f64; 2], bool) {
    let size = length(z);
    if size < d * radius {
        ([-z[0] / d, -z[1] / d], false)
    } else if size > 0.0 {
        let s = radius / size;
        ([-s * z[0], -s * z[1]], true)
    } else {
        ([0.0, 0.0], true)
    }
}

impl SingleContact {
    /// Whether 200 passes over two saturated discs reach rounding: `b^2/(a c) <= 5/6`, that is `I >= 0.2 m r^2`.
    #[inline]
    pub fn settles(mass: f64, inertia: f64, radius: f64) -> bool {
        inertia >= 0.2 * mass * radius * radius
    }

    /// The exact solution.
    #[inline(always)]
    pub fn solve(&self) -> SingleSolution {
        let mut out = SingleSolution::default();
        if self.z_normal >= 0.0 {
            return out;
        }
        out.normal = -self.z_normal / self.d_normal;
        let (radius_t, radius_r) = (self.mu * out.normal, self.rho * out.normal);
        if self.delta > 0.0 {
            let limit = self.delta * out.normal;
            out.spinning = (-self.z_spinning / self.d_turn).clamp(-limit, limit);
        }
        if self.rho <= 0.0 {
            (out.sliding, out.slip) = disc(self.z_sliding, self.d_sliding, radius_t);
        } else if self.mu <= 0.0 {
            (out.rolling, _) = disc(self.z_rolling, self.d_turn, radius_r);
            out.slip = true;
        } else {
            (out.sliding, out.rolling, out.slip) = self.two_discs(radius_t, radius_r);
        }
        out
    }

    /// Sliding and rolling together: a strictly convex problem over two discs. Three of its four cases are closed.
    fn two_discs(&self, radius_t: f64, radius_r: f64) -> ([f64; 2], [f64; 2], bool) {
        let (a, b, c) = (self.d_sliding, self.d_coupling, self.d_turn);
        let (zt, zr) = (self.z_sliding, self.z_rolling);
        let det = a * c - b * b;
        // Both stick.
        let t = [(b * zr[0] - c * zt[0]) / det, (b * zr[1] - c * zt[1]) / det];
        let r = [(b * zt[0] - a * zr[0]) / det, (b * zt[1] - a * zr[1]) / det];
        if length(t) < radius_t && length(r) < radius_r {
            return (t, r, false);
        }
        // Sliding sticks: eliminate it, the rolling disc sees the Schur complement.
        let (r, saturated) = disc(
            [zr[0] - b / a * zt[0], zr[1] - b / a * zt[1]],
            det / a,
            radius_r,
        );
        let t = [-(zt[0] + b * r[0]) / a, -(zt[1] + b * r[1]) / a];
        if saturated && length(t) < radius_t {
            return (t, r, false);
        }
        // Rolling sticks, sliding slips.
        let (t, saturated) = disc(
            [zt[0] - b / c * zr[0], zt[1] - b / c * zr[1]],
            det / c,
            radius_t,
        );
        let r = [-(zr[0] + b * t[0]) / c, -(zr[1] + b * t[1]) / c];
        if saturated && length(r) < radius_r {
            return (t, r, true);
        }
        self.both_saturated(radius_t, radius_r)
    }

    /// Both discs on their rims: alternate exact minimisation. The rate of contraction is at most `b^2/(a c)`
    /// (5/7 at a homogeneous sphere), and each half-step is exact, so this ends at rounding; usually the directions hardly
    /// turn and it ends in a few passes. Callers keep it from spheres with nearly all mass at the centre, where the rate
    /// nears 1 ([`SingleContact::settles`]).
    fn both_saturated(&self, radius_t: f64, radius_r: f64) -> ([f64; 2], [f64; 2], bool) {
        let (a, b, c) = (self.d_sliding, self.d_coupling, self.d_turn);
        let (zt, zr) = (self.z_sliding, self.z_rolling);
        let (mut t, mut slip) = disc(zt, a, radius_t);
        let mut r = [0.0; 2];
        for _ in 0..200 {
            let before = (t, r);
            (r, _) = disc([zr[0] + b * t[0], zr[1] + b * t[1]], c, radius_r);
            (t, slip) = disc([zt[0] + b * r[0], zt[1] + b * r[1]], a, radius_t);
            let change = (t[0] - before.0[0]).abs() + (t[1] - before.0[1]).abs();
            let turn = (r[0] - before.1[0]).abs() + (r[1] - before.1[1]).abs();
            if change <= 4e-16 * radius_t && turn <= 4e-16 * radius_r {
                break;
            }
        }
        (t, r, slip)
    }
}
