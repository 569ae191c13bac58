//! Arrays in and out. Vectors are moved into NumPy, never copied element by element in Python.

use crate::{coupling, flow, walls, ModelError};
use carom_core::model::ModelInput;
use carom_core::options::{Options, Value};
use numpy::ndarray::ArrayView;
use numpy::{
    PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn, ToPyArray,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
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

/// Fetches a required entry.
pub fn item<'py>(dict: &Bound<'py, PyDict>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    dict.get_item(name)?
        .ok_or_else(|| ModelError::new_err(format!("array {name} is missing")))
}

fn bad(name: &str, what: &str) -> PyErr {
    ModelError::new_err(format!("array {name}: expected {what}"))
}

pub fn floats(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<f64>> {
    let array: PyReadonlyArray1<f64> = item(dict, name)?
        .extract()
        .map_err(|_| bad(name, "float64 (n,)"))?;
    Ok(array.as_array().to_vec())
}

pub fn rows<const K: usize>(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<[f64; K]>> {
    let array: PyReadonlyArray2<f64> = item(dict, name)?
        .extract()
        .map_err(|_| bad(name, &format!("float64 (n, {K})")))?;
    let view = array.as_array();
    if view.ncols() != K {
        return Err(bad(name, &format!("float64 (n, {K})")));
    }
    Ok(view
        .rows()
        .into_iter()
        .map(|r| std::array::from_fn(|k| r[k]))
        .collect())
}

/// Non-negative integers of any integer type.
pub fn indices(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<u64>> {
    let value = item(dict, name)?;
    let array = value
        .call_method1("astype", ("int64",))
        .map_err(|_| bad(name, "integers (n,)"))?;
    let array: PyReadonlyArrayDyn<i64> = array.extract().map_err(|_| bad(name, "integers (n,)"))?;
    array
        .as_array()
        .iter()
        .map(|&i| u64::try_from(i).map_err(|_| bad(name, "integers not below 0")))
        .collect()
}

fn ids(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<u32>> {
    indices(dict, name)?
        .into_iter()
        .map(|i| u32::try_from(i).map_err(|_| bad(name, "small integers")))
        .collect()
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
        wall_motion: walls::motions(dict)?,
        record_walls: walls::wish(dict, "record_walls")?,
        drop_impacts: walls::wish(dict, "drop_impacts")?,
        every_impact: walls::wish(dict, "every_impact")?,
        periodic: flow::lengths(dict, "periodic")?,
        periodic_origin: flow::lengths(dict, "periodic_origin")?,
        inflow: flow::inflows(dict)?,
        outlet: flow::outlets(dict)?,
        laws,
        friction_law: coupling::friction_laws(dict)?,
        joints: coupling::joints(dict, &radius)?,
        loads: coupling::loads(dict)?,
        radius,
    })
}

/// Numbers up to which a copy costs less than an object that owns the vector.
const COPIED: usize = 1024;

/// Puts a vector into a dict as an array of the given shape, moving it if it is long.
pub fn put<'py, T: numpy::Element>(
    out: &Bound<'py, PyDict>,
    name: &str,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<()> {
    let py = out.py();
    match (shape.len(), values.len() <= COPIED) {
        (1, true) => out.set_item(name, PyArray1::from_slice(py, &values)),
        (1, false) => out.set_item(name, PyArray1::from_vec(py, values)),
        (_, true) => match ArrayView::from_shape(shape, &values) {
            Ok(view) => out.set_item(name, view.to_pyarray(py)),
            Err(error) => Err(PyValueError::new_err(error.to_string())),
        },
        (_, false) => {
            let array = PyArray1::from_vec(py, values).reshape(shape.to_vec())?;
            out.set_item(name, array)
        }
    }
}

/// Arrays of K numbers, one after the other.
pub fn flat<const K: usize>(values: impl Iterator<Item = [f64; K]>) -> Vec<f64> {
    values.flatten().collect()
}
