//! The class `Simulation`.

use crate::convert::{self, put};
use crate::ModelError;
use carom_core::record::{Block, ContactRecord};
use carom_core::report::{Column, Spread};
use carom_core::state::{State, Warm};
use carom_core::{Model, Outcome, Recording, StepReport};
use glam::{DQuat, DVec3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::time::Duration;

/// A model, its state and its scratch memory.
#[pyclass(module = "carom._core")]
pub struct Simulation {
    inner: carom_core::Simulation,
}

fn flat<const K: usize>(values: impl Iterator<Item = [f64; K]>) -> Vec<f64> {
    values.flatten().collect()
}

#[pymethods]
impl Simulation {
    #[new]
    fn new(model: &Bound<'_, PyDict>) -> PyResult<Self> {
        let options = match model.get_item("options")? {
            Some(dict) => convert::options(dict.cast::<PyDict>()?)?,
            None => carom_core::Options::default(),
        };
        let input = convert::model_input(model)?;
        let (model, initial) =
            Model::new(&input, options).map_err(|e| ModelError::new_err(e.to_string()))?;
        Ok(Simulation {
            inner: carom_core::Simulation::new(model, initial),
        })
    }

    #[getter]
    fn step(&self) -> u64 {
        self.inner.state.step
    }

    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    /// Current time, position, orientation, velocity, angular velocity as copies.
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        out.set_item("time", self.inner.time())?;
        put_kinematics(&out, &self.inner.state)?;
        Ok(out)
    }

    /// Advances; see the stub for the meaning of the arguments and the tables.
    fn advance<'py>(
        &mut self,
        py: Python<'py>,
        steps: u64,
        frame_every: u64,
        contacts: bool,
        wall_limit: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let limit = Duration::try_from_secs_f64(wall_limit).unwrap_or(Duration::MAX);
        let recording = Recording {
            frame_every,
            contacts,
        };
        let inner = &mut self.inner;
        let (outcome, block) = py.detach(|| {
            let outcome = inner.advance(steps, recording, limit);
            (outcome, inner.take_block())
        });
        let out = PyDict::new(py);
        put_block(&out, block, self.inner.model.spheres())?;
        match outcome {
            Some(o) => out.set_item("outcome", outcome_dict(py, &o)?)?,
            None => out.set_item("outcome", py.None())?,
        }
        Ok(out)
    }

    /// Everything that must be saved to continue bit for bit.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = &self.inner.state;
        let out = PyDict::new(py);
        put(&out, "step", vec![s.step], &[1])?;
        put_kinematics(&out, s)?;
        let n = s.position.len();
        for (name, pairs) in [("pseudo", &s.pseudo), ("acceleration", &s.acceleration)] {
            let values = flat(pairs.iter().map(|[a, b]| [a.x, a.y, a.z, b.x, b.y, b.z]));
            put(&out, name, values, &[n, 6])?;
        }
        put(&out, "warm_step", vec![s.warm_step], &[1])?;
        let keys: Vec<u64> = s
            .warm
            .iter()
            .flat_map(|w| [u64::from(w.key.0), u64::from(w.key.1)])
            .collect();
        put(&out, "warm_key", keys, &[s.warm.len(), 2])?;
        let values = flat(s.warm.iter().map(|w| six(w.impulse, w.moment)));
        put(&out, "warm_value", values, &[s.warm.len(), 6])?;
        let open = &self.inner.recorder.open;
        let keys: Vec<u64> = open
            .iter()
            .flat_map(|r| [u64::from(r.key.0), u64::from(r.key.1)])
            .collect();
        put(&out, "open_key", keys, &[open.len(), 2])?;
        put(
            &out,
            "open_status",
            open.iter().map(|r| u64::from(r.status)).collect(),
            &[open.len()],
        )?;
        put(
            &out,
            "open_value",
            flat(open.iter().map(open_values)),
            &[open.len(), 20],
        )?;
        let (integers, floats) = monitor_arrays(&self.inner.monitors);
        put(&out, "monitor_int", integers, &[1])?;
        put(&out, "monitor_float", floats, &[1])?;
        Ok(out)
    }

    /// Takes a state back. Refuses one of another model size.
    fn restore(&mut self, state: &Bound<'_, PyDict>) -> PyResult<()> {
        let n = self.inner.model.spheres();
        let loaded = read_state(state)?;
        for (name, found) in [
            ("position", loaded.position.len()),
            ("orientation", loaded.orientation.len()),
            ("velocity", loaded.velocity.len()),
            ("angular_velocity", loaded.angular_velocity.len()),
            ("pseudo", loaded.pseudo.len()),
            ("acceleration", loaded.acceleration.len()),
        ] {
            if found != n {
                return Err(ModelError::new_err(format!(
                    "state: {name} is for {found} spheres, the model has {n}"
                )));
            }
        }
        let open = read_open(state)?;
        let integers = convert::indices(state, "monitor_int")?;
        let floats = convert::floats(state, "monitor_float")?;
        let Some(monitors) = monitors_from(&integers, &floats) else {
            return Err(ModelError::new_err(
                "state: the monitors are of another version",
            ));
        };
        self.inner.state = loaded;
        self.inner.recorder.open = open;
        self.inner.monitors = monitors;
        Ok(())
    }

    /// Totals since the start.
    fn monitors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let m = &self.inner.monitors;
        let out = PyDict::new(py);
        let spread = |s: &Spread| -> PyResult<Bound<'py, PyDict>> {
            let d = PyDict::new(py);
            d.set_item("max", s.max)?;
            d.set_item(
                "mean",
                if m.steps == 0 {
                    0.0
                } else {
                    s.sum as f64 / m.steps as f64
                },
            )?;
            Ok(d)
        };
        out.set_item("steps", m.steps)?;
        let iterations = PyDict::new(py);
        iterations.set_item("smooth", spread(&m.smooth)?)?;
        iterations.set_item("position", spread(&m.position)?)?;
        iterations.set_item("velocity", spread(&m.velocity)?)?;
        out.set_item("iterations", iterations)?;
        let search = PyDict::new(py);
        search.set_item("position", m.line_search_position.max)?;
        search.set_item("velocity", m.line_search_velocity.max)?;
        out.set_item("line_search", search)?;
        out.set_item("impact_problems", spread(&m.impact_problems)?)?;
        out.set_item("contacts", spread(&m.contacts)?)?;
        for (name, value) in [
            ("fallbacks", m.fallbacks),
            ("truncated_sequences", m.truncated),
            ("unconverged", m.unconverged),
            ("halvings", m.halvings),
            ("missed_impacts", m.missed_impacts),
            ("relisted", m.relisted),
            ("safeguarded", m.safeguarded),
        ] {
            out.set_item(name, value)?;
        }
        out.set_item("restitution_scale_min", m.restitution_scale)?;
        out.set_item("residual_position_max", m.residual_position)?;
        out.set_item("residual_velocity_max", m.residual_velocity)?;
        out.set_item("penetration_max", m.penetration)?;
        out.set_item("penetration_max_relative", m.penetration_relative)?;
        out.set_item("travel_max", m.travel)?;
        let energy = PyDict::new(py);
        energy.set_item("initial", m.energy_initial)?;
        energy.set_item("final", m.energy_final)?;
        energy.set_item("max_rise", m.energy_max_rise)?;
        energy.set_item(
            "max_rise_relative",
            m.energy_max_rise / m.energy_scale.max(f64::MIN_POSITIVE),
        )?;
        energy.set_item("rises", m.energy_rises)?;
        out.set_item("energy", energy)?;
        Ok(out)
    }

    /// Seconds by phase, estimated from sampled steps.
    fn phases<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (name, seconds) in self.inner.timers.estimate() {
            out.set_item(name, seconds)?;
        }
        Ok(out)
    }

    /// The contact problem that could not be solved, or None.
    fn failing_problem<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(f) = &self.inner.failed else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        out.set_item("level", f.level)?;
        out.set_item("step", f.step)?;
        out.set_item("time", f.time)?;
        out.set_item("residual", f.residual)?;
        let (rows, contacts) = (f.free.len(), f.bodies.len());
        if f.delassus.len() == rows * rows {
            put(&out, "W", f.delassus.clone(), &[rows, rows])?;
        }
        put(&out, "q", f.free.clone(), &[rows])?;
        let bodies = f
            .bodies
            .iter()
            .flat_map(|&(a, b)| [i64::from(a), i64::from(b)])
            .collect();
        put::<i64>(&out, "bodies", bodies, &[contacts, 2])?;
        put(&out, "first_row", f.first_row.clone(), &[contacts])?;
        put(&out, "rows", f.rows.clone(), &[contacts])?;
        for (k, name) in ["mu", "rolling_radius", "spinning_radius"]
            .into_iter()
            .enumerate()
        {
            put(
                &out,
                name,
                f.bounds.iter().map(|b| b[k]).collect(),
                &[contacts],
            )?;
        }
        out.set_item("worst", f.worst)?;
        Ok(Some(out))
    }
}

