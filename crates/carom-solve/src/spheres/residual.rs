//! What is computed beside the sweep, without its kernel: the residual, and `u` of given impulses.

use super::groups::{Block, EMPTY};
use super::kernel::{Group, State};
use super::lanes::{Lanes, Work, GROUP};
use glam::DVec3;

fn vector(columns: &[super::kernel::Column; 3], lane: usize) -> DVec3 {
    DVec3::new(columns[0][lane], columns[1][lane], columns[2][lane])
}

fn head(row: &[f64; 4]) -> DVec3 {
    DVec3::new(row[0], row[1], row[2])
}

/// Lanes with a contact.
fn lanes(block: &Block) -> impl Iterator<Item = (&Group, usize)> {
    block
        .groups
        .iter()
        .zip(&block.ids)
        .flat_map(|(group, ids)| {
            ids.iter()
                .enumerate()
                .filter(|(_, &id)| id != EMPTY)
                .map(move |(lane, _)| (group, lane))
        })
}

/// Largest part of the natural map, N s.
pub fn largest(block: &Block, left: &[State], right: &[State]) -> f64 {
    let mut worst = 0.0f64;
    for (group, lane) in lanes(block) {
        let (a, b) = (
            &left[group.a[lane] as usize],
            &right[group.b[lane] as usize],
        );
        let (n, r) = (vector(&group.normal, lane), vector(&group.impulse, lane));
        let spin = head(&a.surface) + head(&b.surface);
        let z = head(&a.linear) - head(&b.linear) + n.cross(spin) + vector(&group.slip, lane);
        let normal = (r.dot(n) - group.mass_normal[lane] * z.dot(n)).max(0.0);
        let across = (r - group.mass_tangential[lane] * z).reject_from_normalized(n);
        let disc = across.clamp_length_max(group.friction[lane] * normal);
        let part = (normal * n + disc - r).length();
        if part > worst || part.is_nan() {
            worst = part;
        }
    }
    worst
}

/// Adds `M^-1 G^T r` to the states.
pub fn push(block: &Block, left: &mut [State], mut right: Option<&mut [State]>) {
    for (group, lane) in lanes(block) {
        let (n, r) = (vector(&group.normal, lane), vector(&group.impulse, lane));
        let turn = n.cross(r);
        let add = |state: &mut State, sign: f64| {
            let (v, s) = (sign * state.linear[3] * r, state.surface[3] * turn);
            for k in 0..3 {
                state.linear[k] += v[k];
                state.surface[k] -= s[k];
            }
        };
        add(&mut left[group.a[lane] as usize], 1.0);
        let b = group.b[lane] as usize;
        match &mut right {
            Some(right) => add(&mut right[b], -1.0),
            None => add(&mut left[b], -1.0),
        }
    }
}

/// Sums of squares of eq. 44 over a block, and its worst closing measure.
#[derive(Clone, Copy, Default)]
pub struct Sums {
    pub residual: f64,
    pub projected: f64,
    pub impulse: f64,
    pub closing: f64,
}

impl Sums {
    pub fn add(&mut self, part: &Sums) {
        self.residual += part.residual;
        self.projected += part.projected;
        self.impulse += part.impulse;
        self.closing = self.closing.max(part.closing);
    }
}

/// Residual rows `P(r - p z) - r` with `p = penalty_scale / w`, and what they are compared with. Plain loops over lanes become vector
/// code, the same bits on all instruction sets. Lanes without contact have only zeros.
pub struct NormsOf<'a> {
    pub block: &'a Block,
    pub left: &'a [State],
    pub right: &'a [State],
    pub penalty_scale: f64,
}

impl Work for NormsOf<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Lanes>(self, _simd: S) -> Sums {
        let mut residual = [0.0; GROUP];
        let mut projected = [0.0; GROUP];
        let mut impulse = [0.0; GROUP];
        let mut closing = [0.0f64; GROUP];
        for group in &self.block.groups {
            let mut d = [[0.0; GROUP]; 3];
            let mut spin = [[0.0; GROUP]; 3];
            for lane in 0..GROUP {
                let a = &self.left[group.a[lane] as usize];
                let b = &self.right[group.b[lane] as usize];
                for k in 0..3 {
                    d[k][lane] = a.linear[k] - b.linear[k];
                    spin[k][lane] = a.surface[k] + b.surface[k];
                }
            }
            let (n, r) = (&group.normal, &group.impulse);
            for l in 0..GROUP {
                let z = [0, 1, 2].map(|k: usize| {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    d[k][l] + (n[i][l] * spin[j][l] - n[j][l] * spin[i][l]) + group.slip[k][l]
                });
                let along = |x: [f64; 3]| x[0] * n[0][l] + x[1] * n[1][l] + x[2] * n[2][l];
                let squared = |x: [f64; 3]| x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
                let r = [0, 1, 2].map(|k: usize| r[k][l]);
                let (r_n, z_n) = (along(r), along(z));
                let normal = (r_n - self.penalty_scale * group.mass_normal[l] * z_n).max(0.0);
                let p = self.penalty_scale * group.mass_tangential[l];
                let x = [0, 1, 2].map(|k: usize| r[k] - p * z[k]);
                let x_n = along(x);
                let across = [0, 1, 2].map(|k: usize| x[k] - x_n * n[k][l]);
                let length = squared(across).sqrt();
                let radius = group.friction[l] * normal;
                let ratio = if length > radius {
                    radius / length
                } else {
                    1.0
                };
                let phi = [0, 1, 2].map(|k: usize| normal * n[k][l] + ratio * across[k]);
                residual[l] += squared([0, 1, 2].map(|k: usize| phi[k] - r[k]));
                projected[l] += squared(phi);
                impulse[l] += squared(r);
                closing[l] = closing[l].max(-z_n);
            }
        }
        Sums {
            residual: residual.iter().sum(),
            projected: projected.iter().sum(),
            impulse: impulse.iter().sum(),
            closing: closing.iter().copied().fold(0.0, f64::max),
        }
    }
}

/// Sum of squares of `M u`, moments over the radius.
pub fn momentum(states: &[State]) -> f64 {
    let part = |row: &[f64; 4]| {
        if row[3] > 0.0 {
            head(row).length_squared() / (row[3] * row[3])
        } else {
            0.0
        }
    };
    states
        .iter()
        .map(|s| part(&s.linear) + part(&s.surface))
        .sum()
}
