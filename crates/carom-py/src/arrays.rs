//! Arrays in and out. Vectors are moved into NumPy, never copied element by element in Python.

use crate::ModelError;
use glam::DVec3;
use numpy::ndarray::ArrayView;
use numpy::{
    PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Fetches a required entry.
pub fn item<'py>(dict: &Bound<'py, PyDict>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    dict.get_item(name)?
        .ok_or_else(|| ModelError::new_err(format!("array {name} is missing")))
}

pub fn bad(name: &str, what: &str) -> PyErr {
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

/// Vectors of three numbers.
pub fn vectors(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<DVec3>> {
    let rows = rows::<3>(dict, name)?;
    Ok(rows.into_iter().map(DVec3::from).collect())
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

pub fn ids(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<u32>> {
    indices(dict, name)?
        .into_iter()
        .map(|i| u32::try_from(i).map_err(|_| bad(name, "small integers")))
        .collect()
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

/// Columns of a dict that have a value for each of the records.
pub struct Table<'a, 'py, R> {
    pub out: &'a Bound<'py, PyDict>,
    pub records: &'a [R],
}

impl<R> Table<'_, '_, R> {
    /// A column of shape (n,).
    pub fn column<T: numpy::Element>(
        &self,
        name: &str,
        value: impl FnMut(&R) -> T,
    ) -> PyResult<()> {
        let values = self.records.iter().map(value).collect();
        put(self.out, name, values, &[self.records.len()])
    }

    /// A column of shape (n, K).
    pub fn rows<T: numpy::Element, const K: usize>(
        &self,
        name: &str,
        value: impl FnMut(&R) -> [T; K],
    ) -> PyResult<()> {
        let values = self.records.iter().flat_map(value).collect();
        put(self.out, name, values, &[self.records.len(), K])
    }
}
