//! What a step, and a run, tell about themselves.

use crate::flow::Exchange;
use crate::islands::Islands;
use crate::outcome::{Failure, Level};
use carom_solve::SolveReport;
use std::error::Error;
use std::sync::Arc;

/// A column of the step table.
#[derive(Clone, Debug)]
pub enum Column {
    F64(Vec<f64>),
    U32(Vec<u32>),
    U64(Vec<u64>),
}

trait Cell: Copy {
    fn column(values: Vec<Self>) -> Column;
}
impl Cell for f64 {
    fn column(values: Vec<Self>) -> Column {
        Column::F64(values)
    }
}
impl Cell for u32 {
    fn column(values: Vec<Self>) -> Column {
        Column::U32(values)
    }
}
impl Cell for u64 {
    fn column(values: Vec<Self>) -> Column {
        Column::U64(values)
    }
}

/// Rows of the step table that stay in the nearest cache while they are taken apart.
const ROWS: usize = 64;

/// How a number takes in another one of its kind, by its rule: the larger, the smaller, the sum; or not at all.
macro_rules! take {
    (max, $type:ty, $own:expr, $other:expr) => {
        $own = $own.max($other)
    };
    (min, $type:ty, $own:expr, $other:expr) => {
        $own = $own.min($other)
    };
    (sum, $type:ty, $own:expr, $other:expr) => {
        $own += <$type>::from($other)
    };
    (spread, $type:ty, $own:expr, $other:expr) => {
        $own.add($other)
    };
    (own, $type:ty, $own:expr, $($other:expr)?) => {};
}

