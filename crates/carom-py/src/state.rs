//! State, open contact records and monitors as arrays, there and back: what a checkpoint holds.

use crate::arrays::{self, Table};
use crate::ModelError;
use carom_core::contact::ContactKey;
use carom_core::record::ContactRecord;
use carom_core::state::{State, Touch, Warm};
use carom_core::Monitors;
use glam::{DQuat, DVec3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Impulse and moment of a contact.
pub fn warm_values(w: &Warm) -> [f64; 6] {
    let mut out = [0.0; 6];
    for (k, v) in [w.impulse, w.moment].into_iter().enumerate() {
        out[3 * k..3 * k + 3].copy_from_slice(&v.to_array());
    }
    out
}

pub fn put_kinematics(out: &Bound<'_, PyDict>, s: &State) -> PyResult<()> {
    let vectors = |name: &str, records| Table { out, records }.rows(name, DVec3::to_array);
    vectors("position", &s.position)?;
    let records = &s.orientation;
    Table { out, records }.rows("orientation", |q| [q.w, q.x, q.y, q.z])?;
    vectors("velocity", &s.velocity)?;
    vectors("angular_velocity", &s.angular_velocity)
}

/// Pairs of vectors, 6 numbers each.
pub fn put_pairs(out: &Bound<'_, PyDict>, name: &str, records: &[[DVec3; 2]]) -> PyResult<()> {
    Table { out, records }.rows(name, |[a, b]| [a.x, a.y, a.z, b.x, b.y, b.z])
}

/// Keys of contacts.
pub fn put_keys<R>(
    out: &Bound<'_, PyDict>,
    name: &str,
    records: &[R],
    key: impl Fn(&R) -> ContactKey,
) -> PyResult<()> {
    Table { out, records }.rows(name, |r| {
        let (a, b) = key(r);
        [a, b].map(u64::from)
    })
}

pub fn open_values(r: &ContactRecord) -> [f64; 20] {
    let mut out = [0.0; 20];
    out[0] = r.gap;
    for (k, v) in [
        r.normal,
        r.impulse,
        r.moment,
        r.position_impulse,
        r.position_moment,
    ]
    .into_iter()
    .enumerate()
    {
        out[1 + 3 * k..4 + 3 * k].copy_from_slice(&v.to_array());
    }
    out[16..].copy_from_slice(&r.work);
    out
}

pub fn touch_values(t: &Touch) -> [f64; 11] {
    let mut out = [0.0; 11];
    (out[0], out[1]) = (t.approach, t.age);
    for (k, v) in [t.spring, t.impulse, t.moment].into_iter().enumerate() {
        out[2 + 3 * k..5 + 3 * k].copy_from_slice(&v.to_array());
    }
    out
}

/// Closed contacts of method `penalty`.
fn read_touches(state: &Bound<'_, PyDict>) -> PyResult<Vec<Touch>> {
    let values = arrays::rows::<11>(state, "touch_value")?;
    let vector = |v: &[f64]| DVec3::new(v[0], v[1], v[2]);
    let touches = read_keys(state, "touch", values.len())?;
    let touches = touches.into_iter().zip(&values).map(|(key, v)| Touch {
        key,
        approach: v[0],
        age: v[1],
        spring: vector(&v[2..]),
        impulse: vector(&v[5..]),
        moment: vector(&v[8..]),
    });
    Ok(touches.collect())
}

/// Keys of contacts, as many as there are values.
fn read_keys(state: &Bound<'_, PyDict>, name: &str, count: usize) -> PyResult<Vec<ContactKey>> {
    let keys = arrays::indices(state, &format!("{name}_key"))?;
    if keys.len() != 2 * count {
        return Err(ModelError::new_err(format!(
            "state: {name}_key and {name}_value differ in length"
        )));
    }
    // A number that is no index is none of a body either.
    let index = |k: u64| u32::try_from(k).unwrap_or(u32::MAX);
    Ok(keys.chunks(2).map(|k| (index(k[0]), index(k[1]))).collect())
}

/// Pairs of a sphere and a later body of a model of `bodies` spheres and walls.
fn check_keys(name: &str, keys: &[u64], bodies: u64) -> PyResult<()> {
    if keys.chunks(2).any(|k| k[0] >= k[1] || k[1] >= bodies) {
        return Err(ModelError::new_err(format!(
            "state: {name} names a body that the model has not"
        )));
    }
    Ok(())
}

pub fn read_open(state: &Bound<'_, PyDict>, bodies: u64) -> PyResult<Vec<ContactRecord>> {
    let keys = arrays::indices(state, "open_key")?;
    let status = arrays::indices(state, "open_status")?;
    let values = arrays::rows::<20>(state, "open_value")?;
    if keys.len() != 2 * values.len() || status.len() != values.len() {
        return Err(ModelError::new_err(
            "state: the open contact records differ in length",
        ));
    }
    check_keys("open_key", &keys, bodies)?;
    if status.iter().any(|&s| s > u64::from(u8::MAX)) {
        return Err(ModelError::new_err("state: open_status is out of range"));
    }
    let vector = |v: &[f64]| DVec3::new(v[0], v[1], v[2]);
    Ok(values
        .iter()
        .enumerate()
        .map(|(i, v)| ContactRecord {
            key: (keys[2 * i] as u32, keys[2 * i + 1] as u32),
            status: status[i] as u8,
            gap: v[0],
            normal: vector(&v[1..]),
            impulse: vector(&v[4..]),
            moment: vector(&v[7..]),
            position_impulse: vector(&v[10..]),
            position_moment: vector(&v[13..]),
            work: [v[16], v[17], v[18], v[19]],
        })
        .collect())
}

/// Pairs of vectors, 6 numbers each.
pub fn read_pairs(state: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<[DVec3; 2]>> {
    Ok(arrays::rows::<6>(state, name)?
        .into_iter()
        .map(|v| [DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])])
        .collect())
}

