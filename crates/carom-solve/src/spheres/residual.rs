//! What is computed beside the sweep, without its kernel: the residual, and `u` of given impulses.

use super::groups::{Block, EMPTY};
use super::kernel::{Group, State};
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
        if part.closing > self.closing || part.closing.is_nan() {
            self.closing = part.closing;
        }
    }
}

/// Residual rows `P(r - p z) - r` with `p = penalty_scale / w`, and what they are compared with.
pub fn norms(block: &Block, left: &[State], right: &[State], penalty_scale: f64) -> Sums {
    let mut sums = Sums::default();
    for (group, lane) in lanes(block) {
        let (a, b) = (
            &left[group.a[lane] as usize],
            &right[group.b[lane] as usize],
        );
        let (n, r) = (vector(&group.normal, lane), vector(&group.impulse, lane));
        let spin = head(&a.surface) + head(&b.surface);
        let z = head(&a.linear) - head(&b.linear) + n.cross(spin) + vector(&group.slip, lane);
        let (r_n, z_n) = (r.dot(n), z.dot(n));
        let normal = (r_n - penalty_scale * group.mass_normal[lane] * z_n).max(0.0);
        let across =
            (r - penalty_scale * group.mass_tangential[lane] * z).reject_from_normalized(n);
        // Without friction the impulse has no part across, whatever the slip.
        let disc = across.clamp_length_max(group.friction[lane] * normal);
        let projected = normal * n + disc;
        sums.residual += (projected - r).length_squared();
        sums.projected += projected.length_squared();
        sums.impulse += r.length_squared();
        if -z_n > sums.closing || z_n.is_nan() {
            sums.closing = if z_n.is_nan() { f64::NAN } else { -z_n };
        }
    }
    sums
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
