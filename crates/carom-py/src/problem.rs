//! Kept contact problems as dicts of arrays.

use crate::arrays::{put, Table};
use crate::dict::dict;
use carom_core::problem::KeptProblem;
use carom_core::Model;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A kept problem; see the stub for its entries.
pub fn problem_dict<'py>(
    py: Python<'py>,
    model: &Model,
    p: &KeptProblem,
) -> PyResult<Bound<'py, PyDict>> {
    let attempts: Vec<String> = p.attempts.iter().map(ToString::to_string).collect();
    let out = dict! { py,
        "level": p.level.name(),
        "step": p.step,
        "time": p.time,
        "part": p.part,
        "island": p.island,
        "index": p.index,
        "iterations": p.iterations,
        "residual": p.residual,
        "converged": p.converged,
        "attempts": attempts.join("; "),
        "joints": p.joints,
        "worst": p.worst,
    };
    let (nodes, rows) = (p.mass.len(), p.free.len());
    let spheres = p.spheres.iter().map(|&i| i64::from(i)).collect();
    put::<i64>(&out, "spheres", spheres, &[nodes])?;
    put(&out, "mass", p.mass.clone(), &[nodes])?;
    put(&out, "inertia", p.inertia.clone(), &[nodes])?;
    let bodies = Table {
        out: &out,
        records: &p.bodies,
    };
    bodies.rows("bodies", |&(a, b)| [a, model.outside(b)].map(i64::from))?;
    put(&out, "bounds", p.bounds.concat(), &[p.bounds.len(), 3])?;
    // A node that is none has an index out of range.
    let at = |node: u32| Some(i64::from(node)).filter(|&n| n < nodes as i64);
    let ends = p.nodes.iter().flatten().map(|&n| at(n).unwrap_or(-1));
    put::<i64>(&out, "node", ends.collect(), &[rows, 2])?;
    let gradient = p.gradient.as_flattened().concat();
    put(&out, "gradient", gradient, &[rows, 2, 6])?;
    put(&out, "q", p.free.clone(), &[rows])?;
    put(&out, "r", p.multiplier.clone(), &[rows])?;
    put(&out, "motion", p.motion.clone(), &[nodes, 6])?;
    put(&out, "correction", p.correction.clone(), &[nodes, 6])?;
    let load = if p.load.is_empty() {
        vec![0.0; 6 * nodes]
    } else {
        p.load.clone()
    };
    put(&out, "load", load, &[nodes, 6])?;
    let tangent = Table {
        out: &out,
        records: &p.load_tangent,
    };
    tangent.column("load_tangent_row", |e| i64::from(e.0))?;
    tangent.column("load_tangent_column", |e| i64::from(e.1))?;
    tangent.column("load_tangent_value", |e| e.2)?;
    Ok(out)
}
