//! The tables of a block, and outcomes, as dicts of arrays.

use crate::arrays::{put, Table};
use crate::dict::dict;
use carom_core::record::{Block, ContactRecord, ResidualRecord, TimedImpact};
use carom_core::report::Column;
use carom_core::transition::Transition;
use carom_core::{Model, Outcome, StepReport};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::mem::take;

pub fn outcome_dict<'py>(py: Python<'py>, o: &Outcome) -> PyResult<Bound<'py, PyDict>> {
    let out = dict! { py,
        "kind": o.kind(),
        "advice": o.advice(),
        "step": o.step,
        "time": o.time,
    };
    if let Some(level) = o.level() {
        out.set_item("level", level.name())?;
    }
    if !o.bodies.is_empty() {
        out.set_item("bodies", &o.bodies)?;
    }
    if let Some(joint) = o.joint {
        out.set_item("joint", joint)?;
    }
    if let Some(unsolved) = &o.unsolved {
        out.set_item("contacts", unsolved.contacts)?;
        out.set_item("joints", unsolved.joints)?;
        out.set_item("residual", unsolved.residual)?;
    }
    if let Some(message) = &o.message {
        out.set_item("message", message)?;
    }
    let source = o.source.as_deref();
    if let Some(raised) = source.and_then(|s| s.downcast_ref::<PyErr>()) {
        out.set_item("error", raised.clone_ref(py).into_value(py))?;
    }
    Ok(out)
}

pub fn put_block(out: &Bound<'_, PyDict>, model: &Model, mut b: Block) -> PyResult<()> {
    let py = out.py();
    let (joints, walls) = (model.joints.len(), model.recorded_walls());
    let tables = ["contacts", "impacts", "steps", "residuals"].map(|_| PyDict::new(py));
    let [contacts, impacts, steps, residuals] = &tables;
    put_contacts(contacts, model, &b.contacts)?;
    put_impacts(impacts, model, &b.impacts)?;
    let s = b.steps.len();
    for (name, column) in StepReport::columns(&b.steps) {
        match column {
            Column::F64(v) => put(steps, name, v, &[s])?,
            Column::U32(v) => put(steps, name, v, &[s])?,
            Column::U64(v) => put(steps, name, v, &[s])?,
        }
    }
    put_residuals(residuals, &b.residuals)?;

    let (f, frames) = (b.frame_step.len(), PyDict::new(py));
    put(&frames, "step", take(&mut b.frame_step), &[f])?;
    put(&frames, "time", take(&mut b.frame_time), &[f])?;
    put_motion(&frames, model, &mut b, &[f])?;
    if joints > 0 {
        put(&frames, "joint_impulse", b.joints, &[f, joints, 6])?;
    }
    if walls > 0 {
        put(&frames, "walls", b.walls, &[f, walls, 6])?;
    }
    put(&frames, "contact_end", b.contact_end, &[f])?;
    out.set_item("frames", frames)?;
    out.set_item("contacts", contacts)?;
    out.set_item("impacts", impacts)?;
    out.set_item("steps", steps)?;
    out.set_item("residuals", residuals)
}

/// Places and velocities of the bodies and the box, in the columns of a run whatever its frames hold: taken from the block, for
/// `frames` in the first dimension, or for a single one in none.
pub fn put_motion(
    out: &Bound<'_, PyDict>,
    model: &Model,
    b: &mut Block,
    frames: &[usize],
) -> PyResult<()> {
    let n = model.balls();
    let put_rows = |name: &str, values: &mut Vec<f64>, shape: &[usize]| {
        put(out, name, take(values), &[frames, shape].concat())
    };
    put_rows("position", &mut b.position, &[n, 3])?;
    if !model.flow.is_none() {
        put(
            out,
            "present",
            take(&mut b.present),
            &[frames, &[n]].concat(),
        )?;
    }
    put_rows("orientation", &mut b.orientation, &[n, 4])?;
    put_rows("velocity", &mut b.velocity, &[n, 3])?;
    put_rows("angular_velocity", &mut b.angular_velocity, &[n, 3])?;
    if !model.free_walls.is_empty() {
        put_rows(
            "free_walls",
            &mut b.free_walls,
            &[model.free_walls.len(), 2],
        )?;
    }
    if !model.clumps.is_empty() {
        put_rows("clumps", &mut b.clumps, &[model.clumps.len(), 13])?;
    }
    if model.deformation.is_some() {
        put_rows("box", &mut b.periodic, &[4])?;
    }
    Ok(())
}

/// The table of transitions of methods that have them; -1 for a body where none had a part.
pub fn put_transitions(out: &Bound<'_, PyDict>, records: &[Transition]) -> PyResult<()> {
    let dict = PyDict::new(out.py());
    let table = Table {
        out: &dict,
        records,
    };
    table.column("step", |r| r.step)?;
    table.column("time", |r| r.time)?;
    table.rows("body", |r| {
        [i64::from(r.body), r.other.map_or(-1, i64::from)]
    })?;
    table.column("kind", |r| r.kind as u8)?;
    table.rows("mode", |r| r.modes.map(|mode| mode as u8))?;
    table.rows("position", |r| r.position.to_array())?;
    table.rows("velocity", |r| r.velocity.to_array())?;
    out.set_item("transitions", dict)
}

