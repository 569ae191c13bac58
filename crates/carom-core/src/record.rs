//! What is kept of a run, in memory, until the border takes it: frames, contacts, impacts, steps, residuals.

use crate::contact::{Contact, ContactKey};
use crate::flow::Event;
use crate::model::Model;
use crate::outcome::ImpactRecord;
use crate::report::StepReport;
use crate::scratch::Scratch;
use crate::state::State;
use crate::transition::Transition;
use glam::DVec3;

/// Impulses of one contact accumulated since the last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactRecord {
    pub key: ContactKey,
    /// Status and geometry at the last step in which it was closed.
    pub status: u8,
    pub gap: f64,
    pub normal: DVec3,
    /// World vectors on body A: velocity level (N s, N m s) and position level (kg m, kg m^2).
    pub impulse: DVec3,
    pub moment: DVec3,
    pub position_impulse: DVec3,
    pub position_moment: DVec3,
    /// Normal, sliding, rolling, spinning, J.
    pub work: [f64; 4],
}

/// An impact with its time.
#[derive(Clone, Debug)]
pub struct TimedImpact {
    pub step: u64,
    pub time: f64,
    pub impact: ImpactRecord,
}

/// Residual history of the longest solve of one level in one step.
#[derive(Clone, Debug)]
pub struct ResidualRecord {
    pub step: u64,
    /// 0 smooth (loads beyond the weight only), 1 position, 2 velocity.
    pub level: u8,
    pub problem: u32,
    pub contacts: u32,
    pub values: Vec<f64>,
}

/// Rows since the border last took them. Frames are flat: an entry for each ball.
#[derive(Clone, Debug, Default)]
pub struct Block {
    pub frame_step: Vec<u64>,
    pub frame_time: Vec<f64>,
    pub position: Vec<f64>,
    pub orientation: Vec<f64>,
    pub velocity: Vec<f64>,
    pub angular_velocity: Vec<f64>,
    /// Of each free wall its displacement and its velocity along the normal, m and m/s.
    pub free_walls: Vec<f64>,
    /// Of each clump its centre of mass, the quaternion of its principal axes (w first), its velocity and its angular velocity.
    pub clumps: Vec<f64>,
    /// Lengths of a periodic box that deforms, and the displacement of the image one up along the gradient, m: 4 per frame.
    pub periodic: Vec<f64>,
    /// Which spheres are there, N per frame; empty unless the model has inflows or outlets.
    pub present: Vec<bool>,
    pub events: Vec<Event>,
    /// Impulse and moment of every joint since the last frame, 6 per joint and frame.
    pub joints: Vec<f64>,
    /// Impulse on every wall since the last frame and its moment about the wall's place, 6 per wall and frame; empty unless the
    /// model records walls.
    pub walls: Vec<f64>,
    pub contact_end: Vec<u64>,
    pub contacts: Vec<ContactRecord>,
    pub impacts: Vec<TimedImpact>,
    pub transitions: Vec<Transition>,
    pub steps: Vec<StepReport>,
    pub residuals: Vec<ResidualRecord>,
}

/// Collects a block.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    pub block: Block,
    /// Sorted by key; empty unless contacts are recorded. Part of what a checkpoint keeps.
    pub open: Vec<ContactRecord>,
    /// Of the joints, since the last frame; part of what a checkpoint keeps.
    pub open_joints: Vec<[DVec3; 2]>,
    /// Of the walls, the same.
    pub open_walls: Vec<[DVec3; 2]>,
    drop_impacts: bool,
}

/// A point to which a recorder can go back.
pub struct Mark {
    impacts: usize,
    transitions: usize,
    residuals: usize,
    open: Vec<ContactRecord>,
    open_joints: Vec<[DVec3; 2]>,
    open_walls: Vec<[DVec3; 2]>,
}

impl Recorder {
    pub fn new(model: &Model) -> Recorder {
        Recorder {
            open_joints: vec![[DVec3::ZERO; 2]; model.joints.len()],
            open_walls: vec![[DVec3::ZERO; 2]; model.recorded_walls()],
            drop_impacts: model.drop_impacts,
            ..Recorder::default()
        }
    }

