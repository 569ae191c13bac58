//! Balls that come and go: inflows and outlets, between two steps of the run's grid.
//!
//! All balls are bodies of the model from the start; those of an inflow are absent until they enter. What an absent ball is:
//! `present` is false, it stands where it stood last at no velocity, has no pairs, no load and no energy. What enters or leaves
//! is a body: a ball, or a clump with its balls, by its centre of mass. Nothing here has a
//! memory but [`crate::state::State`]: places are drawn from the seed, the body, the step and the number of the try.

pub mod exchange;
mod room;

use carom_geom::tangent_frame;
use glam::DVec3;

/// Where the centres of mass of what enters are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// Lowest and highest corner, m.
    Box { low: DVec3, high: DVec3 },
    /// Centre (m), unit normal, radius (m).
    Disc {
        centre: DVec3,
        normal: DVec3,
        radius: f64,
    },
}

/// Bodies `first..first + count`, balls or clumps, enter one after the other, at most `rate` of them a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inflow {
    pub first: u32,
    pub count: u32,
    pub region: Region,
    /// Bodies a second; 0: as fast as there is room.
    pub rate: f64,
    /// When the first may enter, s.
    pub start: f64,
    /// With which they enter, each component changed at random by at most `spread`, m/s.
    pub velocity: DVec3,
    pub spread: f64,
    /// Clumps are turned at random; else they enter as they wait.
    pub turned: bool,
    pub seed: u64,
}

/// A box; bodies whose centre is inside (or outside) leave: in a periodic world those of which an image is (or none is). Balls
/// that joints or loads of their own hold stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlet {
    pub low: DVec3,
    pub high: DVec3,
    pub inside: bool,
}

impl Inflow {
    pub fn bodies(&self) -> std::ops::Range<usize> {
        let first = self.first as usize;
        first..first + self.count as usize
    }
}

/// All inflows and outlets of a model.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    pub inflows: Vec<Inflow>,
    pub outlets: Vec<Outlet>,
    /// Which bodies do not leave by themselves: balls that joints or loads of their own hold, and those of clumps. Empty without outlets.
    pub(crate) held: Vec<bool>,
}

/// A ball that entered or left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub step: u64,
    /// s.
    pub time: f64,
    pub body: u32,
    pub entered: bool,
}

impl Event {
    fn new((step, time): (u64, f64), body: u32, entered: bool) -> Event {
        Event {
            step,
            time,
            body,
            entered,
        }
    }
}

/// What entered and left between two steps, or within one: each ball, numbers, kinetic and potential energy, J.
#[derive(Clone, Debug, Default)]
pub struct Exchange {
    pub events: Vec<Event>,
    pub entered: u32,
    pub removed: u32,
    pub energy_in: [f64; 2],
    pub energy_out: [f64; 2],
}

impl Exchange {
    /// Adds numbers and energies of what was earlier, and puts its balls before.
    pub(crate) fn follow(&mut self, mut earlier: Exchange) {
        self.entered += earlier.entered;
        self.removed += earlier.removed;
        for k in 0..2 {
            self.energy_in[k] += earlier.energy_in[k];
            self.energy_out[k] += earlier.energy_out[k];
        }
        earlier.events.append(&mut self.events);
        self.events = earlier.events;
    }
}

impl Flow {
    /// Neither inflows nor outlets: every ball is there all the time.
    pub fn is_none(&self) -> bool {
        self.inflows.is_empty() && self.outlets.is_empty()
    }
}

impl Region {
    /// The point of three numbers in [0, 1): evenly distributed as they are.
    pub(super) fn point(&self, [u, v, w]: [f64; 3]) -> DVec3 {
        match *self {
            Region::Box { low, high } => low + DVec3::new(u, v, w) * (high - low),
            Region::Disc {
                centre,
                normal,
                radius,
            } => {
                let (t1, t2) = tangent_frame(normal);
                let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
                centre + radius * u.sqrt() * (cos * t1 + sin * t2)
            }
        }
    }

    /// Lowest and highest corner of a box around it, m.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        match *self {
            Region::Box { low, high } => [low, high],
            Region::Disc { centre, radius, .. } => {
                [centre - DVec3::splat(radius), centre + DVec3::splat(radius)]
            }
        }
    }
}
