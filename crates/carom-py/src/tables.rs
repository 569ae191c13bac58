//! The tables of a block, and outcomes, as dicts of arrays.

use crate::arrays::{flat, put};
use carom_core::record::{Block, ContactRecord};
use carom_core::report::Column;
use carom_core::{Outcome, StepReport};
use glam::DVec3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

pub fn outcome_dict<'py>(py: Python<'py>, o: &Outcome) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("kind", o.kind())?;
    out.set_item("advice", o.advice())?;
    match o {
        Outcome::NotConverged {
            step,
            time,
            level,
            bodies,
            contacts,
            joints,
            residual,
            ..
        } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("level", level.name())?;
            out.set_item("bodies", [bodies.0, bodies.1])?;
            out.set_item("contacts", contacts)?;
            out.set_item("joints", joints)?;
            out.set_item("residual", residual)?;
        }
        Outcome::TooManyPairs { step, time } | Outcome::TooManySubsteps { step, time } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
        }
        Outcome::BlowUp { step, time, what } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("level", what.level.name())?;
            out.set_item("bodies", [what.bodies.0, what.bodies.1])?;
            let message = if what.speed.is_finite() {
                format!("at {:.3e} m/s", what.speed)
            } else {
                "its motion is no number".to_owned()
            };
            out.set_item("message", message)?;
        }
        Outcome::MissingLaw { step, time, bodies } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("bodies", [bodies.0, bodies.1])?;
        }
        Outcome::FrictionFailed {
            step,
            time,
            bodies,
            message,
        }
        | Outcome::TooFast {
            step,
            time,
            bodies,
            message,
        } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("bodies", [bodies.0, bodies.1])?;
            out.set_item("message", message)?;
        }
        Outcome::LoadFailed {
            step,
            time,
            message,
            body,
        } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("message", message)?;
            if let Some(body) = body {
                out.set_item("bodies", [*body])?;
            }
        }
    }
    Ok(out)
}

