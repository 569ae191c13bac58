//! The skin: converts arrays, releases the interpreter lock, maps errors. No physics.

mod arrays;
mod contact_solver;
mod convert;
mod coupling;
mod dict;
mod element;
mod expression;
mod flow;
mod problem;
mod simulation;
mod state;
mod tables;
mod walls;

use dict::dict;
use pyo3::prelude::*;
use pyo3::types::PyDict;

pyo3::create_exception!(carom._core, ModelError, pyo3::exceptions::PyValueError);
pyo3::create_exception!(carom._core, ExpressionError, pyo3::exceptions::PyValueError);

/// Every numerical option with its default.
#[pyfunction]
fn defaults(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    for (name, value) in carom_core::Options::default().entries() {
        convert::set_value(&out, name, &value)?;
    }
    Ok(out)
}

/// Admitted values of the options that are names.
#[pyfunction]
fn choices(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    use carom_core::options::{
        Impact, Method, OnNonconvergence, PenaltyFriction, PenaltyLaw, PositionFriction, Solver,
    };
    Ok(dict! { py,
        "method": Method::NAMES,
        "impact": Impact::NAMES,
        "solver": Solver::NAMES,
        "on_nonconvergence": OnNonconvergence::NAMES,
        "penalty_law": PenaltyLaw::NAMES,
        "position_friction": PositionFriction::NAMES,
        "penalty_friction": PenaltyFriction::NAMES,
    })
}

/// The table of impact laws (`_core.pyi`).
#[pyfunction]
fn impact_laws(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    use carom_core::impact::laws::Restitution;
    let out = PyDict::new(py);
    for law in carom_core::options::Impact::ALL {
        let facts = law.facts();
        let restitution = match facts.restitution {
            Restitution::Newton => "newton",
            Restitution::Printed => "printed",
            Restitution::Poisson => "poisson",
            Restitution::Energetic => "energetic",
        };
        let row = dict! { py,
            "summary": facts.summary,
            "advice": facts.advice,
            "loads_first": facts.loads_first,
            "energy": facts.energy,
            "restitution": restitution,
            "problems": facts.problems,
            "needs": facts.needs,
            "cite": facts.cite,
        };
        out.set_item(law.name(), row)?;
    }
    Ok(out)
}

/// What the solver of piles may leave of overlaps (`_core.pyi`).
#[pyfunction]
fn pile_overlap(tolerance: f64, contacts: usize) -> f64 {
    carom_core::pile_overlap(tolerance, contacts)
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("ModelError", m.py().get_type::<ModelError>())?;
    m.add("ExpressionError", m.py().get_type::<ExpressionError>())?;
    m.add_function(wrap_pyfunction!(defaults, m)?)?;
    m.add_function(wrap_pyfunction!(choices, m)?)?;
    m.add_function(wrap_pyfunction!(impact_laws, m)?)?;
    m.add_function(wrap_pyfunction!(pile_overlap, m)?)?;
    m.add_function(wrap_pyfunction!(contact_solver::solve_contact_problem, m)?)?;
    m.add_function(wrap_pyfunction!(contact_solver::contact_solvers, m)?)?;
    m.add_function(wrap_pyfunction!(contact_solver::auto_rule, m)?)?;
    m.add_function(wrap_pyfunction!(element::tangential_increment, m)?)?;
    m.add_class::<contact_solver::Cancel>()?;
    m.add_class::<simulation::Simulation>()?;
    m.add_class::<expression::Expression>()?;
    Ok(())
}