    /// Takes the events of a (sub-)step that was made.
    pub fn add_step(&mut self, scratch: &Scratch, step: u64, time: f64, contacts: bool) {
        let impacts = if self.drop_impacts {
            &[]
        } else {
            &scratch.impacts[..]
        };
        for (k, impact) in impacts.iter().enumerate() {
            let time = scratch.impact_times.get(k).copied().unwrap_or(time);
            let impact = impact.clone();
            self.block.impacts.push(TimedImpact { step, time, impact });
        }
        self.block.transitions.extend(&scratch.transitions);
        for (level, history) in scratch.history.iter().enumerate() {
            if !history.values.is_empty() {
                self.block.residuals.push(ResidualRecord {
                    step,
                    level: level as u8,
                    problem: history.problem,
                    contacts: history.contacts,
                    values: history.values.clone(),
                });
            }
        }
        let joints = self.open_joints.iter_mut().zip(&scratch.joint_reaction);
        let walls = self.open_walls.iter_mut().zip(&scratch.wall_impulse);
        for (sum, given) in joints.chain(walls) {
            sum[0] += given[0];
            sum[1] += given[1];
        }
        if contacts {
            self.accumulate(&scratch.contacts);
        }
    }

    /// What has to be remembered to undo the steps that follow.
    pub fn mark(&self) -> Mark {
        Mark {
            impacts: self.block.impacts.len(),
            transitions: self.block.transitions.len(),
            residuals: self.block.residuals.len(),
            open: self.open.clone(),
            open_joints: self.open_joints.clone(),
            open_walls: self.open_walls.clone(),
        }
    }

    /// Undoes what was added by [`Self::add_step`] since a mark. Frames are added between steps, never within one.
    pub fn rewind(&mut self, mark: Mark) {
        self.block.impacts.truncate(mark.impacts);
        self.block.transitions.truncate(mark.transitions);
        self.block.residuals.truncate(mark.residuals);
        self.open = mark.open;
        self.open_joints = mark.open_joints;
        self.open_walls = mark.open_walls;
    }

    /// Merges the step's contacts into the open records; both are sorted by key.
    fn accumulate(&mut self, contacts: &[Contact]) {
        let known = self.open.len();
        let mut cursor = 0;
        for c in contacts.iter().filter(|c| c.acts()) {
            let key = (c.a, c.b);
            while cursor < known && self.open[cursor].key < key {
                cursor += 1;
            }
            if cursor < known && self.open[cursor].key == key {
                add(c, &mut self.open[cursor]);
                continue;
            }
            let mut record = ContactRecord {
                key,
                ..ContactRecord::default()
            };
            add(c, &mut record);
            self.open.push(record);
        }
        if self.open.len() > known {
            // Two sorted runs, which this merges.
            self.open.sort_by_key(|record| record.key);
        }
    }

    /// Closes a frame: state and the contacts since the last one.
    pub fn add_frame(&mut self, model: &Model, state: &State, time: f64) {
        let (b, n) = (&mut self.block, model.balls());
        b.frame_step.push(state.step);
        b.frame_time.push(time);
        if model.deformation.is_some() {
            b.periodic.extend(model.periodic_at(time));
        }
        if !model.flow.is_none() {
            b.present.extend_from_slice(&state.present[..n]);
        }
        for i in 0..n {
            b.position.extend(state.seen(i).to_array());
        }
        for q in &state.orientation[..n] {
            b.orientation.extend([q.w, q.x, q.y, q.z]);
        }
        for v in &state.velocity[..n] {
            b.velocity.extend(v.to_array());
        }
        for w in &state.angular_velocity[..n] {
            b.angular_velocity.extend(w.to_array());
        }
        for (wall, i) in model.free_walls.iter().zip(model.first_wall()..) {
            let along = [state.position[i], state.velocity[i]];
            b.free_walls.extend(along.map(|v| v.dot(wall.normal)));
        }
        for i in n..model.first_wall() {
            let (x, q) = (state.seen(i), state.orientation[i]);
            b.clumps.extend(x.to_array());
            b.clumps.extend([q.w, q.x, q.y, q.z]);
            let motion = [state.velocity[i], state.angular_velocity[i]];
            b.clumps.extend(motion.iter().flat_map(DVec3::to_array));
        }
        for (open, flat) in [
            (&mut self.open_joints, &mut b.joints),
            (&mut self.open_walls, &mut b.walls),
        ] {
            for v in open.iter_mut().flatten() {
                flat.extend(v.to_array());
                *v = DVec3::ZERO;
            }
        }
        b.contacts.append(&mut self.open);
        b.contact_end.push(b.contacts.len() as u64);
    }
}

fn add(c: &Contact, record: &mut ContactRecord) {
    let (velocity, _) = c.impulse();
    let position = c.position_impulse();
    record.status = c.status as u8;
    record.gap = c.gap;
    record.normal = c.n1;
    record.impulse += velocity.impulse;
    record.moment += velocity.moment;
    record.position_impulse += position.impulse;
    record.position_moment += position.moment;
    for (sum, w) in record.work.iter_mut().zip(c.work) {
        *sum += w;
    }
}
