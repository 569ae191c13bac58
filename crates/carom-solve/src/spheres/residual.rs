//! What is computed beside the sweep, without its kernel: the residual, and `u` of given impulses.

use super::bodies::{Both, State};
use super::goal::Projection;
use super::groups::{least, ContactBlock};
use super::kernel::{gather, measures, project};
use super::lanes::{head, Lanes, Work, GROUP};
use super::vectors::{dot, larger, part, parts, sub};

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

/// Residual rows `P(r - p z) - r` with `p = penalty_scale / w`, and what they are compared with. Lanes without contact have only zeros.
pub struct NormsOf<'a> {
    pub block: &'a ContactBlock,
    pub left: &'a [State],
    pub right: &'a [State],
    pub penalty_scale: f64,
    pub law: Projection,
}

impl Work for NormsOf<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) -> Sums {
        let mut sums = [[0.0; GROUP]; 4];
        let scale_of = s.splat_f64s(self.penalty_scale);
        let bodies = Both(self.left, self.right);
        for (k, group) in self.block.groups.iter().enumerate() {
            let least = least(&self.block.least, k);
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let n = parts::<S>(&group.normal, at);
                let r = parts::<S>(&group.impulse, at);
                let z = measures(s, gather(s, &bodies, group, at), group, at);
                let (r_n, z_n) = (dot(s, r, n), dot(s, z, n));
                let masses = [
                    s.mul_f64s(scale_of, group.mass_normal(s, at)),
                    s.mul_f64s(scale_of, part::<S>(&group.mass_tangential, at)),
                ];
                let bounds = [part::<S>(&group.friction, at), part::<S>(least, at)];
                let phi = project(s, r, [r_n, z_n], z, n, masses, (bounds, self.law));
                let residual = sub(s, phi, r);
                let lane = at / S::F64_LANES;
                for (sum, x) in sums.iter_mut().zip([residual, phi, r]) {
                    let sum = &mut S::as_mut_simd_f64s(sum).0[lane];
                    *sum = s.add_f64s(*sum, dot(s, x, x));
                }
                let closing = &mut S::as_mut_simd_f64s(&mut sums[3]).0[lane];
                *closing = larger(s, s.sub_f64s(s.splat_f64s(0.0), z_n), *closing);
            }
        }
        let [mut residual, mut projected, mut impulse] =
            [0, 1, 2].map(|k: usize| sums[k].iter().sum());
        if !self.block.rolls.is_empty() {
            let moments = super::moments::norms(s, self.block, &bodies, self.penalty_scale);
            residual += moments[0];
            projected += moments[1];
            impulse += moments[2];
        }
        Sums {
            residual,
            projected,
            impulse,
            closing: sums[3].iter().copied().fold(0.0, f64::max),
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
