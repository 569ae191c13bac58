//! Expressions of scenario files.

use crate::ExpressionError;
use carom_laws::Scalar;
use pyo3::prelude::*;
use pyo3::types::PyMapping;

/// A formula of named variables.
#[pyclass(module = "carom._core", frozen)]
pub struct Expression {
    inner: carom_laws::Expression,
}

#[pymethods]
impl Expression {
    #[new]
    fn new(text: &str) -> PyResult<Self> {
        let inner = carom_laws::Expression::parse(text).map_err(ExpressionError::new_err)?;
        Ok(Expression { inner })
    }

    /// Names of all functions.
    #[staticmethod]
    fn functions() -> Vec<&'static str> {
        carom_laws::functions().collect()
    }

    #[getter]
    fn variables(&self) -> Vec<String> {
        self.inner.variables().to_vec()
    }

    /// That of a law: as the core takes it.
    fn slope(&self, x: f64) -> PyResult<f64> {
        let law = Scalar::Expression(self.inner.clone());
        law.check().map_err(ExpressionError::new_err)?;
        Ok(law.slope(x))
    }

    fn evaluate(&self, values: &Bound<'_, PyMapping>) -> PyResult<f64> {
        let names = self.inner.variables().iter();
        let numbers = names.map(|name| {
            let value = values
                .get_item(name)
                .map_err(|_| ExpressionError::new_err(format!("{name} has no value")))?;
            value.extract::<f64>()
        });
        let numbers = numbers.collect::<PyResult<Vec<f64>>>()?;
        self.inner
            .check_at(&numbers)
            .map_err(ExpressionError::new_err)
    }

    fn __repr__(&self) -> String {
        format!("Expression(\"{}\")", self.inner)
    }
}
