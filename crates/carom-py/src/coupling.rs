//! Joints, loads and laws of one variable, from lists of dicts and tuples.

use crate::arrays::item;
use crate::ModelError;
use carom_core::force::applied::Applied;
use carom_core::force::drag::Drag;
use carom_core::force::spring::Spring;
use carom_core::force::{Dependence, Load, LoadError, Motion};
use carom_core::joint::{Joint, JointRow, RowKind, GROUND};
use carom_laws::{Expression, Scalar};
use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::Arc;

pub(crate) fn refuse(text: String) -> PyErr {
    ModelError::new_err(text)
}

/// `("constant", x)`, `("polynomial", [...])`, `("table", [[x, y], ...])`, `("expression", text)`.
pub(crate) fn law(value: &Bound<'_, PyAny>) -> PyResult<Scalar> {
    let (kind, data): (String, Bound<'_, PyAny>) = value.extract()?;
    match kind.as_str() {
        "constant" => Ok(Scalar::Constant(data.extract()?)),
        "polynomial" => Ok(Scalar::Polynomial(data.extract()?)),
        "table" => Ok(Scalar::Table(data.extract()?)),
        "expression" => {
            let text: String = data.extract()?;
            let parsed = Expression::parse(&text).map_err(|e| refuse(format!("{text}: {e}")))?;
            Ok(Scalar::Expression(parsed))
        }
        other => Err(refuse(format!("a law of kind {other} is not known"))),
    }
}

pub(crate) fn three_laws(value: &Bound<'_, PyAny>) -> PyResult<[Scalar; 3]> {
    let list: [Bound<'_, PyAny>; 3] = value.extract()?;
    Ok([law(&list[0])?, law(&list[1])?, law(&list[2])?])
}

pub(crate) fn vector(value: &Bound<'_, PyAny>) -> PyResult<DVec3> {
    Ok(DVec3::from(value.extract::<[f64; 3]>()?))
}

/// A sphere's index, or -1 for the ground.
fn body(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<u32> {
    let index: i64 = item(dict, name)?.extract()?;
    if index == -1 {
        return Ok(GROUND);
    }
    u32::try_from(index).map_err(|_| refuse(format!("{name} is {index}")))
}

pub(crate) fn list<'py>(dict: &Bound<'py, PyDict>, name: &str) -> PyResult<Vec<Bound<'py, PyAny>>> {
    match dict.get_item(name)? {
        Some(value) => Ok(value.cast::<PyList>()?.iter().collect()),
        None => Ok(Vec::new()),
    }
}

/// What is read of each dict of a list that may be left out.
pub(crate) fn each<'py, T>(
    dict: &Bound<'py, PyDict>,
    name: &str,
    read: impl Fn(&Bound<'py, PyDict>) -> PyResult<T>,
) -> PyResult<Vec<T>> {
    let listed = list(dict, name)?;
    listed.iter().map(|value| read(value.cast()?)).collect()
}

/// Laws in place of numbers of contact laws: `friction_law`, `restitution_law`.
pub fn contact_laws(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<Option<Scalar>>> {
    list(dict, name)?
        .iter()
        .map(|value| (!value.is_none()).then(|| law(value)).transpose())
        .collect()
}

pub fn joints(dict: &Bound<'_, PyDict>, radius: &[f64]) -> PyResult<Vec<Joint>> {
    each(dict, "joints", |given| joint(given, radius))
}

fn joint(dict: &Bound<'_, PyDict>, radius: &[f64]) -> PyResult<Joint> {
    let (a, b) = (body(dict, "a")?, body(dict, "b")?);
    let mut rows = Vec::new();
    for row in item(dict, "rows")?.try_iter()? {
        let row = row?;
        let row = row.cast::<PyTuple>()?;
        let kind: String = row.get_item(0)?.extract()?;
        let kind = match kind.as_str() {
            "point" => RowKind::Point,
            "distance" => RowKind::Distance,
            "rotation" => RowKind::Rotation,
            other => return Err(refuse(format!("a joint row of kind {other} is not known"))),
        };
        rows.push(JointRow {
            kind,
            direction: vector(&row.get_item(1)?)?,
            arm_a: vector(&row.get_item(2)?)?,
            arm_b: vector(&row.get_item(3)?)?,
            law: law(&row.get_item(4)?)?,
        });
    }
    let translational = rows.iter().filter(|r| r.kind != RowKind::Rotation).count();
    Ok(Joint {
        a,
        b,
        rows,
        translational,
        length: radius.get(a as usize).copied().unwrap_or(1.0),
    })
}

/// Loads of a model of so many balls.
pub fn loads(dict: &Bound<'_, PyDict>, balls: usize) -> PyResult<Vec<Arc<dyn Load>>> {
    each(dict, "loads", |given| load(given, balls))
}

fn load(dict: &Bound<'_, PyDict>, balls: usize) -> PyResult<Arc<dyn Load>> {
    let number = |name: &str| -> PyResult<f64> { item(dict, name)?.extract() };
    let kind: String = item(dict, "kind")?.extract()?;
    Ok(match kind.as_str() {
        "force" => Arc::new(Applied {
            body: body(dict, "body")?,
            arm: DVec3::ZERO,
            force: three_laws(&item(dict, "force")?)?,
            torque: three_laws(&item(dict, "torque")?)?,
        }),
        "spring" => Arc::new(Spring {
            a: body(dict, "a")?,
            b: body(dict, "b")?,
            arm_a: vector(&item(dict, "arm_a")?)?,
            arm_b: vector(&item(dict, "arm_b")?)?,
            stiffness: number("stiffness")?,
            damping: number("damping")?,
            rest_length: number("rest_length")?,
        }),
        "drag" => Arc::new(Drag {
            body: body(dict, "body")?,
            arm: DVec3::ZERO,
            translation: number("translation")?,
            rotation: number("rotation")?,
        }),
        "callable" => Arc::new(Callable {
            function: item(dict, "function")?.unbind(),
            balls,
        }),
        other => return Err(refuse(format!("a load of kind {other} is not known"))),
    })
}

/// A function of the user: `f(t, position, velocity, angular_velocity) -> (N, 6)`.
#[derive(Debug)]
struct Callable {
    function: Py<PyAny>,
    balls: usize,
}

impl Callable {
    fn wrench(&self, at: &Motion) -> Result<Vec<[f64; 6]>, LoadError> {
        let n = self.balls;
        Python::attach(|py| -> PyResult<Vec<[f64; 6]>> {
            let array = |v: &[DVec3]| {
                let flat: Vec<f64> = v[..n].iter().flat_map(|x| x.to_array()).collect();
                PyArray1::from_vec(py, flat).reshape([n, 3])
            };
            let arguments = (
                at.time,
                array(at.position)?,
                array(at.velocity)?,
                array(at.angular_velocity)?,
            );
            let value = self.function.bind(py).call1(arguments)?;
            let wrong = || {
                refuse(format!(
                    "must return a float64 array of shape ({n}, 6): force and torque per sphere"
                ))
            };
            let value = value
                .call_method1("astype", ("float64",))
                .map_err(|_| wrong())?;
            let found: PyReadonlyArray2<f64> = value.extract().map_err(|_| wrong())?;
            let view = found.as_array();
            if view.dim() != (n, 6) {
                return Err(wrong());
            }
            Ok(view
                .rows()
                .into_iter()
                .map(|r| std::array::from_fn(|k| r[k]))
                .collect())
        })
        .map_err(|error| LoadError {
            text: error.to_string(),
            source: Some(Arc::new(error)),
            ..LoadError::default()
        })
    }
}

impl Load for Callable {
    fn dependence(&self) -> Dependence {
        Dependence::Opaque
    }

    fn bodies(&self) -> [Option<u32>; 2] {
        [None; 2]
    }

    fn check(&self) -> Result<(), (&'static str, String)> {
        Ok(())
    }

    fn add(&self, at: &Motion, wrench: &mut [[DVec3; 2]]) -> Result<(), LoadError> {
        for (out, w) in wrench.iter_mut().zip(self.wrench(at)?) {
            out[0] += DVec3::new(w[0], w[1], w[2]);
            out[1] += DVec3::new(w[3], w[4], w[5]);
        }
        Ok(())
    }

    fn power(&self, at: &Motion) -> Result<f64, LoadError> {
        let wrench = self.wrench(at)?;
        let parts = wrench
            .iter()
            .zip(at.velocity.iter().zip(at.angular_velocity));
        let of = |(f, (v, w)): (&[f64; 6], (&DVec3, &DVec3))| {
            f[0] * v.x + f[1] * v.y + f[2] * v.z + f[3] * w.x + f[4] * w.y + f[5] * w.z
        };
        Ok(parts.map(of).sum())
    }
}
