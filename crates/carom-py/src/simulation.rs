//! The class `Simulation`.

use crate::arrays::{self, put, Table};
use crate::convert::{self};
use crate::dict::dict;
use crate::flow;
use crate::problem::problem_dict;
use crate::state::{
    monitor_arrays, monitors_from, put_kept, put_kinematics, put_pairs, read_open, read_pairs,
    read_state, told,
};
use crate::tables::{outcome_dict, put_block, put_impulses, put_motion, put_transitions};
use crate::ModelError;
use carom_core::model::ContactLaw;
use carom_core::options::Method;
use carom_core::problem::Steps;
use carom_core::report::Spread;
use carom_core::{Model, Recording};
use carom_penalty::{damping, law};
use pyo3::import_exception;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{RwLock, RwLockReadGuard, RwLockWriteGuard, TryLockError};
use std::time::Duration;

/// A model, its state and its scratch memory.
#[pyclass(frozen, module = "carom._core")]
pub struct Simulation {
    inner: RwLock<carom_core::Simulation>,
}

import_exception!(carom.errors, CaromError);

/// What a lock guards, but for the error that it is taken: the simulation is in the midst of a step.
fn held<G>(lock: Result<G, TryLockError<G>>) -> PyResult<G> {
    match lock {
        Ok(guard) => Ok(guard),
        Err(TryLockError::Poisoned(left)) => Ok(left.into_inner()),
        Err(TryLockError::WouldBlock) => Err(CaromError::new_err(
            "the simulation is being stepped; a load function takes what it needs from its arguments, and another \
             thread waits until step() returns",
        )),
    }
}