macro_rules! step_report {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $rule:ident),+ $(,)?) => {
        /// One row of the step table.
        #[derive(Clone, Copy, Debug, Default)]
        pub struct StepReport { $($(#[$doc])* pub $name: $type),+ }

        impl StepReport {
            /// The table as named columns, in the order of the fields.
            pub fn columns(rows: &[StepReport]) -> Vec<(&'static str, Column)> {
                $(let mut $name: Vec<$type> = Vec::with_capacity(rows.len());)+
                // Some rows at a time, so that each is read from memory once.
                for some in rows.chunks(ROWS) {
                    $($name.extend(some.iter().map(|r| r.$name));)+
                }
                vec![$((stringify!($name), Cell::column($name))),+]
            }

            /// Takes in what solves of islands told elsewhere, or an earlier part of the step: largest values and sums, in no order.
            pub(crate) fn join(&mut self, other: &StepReport) {
                $(take!($rule, $type, self.$name, other.$name);)+
                self.take_substeps(other.substeps, other.substep_min);
            }
        }
    };
}

step_report! {
    /// Number of the step on the original grid (1 is the first).
    step: u64 = own,
    /// Time at its end, s.
    time: f64 = own,
    /// Newton iterations: largest of any island (and impact problem); a closed form counts 1.
    iterations_smooth: u32 = max,
    iterations_position: u32 = max,
    iterations_velocity: u32 = max,
    /// Step-length reductions, largest of any solve.
    line_search_position: u32 = max,
    line_search_velocity: u32 = max,
    /// Impact problems of the island that needed most, the resting solve (stage 0) among them.
    impact_problems: u32 = max,
    /// Gauss-Seidel sweeps of the pile that needed most.
    sweeps_position: u32 = max,
    sweeps_velocity: u32 = max,
    /// Candidate contacts, closed contacts, islands with a closed contact, closed contacts of the largest island.
    candidates: u32 = own,
    contacts: u32 = own,
    islands: u32 = own,
    largest_island: u32 = own,
    /// Relative residual of eq. 44 at the end, worst solve.
    residual_smooth: f64 = max,
    residual_position: f64 = max,
    residual_velocity: f64 = max,
    /// Energies after the step, J.
    energy_kinetic: f64 = own,
    energy_potential: f64 = own,
    /// Work of loads without a potential and of prescribed motion in the step, J.
    energy_work: f64 = sum,
    /// Energy of the balls that entered and left after the step, J, and their numbers.
    energy_in: f64 = own,
    energy_out: f64 = own,
    entered: u32 = own,
    removed: u32 = own,
    /// Largest penetration after the step, m, and over r_c.
    penetration: f64 = max,
    penetration_relative: f64 = max,
    /// Solves that needed a later rung of the chain, impact sequences cut short, solves accepted unconverged.
    fallbacks: u32 = sum,
    truncated: u32 = sum,
    unconverged: u32 = sum,
    /// How often this step was halved.
    halvings: u32 = sum,
    /// Contacts found overlapping while separating: the step was too long to see them.
    missed_impacts: u32 = sum,
    /// Position solves repeated because a new pair overlapped.
    relisted: u32 = sum,
    /// Smallest factor of the energy safeguard (1: never needed).
    restitution_scale: f64 = min,
    /// Parts of the step and the smallest, s: the substeps of method `penalty`; with others the parts into which a step was
    /// cut so that nothing passes through anything, 0 where it was not.
    substeps: u32 = own,
    substep_min: f64 = own,
    /// How often method `events` handed the motion to steps of `nsga`, and for how long in all, s.
    handovers: u32 = sum,
    stepped: f64 = sum,
}

impl StepReport {
    pub fn new(step: u64, time: f64) -> Self {
        StepReport {
            step,
            time,
            restitution_scale: 1.0,
            ..StepReport::default()
        }
    }

    #[inline(always)]
    pub(crate) fn add_position(&mut self, r: &SolveReport) {
        self.iterations_position = self.iterations_position.max(r.iterations);
        self.line_search_position = self.line_search_position.max(r.line_search);
        self.residual_position = self.residual_position.max(r.residual);
        self.fallbacks += u32::from(r.fallback);
    }

    #[inline(always)]
    pub(crate) fn add_velocity(&mut self, r: &SolveReport) {
        self.iterations_velocity = self.iterations_velocity.max(r.iterations);
        self.line_search_velocity = self.line_search_velocity.max(r.line_search);
        self.residual_velocity = self.residual_velocity.max(r.residual);
        self.fallbacks += u32::from(r.fallback);
    }

    /// Counts the islands of closed contacts.
    pub fn count(&mut self, islands: &Islands) {
        (self.contacts, self.islands, self.largest_island) = (0, 0, 0);
        for members in islands.sizes() {
            self.contacts += members;
            self.islands += u32::from(members > 0);
            self.largest_island = self.largest_island.max(members);
        }
    }

    /// Takes in what entered and left after the step.
    pub(crate) fn add_exchange(&mut self, e: &Exchange) {
        self.energy_in += e.energy_in.iter().sum::<f64>();
        self.energy_out += e.energy_out.iter().sum::<f64>();
        self.entered = e.entered;
        self.removed = e.removed;
    }

    /// Adds substeps and the smallest of them, s; it says nothing where there are none.
    pub fn take_substeps(&mut self, count: u32, smallest: f64) {
        if count > 0 {
            self.substep_min = if self.substeps == 0 {
                smallest
            } else {
                self.substep_min.min(smallest)
            };
            self.substeps += count;
        }
    }

    /// Takes in a part of the step. The first that is made has nothing to merge with but the counts of those who cut it.
    pub(crate) fn add_part(&mut self, mut part: StepReport) {
        if self.iterations_smooth > 0 {
            return self.merge(&part);
        }
        part.halvings = self.halvings;
        part.fallbacks += self.fallbacks;
        part.take_substeps(self.substeps, self.substep_min);
        *self = part;
    }

    /// Merges the second half of a halved step into the first.
    pub fn merge(&mut self, later: &StepReport) {
        let earlier = std::mem::replace(self, *later);
        self.join(&earlier);
    }
}

/// Largest value and sum, for the mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    pub max: u64,
    pub sum: u64,
}

impl Spread {
    fn add(&mut self, value: u32) {
        self.max = self.max.max(u64::from(value));
        self.sum += u64::from(value);
    }
}

/// A total of a run.
trait Total {
    /// Its numbers, counts and measures.
    fn numbers<'a>(&'a mut self, counts: &mut Vec<&'a mut u64>, measures: &mut Vec<&'a mut f64>);
}

impl Total for u64 {
    fn numbers<'a>(&'a mut self, counts: &mut Vec<&'a mut u64>, _: &mut Vec<&'a mut f64>) {
        counts.push(self);
    }
}

impl Total for Spread {
    fn numbers<'a>(&'a mut self, counts: &mut Vec<&'a mut u64>, _: &mut Vec<&'a mut f64>) {
        counts.extend([&mut self.max, &mut self.sum]);
    }
}

impl Total for f64 {
    fn numbers<'a>(&'a mut self, _: &mut Vec<&'a mut u64>, measures: &mut Vec<&'a mut f64>) {
        measures.push(self);
    }
}

