//! Semi-smooth Newton on the augmented Lagrangian (eqs. 10-23), with line search and the chain of rule R1.
//!
//! Unknowns are the correction `u` (M u = G^T lambda) and the multipliers. One iteration solves
//! `[M - sum phi_N K + p G^T C G, -G^T C; -C p G, C - 1] (du, dl) = -(M u - G^T phi, phi - l)`
//! after elimination of `du` (see `linear_step`): the system that is factored is the small one over the rows of
//! active contacts. At velocity level (`K = 0`) this gives the iterates of the full saddle system exactly, because
//! `M u = G^T lambda` holds from the start (decision record 004).

use crate::cone::{self, Block, Status, MAX_ROWS};
use crate::gauss_seidel;
use crate::hybrid::Hybrid;
use crate::ladder::{Attempt, IslandWay, IslandWhen, ISLAND};
use crate::linear_step::LinearStep;
use crate::report::SolveReport;
use crate::rows::{RowSystem, Subproblem, NODE_DOF};

/// Numerical options of a solve.
#[derive(Clone, Copy, Debug)]
pub struct NewtonOptions {
    /// tol_r of eq. 44, dimensionless.
    pub tolerance: f64,
    /// Absolute floor of eq. 44 (tol_r tol_f), in the unit of the multipliers.
    pub floor: f64,
    /// Closed contacts must meet `|gap| <= gap_tolerance * r_c` (position level, small islands); infinite: not asked.
    pub gap_tolerance: f64,
    /// Rounding of a coordinate, m: what a gap cannot be known better than (position level).
    pub rounding: f64,
    pub max_iterations: u32,
    /// p per row is `penalty_scale / D_cc` (rule R1: 0.5; safe for one contact up to 2).
    pub penalty_scale: f64,
    /// Proximal shift of the multiplier block, relative to its diagonal, times min(1, |r|/|r_0|) (rule R11).
    pub proximal_shift: f64,
    /// Step-length reductions per iteration; 0 switches the line search off.
    pub max_line_search: u32,
    /// Gauss-Seidel sweeps before the last restart.
    pub sweeps: u32,
    /// Up to this many contacts: dense matrix with the exact Hessian.
    pub dense_contacts: usize,
}

/// Most that the floor of a large island counts for, over the terms of eq. 44; and the share of it that stands where there are none.
const FLOOR_OVER_TERMS: f64 = 9.0;
const LEAST_FLOOR: f64 = 1e-3;
/// Merits of this many last iterates a new one may reach (non-monotone line search).
const MEMORY: usize = 5;
/// The shift never falls below these shares of `proximal_shift`, in dense and in large islands: a redundant system
/// stays factorable and rounding is not blown up along its null space (1e-6 leaves piles cycling; measured).
const SHIFT_FLOOR_DENSE: f64 = 1e-4;
const SHIFT_FLOOR_LARGE: f64 = 1e-2;
/// Up to this many nodes an island with loads that depend on the motion has a dense matrix.
const DENSE_NODES: usize = 24;
/// Below this share of the first residual a dense system is tried without shift.
const NEAR: f64 = 1e-2;

/// Tolerance of a linear problem relative to that of the island, and how far it may be tightened.
const LINEAR_SHARE: f64 = 0.1;
const TIGHTER: f64 = 1e-2;
const LEAST_TOLERANCE: f64 = 1e-12;
/// Roundings of a coordinate by which a closed gap may miss its tolerance, and those that the gaps of a linear problem may keep. A rack of
/// touching spheres has gaps that are rounding and contradict one another; where steps are short they are above the tolerance of the
/// loads, and no method but the path solved them.
const GAP_ROUNDINGS: f64 = 16.0;
const LINEAR_ROUNDINGS: f64 = 4.0;
/// Share of the residual below which a linear problem was worth it.
const GAIN: f64 = 0.5;

/// Contact updates that the sweeps of one solve may cost: some tenths of a second. Doublings of the sweeps of a round.
const SWEEP_BUDGET: u32 = 400_000;
const MAX_DOUBLINGS: u32 = 9;
/// Sweeps go on while they bring something: where the residual of what they leave has not fallen to this share of its least in
/// so many rounds, thus in some sixteen times the sweeps, nothing better comes of them. Rows of joints, and gaps, that
/// contradict one another leave it where it is, or let it run away.
const STALE_SHARE: f64 = 0.5;
const STALE_ROUNDS: u32 = 4;

