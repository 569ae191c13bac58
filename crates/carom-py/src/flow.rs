//! Periodic boxes, and balls that come and go, from optional keys of the model; their tables and state.

use crate::arrays::{self, item, put, Table};
use crate::coupling::{each, law, list, refuse, vector};
use crate::walls::wish;
use carom_core::deformation::law::Deformation;
use carom_core::flow::{Event, Inflow, Outlet, Region};
use carom_core::{Model, State};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// Three lengths (m), 0 without the key.
pub fn lengths(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<[f64; 3]> {
    match dict.get_item(name)? {
        Some(value) => Ok(vector(&value)?.to_array()),
        None => Ok([0.0; 3]),
    }
}

/// `{"stretch": (law or None,) * 3, "shear": law or None, "flow": axis, "gradient": axis}`.
pub fn deformation(dict: &Bound<'_, PyDict>) -> PyResult<Option<Deformation>> {
    let Some(value) = dict.get_item("deformation")? else {
        return Ok(None);
    };
    let given = value.cast::<PyDict>()?;
    let maybe = |value: &Bound<'_, PyAny>| match value.is_none() {
        true => Ok(None),
        false => law(value).map(Some),
    };
    let [x, y, z]: [Bound<'_, PyAny>; 3] = item(given, "stretch")?.extract()?;
    Ok(Some(Deformation {
        stretch: [maybe(&x)?, maybe(&y)?, maybe(&z)?],
        shear: maybe(&item(given, "shear")?)?,
        flow: item(given, "flow")?.extract()?,
        gradient: item(given, "gradient")?.extract()?,
    }))
}

/// `{"bodies": (first, count), "region": ..., "rate", "start", "velocity", "spread", "seed"}`, of clumps with `"turned"`.
pub fn inflows(dict: &Bound<'_, PyDict>) -> PyResult<Vec<Inflow>> {
    each(dict, "inflow", |given| {
        let (first, count): (u32, u32) = item(given, "bodies")?.extract()?;
        let number = |name: &str| -> PyResult<f64> { item(given, name)?.extract() };
        let wanted = item(given, "region")?;
        Ok(Inflow {
            first,
            count,
            region: region(wanted.cast::<PyTuple>()?)?,
            rate: number("rate")?,
            start: number("start")?,
            velocity: vector(&item(given, "velocity")?)?,
            spread: number("spread")?,
            turned: wish(given, "turned")?,
            seed: item(given, "seed")?.extract()?,
        })
    })
}

/// `("box", low, high)` or `("disc", centre, normal, radius)`.
fn region(given: &Bound<'_, PyTuple>) -> PyResult<Region> {
    let kind: String = given.get_item(0)?.extract()?;
    let point = |k: usize| vector(&given.get_item(k)?);
    match kind.as_str() {
        "box" => Ok(Region::Box {
            low: point(1)?,
            high: point(2)?,
        }),
        "disc" => Ok(Region::Disc {
            centre: point(1)?,
            normal: point(2)?.normalize_or_zero(),
            radius: given.get_item(3)?.extract()?,
        }),
        other => Err(refuse(format!("an inflow region {other} is not known"))),
    }
}

/// `(low, high, inside)`.
pub fn outlets(dict: &Bound<'_, PyDict>) -> PyResult<Vec<Outlet>> {
    list(dict, "outlet")?
        .iter()
        .map(|value| {
            let (low, high, inside): (Bound<'_, PyAny>, Bound<'_, PyAny>, bool) =
                value.extract()?;
            Ok(Outlet {
                low: vector(&low)?,
                high: vector(&high)?,
                inside,
            })
        })
        .collect()
}

/// The table of balls that entered (`kind` 1) and left (0).
pub fn put_events(out: &Bound<'_, PyDict>, events: &[Event]) -> PyResult<()> {
    let events_dict = PyDict::new(out.py());
    let table = Table {
        out: &events_dict,
        records: events,
    };
    table.column("step", |e| e.step)?;
    table.column("time", |e| e.time)?;
    table.column("body", |e| i64::from(e.body))?;
    table.column("kind", |e| u8::from(e.entered))?;
    out.set_item("events", events_dict)
}

/// What a checkpoint holds of it, if balls come and go.
pub fn put_state(out: &Bound<'_, PyDict>, model: &Model, state: &State) -> PyResult<()> {
    if model.flow.is_none() {
        return Ok(());
    }
    let n = state.present.len();
    put::<bool>(out, "present", state.present.clone(), &[n])?;
    let entered: Vec<u64> = state.entered.iter().map(|&k| u64::from(k)).collect();
    let count = entered.len();
    put(out, "entered", entered, &[count])
}

/// The same back, into a state that is the model's otherwise.
pub fn read_state(dict: &Bound<'_, PyDict>, model: &Model, state: &mut State) -> PyResult<()> {
    state.present = vec![true; model.bodies()];
    state.entered.clear();
    if model.flow.is_none() {
        return Ok(());
    }
    let present = arrays::indices(dict, "present")?;
    let entered = arrays::indices(dict, "entered")?;
    state.present = present.iter().map(|&p| p != 0).collect();
    // More balls than there are indices have not entered.
    let number = |&k: &u64| u32::try_from(k).unwrap_or(u32::MAX);
    state.entered = entered.iter().map(number).collect();
    Ok(())
}