macro_rules! monitors {
    ($($(#[$doc:meta])* $name:ident: $type:ident = $rule:ident $($of:ident)?),+ $(,)?) => {
        /// Totals since the start of the run; part of what a checkpoint keeps, in this order.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Monitors { $($(#[$doc])* pub $name: $type),+ }

        impl Monitors {
            /// All counts, and all measures.
            pub fn numbers(&mut self) -> (Vec<&mut u64>, Vec<&mut f64>) {
                let (mut counts, mut measures) = (Vec::new(), Vec::new());
                $(self.$name.numbers(&mut counts, &mut measures);)+
                (counts, measures)
            }

            fn take(&mut self, r: &StepReport) {
                $(take!($rule, $type, self.$name, $(r.$of)?);)+
            }
        }
    };
}

monitors! {
    steps: u64 = own,
    smooth: Spread = spread iterations_smooth,
    position: Spread = spread iterations_position,
    velocity: Spread = spread iterations_velocity,
    line_search_position: Spread = spread line_search_position,
    line_search_velocity: Spread = spread line_search_velocity,
    impact_problems: Spread = spread impact_problems,
    contacts: Spread = spread contacts,
    fallbacks: u64 = sum fallbacks,
    truncated: u64 = sum truncated,
    unconverged: u64 = sum unconverged,
    halvings: u64 = sum halvings,
    missed_impacts: u64 = sum missed_impacts,
    relisted: u64 = sum relisted,
    /// Steps in which restitution was scaled down, and the smallest factor.
    safeguarded: u64 = own,
    restitution_scale: f64 = min restitution_scale,
    residual_position: f64 = max residual_position,
    residual_velocity: f64 = max residual_velocity,
    penetration: f64 = max penetration,
    penetration_relative: f64 = max penetration_relative,
    energy_initial: f64 = own,
    energy_final: f64 = own,
    /// Largest rise of the total energy in one step beyond work and exchange, J (0: it never rose).
    energy_max_rise: f64 = own,
    /// The scale against which a rise is judged, J: largest kinetic energy, plus `sum m |g| r` and what other loads give from
    /// rest in a step, for where forces cancel the motion is rounding.
    energy_scale: f64 = own,
    /// Steps whose rise exceeds 1e-12 of the scale.
    energy_rises: u64 = own,
    /// Largest `|v| h / r` of any sphere after any step (rule R6).
    travel: f64 = own,
    /// Work of loads without a potential and of prescribed motion, J.
    energy_work: f64 = sum energy_work,
    /// Substeps and the smallest, s; 0 if there were none.
    substeps: u64 = own,
    substep_min: f64 = own,
    /// Energy of the balls that entered and left in the course of the run, J, and their numbers.
    energy_in: f64 = sum energy_in,
    energy_out: f64 = sum energy_out,
    entered: u64 = sum entered,
    removed: u64 = sum removed,
    /// Of method `events`: how often steps took over, and for how long, s.
    handovers: u64 = sum handovers,
    stepped: f64 = sum stepped,
}

impl Monitors {
    pub fn new(kinetic: f64, potential: f64, static_scale: f64) -> Self {
        Monitors {
            restitution_scale: 1.0,
            energy_initial: kinetic + potential,
            energy_final: kinetic + potential,
            energy_scale: kinetic + static_scale,
            ..Monitors::default()
        }
    }

    /// Takes a step's report into the totals. `floor` is what the scale has beside the kinetic energy, J.
    pub fn add(&mut self, r: &StepReport, floor: f64, travel: f64) {
        self.take(r);
        self.steps += 1;
        self.safeguarded += u64::from(r.restitution_scale < 1.0);
        let energy = r.energy_kinetic + r.energy_potential;
        let rise = energy - self.energy_final - r.energy_work - (r.energy_in - r.energy_out);
        self.energy_scale = self.energy_scale.max(r.energy_kinetic + floor);
        self.energy_max_rise = self.energy_max_rise.max(rise);
        // The potential has its zero at the origin: far from it, its rounding is no rise.
        let rounding = 16.0 * f64::EPSILON * r.energy_potential.abs();
        self.energy_rises += u64::from(rise > 1e-12 * self.energy_scale + rounding);
        self.energy_final = energy;
        self.travel = self.travel.max(travel);
        if r.substeps > 0 {
            let first = self.substeps == 0;
            self.substep_min = if first {
                r.substep_min
            } else {
                self.substep_min.min(r.substep_min)
            };
            self.substeps += u64::from(r.substeps);
        }
    }
}

/// Why a run stopped before its end, and where.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The step that could not be made, and the time at its end, s.
    pub step: u64,
    pub time: f64,
    pub failure: Failure,
    /// The spheres and walls that it is about, as far as it is about any.
    pub bodies: Vec<u32>,
    /// The joint whose law could not be evaluated.
    pub joint: Option<u32>,
    /// What else there is to say: numbers, or what a load said.
    pub message: Option<String>,
    /// The error of a load that is a function of the user.
    pub source: Option<Arc<dyn Error + Send + Sync>>,
    pub unsolved: Option<Unsolved>,
}

/// A sub-problem that did not converge after the whole ladder and every halving.
#[derive(Clone, Debug)]
pub struct Unsolved {
    pub contacts: u32,
    pub joints: u32,
    pub residual: f64,
    /// Settings that may solve it and are not there yet, in words.
    pub cures: String,
}

impl Outcome {
    pub fn kind(&self) -> &'static str {
        match self.failure {
            Failure::NotConverged(_) => "not_converged",
            Failure::BlowUp(what) if what.speed.is_finite() => "blow_up",
            Failure::BlowUp(_) => "not_finite",
            Failure::MissingLaw(..) => "missing_law",
            Failure::Load => "load_failed",
            Failure::Friction { .. } => "friction_failed",
            Failure::Restitution { .. } => "restitution_failed",
            // Only a wall stops a shorter way: its sheet is between the centre and where it was.
            Failure::TooFar { travel, length, .. } if travel < length => "sunk",
            Failure::TooFar { .. } => "too_fast",
            Failure::TooManyPairs => "too_many_pairs",
            Failure::TooManySubsteps => "too_many_substeps",
            Failure::TooManyEvents(..) => "too_many_events",
        }
    }

    /// The sub-problem in which it happened, if it was one.
    pub fn level(&self) -> Option<Level> {
        match self.failure {
            Failure::NotConverged(level) => Some(level),
            Failure::BlowUp(what) => Some(what.level),
            _ => None,
        }
    }

    /// What a person can do about it.
    pub fn advice(&self) -> &str {
        match (self.failure, &self.unsolved) {
            (Failure::NotConverged(Level::Smooth), _) => {
                "joints that contradict one another leave no motion; in one line or plane between held ends, as a taut chain, they carry \
                 no load across: give them sag; a load may be too wild for the step: try a smaller one"
            }
            (_, Some(Unsolved { joints: 1.., .. })) => {
                "joints and contacts of these spheres may leave no motion (a sphere driven into a wall, joined spheres that \
                 overlap): look at them; if they are as meant, try a smaller step"
            }
            (_, Some(unsolved)) => &unsolved.cures,
            (Failure::NotConverged(_), None) => "try a smaller step",
            (Failure::BlowUp(what), _) if what.level == Level::Smooth => {
                "a load drives it there without any contact: look at loads, springs and joints on it, its mass and the step"
            }
            (Failure::BlowUp(_), _) => {
                "look for extreme speeds, masses, inertias or radii of these bodies; try a smaller step"
            }
            (Failure::TooFar { travel, length, .. }, _) if travel < length => {
                "method = \"moreau\" lets balls sink into walls: position_projection = true keeps them out; else look at what presses it"
            }
            (Failure::TooFar { .. }, _) => {
                "take that step, or more max_halvings; if the speed is not meant, look at what made it"
            }
            (Failure::TooManyPairs, _) => {
                "the step is far too long for the speeds: spheres travel radii per step; take a smaller step"
            }
            (Failure::TooManySubsteps, _) => {
                "the contacts are far too stiff for the step, or begin far in one another; take a shorter step, a lower stiffness or resolution"
            }
            (Failure::TooManyEvents(..), _) => {
                "impacts follow one another without end: look at these bodies, or take method = \"nsga\""
            }
            (Failure::Friction { .. }, _) => {
                "a friction law must give a finite number not below 0 at every slip speed that occurs: max(0, ...) helps"
            }
            (Failure::Restitution { .. }, _) => {
                "a law of restitution must give a number from 0 to 1 at every approach speed that occurs: min(1, ...) and max(0, ...) help"
            }
            (Failure::Load, _) => {
                "mend the law or the function of what is named: a load, a joint or the motion of a wall"
            }
            (Failure::MissingLaw(..), _) => "add a [[contact]] entry for this pair of materials",
        }
    }
}
