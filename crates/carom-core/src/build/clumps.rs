//! Clumps from their description, and the masses and sizes of all bodies.

use super::ModelInput;
use crate::clump::body::{quaternion, Carrier, Clump};
use crate::force::Load;
use crate::joint::Joint;
use crate::options::{Method, Options};
use crate::outcome::{Entry, ModelError};
use crate::wall::{self, FreeWall};
use std::sync::Arc;

/// How far (1) the largest principal moment may be above the sum of the others: rounding of flat bodies.
const FLAT: f64 = 1e-9;

/// Checks clumps, and that nothing is there which does not know them.
pub fn compile(input: &ModelInput, options: &Options) -> Result<Vec<Clump>, ModelError> {
    if input.clumps.is_empty() {
        return Ok(Vec::new());
    }
    check_beside(options)?;
    let (n, mut free) = (input.radius.len(), 0);
    for (index, c) in input.clumps.iter().enumerate() {
        let clump = Entry("clump", index);
        let refuse = |quantity, text: String| Err(clump.refused((quantity, text)));
        let balls = &c.balls;
        if balls.is_empty() || balls.start < free || balls.end > n {
            let text = format!("are {balls:?} of {n}; clumps stand in the order of their balls");
            return refuse("balls", text);
        }
        free = balls.end;
        clump.positive("mass", c.mass)?;
        for moment in c.inertia {
            clump.positive("inertia", moment)?;
        }
        let largest = c.inertia.iter().copied().fold(0.0, f64::max);
        let others = c.inertia.iter().sum::<f64>() - largest;
        if largest > others * (1.0 + FLAT) {
            let text = format!("has a moment {largest} above the sum {others} of the others");
            return refuse("inertia", text);
        }
        clump.finite("position", &c.position)?;
        wall::place("position", c.position.into()).map_err(|why| clump.refused(why))?;
        clump.finite("velocity", &c.velocity)?;
        clump.finite("angular_velocity", &c.angular_velocity)?;
        clump.unit(&c.orientation)?;
    }
    let made = input.clumps.iter().map(|c| Clump::new(c, &input.position));
    Ok(made.collect())
}

/// Refuses what does not know clumps.
fn check_beside(options: &Options) -> Result<(), ModelError> {
    let found = [
        (options.method != Method::Nsga, "methods other than nsga"),
        (options.is_printed(), "position_friction = \"paper\""),
        (options.impact.is_printed(), "impact = \"sequence-paper\""),
    ];
    match found.into_iter().find(|(is_there, _)| *is_there) {
        None => Ok(()),
        Some((_, what)) => {
            let text = format!("cannot be with {what}; leave out one of both");
            Err(Entry("clump", 0).refused(("balls", text)))
        }
    }
}

/// Masses and sizes of the bodies: balls, clumps, free walls.
pub struct Bodies {
    pub radius: Vec<f64>,
    pub mass: Vec<f64>,
    pub inertia: Vec<f64>,
}

impl Bodies {
    pub fn new(input: &ModelInput, free: &[FreeWall], clumps: &[Clump]) -> Bodies {
        // A wall has no radius: lengths of its residuals are those of the smallest ball.
        let smallest = input.radius.iter().copied().fold(f64::INFINITY, f64::min);
        let (mut radius, mut mass) = (input.radius.clone(), input.mass.clone());
        let mut inertia = input.inertia.clone();
        // What a clump weighs is its own, not that of its balls.
        for ball in clumps.iter().flat_map(|c| c.balls.clone()) {
            (mass[ball], inertia[ball]) = (0.0, 0.0);
        }
        for (clump, given) in clumps.iter().zip(&input.clumps) {
            let balls = clump.balls.clone().zip(&clump.offsets);
            let reach = balls.map(|(ball, offset)| offset.length() + input.radius[ball]);
            radius.push(reach.fold(0.0, f64::max));
            mass.push(given.mass);
            inertia.push(clump.mean_inertia());
        }
        for wall in &input.free_walls[..free.len()] {
            radius.push(smallest);
            mass.push(wall.mass);
            inertia.push(wall::HELD_INERTIA);
        }
        Bodies {
            radius,
            mass,
            inertia,
        }
    }
}

/// The clump that carries a ball of a description, and where; none of other balls.
fn carrier(input: &ModelInput, clumps: &[Clump], ball: u32) -> Option<Carrier> {
    let ball = ball as usize;
    let number = clumps.partition_point(|c| c.balls.end <= ball);
    let clump = clumps.get(number).filter(|c| c.balls.contains(&ball))?;
    let axes = quaternion(input.clumps[number].orientation).inverse();
    Some(Carrier {
        body: (input.radius.len() + number) as u32,
        centre: clump.offsets[ball - clump.balls.start],
        axes: axes * quaternion(input.orientation[ball]),
    })
}

/// Loads and joints that are given on balls of clumps as those of the clumps.
pub fn carry(input: &ModelInput, clumps: &[Clump]) -> (Vec<Joint>, Vec<Arc<dyn Load>>) {
    let by = |ball: u32| carrier(input, clumps, ball);
    let loads = input
        .loads
        .iter()
        .map(|load| load.carried(&by).unwrap_or_else(|| load.clone()));
    let joints = input.joints.iter().map(|joint| joint.carried(&by));
    (joints.collect(), loads.collect())
}

/// The clump + 1 of each of `n` balls; nothing without clumps.
pub fn owners(clumps: &[Clump], n: usize) -> Vec<u32> {
    let mut owners = vec![0; if clumps.is_empty() { 0 } else { n }];
    for (clump, number) in clumps.iter().zip(1..) {
        owners[clump.balls.clone()].fill(number);
    }
    owners
}
