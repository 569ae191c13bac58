//! Kept contact problems as dicts of arrays.

use crate::arrays::{flat, put};
use carom_core::problem::KeptProblem;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A kept problem; see the stub for its entries.
pub fn problem_dict<'py>(py: Python<'py>, p: &KeptProblem) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("level", p.level.name())?;
    out.set_item("step", p.step)?;
    out.set_item("time", p.time)?;
    out.set_item("part", p.part)?;
    out.set_item("island", p.island)?;
    out.set_item("index", p.index)?;
    out.set_item("iterations", p.iterations)?;
    out.set_item("residual", p.residual)?;
    out.set_item("converged", p.converged)?;
    let attempts: Vec<String> = p.attempts.iter().map(ToString::to_string).collect();
    out.set_item("attempts", attempts.join("; "))?;
    out.set_item("joints", p.joints)?;
    out.set_item("worst", p.worst)?;
    let (nodes, rows) = (p.mass.len(), p.free.len());
    put(&out, "spheres", integers(&p.spheres), &[nodes])?;
    put(&out, "mass", p.mass.clone(), &[nodes])?;
    put(&out, "inertia", p.inertia.clone(), &[nodes])?;
    let pairs: Vec<i64> = p
        .bodies
        .iter()
        .flat_map(|&(a, b)| [i64::from(a), i64::from(b)])
        .collect();
    put(&out, "bodies", pairs, &[p.bodies.len(), 2])?;
    put(
        &out,
        "bounds",
        flat(p.bounds.iter().copied()),
        &[p.bounds.len(), 3],
    )?;
    // A node that is none has an index out of range.
    let at = |node: u32| Some(i64::from(node)).filter(|&n| n < nodes as i64);
    let ends = p.nodes.iter().flatten().map(|&n| at(n).unwrap_or(-1));
    put::<i64>(&out, "node", ends.collect(), &[rows, 2])?;
    put(
        &out,
        "gradient",
        flat(p.gradient.iter().flatten().copied()),
        &[rows, 2, 6],
    )?;
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
    let t = &p.load_tangent;
    let row: Vec<u32> = t.iter().map(|e| e.0).collect();
    let column: Vec<u32> = t.iter().map(|e| e.1).collect();
    put(&out, "load_tangent_row", integers(&row), &[t.len()])?;
    put(&out, "load_tangent_column", integers(&column), &[t.len()])?;
    let value = t.iter().map(|e| e.2).collect();
    put(&out, "load_tangent_value", value, &[t.len()])?;
    Ok(out)
}

fn integers(values: &[u32]) -> Vec<i64> {
    values.iter().map(|&v| i64::from(v)).collect()
}