impl Simulation {
    fn read(&self) -> PyResult<RwLockReadGuard<'_, carom_core::Simulation>> {
        held(self.inner.try_read())
    }

    fn write(&self) -> PyResult<RwLockWriteGuard<'_, carom_core::Simulation>> {
        held(self.inner.try_write())
    }
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
        let made =
            Model::new(&input, options).and_then(|(model, initial)| match model.options.method {
                Method::Events => carom_events::simulation(model, initial),
                _ => carom_penalty::simulation(model, initial),
            });
        let inner = made.map_err(|e| ModelError::new_err(e.to_string()))?;
        Ok(Simulation {
            inner: RwLock::new(inner),
        })
    }

    #[getter]
    fn step(&self) -> PyResult<u64> {
        Ok(self.read()?.state.step)
    }

    #[getter]
    fn time(&self) -> PyResult<f64> {
        Ok(self.read()?.time())
    }

    /// Current time, position, orientation, velocity, angular velocity as copies.
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (inner, out) = (self.read()?, PyDict::new(py));
        out.set_item("time", inner.time())?;
        put_motion(&out, &inner.model, &mut inner.frame(), &[])?;
        Ok(out)
    }

    /// Pairs that overlap now: `(a, b, gap)`.
    fn overlaps(&self, tolerance: f64, most: usize) -> PyResult<Vec<(u32, u32, f64)>> {
        let inner = self.read()?;
        let found = inner.overlaps(tolerance, most);
        let outside = |b: u32| inner.model.outside(b);
        let named = found.into_iter().map(|o| (o.a, outside(o.b), o.gap));
        Ok(named.collect())
    }

    /// Advances; see the stub for the meaning of the arguments and the tables.
    fn advance<'py>(
        &self,
        py: Python<'py>,
        steps: u64,
        frame_every: u64,
        contacts: bool,
        wall_limit: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let limit = if wall_limit > 0.0 {
            Duration::try_from_secs_f64(wall_limit).unwrap_or(Duration::MAX)
        } else {
            Duration::ZERO
        };
        let recording = Recording {
            frame_every,
            contacts,
        };
        let mut held = self.write()?;
        let inner = &mut *held;
        let (outcome, block) = py.detach(|| {
            let mut outcome = inner.advance(steps, recording, limit);
            for body in outcome.iter_mut().flat_map(|o| &mut o.bodies) {
                *body = inner.model.outside(*body);
            }
            (outcome, inner.take_block())
        });
        let out = PyDict::new(py);
        let model = &inner.model;
        if !model.flow.is_none() {
            flow::put_events(&out, &block.events)?;
        }
        if model.options.method == Method::Events {
            put_transitions(&out, &block.transitions)?;
        }
        if model.courses {
            put_impulses(&out, model, &block.impacts)?;
        }
        put_block(&out, model, block)?;
        match outcome {
            Some(o) => out.set_item("outcome", outcome_dict(py, &o)?)?,
            None => out.set_item("outcome", py.None())?,
        }
        Ok(out)
    }

    /// Everything that must be saved to continue bit for bit.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = self.read()?;
        let s = &inner.state;
        let out = PyDict::new(py);
        put(&out, "step", vec![s.step], &[1])?;
        put_kinematics(&out, s)?;
        flow::put_state(&out, &inner.model, s)?;
        put_pairs(&out, "pseudo", &s.pseudo)?;
        put_pairs(&out, "acceleration", &s.acceleration)?;
        for (k, name) in ["joint_reaction", "joint_pseudo"].into_iter().enumerate() {
            let pairs: Vec<_> = s.reaction.iter().map(|r| r[k]).collect();
            put_pairs(&out, name, &pairs)?;
        }
        put(&out, "warm_step", vec![s.warm_step], &[1])?;
        let recorder = &inner.recorder;
        put_kept(&out, "warm", &s.warm, |w| w.key)?;
        put_kept(&out, "touch", &s.touches, |t| t.key)?;
        if inner.model.options.method == Method::Events {
            let told = told(s);
            let count = told.len();
            put(&out, "told", told, &[count])?;
        }
        let (out, records) = (&out, &recorder.open[..]);
        put_kept(out, "open", records, |r| r.key)?;
        Table { out, records }.column("open_status", |r| u64::from(r.status))?;
        put_pairs(out, "open_joint", &recorder.open_joints)?;
        put_pairs(out, "open_wall", &recorder.open_walls)?;
        let (integers, floats) = monitor_arrays(&inner.monitors);
        put(out, "monitor_int", integers, &[1])?;
        put(out, "monitor_float", floats, &[1])?;
        Ok(out.clone())
    }

    /// Takes a state back. Refuses one of another model size.
    fn restore(&self, state: &Bound<'_, PyDict>) -> PyResult<()> {
        let mut held = self.write()?;
        let inner = &mut *held;
        let bodies = inner.model.first_wall() + inner.model.walls.len();
        let mut loaded = read_state(state)?;
        flow::read_state(state, &inner.model, &mut loaded)?;
        (loaded.check(&inner.model)).map_err(|e| ModelError::new_err(e.to_string()))?;
        if let Some(clump) = loaded.struck_in_parts(&inner.model, &inner.state) {
            return Err(ModelError::new_err(format!(
                "state: balls of a clump do not move as it does; strike the clump, row {clump} of velocity and angular_velocity"
            )));
        }
        loaded.follow_clumps(&inner.model);
        let open = read_open(state, bodies as u32)?;
        // Without them the totals begin anew.
        let monitors = match state.get_item("monitor_int")? {
            Some(_) => {
                let integers = arrays::indices(state, "monitor_int")?;
                let floats = arrays::floats(state, "monitor_float")?;
                let found = monitors_from(&integers, &floats);
                Some(found.ok_or_else(|| {
                    ModelError::new_err("state: the monitors are of another version")
                })?)
            }
            None => None,
        };
        let joints = read_pairs(state, "open_joint")?;
        let count = inner.model.joints.len();
        if joints.len() != count {
            return Err(ModelError::new_err(format!(
                "state: open_joint is for {} joints, the model has {}",
                joints.len(),
                count
            )));
        }
        // A checkpoint of a version that knew no moving walls has none.
        let walls = match state.get_item("open_wall")? {
            Some(_) => read_pairs(state, "open_wall")?,
            None => Vec::new(),
        };
        let count = inner.model.recorded_walls();
        if walls.len() != count {
            return Err(ModelError::new_err(format!(
                "state: open_wall is for {} walls, the model records {count}",
                walls.len()
            )));
        }
        inner.recorder.open_walls = walls;
        inner.recorder.open_joints = joints;
        // What happened before the start of a new run has no place in one taken up again.
        inner.recorder.block.events.clear();
        inner.state = loaded;
        inner.recorder.open = open;
        match monitors {
            Some(monitors) => inner.monitors = monitors,
            None => inner.begin_totals(),
        }
        Ok(())
    }

    /// Totals since the start.
    fn monitors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = self.read()?;
        let m = &inner.monitors;
        let spread = |s: &Spread| -> PyResult<Bound<'py, PyDict>> {
            let mean = match m.steps {
                0 => 0.0,
                steps => s.sum as f64 / steps as f64,
            };
            Ok(dict! { py, "max": s.max, "mean": mean })
        };
        let iterations = dict! { py,
            "smooth": spread(&m.smooth)?,
            "position": spread(&m.position)?,
            "velocity": spread(&m.velocity)?,
        };
        let search = dict! { py,
            "position": m.line_search_position.max,
            "velocity": m.line_search_velocity.max,
        };
        let energy = dict! { py,
            "initial": m.energy_initial,
            "final": m.energy_final,
            "work": m.energy_work,
            "in": m.energy_in,
            "out": m.energy_out,
            "max_rise": m.energy_max_rise,
            "max_rise_relative": m.energy_max_rise / m.energy_scale.max(f64::MIN_POSITIVE),
            "rises": m.energy_rises,
        };
        let out = dict! { py,
            "steps": m.steps,
            "iterations": iterations,
            "line_search": search,
            "impact_problems": spread(&m.impact_problems)?,
            "contacts": spread(&m.contacts)?,
            "fallbacks": m.fallbacks,
            "truncated_sequences": m.truncated,
            "unconverged": m.unconverged,
            "halvings": m.halvings,
            "substeps": m.substeps,
            "handovers": m.handovers,
            "entered": m.entered,
            "removed": m.removed,
            "missed_impacts": m.missed_impacts,
            "relisted": m.relisted,
            "safeguarded": m.safeguarded,
            "stepped": m.stepped,
            "restitution_scale_min": m.restitution_scale,
            "residual_position_max": m.residual_position,
            "residual_velocity_max": m.residual_velocity,
            "penetration_max": m.penetration,
            "penetration_max_relative": m.penetration_relative,
            "travel_max": m.travel,
        };
        if inner.model.options.method == Method::Penalty {
            out.set_item("penalty", penalty(py, &inner)?)?;
        }
        out.set_item("energy", energy)?;
        Ok(out)
    }

    /// Seconds by phase, estimated from sampled steps.
    fn phases<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (name, seconds) in self.read()?.timers.estimate() {
            out.set_item(name, seconds)?;
        }
        Ok(out)
    }

    /// The contact problem that could not be solved, or None.
    fn failing_problem<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let inner = self.read()?;
        let failed = inner.failed.as_ref();
        failed
            .map(|p| problem_dict(py, &inner.model, p))
            .transpose()
    }

    /// Chooses what `take_problems` gives: steps `(first, last, stride)`, and how many of the hardest problems.
    fn keep_problems(&self, steps: Vec<(u64, u64, u64)>, hardest: usize) -> PyResult<()> {
        let mut inner = self.write()?;
        let keeper = inner.keeper();
        keeper.hardest = hardest;
        keeper.steps = steps
            .into_iter()
            .map(|(first, last, stride)| Steps {
                first,
                last,
                stride,
            })
            .collect();
        Ok(())
    }

    /// Problems of the chosen steps since the last call; with `hardest` the hardest of the run so far instead.
    fn take_problems<'py>(
        &self,
        py: Python<'py>,
        hardest: bool,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let mut inner = self.write()?;
        let keeper = inner.keeper();
        let taken = if hardest {
            keeper.take_hardest()
        } else {
            keeper.take()
        };
        let model = &inner.model;
        taken.iter().map(|p| problem_dict(py, model, p)).collect()
    }
}

/// What method `penalty` chose: its substeps, and what each contact law came to.
fn penalty<'py>(py: Python<'py>, inner: &carom_core::Simulation) -> PyResult<Bound<'py, PyDict>> {
    let (m, model) = (&inner.monitors, &inner.model);
    let entry = |law: &ContactLaw| -> PyResult<Bound<'py, PyDict>> {
        let chi = law::damping(&model.options, law, 0.0);
        Ok(dict! { py,
            "restitution": law.restitution(0.0),
            "varies": law.restitution_law.is_some(),
            "damping": chi,
            "restitution_effective": damping::restitution(chi),
        })
    };
    Ok(dict! { py,
        "substeps": m.substeps,
        "substep_min": m.substep_min,
        "laws": model.laws.iter().map(entry).collect::<PyResult<Vec<_>>>()?,
    })
}
