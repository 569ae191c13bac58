//! Contact problems from arrays to the solvers and back.

use carom_solve::problem::Problem;
use carom_solve::solver::{self, Settings};
use carom_solve::Bounds;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::time::{Duration, Instant};

/// Solves a contact problem in local form; see `carom.ContactProblem.solve`.
#[pyfunction]
#[pyo3(signature = (indptr, indices, data, q, dimension, mu, mu_r, mu_s, r0, solver, tolerance, max_iterations, time_limit, threads))]
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
) -> PyResult<Bound<'py, PyDict>> {
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
    let (problem, map) = Problem::from_csr(
        indptr.as_slice()?,
        indices.as_slice()?,
        data.as_slice()?,
        q.as_slice()?,
        dimension,
        &bounds,
    )
    .map_err(|e| value_error(e.to_string()))?;
    let start = match &r0 {
        Some(r0) if r0.len()? != q.len()? => {
            return Err(value_error("r0: as many values as q".into()))
        }
        Some(r0) => map.enter(r0.as_slice()?),
        None => vec![0.0; problem.rows()],
    };
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
    let settings = Settings {
        tolerance,
        max_iterations,
        time_limit: Duration::try_from_secs_f64(time_limit).ok(),
        cancel: None,
        threads,
    };
    let began = Instant::now();
    let (r, outcome) = py.detach(move || {
        let mut r = start;
        let outcome = solver::solve(&problem, method.as_mut(), settings, &mut r);
        (map.leave(&r), outcome)
    });
    let stages = PyList::empty(py);
    for s in &outcome.stages {
        let stage = PyDict::new(py);
        stage.set_item("name", s.name)?;
        stage.set_item("solver", s.solver)?;
        stage.set_item("iterations", s.iterations)?;
        stage.set_item("err", s.err)?;
        stage.set_item("wall_s", s.seconds)?;
        stage.set_item("why", &s.why)?;
        stages.append(stage)?;
    }
    let out = PyDict::new(py);
    out.set_item("r", PyArray1::from_vec(py, r))?;
    out.set_item("converged", outcome.converged)?;
    out.set_item("iterations", outcome.iterations)?;
    out.set_item("wall_s", began.elapsed().as_secs_f64())?;
    out.set_item("stages", stages)?;
    Ok(out)
}

/// Names of the solvers with one line each.
#[pyfunction]
pub fn contact_solvers() -> Vec<(&'static str, &'static str)> {
    solver::SOLVERS.to_vec()
}

/// What `auto` does, in words.
#[pyfunction]
pub fn auto_rule() -> &'static str {
    solver::RULE
}