/// The arrays of a state, of whatever model: [`State::check`] says whether it is one of this.
pub fn read_state(state: &Bound<'_, PyDict>) -> PyResult<State> {
    let vectors = |name: &str| -> PyResult<Vec<DVec3>> {
        Ok(arrays::rows::<3>(state, name)?
            .into_iter()
            .map(DVec3::from)
            .collect())
    };
    let values = arrays::rows::<6>(state, "warm_value")?;
    let keys = read_keys(state, "warm", values.len())?;
    let warm = keys.into_iter().zip(&values).map(|(key, v)| Warm {
        key,
        impulse: DVec3::new(v[0], v[1], v[2]),
        moment: DVec3::new(v[3], v[4], v[5]),
    });
    let warm_step = arrays::floats(state, "warm_step")?
        .first()
        .copied()
        .ok_or_else(|| ModelError::new_err("state: warm_step is empty"))?;
    let (last, pseudo) = (
        read_pairs(state, "joint_reaction")?,
        read_pairs(state, "joint_pseudo")?,
    );
    if last.len() != pseudo.len() {
        return Err(ModelError::new_err(
            "state: joint_reaction and joint_pseudo differ in length",
        ));
    }
    Ok(State {
        step: arrays::indices(state, "step")?
            .first()
            .copied()
            .unwrap_or(0),
        position: vectors("position")?,
        orientation: arrays::rows::<4>(state, "orientation")?
            .into_iter()
            .map(|q| DQuat::from_xyzw(q[1], q[2], q[3], q[0]))
            .collect(),
        velocity: vectors("velocity")?,
        angular_velocity: vectors("angular_velocity")?,
        pseudo: read_pairs(state, "pseudo")?,
        acceleration: read_pairs(state, "acceleration")?,
        reaction: last.into_iter().zip(pseudo).map(|(l, p)| [l, p]).collect(),
        // Of models whose balls come and go, see `flow.rs`.
        present: Vec::new(),
        entered: Vec::new(),
        warm: warm.collect(),
        warm_step,
        touches: read_touches(state)?,
    })
}

/// All numbers of the monitors in the order of a checkpoint: counts, and measures.
fn numbers(m: &mut Monitors) -> ([&mut u64; 27], [&mut f64; 15]) {
    let counts = [
        &mut m.steps,
        &mut m.smooth.max,
        &mut m.smooth.sum,
        &mut m.position.max,
        &mut m.position.sum,
        &mut m.velocity.max,
        &mut m.velocity.sum,
        &mut m.line_search_position.max,
        &mut m.line_search_position.sum,
        &mut m.line_search_velocity.max,
        &mut m.line_search_velocity.sum,
        &mut m.impact_problems.max,
        &mut m.impact_problems.sum,
        &mut m.contacts.max,
        &mut m.contacts.sum,
        &mut m.fallbacks,
        &mut m.truncated,
        &mut m.unconverged,
        &mut m.halvings,
        &mut m.missed_impacts,
        &mut m.relisted,
        &mut m.safeguarded,
        &mut m.energy_rises,
        &mut m.substeps,
        &mut m.entered,
        &mut m.removed,
        &mut m.handovers,
    ];
    let measures = [
        &mut m.restitution_scale,
        &mut m.residual_position,
        &mut m.residual_velocity,
        &mut m.penetration,
        &mut m.penetration_relative,
        &mut m.energy_initial,
        &mut m.energy_final,
        &mut m.energy_max_rise,
        &mut m.energy_scale,
        &mut m.travel,
        &mut m.energy_work,
        &mut m.substep_min,
        &mut m.energy_in,
        &mut m.energy_out,
        &mut m.stepped,
    ];
    (counts, measures)
}

pub fn monitor_arrays(m: &Monitors) -> (Vec<u64>, Vec<f64>) {
    let mut m = m.clone();
    let (counts, measures) = numbers(&mut m);
    (counts.map(|x| *x).to_vec(), measures.map(|x| *x).to_vec())
}

pub fn monitors_from(counts: &[u64], measures: &[f64]) -> Option<Monitors> {
    // Without the last of each: of a version without hand-overs; without three: in which balls did not come and go.
    if !matches!(
        (counts.len(), measures.len()),
        (27, 15) | (26, 14) | (24, 12)
    ) {
        return None;
    }
    let mut m = Monitors::default();
    let (to_counts, to_measures) = numbers(&mut m);
    to_counts
        .into_iter()
        .zip(counts)
        .for_each(|(to, x)| *to = *x);
    (to_measures.into_iter().zip(measures)).for_each(|(to, x)| *to = *x);
    Some(m)
}
