//! A step of `nsga` made ahead, of the balls that press one another.

use crate::sums::Sums;
use carom_core::contact::Contact;
use carom_core::flow::Exchange;
use carom_core::outcome::ImpactRecord;
use carom_core::scratch::Scratch;
use carom_core::state::State;
use carom_core::transition::Transition;
use carom_core::StepReport;
use glam::DVec3;
use std::mem::take;

/// A step of `nsga` that was made, of some balls, and what it has to tell.
pub struct Ahead {
    /// s, since the start of the step of the run.
    pub until: f64,
    /// What of it is taken (1).
    pub share: f64,
    /// At its end. Others are absent there.
    pub state: State,
    pub report: StepReport,
    pub sums: Sums,
    pub impacts: Vec<ImpactRecord>,
    pub times: Vec<f64>,
    pub walls: Vec<[DVec3; 2]>,
    /// Of its last part, with the size of that, s.
    pub contacts: Vec<Contact>,
    pub h: f64,
}

impl Ahead {
    /// Nothing yet, of a state in which all others are absent.
    pub fn new(state: State, until: f64, report: StepReport, walls: usize) -> Ahead {
        Ahead {
            until,
            share: 1.0,
            state,
            report,
            sums: Sums::default(),
            impacts: Vec::new(),
            times: Vec::new(),
            walls: vec![[DVec3::ZERO; 2]; walls],
            contacts: Vec::new(),
            h: 0.0,
        }
    }
}

/// What the step has collected so far, out of the way of a step within it.
pub struct Kept {
    impacts: Vec<ImpactRecord>,
    times: Vec<f64>,
    left: Exchange,
    transitions: Vec<Transition>,
    walls: Vec<[DVec3; 2]>,
}

impl Kept {
    pub fn take(scratch: &mut Scratch) -> Kept {
        Kept {
            impacts: take(&mut scratch.impacts),
            times: take(&mut scratch.impact_times),
            left: take(&mut scratch.left),
            transitions: take(&mut scratch.transitions),
            walls: scratch.wall_impulse.clone(),
        }
    }

    /// Back into `scratch`.
    pub fn put_back(self, scratch: &mut Scratch) {
        scratch.impacts = self.impacts;
        scratch.impact_times = self.times;
        scratch.left = self.left;
        scratch.transitions = self.transitions;
        scratch.wall_impulse = self.walls;
    }
}