pub fn put_block(
    out: &Bound<'_, PyDict>,
    b: Block,
    n: usize,
    joints: usize,
    walls: usize,
) -> PyResult<()> {
    let py = out.py();
    let bodies = |a: u32, b: u32| {
        let (a, b) = (i64::from(a), i64::from(b));
        [a, b]
    };
    let f = b.frame_step.len();
    let frames = PyDict::new(py);
    put(&frames, "step", b.frame_step, &[f])?;
    put(&frames, "time", b.frame_time, &[f])?;
    put(&frames, "position", b.position, &[f, n, 3])?;
    // Also in a block without frames: its columns are those of the run. The events are put before.
    if out.contains("events")? {
        put(&frames, "present", b.present, &[f, n])?;
    }
    put(&frames, "orientation", b.orientation, &[f, n, 4])?;
    put(&frames, "velocity", b.velocity, &[f, n, 3])?;
    put(&frames, "angular_velocity", b.angular_velocity, &[f, n, 3])?;
    if joints > 0 {
        put(&frames, "joint_impulse", b.joints, &[f, joints, 6])?;
    }
    if walls > 0 {
        put(&frames, "walls", b.walls, &[f, walls, 6])?;
    }
    put(&frames, "contact_end", b.contact_end, &[f])?;
    out.set_item("frames", frames)?;

    let c = b.contacts.len();
    let contacts = PyDict::new(py);
    put(
        &contacts,
        "body",
        b.contacts
            .iter()
            .flat_map(|r| bodies(r.key.0, r.key.1))
            .collect(),
        &[c, 2],
    )?;
    put(
        &contacts,
        "status",
        b.contacts.iter().map(|r| r.status).collect(),
        &[c],
    )?;
    put(
        &contacts,
        "gap",
        b.contacts.iter().map(|r| r.gap).collect(),
        &[c],
    )?;
    type Vector = (&'static str, fn(&ContactRecord) -> DVec3);
    let vectors: [Vector; 5] = [
        ("normal", |r| r.normal),
        ("impulse", |r| r.impulse),
        ("moment", |r| r.moment),
        ("position_impulse", |r| r.position_impulse),
        ("position_moment", |r| r.position_moment),
    ];
    for (name, get) in vectors {
        put(
            &contacts,
            name,
            flat(b.contacts.iter().map(|r| get(r).to_array())),
            &[c, 3],
        )?;
    }
    for (k, name) in [
        "work_normal",
        "work_friction",
        "work_rolling",
        "work_spinning",
    ]
    .into_iter()
    .enumerate()
    {
        put(
            &contacts,
            name,
            b.contacts.iter().map(|r| r.work[k]).collect(),
            &[c],
        )?;
    }
    out.set_item("contacts", contacts)?;

    let i = b.impacts.len();
    let impacts = PyDict::new(py);
    put(
        &impacts,
        "step",
        b.impacts.iter().map(|r| r.step).collect(),
        &[i],
    )?;
    put(
        &impacts,
        "time",
        b.impacts.iter().map(|r| r.time).collect(),
        &[i],
    )?;
    put(
        &impacts,
        "problem",
        b.impacts.iter().map(|r| r.impact.problem).collect(),
        &[i],
    )?;
    put(
        &impacts,
        "body",
        b.impacts
            .iter()
            .flat_map(|r| bodies(r.impact.a, r.impact.b))
            .collect(),
        &[i, 2],
    )?;
    put(
        &impacts,
        "status",
        b.impacts.iter().map(|r| r.impact.status).collect(),
        &[i],
    )?;
    put(
        &impacts,
        "normal",
        flat(b.impacts.iter().map(|r| r.impact.normal.to_array())),
        &[i, 3],
    )?;
    put(
        &impacts,
        "impulse",
        flat(b.impacts.iter().map(|r| r.impact.impulse.to_array())),
        &[i, 3],
    )?;
    put(
        &impacts,
        "moment",
        flat(b.impacts.iter().map(|r| r.impact.moment.to_array())),
        &[i, 3],
    )?;
    put(
        &impacts,
        "approach",
        b.impacts.iter().map(|r| r.impact.approach).collect(),
        &[i],
    )?;
    put(
        &impacts,
        "separation",
        b.impacts.iter().map(|r| r.impact.separation).collect(),
        &[i],
    )?;
    let scale = b
        .impacts
        .iter()
        .map(|r| r.impact.restitution_scale)
        .collect();
    put::<f64>(&impacts, "restitution_scale", scale, &[i])?;
    out.set_item("impacts", impacts)?;

    let s = b.steps.len();
    let steps = PyDict::new(py);
    for (name, column) in StepReport::columns(&b.steps) {
        match column {
            Column::F64(v) => put(&steps, name, v, &[s])?,
            Column::U32(v) => put(&steps, name, v, &[s])?,
            Column::U64(v) => put(&steps, name, v, &[s])?,
        }
    }
    out.set_item("steps", steps)?;

    let k = b.residuals.len();
    let residuals = PyDict::new(py);
    put(
        &residuals,
        "step",
        b.residuals.iter().map(|r| r.step).collect(),
        &[k],
    )?;
    put(
        &residuals,
        "level",
        b.residuals.iter().map(|r| r.level).collect(),
        &[k],
    )?;
    put(
        &residuals,
        "problem",
        b.residuals.iter().map(|r| r.problem).collect(),
        &[k],
    )?;
    put(
        &residuals,
        "contacts",
        b.residuals.iter().map(|r| r.contacts).collect(),
        &[k],
    )?;
    let mut total = 0u64;
    let ends: Vec<u64> = b
        .residuals
        .iter()
        .map(|r| {
            total += r.values.len() as u64;
            total
        })
        .collect();
    put(&residuals, "end", ends, &[k])?;
    let values: Vec<f64> = b.residuals.into_iter().flat_map(|r| r.values).collect();
    let count = values.len();
    put(&residuals, "value", values, &[count])?;
    out.set_item("residuals", residuals)
}
