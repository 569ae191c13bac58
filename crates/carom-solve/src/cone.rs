//! The admissible multipliers of one contact: a half-line for the normal, and discs whose radius is a bound times
//! the normal augmented multiplier (eqs. 14-23, `docs/theory/algorithm.md` sections 2 and 4).
//!
//! Row order in a contact: normal; sliding (2); rolling (2); spinning (1). Discs with bound 0 have no rows.

/// Rows a contact can have at most.
pub const MAX_ROWS: usize = 6;

/// A small dense block over the rows of one contact.
pub type Block = [[f64; MAX_ROWS]; MAX_ROWS];

/// Bounds of the discs of one contact over its normal multiplier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Coulomb coefficient mu, dimensionless.
    pub sliding: f64,
    /// Rolling radius rho, m.
    pub rolling: f64,
    /// Spinning radius delta, m.
    pub spinning: f64,
}

/// State of one contact: eq. 21's three cases, decided on the sliding disc.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    #[default]
    Gap = 0,
    Stick = 1,
    Slip = 2,
}

/// One disc: first row within the contact, number of rows, bound.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    pub start: usize,
    pub dim: usize,
    pub bound: f64,
}

impl Bounds {
    /// Number of rows of a contact with these bounds.
    #[inline]
    pub fn dim(&self) -> usize {
        1 + if self.sliding > 0.0 { 2 } else { 0 }
            + if self.rolling > 0.0 { 2 } else { 0 }
            + usize::from(self.spinning > 0.0)
    }

    /// Discs of this share of their radius.
    pub fn scaled(&self, share: f64) -> Bounds {
        Bounds {
            sliding: share * self.sliding,
            rolling: share * self.rolling,
            spinning: share * self.spinning,
        }
    }

    /// The discs present, in row order.
    #[inline]
    pub fn discs(&self) -> impl Iterator<Item = Disc> {
        let mut start = 1;
        [(self.sliding, 2), (self.rolling, 2), (self.spinning, 1)]
            .into_iter()
            .filter_map(move |(bound, dim)| {
                if bound <= 0.0 {
                    return None;
                }
                let disc = Disc { start, dim, bound };
                start += dim;
                Some(disc)
            })
    }
}

/// Projects the augmented multiplier `xi` (rows of one contact) on the admissible set, writing `phi`.
///
/// The normal row is `max(0, xi_N)`; each disc has radius `bound * max(0, xi_N)`, evaluated at the *augmented*
/// normal multiplier as in eq. 21. The status is that of the sliding disc (stick where there is none).
#[inline]
pub fn project(bounds: &Bounds, xi: &[f64], phi: &mut [f64]) -> Status {
    project_from(bounds, 0.0, xi, phi)
}

/// [`project`] where the normal multiplier is at least `least` (expansion by Poisson's law).
#[inline]
pub fn project_from(bounds: &Bounds, least: f64, xi: &[f64], phi: &mut [f64]) -> Status {
    if xi[0] < 0.0 && least <= 0.0 {
        phi.fill(0.0);
        return Status::Gap;
    }
    let normal = if xi[0] < least { least } else { xi[0] };
    phi[0] = normal;
    let mut status = Status::Stick;
    for disc in bounds.discs() {
        let rows = disc.start..disc.start + disc.dim;
        let radius = disc.bound * normal;
        let length = norm(&xi[rows.clone()]);
        // `>=`: a disc of radius 0 (no normal load) is slip with phi = 0, never a division by zero.
        if length >= radius {
            let scale = if length > 0.0 { radius / length } else { 0.0 };
            for row in rows {
                phi[row] = scale * xi[row];
            }
            if disc.start == 1 && bounds.sliding > 0.0 {
                status = Status::Slip;
            }
        } else {
            phi[rows.clone()].copy_from_slice(&xi[rows]);
        }
    }
    status
}

/// [`project`] for a joint: no bound, always active.
#[inline]
pub fn pass(xi: &[f64], phi: &mut [f64]) -> Status {
    phi.copy_from_slice(xi);
    Status::Stick
}

/// Derivative of [`pass`].
#[inline]
pub fn pass_tangent(dim: usize, block: &mut Block) {
    for (r, row) in block.iter_mut().enumerate().take(dim) {
        row[..dim].fill(0.0);
        row[r] = 1.0;
    }
}

/// Derivative of [`project`] with respect to `xi`: an element of its generalised Jacobian (theory: the blocks
/// `C_NN, C_TN, C_TT`). Unused entries of `block` are left alone.
#[inline]
pub fn tangent(bounds: &Bounds, xi: &[f64], block: &mut Block) {
    tangent_from(bounds, 0.0, xi, block);
}

/// Derivative of [`project_from`].
#[inline]
pub fn tangent_from(bounds: &Bounds, least: f64, xi: &[f64], block: &mut Block) {
    let dim = xi.len();
    for row in block.iter_mut().take(dim) {
        row[..dim].fill(0.0);
    }
    if xi[0] < 0.0 && least <= 0.0 {
        return;
    }
    let held = xi[0] < least;
    let normal = if held { least } else { xi[0] };
    block[0][0] = if held { 0.0 } else { 1.0 };
    for disc in bounds.discs() {
        let rows = disc.start..disc.start + disc.dim;
        let radius = disc.bound * normal;
        let length = norm(&xi[rows.clone()]);
        if length < radius {
            for row in rows {
                block[row][row] = 1.0;
            }
            continue;
        }
        // tau is undefined without load or without slip: phi is 0 there and so is its tangent.
        if radius <= 0.0 || length <= 0.0 {
            continue;
        }
        let ratio = radius / length;
        for row in rows.clone() {
            let tau = xi[row] / length;
            block[row][0] = if held { 0.0 } else { disc.bound * tau };
            for col in rows.clone() {
                block[row][col] = -ratio * tau * (xi[col] / length);
            }
            block[row][row] += ratio;
        }
    }
}

#[inline]
pub(crate) fn norm(v: &[f64]) -> f64 {
    match v {
        [x] => x.abs(),
        [x, y] => (x * x + y * y).sqrt(),
        _ => v.iter().map(|x| x * x).sum::<f64>().sqrt(),
    }
}
