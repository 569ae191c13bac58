//! Islands of rows, solved by the ladder [`ISLAND`] (rule R1): large ones at a coarse tolerance are swept, others have Newton's method first.
//!
//! Unknowns are the multipliers and the correction `u` (M u = G^T lambda). One iteration of Newton's method solves
//! `[M - sum phi_N K + p G^T C G, -G^T C; -C p G, C - 1] (du, dl) = -(M u - G^T phi, phi - l)`
//! after elimination of `du` (see `linear_step`): the system that is factored is the small one over the rows of
//! active contacts. At velocity level (`K = 0`) this gives the iterates of the full saddle system exactly, because
//! `M u = G^T lambda` holds from the start (decision record 004).

mod convex;
mod hybrid;
mod linearised;
mod swept;

use crate::companion::moved_apart;
use crate::cone::Status;
use crate::judge::Terms;
use crate::ladder::{Attempt, IslandWay, IslandWhen, COARSE_TOLERANCE, ISLAND};
use crate::linear_step::{Iterate, LinearStep};
use crate::newton::{Augmented, Equations, Rule, Steps};
use crate::report::SolveReport;
use crate::rows::{RowContact, RowSystem, Subproblem, NODE_DOF, WORLD};
use crate::solver::SPLIT_CONTACTS;
use hybrid::Hybrid;
use swept::RowSweeps;

/// Numerical options of a solve.
#[derive(Clone, Copy, Debug)]
pub struct NewtonOptions {
    /// tol_r of eq. 44, dimensionless.
    pub tolerance: f64,
    /// Absolute floor of eq. 44 (tol_r tol_f), in the unit of the multipliers.
    pub floor: f64,
    /// Closed contacts must meet `|gap| <= gap_tolerance * r_c` (position level, where rows turn with the correction; small islands);
    /// infinite: not asked (velocity level).
    pub gap_tolerance: f64,
    /// What the worst contact may close by, m/s (velocity level); infinite: not asked.
    pub closing: f64,
    /// By how much a row, or a node's velocity, may miss what the impulses that are taken make of it, m/s (velocity level); infinite: not asked.
    pub missed: f64,
    /// Rounding of a coordinate, m: what a gap cannot be known better than (position level).
    pub rounding: f64,
    pub max_iterations: u32,
    /// p per row is `penalty_scale / D_cc` (rule R1: 0.5; safe for one contact up to 2).
    pub penalty_scale: f64,
    /// Proximal shift of the multiplier block, relative to its diagonal, times min(1, |r|/|r_0|) (rule R11).
    pub proximal_shift: f64,
    /// Step-length reductions per iteration; 0 switches the line search off.
    pub max_line_search: u32,
    /// Up to this many contacts: dense matrix with the exact Hessian.
    pub dense_contacts: usize,
    /// Share by which contacts give way of what they would alone: where impulses can hold one another many solutions are one then.
    pub softness: f64,
    pub beside: Beside,
}

/// Rungs of [`ISLAND`] that may be climbed beside Newton's method.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside {
    /// Sweeps, where the island is large and the tolerance coarse.
    pub sweeps: bool,
    pub linearised: bool,
    /// The convex companion, with this share of the friction.
    pub companion: Option<f64>,
}

/// Least shift of a dense island, a share (1) of `proximal_shift`: a redundant system stays factorable and rounding is not
/// blown up along its null space. With 1e-6 piles go round in circles (measured); with 1 convergence is linear.
const SHIFT_FLOOR_DENSE: f64 = 1e-4;
/// The same of large islands, which have sparse matrices.
const SHIFT_FLOOR_LARGE: f64 = 1e-2;
/// Last merits (1) that a new one may reach. With 1 steps across a change of status are cut to nothing; with many, Newton's
/// method goes round in circles until its iterations are spent.
const MEMORY: usize = 5;
/// Iterations (1) that do not halve the least merit after which steps are halved. Small: steps across a change of status take more
/// iterations; large: circles of two statuses of 3 to 9 contacts are left to the next rung.
const PATIENCE: u32 = 6;
/// Iterations (1) that do not halve the least residual after which Newton's method leaves an island of clumps to the next rung. Small: what would have
/// converged is solved twice; large: hyperstatic islands, in which it goes round in circles, cost all its iterations first.
const GIVE_UP: u32 = 15;
/// Relative residual (1) above which a solved island takes one more step. Small: steps of small islands take an iteration more; large:
/// piles at rest creep by a millionth of the speed that loads give them.
const FINE: f64 = 1e-8;
/// Nodes (1) up to which an island with loads that depend on the motion has a dense matrix. Only time hangs on it.
const DENSE_NODES: usize = 24;
/// Share (1) of the first residual below which a dense system is tried without shift: quadratic from there. With 1 the shift is
/// missing where it is needed, far from the solution; with 0 the last digits take many iterations.
const NEAR: f64 = 1e-2;
/// By how much (1) penalties of both rows of a disc differ that are not those of spheres, where rounding alone makes them differ. Both rows then have
/// one penalty: with two, what slides is not slowed against its slip.
const UNEVEN: f64 = 1e-9;
/// Roundings of the impulses on a node (1) by which its velocity may be off. With 0 a light ball that heavy ones squeeze is never solved to a fine
/// tolerance; large, it is moved by what it is squeezed by.
const MISSED_ROUNDINGS: f64 = 64.0;
/// Roundings of a coordinate (1) by which a closed gap may miss its tolerance. A rack of touching spheres has gaps that are
/// rounding and contradict one another: with 0 no method solves them where steps are short; large, joints drift.
const GAP_ROUNDINGS: f64 = 16.0;

