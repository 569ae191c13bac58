//! The contact element by itself, for studies of its accuracy (Appendix B of the paper).

use crate::ModelError;
use carom_core::contact::tangential_increment as increment;
use glam::DVec3;
use pyo3::prelude::*;

type Tangential = (f64, f64, [f64; 3], [f64; 3]);

/// Incremental tangential gap of two spheres over a step (eq. 37), m, and the tangents it is measured along.
#[pyfunction]
#[pyo3(signature = (x_a0, x_b0, x_a1, x_b1, psi_a, psi_b, r_a, r_b))]
#[allow(clippy::too_many_arguments)] // the arguments of eq. 37
pub fn tangential_increment(
    x_a0: [f64; 3],
    x_b0: [f64; 3],
    x_a1: [f64; 3],
    x_b1: [f64; 3],
    psi_a: [f64; 3],
    psi_b: [f64; 3],
    r_a: f64,
    r_b: f64,
) -> PyResult<Tangential> {
    if x_a0 == x_b0 {
        return Err(ModelError::new_err("the centres coincide at t_n"));
    }
    let v = DVec3::from;
    let (g, [t1, t2]) = increment(
        [v(x_a0), v(x_b0)],
        [v(x_a1) - v(x_a0), v(x_b1) - v(x_b0)],
        [v(psi_a), v(psi_b)],
        [r_a, r_b],
    );
    Ok((g[0], g[1], t1.to_array(), t2.to_array()))
}
