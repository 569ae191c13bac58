//! State, open contact records and monitors as arrays, there and back: what a checkpoint holds.

use crate::arrays::{self, Table};
use crate::ModelError;
use carom_core::contact::ContactKey;
use carom_core::record::ContactRecord;
use carom_core::state::{State, Touch, Warm};
use carom_core::transition::Mode;
use carom_core::Monitors;
use glam::{DQuat, DVec3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::slice::from_mut;

/// What a checkpoint keeps of a contact: its numbers, in one order for there and back.
pub trait Kept<const K: usize>: Clone {
    fn of(key: ContactKey) -> Self;
    fn numbers(&mut self) -> Vec<&mut [f64]>;

    fn values(&self) -> [f64; K] {
        let (mut own, mut out) = (self.clone(), [0.0; K]);
        let numbers = own.numbers().into_iter().flatten();
        out.iter_mut().zip(numbers).for_each(|(to, x)| *to = *x);
        out
    }

    fn from_values(key: ContactKey, values: &[f64; K]) -> Self {
        let mut own = Self::of(key);
        let numbers = own.numbers().into_iter().flatten();
        numbers.zip(values).for_each(|(to, x)| *to = *x);
        own
    }
}

impl Kept<6> for Warm {
    fn of(key: ContactKey) -> Warm {
        let (impulse, moment) = (DVec3::ZERO, DVec3::ZERO);
        Warm {
            key,
            impulse,
            moment,
        }
    }
    fn numbers(&mut self) -> Vec<&mut [f64]> {
        vec![self.impulse.as_mut(), self.moment.as_mut()]
    }
}

impl Kept<11> for Touch {
    fn of(key: ContactKey) -> Touch {
        Touch::new(key, 0.0)
    }
    fn numbers(&mut self) -> Vec<&mut [f64]> {
        vec![
            from_mut(&mut self.approach),
            from_mut(&mut self.age),
            self.spring.as_mut(),
            self.impulse.as_mut(),
            self.moment.as_mut(),
        ]
    }
}

impl Kept<20> for ContactRecord {
    fn of(key: ContactKey) -> ContactRecord {
        ContactRecord {
            key,
            ..ContactRecord::default()
        }
    }
    fn numbers(&mut self) -> Vec<&mut [f64]> {
        vec![
            from_mut(&mut self.gap),
            self.normal.as_mut(),
            self.impulse.as_mut(),
            self.moment.as_mut(),
            self.position_impulse.as_mut(),
            self.position_moment.as_mut(),
            &mut self.work,
        ]
    }
}

/// Places and velocities of all bodies.
pub fn put_kinematics(out: &Bound<'_, PyDict>, s: &State) -> PyResult<()> {
    let vectors =
        |name: &str, records: &[DVec3]| Table { out, records }.rows(name, DVec3::to_array);
    vectors("position", &s.position)?;
    let records = &s.orientation[..];
    Table { out, records }.rows("orientation", |q| [q.w, q.x, q.y, q.z])?;
    vectors("velocity", &s.velocity)?;
    vectors("angular_velocity", &s.angular_velocity)
}

/// Pairs of vectors, 6 numbers each.
pub fn put_pairs(out: &Bound<'_, PyDict>, name: &str, records: &[[DVec3; 2]]) -> PyResult<()> {
    Table { out, records }.rows(name, |[a, b]| [a.x, a.y, a.z, b.x, b.y, b.z])
}

/// Contacts: keys and values.
pub fn put_kept<const K: usize, R: Kept<K>>(
    out: &Bound<'_, PyDict>,
    name: &str,
    records: &[R],
    key: impl Fn(&R) -> ContactKey,
) -> PyResult<()> {
    let table = Table { out, records };
    table.rows(&format!("{name}_key"), |r| {
        let (a, b) = key(r);
        [a, b].map(u64::from)
    })?;
    table.rows(&format!("{name}_value"), R::values)
}

/// The same back.
fn read_kept<const K: usize, R: Kept<K>>(
    state: &Bound<'_, PyDict>,
    name: &str,
) -> PyResult<Vec<R>> {
    let values = arrays::rows::<K>(state, &format!("{name}_value"))?;
    let keys = arrays::indices(state, &format!("{name}_key"))?;
    if keys.len() != 2 * values.len() {
        return Err(ModelError::new_err(format!(
            "state: {name}_key and {name}_value differ in length"
        )));
    }
    // A number that is no index is none of a body either.
    let index = |k: u64| u32::try_from(k).unwrap_or(u32::MAX);
    let keys = keys.chunks(2).map(|k| (index(k[0]), index(k[1])));
    Ok(keys
        .zip(&values)
        .map(|(key, values)| R::from_values(key, values))
        .collect())
}

/// Open contact records of a model of `bodies` spheres and walls.
pub fn read_open(state: &Bound<'_, PyDict>, bodies: u32) -> PyResult<Vec<ContactRecord>> {
    let mut open: Vec<ContactRecord> = read_kept(state, "open")?;
    let status = arrays::indices(state, "open_status")?;
    if status.len() != open.len() {
        return Err(ModelError::new_err(
            "state: the open contact records differ in length",
        ));
    }
    // Pairs of a sphere and a later body.
    if open.iter().any(|r| r.key.0 >= r.key.1 || r.key.1 >= bodies) {
        return Err(ModelError::new_err(
            "state: open_key names a body that the model has not",
        ));
    }
    for (record, status) in open.iter_mut().zip(status) {
        record.status = u8::try_from(status)
            .map_err(|_| ModelError::new_err("state: open_status is out of range"))?;
    }
    Ok(open)
}

/// Pairs of vectors, 6 numbers each.
pub fn read_pairs(state: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<[DVec3; 2]>> {
    Ok(arrays::rows::<6>(state, name)?
        .into_iter()
        .map(|v| [DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])])
        .collect())
}

