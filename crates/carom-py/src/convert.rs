//! The model and its options, from dicts.

use crate::arrays::{bad, floats, ids, rows};
use crate::{coupling, flow, walls, ModelError};
use carom_core::build::ModelInput;
use carom_core::options::{Options, Value};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};

/// Writes an option value into a dict.
pub fn set_value(out: &Bound<'_, PyDict>, name: &str, value: &Value) -> PyResult<()> {
    match value {
        Value::Float(x) => out.set_item(name, x),
        Value::Int(i) => out.set_item(name, i),
        Value::Bool(b) => out.set_item(name, b),
        Value::Text(t) => out.set_item(name, t),
    }
}

fn get_value(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    // bool is a subclass of int in Python: ask for it first.
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Bool(value.extract()?));
    }
    if value.is_instance_of::<PyInt>() {
        return match value.extract::<u64>() {
            Ok(i) => Ok(Value::Int(i)),
            Err(_) => Err(ModelError::new_err(format!(
                "option {name} is out of range"
            ))),
        };
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Value::Text(value.extract()?));
    }
    Err(PyTypeError::new_err(format!(
        "option {name}: expected a number, a bool or a name"
    )))
}

/// Options from a dict, over the defaults.
pub fn options(dict: &Bound<'_, PyDict>) -> PyResult<Options> {
    let mut options = Options::default();
    for (key, value) in dict {
        let name: String = key.extract()?;
        let value = get_value(&name, &value)?;
        options
            .set(&name, &value)
            .map_err(|e| ModelError::new_err(e.to_string()))?;
    }
    Ok(options)
}

/// Numbers that may be left out.
fn given(dict: &Bound<'_, PyDict>, name: &'static str) -> PyResult<Vec<f64>> {
    match dict.contains(name)? {
        true => floats(dict, name),
        false => Ok(Vec::new()),
    }
}

/// The model's arrays.
pub fn model_input(dict: &Bound<'_, PyDict>) -> PyResult<ModelInput> {
    let gravity = floats(dict, "gravity")?;
    let gravity: [f64; 3] = gravity
        .try_into()
        .map_err(|_| bad("gravity", "float64 (3,)"))?;
    let (a, b) = (ids(dict, "law_a")?, ids(dict, "law_b")?);
    let columns: [Vec<f64>; 5] = [
        floats(dict, "friction")?,
        floats(dict, "restitution")?,
        floats(dict, "tangential_restitution")?,
        floats(dict, "rolling_radius")?,
        floats(dict, "spinning_radius")?,
    ];
    if b.len() != a.len() || columns.iter().any(|c| c.len() != a.len()) {
        return Err(bad("law_a, law_b, friction, ...", "the same length"));
    }
    let laws = (0..a.len())
        .map(|l| (a[l], b[l], std::array::from_fn(|k| columns[k][l])))
        .collect();
    let radius = floats(dict, "radius")?;
    Ok(ModelInput {
        gravity,
        mass: floats(dict, "mass")?,
        inertia: floats(dict, "inertia")?,
        material: ids(dict, "material")?,
        position: rows(dict, "position")?,
        orientation: rows(dict, "orientation")?,
        velocity: rows(dict, "velocity")?,
        angular_velocity: rows(dict, "angular_velocity")?,
        plane_point: rows(dict, "plane_point")?,
        plane_normal: rows(dict, "plane_normal")?,
        plane_material: ids(dict, "plane_material")?,
        walls: walls::walls(dict)?,
        meshes: walls::meshes(dict)?,
        wall_motion: walls::motions(dict)?,
        free_walls: walls::free_walls(dict)?,
        clumps: walls::clumps(dict)?,
        record_walls: walls::wish(dict, "record_walls")?,
        drop_impacts: walls::wish(dict, "drop_impacts")?,
        every_impact: walls::wish(dict, "every_impact")?,
        courses: walls::wish(dict, "courses")?,
        periodic: flow::lengths(dict, "periodic")?,
        periodic_origin: flow::lengths(dict, "periodic_origin")?,
        deformation: flow::deformation(dict)?,
        inflow: flow::inflows(dict)?,
        outlet: flow::outlets(dict)?,
        laws,
        friction_law: coupling::contact_laws(dict, "friction_law")?,
        stiffness_ratio: given(dict, "stiffness_ratio")?,
        cohesion: given(dict, "cohesion")?,
        rupture_distance: given(dict, "rupture_distance")?,
        restitution_law: coupling::contact_laws(dict, "restitution_law")?,
        joints: coupling::joints(dict, &radius)?,
        loads: coupling::loads(dict, radius.len())?,
        radius,
    })
}