fn six(a: DVec3, b: DVec3) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

fn put_kinematics(out: &Bound<'_, PyDict>, s: &State) -> PyResult<()> {
    let n = s.position.len();
    put(
        out,
        "position",
        flat(s.position.iter().map(DVec3::to_array)),
        &[n, 3],
    )?;
    put(
        out,
        "orientation",
        flat(s.orientation.iter().map(|q| [q.w, q.x, q.y, q.z])),
        &[n, 4],
    )?;
    put(
        out,
        "velocity",
        flat(s.velocity.iter().map(DVec3::to_array)),
        &[n, 3],
    )?;
    put(
        out,
        "angular_velocity",
        flat(s.angular_velocity.iter().map(DVec3::to_array)),
        &[n, 3],
    )
}

fn outcome_dict<'py>(py: Python<'py>, o: &Outcome) -> PyResult<Bound<'py, PyDict>> {
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
            residual,
        } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("level", level.name())?;
            out.set_item("bodies", [bodies.0, bodies.1])?;
            out.set_item("contacts", contacts)?;
            out.set_item("residual", residual)?;
        }
        Outcome::NotFinite { step, time, body } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("bodies", [*body])?;
        }
        Outcome::MissingLaw { step, time, bodies } => {
            out.set_item("step", step)?;
            out.set_item("time", time)?;
            out.set_item("bodies", [bodies.0, bodies.1])?;
        }
    }
    Ok(out)
}

