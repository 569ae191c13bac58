//! The same problem with less friction: what is left where spheres wedge one another.

use crate::cone::Bounds;
use crate::island::{Newton, NewtonOptions};
use crate::report::SolveReport;
use crate::rows::{RowSystem, Subproblem};

impl Newton {
    /// Solves with these shares of the friction of the contacts that `of` names, one after the other, until one converges; each from
    /// nothing. Where none does, `(lambda, u)` and what the solver says of them are as they were.
    pub fn solve_with_less_friction<P: Subproblem>(
        &mut self,
        system: &mut RowSystem,
        problem: &mut P,
        options: &NewtonOptions,
        shares: &[f64],
        of: impl Fn(usize) -> bool,
        [lambda, u]: [&mut [f64]; 2],
    ) -> Option<SolveReport> {
        let bounds: Vec<Bounds> = system.contacts.iter().map(|c| c.bounds).collect();
        let start = (lambda.to_vec(), u.to_vec());
        let (history, mut attempts) = (self.history.clone(), std::mem::take(&mut self.attempts));
        let found = shares.iter().find_map(|&share| {
            for (index, (c, b)) in system.contacts.iter_mut().zip(&bounds).enumerate() {
                if of(index) {
                    c.bounds = b.scaled(share);
                }
            }
            lambda.fill(0.0);
            u.fill(0.0);
            let mut report = self.solve(system, problem, options, lambda, u);
            report.rung = "less friction";
            attempts.push(report.attempt());
            report.converged.then_some(report)
        });
        self.attempts = attempts;
        for (c, b) in system.contacts.iter_mut().zip(bounds) {
            c.bounds = b;
        }
        if found.is_none() {
            lambda.copy_from_slice(&start.0);
            u.copy_from_slice(&start.1);
            self.judge(system, problem, options, lambda, u);
            self.history = history;
        }
        found
    }
}