/// Workspace of the solver; allocate once, reuse for every problem.
#[derive(Default)]
pub struct Newton {
    z: Vec<f64>,
    penalty: Vec<f64>,
    xi: Vec<f64>,
    phi: Vec<f64>,
    residual: Vec<f64>,
    tangents: Vec<Block>,
    statuses: Vec<Status>,
    force: Vec<f64>,
    d_lambda: Vec<f64>,
    d_u: Vec<f64>,
    start_lambda: Vec<f64>,
    start_u: Vec<f64>,
    trial_lambda: Vec<f64>,
    trial_u: Vec<f64>,
    linear: LinearStep,
    hybrid: Hybrid,
    /// Norm of the residual where the last run of iterations began.
    began: f64,
    /// Relative residual (eq. 44) at each iterate of the last solve, all rungs in order.
    pub history: Vec<f64>,
    /// The rungs that the last solve has tried.
    pub attempts: Vec<Attempt>,
}

/// Norm of the residual and the sum of the norms of its terms.
#[derive(Clone, Copy)]
struct ResidualNorms {
    residual: f64,
    terms: f64,
}

impl ResidualNorms {
    /// `|r| / (sum |r_k| + tol_f)`: converged below tol_r (eq. 44).
    ///
    /// In large islands callers give a floor of lengths (decision record 015), far above rounding where steps are
    /// short: there it may count for [`FLOOR_OVER_TERMS`] times the terms, so the tolerance is never more than ten times
    /// what was asked for.
    fn relative(&self, options: &NewtonOptions, large: bool) -> f64 {
        let mut floor = options.floor / options.tolerance;
        if large {
            floor = floor.min(FLOOR_OVER_TERMS * self.terms.max(LEAST_FLOOR * floor));
        }
        if self.residual == 0.0 {
            return 0.0; // all terms may be 0 too: a ball at rest, with drag, on a floor without gravity
        }
        self.residual / (self.terms + floor)
    }
}

impl Newton {
    /// Statuses of the contacts at the end of the last solve.
    pub fn statuses(&self) -> &[Status] {
        &self.statuses
    }

    /// Rows of `phi - lambda` at the end of the last solve.
    pub fn residual_rows(&self) -> &[f64] {
        &self.residual
    }

    /// Measures `z` at the end of the last solve.
    pub fn measures(&self) -> &[f64] {
        &self.z
    }