/// Workspace of the solver; allocate once, reuse for every problem.
#[derive(Default)]
pub struct Newton {
    at: Augmented,
    steps: Steps,
    force: Vec<f64>,
    /// Multipliers, then corrections: those at the start, and the iterate.
    start: Vec<f64>,
    x: Vec<f64>,
    linear: LinearStep,
    hybrid: Hybrid,
    row_sweeps: RowSweeps,
    /// What impulses of each node round off its velocity, m/s.
    rounding: Vec<f64>,
    /// Norm of the residual where the last run of iterations began.
    began: f64,
    /// Relative residual (eq. 44) at each iterate of the last solve, all rungs in order.
    pub history: Vec<f64>,
    /// The rungs that the last solve has tried.
    pub attempts: Vec<Attempt>,
}

/// An island on its way up the ladder.
struct Island<'a, P> {
    system: &'a mut RowSystem,
    problem: &'a mut P,
    options: &'a NewtonOptions,
}

impl<P> Island<'_, P> {
    fn is_large(&self) -> bool {
        self.system.contacts.len() > self.options.dense_contacts
    }

    /// Whether sweeps are the faster way.
    fn is_coarse(&self) -> bool {
        let options = self.options;
        let contacts = self.system.contacts.iter().filter(|c| !c.bilateral);
        let many = contacts.count() > options.dense_contacts;
        many && options.tolerance >= COARSE_TOLERANCE && options.beside.sweeps
    }

    /// Relative residual of eq. 44.
    fn relative(&self, terms: &Terms) -> f64 {
        let floor = self.options.floor / self.options.tolerance;
        terms.relative(floor, self.is_large())
    }
}

impl Newton {
    /// Statuses of the contacts at the end of the last solve.
    pub fn statuses(&self) -> &[Status] {
        &self.at.statuses
    }

    /// Rows of `phi - lambda` at the end of the last solve.
    pub fn residual_rows(&self) -> &[f64] {
        &self.at.residual
    }

    /// Measures `z` at the end of the last solve.
    pub fn measures(&self) -> &[f64] {
        &self.at.z
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
        let mut on = Island {
            system,
            problem,
            options,
        };
        self.begin(on.system);
        self.attempts.clear();
        self.start.clear();
        self.start.extend_from_slice(lambda);
        self.start.extend_from_slice(u);
        let mut x = std::mem::take(&mut self.x);
        let mut total = SolveReport::default();
        let held = on.system.contacts.iter().any(|c| c.least > 0.0);
        for rung in &ISLAND {
            let knows = !held || !matches!(rung.way, IslandWay::Companion);
            let fits = knows
                && match rung.when {
                    IslandWhen::Coarse => on.is_coarse(),
                    IslandWhen::Swept => {
                        let velocities = options.gap_tolerance.is_infinite();
                        let swept = !self.attempts.is_empty();
                        swept && velocities && on.system.contacts.len() <= SPLIT_CONTACTS
                    }
                    IslandWhen::Always => true,
                    IslandWhen::Linearised => options.beside.linearised,
                    IslandWhen::Last => options.beside.companion.is_some(),
                };
            if !fits {
                continue;
            }
            total.fallback |= !self.attempts.is_empty();
            x.clone_from(&self.start);
            let report = match rung.way {
                IslandWay::Sweeps => self.sweep(&mut on, rung.budget, &mut x),
                IslandWay::Split => self.split(&mut on, rung.budget, &mut x),
                IslandWay::Newton => Some(self.iterate(&mut on, &mut x)),
                IslandWay::Linearised => Some(self.linearise(&mut on, rung.budget, &mut x)),
                IslandWay::Companion => Some(self.companion(&mut on, rung.budget, &mut x)),
            };
            let Some(mut report) = report else {
                continue;
            };
            report.rung = rung.name;
            total.add(&report);
            self.attempts.push(report.attempt());
            if total.converged {
                break;
            }
        }
        // Also an iterate that is accepted unconverged (option `warn`) lies inside its cones.
        lambda.copy_from_slice(&self.at.phi);
        u.copy_from_slice(&x[lambda.len()..]);
        self.x = x;
        total
    }