/// What method `events` has told: of which motion, and the mode of each body. Nothing in states of other methods, or of version 0.2.0.
fn read_told(state: &Bound<'_, PyDict>) -> PyResult<(u64, Vec<Mode>)> {
    if !state.contains("told")? {
        return Ok((0, Vec::new()));
    }
    let told = arrays::indices(state, "told")?;
    let Some((&of, modes)) = told.split_first() else {
        return Ok((0, Vec::new()));
    };
    let mode = |&k: &u64| Mode::ALL.get(k as usize).copied();
    let modes: Option<Vec<Mode>> = modes.iter().map(mode).collect();
    let modes = modes.ok_or_else(|| ModelError::new_err("state: told is out of range"))?;
    Ok((of, modes))
}

/// The same as it is saved.
pub fn told(state: &State) -> Vec<u64> {
    let modes = state.told.iter().map(|&mode| mode as u64);
    [state.told_of].into_iter().chain(modes).collect()
}

/// The arrays of a state, of whatever model: [`State::check`] says whether it is one of this.
pub fn read_state(state: &Bound<'_, PyDict>) -> PyResult<State> {
    let vectors = |name: &str| arrays::vectors(state, name);
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
    let (told_of, told) = read_told(state)?;
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
        warm: read_kept(state, "warm")?,
        warm_step,
        touches: read_kept(state, "touch")?,
        told,
        told_of,
    })
}

pub fn monitor_arrays(m: &Monitors) -> (Vec<u64>, Vec<f64>) {
    let mut m = m.clone();
    let (counts, measures) = m.numbers();
    let counts = counts.into_iter().map(|x| *x).collect();
    (counts, measures.into_iter().map(|x| *x).collect())
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
    let (to_counts, to_measures) = m.numbers();
    (to_counts.into_iter().zip(counts)).for_each(|(to, x)| *to = *x);
    (to_measures.into_iter().zip(measures)).for_each(|(to, x)| *to = *x);
    Some(m)
}