fn put_block(out: &Bound<'_, PyDict>, b: Block, n: usize) -> PyResult<()> {
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
    put(&frames, "orientation", b.orientation, &[f, n, 4])?;
    put(&frames, "velocity", b.velocity, &[f, n, 3])?;
    put(&frames, "angular_velocity", b.angular_velocity, &[f, n, 3])?;
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

fn open_values(r: &ContactRecord) -> [f64; 20] {
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

fn read_open(state: &Bound<'_, PyDict>) -> PyResult<Vec<ContactRecord>> {
    let keys = convert::indices(state, "open_key")?;
    let status = convert::indices(state, "open_status")?;
    let values = convert::rows::<20>(state, "open_value")?;
    if keys.len() != 2 * values.len() || status.len() != values.len() {
        return Err(ModelError::new_err(
            "state: the open contact records differ in length",
        ));
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

fn read_state(state: &Bound<'_, PyDict>) -> PyResult<State> {
    let vectors = |name: &str| -> PyResult<Vec<DVec3>> {
        Ok(convert::rows::<3>(state, name)?
            .into_iter()
            .map(DVec3::from)
            .collect())
    };
    let pairs = |name: &str| -> PyResult<Vec<[DVec3; 2]>> {
        Ok(convert::rows::<6>(state, name)?
            .into_iter()
            .map(|v| [DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])])
            .collect())
    };
    let one = |name: &str| -> PyResult<f64> {
        convert::floats(state, name)?
            .first()
            .copied()
            .ok_or_else(|| ModelError::new_err(format!("state: {name} is empty")))
    };
    let keys = convert::indices(state, "warm_key")?;
    let values = convert::rows::<6>(state, "warm_value")?;
    if keys.len() != 2 * values.len() {
        return Err(ModelError::new_err(
            "state: warm_key and warm_value differ in length",
        ));
    }
    let warm = values
        .iter()
        .enumerate()
        .map(|(i, v)| Warm {
            key: (keys[2 * i] as u32, keys[2 * i + 1] as u32),
            impulse: DVec3::new(v[0], v[1], v[2]),
            moment: DVec3::new(v[3], v[4], v[5]),
        })
        .collect();
    Ok(State {
        step: convert::indices(state, "step")?
            .first()
            .copied()
            .unwrap_or(0),
        position: vectors("position")?,
        orientation: convert::rows::<4>(state, "orientation")?
            .into_iter()
            .map(|q| DQuat::from_xyzw(q[1], q[2], q[3], q[0]))
            .collect(),
        velocity: vectors("velocity")?,
        angular_velocity: vectors("angular_velocity")?,
        pseudo: pairs("pseudo")?,
        acceleration: pairs("acceleration")?,
        warm,
        warm_step: one("warm_step")?,
    })
}

/// Monitors as two arrays, in the order of [`monitors_from`].
fn monitor_arrays(m: &carom_core::Monitors) -> (Vec<u64>, Vec<f64>) {
    let spreads = [
        m.smooth,
        m.position,
        m.velocity,
        m.line_search_position,
        m.line_search_velocity,
        m.impact_problems,
        m.contacts,
    ];
    let mut integers = vec![m.steps];
    integers.extend(spreads.iter().flat_map(|s| [s.max, s.sum]));
    integers.extend([
        m.fallbacks,
        m.truncated,
        m.unconverged,
        m.halvings,
        m.missed_impacts,
        m.relisted,
        m.safeguarded,
        m.energy_rises,
    ]);
    let floats = vec![
        m.restitution_scale,
        m.residual_position,
        m.residual_velocity,
        m.penetration,
        m.penetration_relative,
        m.energy_initial,
        m.energy_final,
        m.energy_max_rise,
        m.energy_scale,
        m.travel,
    ];
    (integers, floats)
}

fn monitors_from(i: &[u64], f: &[f64]) -> Option<carom_core::Monitors> {
    if i.len() != 23 || f.len() != 10 {
        return None;
    }
    let spread = |k: usize| Spread {
        max: i[1 + 2 * k],
        sum: i[2 + 2 * k],
    };
    Some(carom_core::Monitors {
        steps: i[0],
        smooth: spread(0),
        position: spread(1),
        velocity: spread(2),
        line_search_position: spread(3),
        line_search_velocity: spread(4),
        impact_problems: spread(5),
        contacts: spread(6),
        fallbacks: i[15],
        truncated: i[16],
        unconverged: i[17],
        halvings: i[18],
        missed_impacts: i[19],
        relisted: i[20],
        safeguarded: i[21],
        energy_rises: i[22],
        restitution_scale: f[0],
        residual_position: f[1],
        residual_velocity: f[2],
        penetration: f[3],
        penetration_relative: f[4],
        energy_initial: f[5],
        energy_final: f[6],
        energy_max_rise: f[7],
        energy_scale: f[8],
        travel: f[9],
    })
}