    /// What `(lambda, u)` leave as they are, `M u = G^T lambda`; converged as [`Newton::solve`] would call it (gaps of large islands
    /// are no condition, nor is each row by itself).
    pub fn judge<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        lambda: &[f64],
        u: &[f64],
    ) -> SolveReport {
        let mut on = Island {
            system,
            problem,
            options,
        };
        self.begin(on.system);
        self.set_penalty(on.system, options.penalty_scale);
        let terms = self.evaluate(&mut on, &[lambda, u].concat());
        let residual = on.relative(&terms);
        self.history.push(residual);
        let gaps_closed = on.is_large() || self.gaps_closed(on.system, options, 0.0);
        let closed = gaps_closed && self.none_closes(on.system, options);
        SolveReport {
            converged: residual < options.tolerance && closed,
            residual,
            ..SolveReport::default()
        }
    }

    fn begin(&mut self, system: &RowSystem) {
        self.at.resize(system.rows(), system.contacts.len());
        self.force.resize(NODE_DOF * system.nodes(), 0.0);
        self.history.clear();
    }

    /// Whether rows of friction differ by more than those of spheres do.
    fn set_penalty(&mut self, system: &RowSystem, scale: f64) -> bool {
        for (p, d) in self.at.penalty.iter_mut().zip(&system.diag) {
            *p = scale / d;
        }
        let mut uneven = false;
        for c in system.contacts.iter().filter(|c| !c.bilateral) {
            let discs = [c.bounds.sliding, c.bounds.rolling].map(|bound| bound > 0.0);
            let mut row = c.row as usize + 1;
            for _ in discs.into_iter().filter(|is_there| *is_there) {
                let both = &mut self.at.penalty[row..row + 2];
                let [least, most] = [both[0].min(both[1]), both[0].max(both[1])];
                if most > (1.0 + UNEVEN) * least {
                    both.fill(least);
                    uneven = true;
                }
                row += 2;
            }
        }
        uneven
    }

    /// Newton's method.
    fn iterate<P: Subproblem>(&mut self, on: &mut Island<P>, x: &mut [f64]) -> SolveReport {
        let options = on.options;
        let uneven = self.set_penalty(on.system, options.penalty_scale);
        // Loads couple nodes beyond the contacts: the nodes count.
        let dense = if on.system.has_load() {
            on.system.nodes() <= DENSE_NODES
        } else {
            !on.is_large()
        };
        // Without multipliers the residual is small for want of terms: the first step is never shortened.
        let nothing = x[..on.system.rows()].iter().all(|&l| l == 0.0);
        let rule = Rule {
            shift: options.proximal_shift,
            shift_floor: if dense {
                SHIFT_FLOOR_DENSE
            } else {
                SHIFT_FLOOR_LARGE
            },
            least: 0.0,
            memory: MEMORY,
            start_counts: if nothing { None } else { Some(false) },
            max_line_search: options.max_line_search,
            patience: PATIENCE,
        };
        let mut steps = std::mem::take(&mut self.steps);
        let mut run = OnRows {
            on,
            newton: self,
            dense,
            terms: Terms::default(),
            report: SolveReport::default(),
            best: f64::INFINITY,
            since_better: 0,
            may_give_up: options.beside.linearised && uneven,
        };
        let [mut iterations, line_search] = steps.iterate(&mut run, x, &rule);
        // Not where Newton's method alone is asked for: its iterations are the paper's then.
        let coarse = run.report.residual > FINE && options.beside.companion.is_some();
        if run.report.converged && coarse && iterations > 0 {
            iterations += u32::from(run.refine(x, rule.shift * rule.shift_floor));
        }
        let report = run.report;
        self.steps = steps;
        if report.converged {
            x[..self.at.phi.len()].copy_from_slice(&self.at.phi);
        }
        SolveReport {
            iterations,
            line_search,
            ..report
        }
    }

    /// Measures, projections and residual rows at `x`, and what eq. 44 asks for.
    fn evaluate<P: Subproblem>(&mut self, on: &mut Island<P>, x: &[f64]) -> Terms {
        let (lambda, u) = x.split_at(on.system.rows());
        on.problem.evaluate(on.system, u, &mut self.at.z);
        let system = &*on.system;
        if on.options.softness > 0.0 {
            for row in (system.contacts.iter().filter(|c| !c.bilateral)).flat_map(RowContact::rows)
            {
                self.at.z[row] += on.options.softness * system.diag[row] * lambda[row];
            }
        }
        self.at
            .project(system.contacts.iter().map(RowContact::group), lambda);
        let (mut rr, mut pp, mut ll, mut moved) = (0.0, 0.0, 0.0, 0.0);
        for c in &system.contacts {
            moved += c.least * c.least;
            let translational = (c.row + c.translational) as usize;
            for row in c.rows() {
                let scale = if row < translational {
                    1.0
                } else {
                    1.0 / c.length
                };
                let [r, phi, l] = [self.at.residual[row], self.at.phi[row], lambda[row]];
                rr += (scale * r) * (scale * r);
                pp += (scale * phi) * (scale * phi);
                ll += (scale * l) * (scale * l);
                let pz = scale * self.at.penalty[row] * self.at.z[row];
                moved += pz * pz;
            }
        }
        system.momentum(&self.at.phi, &mut self.force);
        let (mut inertia, mut force) = (0.0, 0.0);
        for node in 0..system.nodes() {
            let (m, i) = (1.0 / system.inv_mass[node], 1.0 / system.inv_inertia[node]);
            let turn = 1.0 / system.node_length[node];
            for k in 0..NODE_DOF {
                let (mass, scale) = if k < 3 { (m, 1.0) } else { (i, turn) };
                let a = scale * mass * u[NODE_DOF * node + k];
                let b = scale * self.force[NODE_DOF * node + k];
                let load = system.load.get(NODE_DOF * node + k);
                moved += load.map_or(0.0, |load| (scale * load).powi(2));
                inertia += a * a;
                force += b * b;
                rr += (a - b) * (a - b);
            }
        }
        Terms {
            residual: rr.sqrt(),
            terms: inertia.sqrt() + force.sqrt() + pp.sqrt() + ll.sqrt(),
            motion: inertia.sqrt() + moved.sqrt(),
        }
    }

    /// Whether rows of impulses, and velocities of nodes, are those of the projected impulses, each by itself, but for the rounding of what presses it.
    /// (Norms of all impulses tell nothing of what is light.)
    fn none_misses(&mut self, system: &RowSystem, options: &NewtonOptions, u: &[f64]) -> bool {
        if options.missed.is_infinite() {
            return true;
        }
        self.rounding.clear();
        self.rounding.resize(system.nodes(), 0.0);
        let length = |node: usize| system.node_length[node];
        for c in &system.contacts {
            let (forces, moments) = self.at.phi[c.rows()].split_at(c.translational as usize);
            let sum = |part: &[f64]| part.iter().map(|phi| phi.abs()).sum::<f64>();
            let size = sum(forces) + sum(moments) / c.length;
            for node in [c.node_a, c.node_b]
                .into_iter()
                .filter(|&node| node != WORLD)
            {
                let node = node as usize;
                let inverse =
                    system.inv_mass[node] + length(node).powi(2) * system.inv_inertia[node];
                self.rounding[node] += MISSED_ROUNDINGS * f64::EPSILON * inverse * size;
            }
        }
        let rows = system.contacts.iter().all(|c| {
            let of = |node: u32| self.rounding.get(node as usize).copied().unwrap_or(0.0);
            let most = options.missed + of(c.node_a) + of(c.node_b);
            let translational = (c.row + c.translational) as usize;
            c.rows().all(|row| {
                let lever = if row < translational { 1.0 } else { c.length };
                self.at.residual[row].abs() * lever <= most * self.at.penalty[row]
            })
        });
        rows && (0..system.nodes()).all(|node| {
            let inverse = [
                (1.0, system.inv_mass[node]),
                (length(node), system.inv_inertia[node]),
            ];
            (0..NODE_DOF).all(|k| {
                let ((lever, inverse), at) = (inverse[k / 3], NODE_DOF * node + k);
                let off = (u[at] - inverse * self.force[at]).abs() * lever;
                off <= options.missed + self.rounding[node]
            })
        })
    }

    /// Whether no contact closes faster than it may.
    fn none_closes(&self, system: &RowSystem, options: &NewtonOptions) -> bool {
        let mut contacts = system.contacts.iter().filter(|c| !c.bilateral);
        contacts.all(|c| self.at.z[c.row as usize] >= -options.closing)
    }

    /// Whether all is closed and nothing closes, as far as the options ask for it.
    fn are_closed(&self, system: &RowSystem, options: &NewtonOptions) -> bool {
        self.none_closes(system, options) && self.gaps_closed(system, options, 0.0)
    }

    /// Whether what is pressed is closed and nothing overlaps, as far as the options ask for it. `share` of the friction moves apart what slides
    /// (the convex companion alone).
    fn gaps_closed(&self, system: &RowSystem, options: &NewtonOptions, share: f64) -> bool {
        options.gap_tolerance.is_infinite()
            || system.contacts.iter().all(|c| {
                let tolerance = options.gap_tolerance * c.length + GAP_ROUNDINGS * options.rounding;
                if c.bilateral {
                    let rows = c.row as usize..(c.row + c.translational) as usize;
                    return self.at.z[rows].iter().all(|z| z.abs() <= tolerance);
                }
                let z = self.at.z[c.row as usize];
                let closed = || {
                    let apart = share * moved_apart(&c.bounds, &self.at.z[c.rows()]);
                    z <= tolerance + apart
                };
                z >= -tolerance && (self.at.phi[c.row as usize] == 0.0 || closed())
            })
    }
}

