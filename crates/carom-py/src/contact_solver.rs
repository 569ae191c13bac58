//! Contact problems from arrays to the solvers and back.

use crate::dict::dict;
use carom_solve::ladder;
use carom_solve::problem::{Problem, ProblemError};
use carom_solve::solver::{self, Settings, Stage};
use carom_solve::Bounds;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Lets another thread end a solve.
#[pyclass(frozen, module = "carom._core")]
#[derive(Default)]
pub struct Cancel {
    flag: Arc<AtomicBool>,
}

#[pymethods]
impl Cancel {
    #[new]
    fn new() -> Cancel {
        Cancel::default()
    }

    /// The solves that were given this return what they have, as soon as their method looks up.
    fn cancel(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    #[getter]
    fn cancelled(&self) -> bool {
        self.flag.load(Ordering::Relaxed)
    }
}

/// Solves a contact problem in local form; see `carom.ContactProblem.solve`.
#[pyfunction]
#[pyo3(signature = (indptr, indices, data, q, dimension, mu, mu_r, mu_s, r0, solver, tolerance, max_iterations, time_limit, threads, cancel=None))]
#[allow(clippy::too_many_arguments)]
pub fn solve_contact_problem<'py>(
    py: Python<'py>,
    indptr: PyReadonlyArray1<'py, i64>,
    indices: PyReadonlyArray1<'py, i64>,
    data: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray1<'py, f64>,
    dimension: usize,
    mu: PyReadonlyArray1<'py, f64>,
    mu_r: PyReadonlyArray1<'py, f64>,
    mu_s: PyReadonlyArray1<'py, f64>,
    r0: Option<PyReadonlyArray1<'py, f64>>,
    solver: &str,
    tolerance: f64,
    max_iterations: u32,
    time_limit: f64,
    threads: usize,
    cancel: Option<PyRef<'py, Cancel>>,
) -> PyResult<Bound<'py, PyDict>> {
    let began = Instant::now();
    let value_error = |text: String| PyValueError::new_err(text);
    let (mu, mu_r, mu_s) = (mu.as_slice()?, mu_r.as_slice()?, mu_s.as_slice()?);
    if mu_r.len() != mu.len() || mu_s.len() != mu.len() {
        return Err(value_error("mu, mu_r and mu_s: lengths differ".into()));
    }
    let bounds: Vec<Bounds> = (0..mu.len())
        .map(|c| Bounds {
            sliding: mu[c],
            rolling: mu_r[c],
            spinning: mu_s[c],
        })
        .collect();
    let (indptr, indices) = (indptr.as_slice()?, indices.as_slice()?);
    let (data, q) = (data.as_slice()?, q.as_slice()?);
    let start = r0.as_ref().map(|r0| r0.as_slice()).transpose()?;
    if start.is_some_and(|start| start.len() != q.len()) {
        return Err(value_error("r0: as many values as q".into()));
    }
    let Some(mut method) = solver::by_name(solver) else {
        let names: Vec<&str> = solver::SOLVERS.iter().map(|s| s.0).collect();
        return Err(value_error(format!(
            "solver: {solver:?} is none of {}",
            names.join(", ")
        )));
    };
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(value_error(format!(
            "tolerance: {tolerance} is not positive"
        )));
    }
    let flag = cancel.map(|cancel| cancel.flag.clone());
    let solved = py.detach(move || {
        let (problem, map) = Problem::from_csr(indptr, indices, data, q, dimension, &bounds)?;
        let mut r = match start {
            Some(start) => map.enter(start),
            None => vec![0.0; problem.rows()],
        };
        let settings = Settings {
            tolerance,
            max_iterations,
            time_limit: Duration::try_from_secs_f64(time_limit).ok(),
            cancel: flag.as_deref(),
            threads,
        };
        let outcome = solver::solve(&problem, method.as_mut(), settings, &mut r);
        Ok((map.leave(&r), outcome))
    });
    let (r, outcome) = solved.map_err(|e: ProblemError| value_error(e.to_string()))?;
    let stages = outcome.stages.iter().map(|s| stage_dict(py, s));
    Ok(dict! { py,
        "r": PyArray1::from_vec(py, r),
        "converged": outcome.converged,
        "err_scaled": outcome.err_scaled,
        "iterations": outcome.iterations,
        "wall_s": began.elapsed().as_secs_f64(),
        "stages": stages.collect::<PyResult<Vec<_>>>()?,
    })
}

fn stage_dict<'py>(py: Python<'py>, s: &Stage) -> PyResult<Bound<'py, PyDict>> {
    Ok(dict! { py,
        "name": s.name,
        "solver": s.solver,
        "iterations": s.iterations,
        "err": s.err,
        "wall_s": s.seconds,
        "why": &s.why,
    })
}

/// Names of the solvers with one line each.
#[pyfunction]
pub fn contact_solvers() -> Vec<(&'static str, &'static str)> {
    solver::SOLVERS.to_vec()
}

/// What `auto` does, in words.
#[pyfunction]
pub fn auto_rule() -> String {
    ladder::rule()
}