    /// Solves from `(lambda, u)`, which must satisfy `M u = G^T lambda`; on success they hold the solution with
    /// `lambda` inside its cones. On failure of a rung the next one starts from the same start.
    pub fn solve<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        lambda: &mut [f64],
        u: &mut [f64],
    ) -> SolveReport {
        self.resize(system);
        self.history.clear();
        self.attempts.clear();
        self.start_lambda.copy_from_slice(lambda);
        self.start_u.copy_from_slice(u);
        let mut total = SolveReport::default();
        let (loads, swept) = (system.has_load(), options.sweeps > 0);
        let large = system.contacts.len() > options.dense_contacts;
        for rung in &ISLAND {
            let fits = match rung.when {
                IslandWhen::Always => true,
                IslandWhen::Large => large && !loads,
                IslandWhen::Swept => swept,
                IslandWhen::Small => swept && !large && !loads,
            };
            if !fits {
                continue;
            }
            total.fallback |= !self.attempts.is_empty();
            lambda.copy_from_slice(&self.start_lambda);
            u.copy_from_slice(&self.start_u);
            let mut report = match rung.way {
                IslandWay::Newton { penalty } => {
                    self.iterate(system, problem, options, penalty, lambda, u)
                }
                IslandWay::SweepsAndNewton { polish } => {
                    let most = [rung.budget, polish];
                    self.sweep_and_polish(system, problem, options, most, lambda, u)
                }
                IslandWay::Linearised => {
                    self.linearise(system, problem, options, rung.budget, lambda, u)
                }
            };
            report.rung = rung.name;
            total.add(&report);
            self.attempts.push(report.attempt());
            if total.converged {
                break;
            }
        }
        // Also an iterate that is accepted unconverged (option `warn`) lies inside its cones.
        lambda.copy_from_slice(&self.phi);
        total
    }

    /// What `(lambda, u)` leave as they are, `M u = G^T lambda`; converged as [`Newton::solve`] would call it (gaps of large islands
    /// are no condition).
    pub fn judge<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        lambda: &[f64],
        u: &[f64],
    ) -> SolveReport {
        self.resize(system);
        self.history.clear();
        self.set_penalty(system, options.penalty_scale);
        problem.evaluate(system, u, &mut self.z);
        let large = system.contacts.len() > options.dense_contacts;
        let norms = self.norms(system, lambda, u);
        let residual = norms.relative(options, large);
        self.history.push(residual);
        SolveReport {
            converged: residual < options.tolerance && (large || self.gaps_closed(system, options)),
            residual,
            ..SolveReport::default()
        }
    }

    /// A sequence of linear cone problems, each solved by the hybrid. At the velocity level one is enough; at the position level
    /// what is left of the gaps and the turning of the normals shrinks with every one.
    fn linearise<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        most: u32,
        lambda: &mut [f64],
        u: &mut [f64],
    ) -> SolveReport {
        let mut total = SolveReport::default();
        let large = system.contacts.len() > options.dense_contacts;
        self.set_penalty(system, options.penalty_scale);
        let mut tolerance = LINEAR_SHARE * options.tolerance;
        let mut rounding = LINEAR_ROUNDINGS * options.rounding;
        let mut before = f64::INFINITY;
        let mut exact = true;
        for _ in 0..most {
            problem.evaluate(system, u, &mut self.z);
            let norms = self.norms(system, lambda, u);
            total.residual = norms.relative(options, large);
            self.history.push(total.residual);
            if !norms.residual.is_finite() {
                return total;
            }
            // Gaps of large islands are a target here, no condition: in a tight one they may contradict one another by rounding.
            let solved = total.residual < options.tolerance;
            let closed = self.gaps_closed(system, options);
            if solved && (!exact || closed) {
                total.converged = large || closed;
                return total;
            }
            if total.residual > GAIN * before {
                // The linear problem was solved as well as it can be, or will be: another one would be the same.
                if !exact || tolerance < LEAST_TOLERANCE {
                    total.converged = solved && (large || closed);
                    return total;
                }
                tolerance *= TIGHTER;
                rounding *= TIGHTER;
            }
            before = total.residual;
            let z = std::mem::take(&mut self.z);
            let report = self
                .hybrid
                .solve(system, &z, [tolerance, rounding], lambda, u);
            self.z = z;
            exact = report.converged;
            total.iterations += report.iterations;
            total.fallback |= report.fallback;
        }
        total
    }

    /// Gauss-Seidel sweeps, twice as many in each round, and a short Newton polish after each. Where Newton alternates between
    /// statuses of redundant contacts, sweeps find a consistent set in the end.
    fn sweep_and_polish<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        [rounds, polish]: [u32; 2],
        lambda: &mut [f64],
        u: &mut [f64],
    ) -> SolveReport {
        let mut total = SolveReport::default();
        let mut swept_lambda = self.start_lambda.clone();
        let mut swept_u = self.start_u.clone();
        let polish = NewtonOptions {
            max_iterations: options.max_iterations.min(polish),
            ..*options
        };
        let mut budget = (SWEEP_BUDGET / system.contacts.len().max(1) as u32).max(options.sweeps);
        let (mut least, mut stale) = (f64::INFINITY, 0);
        for round in 0..rounds {
            let count = (options.sweeps << round.min(MAX_DOUBLINGS)).min(budget);
            if count == 0 {
                break;
            }
            budget -= count;
            let (r, v) = (&mut swept_lambda, &mut swept_u);
            gauss_seidel::sweeps(system, problem, count, r, v, &mut self.z);
            lambda.copy_from_slice(&swept_lambda);
            u.copy_from_slice(&swept_u);
            let report = self.iterate(system, problem, &polish, 1.0, lambda, u);
            total.add(&report);
            if report.converged {
                break;
            }
            if self.began < STALE_SHARE * least {
                (least, stale) = (self.began, 0);
                continue;
            }
            stale += 1;
            if stale == STALE_ROUNDS {
                break;
            }
        }
        total
    }

    fn resize(&mut self, system: &RowSystem) {
        let (rows, dofs) = (system.rows(), NODE_DOF * system.nodes());
        for v in [
            &mut self.z,
            &mut self.penalty,
            &mut self.xi,
            &mut self.phi,
            &mut self.residual,
            &mut self.d_lambda,
            &mut self.start_lambda,
            &mut self.trial_lambda,
        ] {
            v.resize(rows, 0.0);
        }
        for v in [
            &mut self.force,
            &mut self.d_u,
            &mut self.start_u,
            &mut self.trial_u,
        ] {
            v.resize(dofs, 0.0);
        }
        self.tangents
            .resize(system.contacts.len(), [[0.0; MAX_ROWS]; MAX_ROWS]);
        self.statuses.resize(system.contacts.len(), Status::Gap);
    }

    fn set_penalty(&mut self, system: &RowSystem, scale: f64) {
        for (p, d) in self.penalty.iter_mut().zip(&system.diag) {
            *p = scale / d;
        }
    }

    fn iterate<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        factor: f64,
        lambda: &mut [f64],
        u: &mut [f64],
    ) -> SolveReport {
        self.set_penalty(system, factor * options.penalty_scale);
        let mut report = SolveReport::default();
        let mut merits = [0.0; MEMORY];
        problem.evaluate(system, u, &mut self.z);
        let mut norms = self.norms(system, lambda, u);
        let first = norms.residual;
        self.began = first;
        // Loads couple nodes beyond the contacts: the nodes count.
        let dense = if system.has_load() {
            system.nodes() <= DENSE_NODES
        } else {
            system.contacts.len() <= options.dense_contacts
        };
        let shift_floor = if dense {
            SHIFT_FLOOR_DENSE
        } else {
            SHIFT_FLOOR_LARGE
        };
        loop {
            report.residual =
                norms.relative(options, system.contacts.len() > options.dense_contacts);
            self.history.push(report.residual);
            if !norms.residual.is_finite() {
                return report;
            }
            if report.residual < options.tolerance && self.gaps_closed(system, options) {
                lambda.copy_from_slice(&self.phi);
                report.converged = true;
                return report;
            }
            if report.iterations >= options.max_iterations {
                return report;
            }
            // Without multipliers the residual is small for want of terms: the first step is never shortened.
            let start = report.iterations == 0 && lambda.iter().all(|&l| l == 0.0);
            merits[report.iterations as usize % MEMORY] =
                if start { f64::INFINITY } else { norms.residual };
            if report.iterations == 1 {
                merits[0] = norms.residual;
            }
            let shift = options.proximal_shift * (norms.residual / first).clamp(shift_floor, 1.0);
            for (c, block) in system.contacts.iter().zip(&mut self.tangents) {
                if c.bilateral {
                    cone::pass_tangent(c.dim as usize, block);
                    continue;
                }
                let rows = c.row as usize..(c.row + c.dim) as usize;
                cone::tangent(&c.bounds, &self.xi[rows], block);
            }
            let solved = self.linear.solve(
                system,
                &crate::linear_step::Iterate {
                    z: &self.z,
                    penalty: &self.penalty,
                    phi: &self.phi,
                    tangents: &self.tangents,
                    statuses: &self.statuses,
                    lambda,
                    u,
                },
                shift,
                norms.residual < NEAR * first || report.residual < NEAR * NEAR,
                dense,
                &mut self.d_lambda,
                &mut self.d_u,
            );
            if solved.is_err() {
                return report;
            }
            report.iterations += 1;
            norms = self.advance(system, problem, options, &merits, lambda, u, &mut report);
        }
    }

    /// Takes the step, shortened while the merit exceeds those of the last iterates. If no length helps the best one
    /// tried is taken: the merit is only piecewise smooth and may have to rise across a change of status.
    #[allow(clippy::too_many_arguments)]
    fn advance<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        merits: &[f64; MEMORY],
        lambda: &mut [f64],
        u: &mut [f64],
        report: &mut SolveReport,
    ) -> ResidualNorms {
        let count = (report.iterations as usize).min(MEMORY);
        let bound = merits[..count].iter().fold(0.0f64, |m, &x| m.max(x));
        let mut length = 1.0;
        let mut tries = 0;
        let mut best = (f64::INFINITY, 1.0);
        let mut last = false;
        loop {
            for (t, (l, d)) in self
                .trial_lambda
                .iter_mut()
                .zip(lambda.iter().zip(&self.d_lambda))
            {
                *t = l + length * d;
            }
            for (t, (v, d)) in self.trial_u.iter_mut().zip(u.iter().zip(&self.d_u)) {
                *t = v + length * d;
            }
            let (trial_lambda, trial_u) = (
                std::mem::take(&mut self.trial_lambda),
                std::mem::take(&mut self.trial_u),
            );
            problem.evaluate(system, &trial_u, &mut self.z);
            let norms = self.norms(system, &trial_lambda, &trial_u);
            (self.trial_lambda, self.trial_u) = (trial_lambda, trial_u);
            let accept =
                norms.residual <= bound * (1.0 + 1e-12) || options.max_line_search == 0 || last;
            if norms.residual < best.0 {
                best = (norms.residual, length);
            }
            if accept {
                lambda.copy_from_slice(&self.trial_lambda);
                u.copy_from_slice(&self.trial_u);
                return norms;
            }
            tries += 1;
            report.line_search += 1;
            last = tries >= options.max_line_search;
            length = if last { best.1 } else { 0.5 * length };
        }
    }

    /// Augmented multipliers, projections, residual rows `phi - lambda`, statuses; returns the norms of eq. 44.
    fn norms(&mut self, system: &RowSystem, lambda: &[f64], u: &[f64]) -> ResidualNorms {
        let (mut rr, mut pp, mut ll) = (0.0, 0.0, 0.0);
        for (index, c) in system.contacts.iter().enumerate() {
            let rows = c.row as usize..(c.row + c.dim) as usize;
            for row in rows.clone() {
                self.xi[row] = lambda[row] - self.penalty[row] * self.z[row];
            }
            let (xi, phi) = (&self.xi[rows.clone()], &mut self.phi[rows.clone()]);
            self.statuses[index] = if c.bilateral {
                cone::pass(xi, phi)
            } else {
                cone::project(&c.bounds, xi, phi)
            };
            let translational = (c.row + c.translational) as usize;
            for row in rows {
                let scale = if row < translational {
                    1.0
                } else {
                    1.0 / c.length
                };
                let r = self.phi[row] - lambda[row];
                self.residual[row] = r;
                rr += (scale * r) * (scale * r);
                pp += (scale * self.phi[row]) * (scale * self.phi[row]);
                ll += (scale * lambda[row]) * (scale * lambda[row]);
            }
        }
        system.momentum(&self.phi, &mut self.force);
        let (mut inertia, mut force) = (0.0, 0.0);
        for node in 0..system.nodes() {
            let (m, i) = (1.0 / system.inv_mass[node], 1.0 / system.inv_inertia[node]);
            let turn = 1.0 / system.node_length[node];
            for k in 0..NODE_DOF {
                let (mass, scale) = if k < 3 { (m, 1.0) } else { (i, turn) };
                let a = scale * mass * u[NODE_DOF * node + k];
                let b = scale * self.force[NODE_DOF * node + k];
                inertia += a * a;
                force += b * b;
                rr += (a - b) * (a - b);
            }
        }
        ResidualNorms {
            residual: rr.sqrt(),
            terms: inertia.sqrt() + force.sqrt() + pp.sqrt() + ll.sqrt(),
        }
    }

    fn gaps_closed(&self, system: &RowSystem, options: &NewtonOptions) -> bool {
        options.gap_tolerance.is_infinite()
            || system.contacts.iter().all(|c| {
                let tolerance = options.gap_tolerance * c.length + GAP_ROUNDINGS * options.rounding;
                if c.bilateral {
                    let rows = c.row as usize..(c.row + c.translational) as usize;
                    return self.z[rows].iter().all(|z| z.abs() <= tolerance);
                }
                let z = self.z[c.row as usize];
                z >= -tolerance && (self.phi[c.row as usize] == 0.0 || z <= tolerance)
            })
    }
}