/// Newton's method at work on an island.
struct OnRows<'r, 'a, P> {
    on: &'r mut Island<'a, P>,
    newton: &'r mut Newton,
    dense: bool,
    terms: Terms,
    report: SolveReport,
    /// Least residual, and the iterations since it was found.
    best: f64,
    since_better: u32,
    /// Whether another rung comes after it.
    may_give_up: bool,
}

impl<P: Subproblem> OnRows<'_, '_, P> {
    /// One more step from a solution, if it is nearer: the last one is quadratic, and what rests does not creep by a coarse tolerance.
    /// Whether it was taken.
    fn refine(&mut self, x: &mut [f64], shift: f64) -> bool {
        let mut step = vec![0.0; x.len()];
        if !self.direction(x, self.terms.residual, shift, &mut step) {
            return false;
        }
        step.iter_mut().zip(&*x).for_each(|(step, x)| *step += x);
        self.evaluate(&step);
        let residual = self.on.relative(&self.terms);
        let closed = self.newton.are_closed(self.on.system, self.on.options);
        let nearer = residual < self.report.residual && closed;
        if nearer {
            x.copy_from_slice(&step);
            self.report.residual = residual;
            self.newton.history.push(residual);
        } else {
            self.evaluate(x);
        }
        nearer
    }
}

