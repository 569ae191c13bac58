//! The one semi-smooth Newton: `phi(r - p z) - r = 0` with the projections of Alart and Curnier (eqs. 10-23), and a line search.
//!
//! What is solved stands in [`Equations`]: islands of rows over nodes, with the correction `u` beside the multipliers
//! (`island`), and `u = W r + q` (`solver::SemiSmoothNewton`). Both have their projections from [`Augmented`].

use crate::cone::{self, Block, Status};
use crate::problem::RowGroup;

/// Merits of this many last iterates at most a new one may reach (non-monotone line search).
const MEMORY: usize = 6;

/// Equations that the method solves for `x`.
pub(crate) trait Equations {
    /// Keeps all that belongs to `x`; the norm of what the equations leave.
    fn evaluate(&mut self, x: &[f64]) -> f64;
    /// Whether the iterates end at `x`, the last one evaluated.
    fn stop(&mut self, x: &mut [f64], merit: f64, iterations: u32) -> bool;
    /// The step of the equations linearised at `x`, with this proximal shift. False: there is none.
    fn direction(&mut self, x: &[f64], merit: f64, shift: f64, step: &mut [f64]) -> bool;
}

/// How the method goes.
pub(crate) struct Rule {
    /// The proximal shift of the multipliers at first, and the share of it that stands however small the merit becomes.
    pub shift: f64,
    pub shift_floor: f64,
    /// Least merit of the start that the shift is measured by.
    pub least: f64,
    /// Last merits that count in the line search, and whether that of the start does: `None`, where the first step is never shortened.
    pub memory: usize,
    pub start_counts: Option<bool>,
    /// Step-length reductions per iteration; 0 switches the line search off.
    pub max_line_search: u32,
    /// Iterations that did not halve the least merit after which steps begin at half of their length: iterates that go round in
    /// circles leave them.
    pub patience: u32,
}

/// Memory of the method.
#[derive(Default)]
pub(crate) struct Steps {
    step: Vec<f64>,
    trial: Vec<f64>,
}

impl Steps {
    /// Iterates from `x` on; iterations, and step-length reductions over all of them.
    pub fn iterate(&mut self, on: &mut impl Equations, x: &mut [f64], rule: &Rule) -> [u32; 2] {
        self.step.resize(x.len(), 0.0);
        self.trial.resize(x.len(), 0.0);
        let (mut iterations, mut reductions) = (0, 0);
        let mut merits = [0.0; MEMORY];
        let mut merit = on.evaluate(x);
        let first = merit.max(rule.least);
        let (mut least, mut since_better) = (merit, 0);
        while !on.stop(x, merit, iterations) {
            merits[iterations as usize % rule.memory] = match rule.start_counts {
                None if iterations == 0 => f64::INFINITY,
                _ => merit,
            };
            if iterations == 1 && rule.start_counts != Some(true) {
                merits[0] = merit;
            }
            let shift = rule.shift * (merit / first).clamp(rule.shift_floor, 1.0);
            if !on.direction(x, merit, shift, &mut self.step) {
                break;
            }
            iterations += 1;
            let known = &merits[..(iterations as usize).min(rule.memory)];
            let bound = known.iter().fold(0.0f64, |m, &x| m.max(x));
            let longest = if since_better < rule.patience {
                1.0
            } else {
                0.5
            };
            let search = [longest, bound];
            merit = self.advance(on, x, search, rule.max_line_search, &mut reductions);
            since_better += 1;
            if merit < 0.5 * least {
                (least, since_better) = (merit, 0);
            }
        }
        [iterations, reductions]
    }

    /// Takes the step from its longest length on, halved while the merit exceeds the bound. If no length helps the best one tried is taken:
    /// the merit is only piecewise smooth and may have to rise across a change of status.
    fn advance(
        &mut self,
        on: &mut impl Equations,
        x: &mut [f64],
        [longest, bound]: [f64; 2],
        most: u32,
        reductions: &mut u32,
    ) -> f64 {
        let (mut length, mut best) = (longest, (f64::INFINITY, longest));
        let (mut tries, mut last) = (0, most == 0);
        loop {
            for (t, (x, d)) in self.trial.iter_mut().zip(x.iter().zip(&self.step)) {
                *t = x + length * d;
            }
            let merit = on.evaluate(&self.trial);
            if merit < best.0 {
                best = (merit, length);
            }
            if merit <= bound * (1.0 + 1e-12) || last {
                x.copy_from_slice(&self.trial);
                return merit;
            }
            tries += 1;
            *reductions += 1;
            last = tries >= most;
            length = if last { best.1 } else { 0.5 * length };
        }
    }
}

/// Multipliers, augmented and projected.
#[derive(Default)]
pub(crate) struct Augmented {
    /// Measures, and penalties `p`.
    pub z: Vec<f64>,
    pub penalty: Vec<f64>,
    /// `r - p z`, its projection `phi`, and `phi - r`.
    pub xi: Vec<f64>,
    pub phi: Vec<f64>,
    pub residual: Vec<f64>,
    pub tangents: Vec<Block>,
    pub statuses: Vec<Status>,
}

impl Augmented {
    pub fn resize(&mut self, rows: usize, contacts: usize) {
        for v in [
            &mut self.z,
            &mut self.penalty,
            &mut self.xi,
            &mut self.phi,
            &mut self.residual,
        ] {
            v.resize(rows, 0.0);
        }
        self.tangents.resize(contacts, Block::default());
        self.statuses.resize(contacts, Status::Gap);
    }

    /// All that follows from `r` and the measures.
    #[inline(always)] // a step of few balls has no time for a call and copies of groups
    pub fn project(&mut self, groups: impl Iterator<Item = RowGroup>, r: &[f64]) {
        for (status, group) in self.statuses.iter_mut().zip(groups) {
            let rows = group.rows();
            for row in rows.clone() {
                self.xi[row] = r[row] - self.penalty[row] * self.z[row];
            }
            let (xi, phi) = (&self.xi[rows.clone()], &mut self.phi[rows.clone()]);
            *status = if group.bilateral {
                cone::pass(xi, phi)
            } else {
                cone::project_from(&group.bounds, group.least, xi, phi)
            };
            for row in rows {
                self.residual[row] = self.phi[row] - r[row];
            }
        }
    }

    /// `d phi / d xi` of every contact.
    #[inline(always)]
    pub fn differentiate(&mut self, groups: impl Iterator<Item = RowGroup>) {
        for (block, group) in self.tangents.iter_mut().zip(groups) {
            if group.bilateral {
                cone::pass_tangent(group.dim, block);
            } else {
                cone::tangent_from(&group.bounds, group.least, &self.xi[group.rows()], block);
            }
        }
    }
}
