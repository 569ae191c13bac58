//! What is said of a step that failed: bodies, message, what was not solved and what may cure it.

use super::{Recording, Simulation};
use crate::cures::cures;
use crate::outcome::{BlowUp, Failure, Level};
use crate::problem::KeptProblem;
use crate::report::{Outcome, StepReport, Unsolved};

/// Masses in one problem over one another (1) beyond which that is why it is not solved: rounding of what presses the heavy one moves the light one.
const UNLIKE: f64 = 1e6;

impl Simulation {
    /// Keeps the contact problem of a blow-up: the step is made once more, in vain, with every problem of it kept.
    #[cold]
    pub(super) fn keep_blow_up(&mut self, what: BlowUp, recording: Recording) {
        if what.level == Level::Smooth || self.stepper.divides_steps() {
            return;
        }
        let (number, time) = (self.state.step + 1, self.time());
        let mut report = StepReport::new(number, time);
        let wanted = self.scratch.keeper.begin_again(number, time);
        let mark = self.recorder.mark();
        let again = self.attempt(0, time, recording, &mut report);
        debug_assert!(again.is_err(), "the same step fails in the same way");
        self.recorder.rewind(mark);
        let island = |p: &KeptProblem| p.level == what.level && p.bodies.contains(&what.bodies);
        self.failed = self.scratch.keeper.end_again(wanted, island);
    }

    pub(super) fn outcome(&mut self, failure: Failure) -> Outcome {
        let step = self.state.step + 1;
        let mut out = Outcome {
            step,
            time: step as f64 * self.model.options.step,
            failure,
            bodies: Vec::new(),
            joint: None,
            message: None,
            source: None,
            unsolved: None,
        };
        let pair = |(a, b)| vec![a, b];
        match failure {
            Failure::TooManyPairs | Failure::TooManySubsteps => {}
            Failure::TooFar {
                bodies,
                travel,
                length,
            } => {
                out.bodies = pair(bodies);
                // A clump that turns too far is alone.
                let how = match bodies.0 == bodies.1 {
                    true => "it turns",
                    false => "they meet",
                };
                out.message = Some(match travel < length {
                    true => "its centre has sunk into it".to_owned(),
                    false => self.too_fast(how, travel, length),
                });
            }
            Failure::BlowUp(what) => {
                out.bodies = pair(what.bodies);
                out.message = Some(if what.speed.is_finite() {
                    format!("at {} m/s", told(what.speed))
                } else {
                    "its motion is no number".to_owned()
                });
            }
            Failure::MissingLaw(a, b) | Failure::TooManyEvents(a, b) => out.bodies = vec![a, b],
            Failure::Friction { bodies, mu, slip } => {
                out.bodies = pair(bodies);
                out.message = Some(format!("mu = {mu} at a slip of {} m/s", told(slip)));
            }
            Failure::Restitution {
                bodies,
                e,
                approach,
            } => {
                out.bodies = pair(bodies);
                out.message = Some(format!(
                    "e_N = {e} at an approach of {} m/s",
                    told(approach)
                ));
            }
            Failure::Load => {
                let said = self.scratch.load_error.take().unwrap_or_default();
                (out.bodies, out.joint) = (said.body.into_iter().collect(), said.joint);
                (out.message, out.source) = (Some(said.text), said.source);
            }
            Failure::NotConverged(level) => {
                let (bodies, unsolved) = self.unsolved(level);
                (out.bodies, out.unsolved) = (pair(bodies), Some(unsolved));
            }
        }
        out
    }

    /// The worst pair of what was not solved, and what is told of it.
    fn unsolved(&self, level: Level) -> ((u32, u32), Unsolved) {
        let (mut bodies, mut contacts, mut joints, mut residual) = ((0, 0), 0, 0, f64::NAN);
        if level == Level::Smooth {
            bodies = self.scratch.smooth.worst(&self.model);
            let history = &self.scratch.history[0].values;
            residual = history.last().copied().unwrap_or(residual);
        }
        if let Some(f) = &self.failed {
            bodies = f.bodies.get(f.worst as usize).copied().unwrap_or((0, 0));
            joints = f.joints;
            contacts = f.bodies.len() as u32 - f.joints;
            residual = f.residual;
        }
        let mut cures = cures(&self.model.options, contacts, residual);
        let pairs = self.failed.iter().flat_map(|f| &f.bodies);
        let balls = pairs.flat_map(|&(a, b)| [a as usize, b as usize]);
        let masses = balls
            .filter(|&i| i < self.model.bodies())
            .map(|i| self.model.mass[i]);
        let [least, most] = masses.fold([f64::INFINITY, 0.0], |[least, most], m| {
            [least.min(m), f64::max(most, m)]
        });
        if most > UNLIKE * least {
            let by = told(most / least);
            cures = format!(
                "masses in it differ by a factor of {by}, which may be why: make the heavy one lighter, or press by a force \
                 in place of its weight; else {cures}"
            );
        }
        if self.model.deformation.is_some() {
            cures += "; rigid grains on which a periodic box closes have no solution: end the run before";
        } else if self.model.walls.iter().any(|wall| wall.motion.is_some()) {
            cures += "; where a driven wall jams bodies no motion is a solution: on_nonconvergence = \"warn\" goes on";
        }
        let unsolved = Unsolved {
            contacts,
            joints,
            residual,
            cures,
        };
        (bodies, unsolved)
    }

    /// `travel` (m) in the smallest part of a step against a radius of `length` (m).
    fn too_fast(&self, how: &str, travel: f64, length: f64) -> String {
        let o = &self.model.options;
        let part = o.step / f64::from(1u32 << o.max_halvings);
        let speed = travel / part;
        format!(
            "{how} at {} m/s: {} radii in {} s, the smallest part of a step; take a step of {} s or less",
            told(speed),
            told(travel / length),
            told(part),
            told(0.5 * length / speed),
        )
    }
}

/// A number of four digits, as people write it.
fn told(x: f64) -> String {
    let rounded: f64 = format!("{x:.3e}").parse().unwrap_or(x);
    match rounded == 0.0 || (1e-4..1e6).contains(&rounded.abs()) {
        true => rounded.to_string(),
        false => format!("{rounded:e}"),
    }
}