impl<P: Subproblem> Equations for OnRows<'_, '_, P> {
    fn evaluate(&mut self, x: &[f64]) -> f64 {
        self.terms = self.newton.evaluate(self.on, x);
        self.terms.residual
    }

    fn stop(&mut self, x: &mut [f64], merit: f64, iterations: u32) -> bool {
        let (newton, on, report) = (&mut *self.newton, &*self.on, &mut self.report);
        if iterations == 0 {
            newton.began = merit;
        }
        report.residual = on.relative(&self.terms);
        newton.history.push(report.residual);
        report.converged = merit.is_finite()
            && report.residual < on.options.tolerance
            && newton.are_closed(on.system, on.options)
            && newton.none_misses(on.system, on.options, &x[newton.at.phi.len()..]);
        self.since_better += 1;
        if report.residual < 0.5 * self.best {
            (self.best, self.since_better) = (report.residual, 0);
        }
        report.converged
            || !merit.is_finite()
            || iterations >= on.options.max_iterations
            || (self.may_give_up && self.since_better > GIVE_UP)
    }

    fn direction(&mut self, x: &[f64], merit: f64, shift: f64, step: &mut [f64]) -> bool {
        let (newton, system) = (&mut *self.newton, &*self.on.system);
        let at = &mut newton.at;
        at.differentiate(system.contacts.iter().map(RowContact::group));
        let (lambda, u) = x.split_at(system.rows());
        let (d_lambda, d_u) = step.split_at_mut(system.rows());
        let iterate = Iterate {
            penalty: &at.penalty,
            phi: &at.phi,
            tangents: &at.tangents,
            statuses: &at.statuses,
            lambda,
            u,
            softness: self.on.options.softness,
        };
        let near = merit < NEAR * newton.began || self.report.residual < NEAR * NEAR;
        let linear = &mut newton.linear;
        linear
            .solve(system, &iterate, shift, near, self.dense, d_lambda, d_u)
            .is_ok()
    }
}