/// The bodies of a contact, and where there are meshes which part of one it is with, -1 for none.
fn put_pairs<T>(table: &Table<T>, model: &Model, key: impl Fn(&T) -> (u32, u32)) -> PyResult<()> {
    table.rows("body", |r| {
        [key(r).0, model.outside(key(r).1)].map(i64::from)
    })?;
    if !model.meshes.is_empty() {
        table.column("part", |r| model.part(key(r).1).map_or(-1, i64::from))?;
    }
    Ok(())
}

fn put_contacts(out: &Bound<'_, PyDict>, model: &Model, records: &[ContactRecord]) -> PyResult<()> {
    let table = Table { out, records };
    put_pairs(&table, model, |r| r.key)?;
    table.column("status", |r| r.status)?;
    table.column("gap", |r| r.gap)?;
    table.rows("normal", |r| r.normal.to_array())?;
    table.rows("impulse", |r| r.impulse.to_array())?;
    table.rows("moment", |r| r.moment.to_array())?;
    table.rows("position_impulse", |r| r.position_impulse.to_array())?;
    table.rows("position_moment", |r| r.position_moment.to_array())?;
    table.column("work_normal", |r| r.work[0])?;
    table.column("work_friction", |r| r.work[1])?;
    table.column("work_rolling", |r| r.work[2])?;
    table.column("work_spinning", |r| r.work[3])
}

fn put_impacts(out: &Bound<'_, PyDict>, model: &Model, records: &[TimedImpact]) -> PyResult<()> {
    let table = Table { out, records };
    table.column("step", |r| r.step)?;
    table.column("time", |r| r.time)?;
    table.column("problem", |r| r.impact.problem)?;
    put_pairs(&table, model, |r| (r.impact.a, r.impact.b))?;
    table.column("status", |r| r.impact.status)?;
    table.rows("normal", |r| r.impact.normal.to_array())?;
    table.rows("impulse", |r| r.impact.impulse.to_array())?;
    table.rows("moment", |r| r.impact.moment.to_array())?;
    table.column("approach", |r| r.impact.normal_before)?;
    table.column("separation", |r| r.impact.separation)?;
    table.column("restitution_scale", |r| r.impact.restitution_scale)
}

/// The table of impulses within impacts: points of each contact, `at` the problems of its step so far, with the share of the one at hand;
/// impulses along the normal since the first problem. What gives impulses at once has the begin and the end of its problem.
pub fn put_impulses(
    out: &Bound<'_, PyDict>,
    model: &Model,
    records: &[TimedImpact],
) -> PyResult<()> {
    struct Point(u64, f64, [u32; 2], f64, f64);
    let (mut points, mut now, mut sums) = (Vec::new(), (0, 0.0), BTreeMap::new());
    for r in records {
        let (i, end) = (&r.impact, f64::from(r.impact.problem));
        if i.problem == 0 {
            continue;
        }
        if now != (r.step, r.time) {
            sums.clear();
            now = (r.step, r.time);
        }
        let pair = [i.a, i.b];
        let (last, sum) = sums.entry(pair).or_insert((-1.0, 0.0));
        let within = i.course.as_deref().unwrap_or(&[[0.0, 0.0]]);
        let within = within
            .iter()
            .map(|[share, p]| (end - 1.0 + share, *sum + p));
        let within = within.filter(|(at, _)| *last < *at && *at < end);
        points.extend(within.map(|(at, p)| Point(r.step, r.time, pair, at, p)));
        *sum += i.normal.dot(i.impulse);
        *last = end;
        points.push(Point(r.step, r.time, pair, end, *sum));
    }
    let dict = PyDict::new(out.py());
    let table = Table {
        out: &dict,
        records: &points,
    };
    table.column("step", |p| p.0)?;
    table.column("time", |p| p.1)?;
    table.rows("body", |p| p.2.map(|body| i64::from(model.outside(body))))?;
    table.column("at", |p| p.3)?;
    table.column("impulse", |p| p.4)?;
    out.set_item("impulses", dict)
}

fn put_residuals(out: &Bound<'_, PyDict>, records: &[ResidualRecord]) -> PyResult<()> {
    let table = Table { out, records };
    table.column("step", |r| r.step)?;
    table.column("level", |r| r.level)?;
    table.column("problem", |r| r.problem)?;
    table.column("contacts", |r| r.contacts)?;
    let mut end = 0u64;
    table.column("end", |r| {
        end += r.values.len() as u64;
        end
    })?;
    let values: Vec<f64> = records.iter().flat_map(|r| &r.values).copied().collect();
    put(out, "value", values, &[end as usize])
}
