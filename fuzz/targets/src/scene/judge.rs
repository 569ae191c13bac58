//! What must hold of every run, whatever the scene.

use carom_core::options::{Impact, Method};
use carom_core::record::{Block, ContactRecord};
use carom_core::{Model, Outcome, Recording, Simulation, State};
use glam::DVec3;
use std::time::Duration;

/// Speeds that the core lets pass (m/s, rad/s).
const FASTEST: f64 = 1e12;
/// Processor time that a few steps of a few bodies may take, s. An instrumented build needs some 10 for the million substeps that
/// method `penalty` may take for a step, and some 40 for joints that hold spheres inside one another through every fallback.
const ADMITTED: f64 = 120.0;
/// Excess over a cone, over the largest impulse of the frame: what the tolerance of a solve leaves of the smallest contact.
const CONE: f64 = 1e-4;
/// Impulses below this (N s) are what the floor of the tolerance leaves.
const LEAST: f64 = 1e-6;
/// Rise of the energy in a step without loads, over the energy: two impact problems' worth of the safeguard's 1e-10, and
/// rounding.
const RISE: f64 = 1e-8;

/// What can be asked of the runs of a scene.
pub struct Judge {
    /// Nothing but impacts changes the energy, and each of them is checked by the core.
    closed: bool,
    /// Impulses come from one solve in one step.
    cones: bool,
    spheres: usize,
}

impl Judge {
    pub fn new(simulation: &Simulation) -> Judge {
        let (m, o) = (&simulation.model, &simulation.model.options);
        let still = m.walls.iter().all(|w| w.motion.is_none());
        let strict = o.tolerance <= 1e-6 && o.pile_tolerance <= 1e-6 && o.tolerance_floor <= 1e-9;
        Judge {
            closed: m.gravity.length() == 0.0
                && m.is_free()
                && still
                && m.flow.is_none()
                && o.method == Method::Nsga
                && o.impact == Impact::Sequence
                && o.energy_safeguard
                && strict,
            cones: o.method == Method::Nsga
                && strict
                && still
                && m.laws.iter().all(|l| l.friction_law.is_none()),
            spheres: m.bodies(),
        }
    }

    /// The run goes on from a saved state: its accelerations and what starts its solves may be anything.
    pub fn gone_on(&mut self) {
        self.closed = false;
    }

    /// Steps, and looks at the state, the records and the outcome.
    pub fn advance(&self, simulation: &mut Simulation, steps: u64) {
        let (first, began) = (simulation.state.step, processor_time());
        let start = simulation.state.position.clone();
        let recording = Recording {
            frame_every: 1,
            contacts: true,
        };
        let outcome = simulation.advance(steps, recording, Duration::MAX);
        let spent = processor_time() - began;
        assert!(spent < ADMITTED, "{spent} s for {steps} steps: {outcome:?}");
        let block = simulation.take_block();
        let made = simulation.state.step - first;
        match &outcome {
            None => assert_eq!(made, steps),
            Some(outcome) => {
                assert!(
                    made < steps && outcome.step == simulation.state.step + 1,
                    "{outcome:?}"
                );
                assert!(!outcome.advice().is_empty() && !outcome.kind().is_empty());
                self.names_what_is_there(outcome, simulation);
            }
        }
        assert_eq!(block.steps.len() as u64, made);
        finite(&simulation.state, made > 0);
        self.records(simulation, &block, start);
    }

    fn names_what_is_there(&self, outcome: &Outcome, simulation: &Simulation) {
        let bodies = (self.spheres + simulation.model.walls.len()) as u32;
        // A joint with the ground names it as such.
        let known = |b: u32| b < bodies || b == carom_core::joint::GROUND;
        assert!(outcome.bodies.iter().all(|&b| known(b)), "{outcome:?}");
    }

    fn records(&self, simulation: &Simulation, block: &Block, start: Vec<DVec3>) {
        let model = &simulation.model;
        let mut begin = 0;
        let mut energy = simulation.monitors.energy_initial; // of the run's begin
        let mut before = start;
        let frames = block.position.chunks(3 * self.spheres);
        for ((report, &end), frame) in block.steps.iter().zip(&block.contact_end).zip(frames) {
            let contacts = &block.contacts[begin..end as usize];
            begin = end as usize;
            let told = || format!("{report:?}\n{contacts:?}");
            let now = report.energy_kinetic + report.energy_potential;
            let numbers = now.is_finite() && !report.penetration.is_nan();
            assert!(numbers, "{}", told());
            if self.closed && report.unconverged == 0 {
                let rose = now - energy > RISE * energy;
                assert!(!rose, "energy {energy} -> {now}: {}", told());
            }
            energy = now;
            let sizes = contacts.iter().map(|c| c.impulse.length());
            let largest = sizes.fold(0.0, f64::max);
            let most = CONE * largest;
            let once = model.options.loads_once();
            // Sums of what loads and impacts give have two frames.
            let whole = report.halvings == 0
                && report.substeps == 0
                && report.unconverged == 0
                && !(once && report.impact_problems > 1);
            for c in contacts {
                let numbers = c.impulse.is_finite() && c.moment.is_finite();
                let numbers = numbers && c.position_impulse.is_finite() && c.gap.is_finite();
                assert!(numbers, "{}", told());
                if !(self.cones && whole && largest > LEAST) {
                    continue;
                }
                // It may have entered in this step, or rolled half around.
                let start = start_normal(model, c, &before);
                if start.is_nan() || start.dot(c.normal) < 0.1 {
                    continue;
                }
                let frames = if once {
                    [[(start + c.normal).normalize(); 2], [c.normal; 2]]
                } else {
                    [[c.normal, start]; 2]
                };
                let wrong = frames.map(|frame| outside_cone(model, c, frame, most));
                if let [Some(wrong), Some(_)] = wrong {
                    panic!("{wrong} at {:?}: {}", c.key, told());
                }
            }
            before = frame.chunks(3).map(DVec3::from_slice).collect();
        }
    }
}

/// Normal of a contact with the centres at `before`.
fn start_normal(model: &Model, c: &ContactRecord, before: &[DVec3]) -> DVec3 {
    let (a, b) = (c.key.0 as usize, c.key.1 as usize);
    let (xa, ra) = (before[a], model.radius[a]);
    let met = match before.get(b) {
        Some(&xb) => model.periodic.sphere_sphere(xa, ra, xb, model.radius[b]),
        None => model.wall(c.key.1).shape.meet(xa, ra),
    };
    met.normal
}

/// What a contact's impulse has too much of. Its normal part is along `along`; friction, rolling and spinning are along the frame of
/// `n0`.
fn outside_cone(
    model: &Model,
    c: &ContactRecord,
    [along, n0]: [DVec3; 2],
    excess: f64,
) -> Option<String> {
    let (a, b) = (c.key.0 as usize, c.key.1 as usize);
    let law = model.law_of(a, b).expect("a contact has a law");
    let bounds = model.laws[law as usize].bounds;
    let ra = model.radius[a];
    let normal = c.impulse.dot(n0) / n0.dot(along);
    let across = (c.impulse - normal * along).length();
    let spinning = c.moment.dot(n0);
    let rolling = (c.moment - spinning * n0).length();
    let admitted = |bound: f64| bound * (normal + excess) + excess;
    let moment = |bound: f64| bound * (normal + excess) + ra * excess;
    if normal < -excess {
        Some(format!("pull {normal:e}"))
    } else if across > admitted(bounds.sliding) {
        Some(format!("friction {across:e}, mu {}", bounds.sliding))
    } else if rolling > moment(bounds.rolling) {
        Some(format!("rolling {rolling:e}, rho {}", bounds.rolling))
    } else if spinning.abs() > moment(bounds.spinning) {
        Some(format!("spinning {spinning:e}, delta {}", bounds.spinning))
    } else {
        None
    }
}

/// Time that this thread has run, s; 0 where the system does not tell.
fn processor_time() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let first = told.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    1e-9 * first.unwrap_or(0.0)
}

/// Every number of a state, and speeds of a size at which they mean something.
fn finite(state: &State, stepped: bool) {
    let vectors = [&state.position, &state.velocity, &state.angular_velocity];
    assert!(
        vectors.iter().all(|v| v.iter().all(|x| x.is_finite())),
        "{state:?}"
    );
    // A gap is made of squares: a ball has no place where they are no numbers.
    let far = |x: &&DVec3| !x.length_squared().is_finite();
    let lost = state.position.iter().find(far);
    assert!(lost.is_none(), "{lost:?}");
    for q in &state.orientation {
        assert!((q.length() - 1.0).abs() < 1e-6, "{q}");
    }
    // A run may begin faster than what a step lets pass.
    if stepped {
        let pairs = state.pseudo.iter().chain(&state.acceleration).flatten();
        assert!(pairs.into_iter().all(|x| x.is_finite()), "{state:?}");
        let fast = |v: &glam::DVec3| v.length() > 1.01 * FASTEST;
        assert!(
            !state
                .velocity
                .iter()
                .chain(&state.angular_velocity)
                .any(fast),
            "{state:?}"
        );
    }
    for w in &state.warm {
        assert!(w.impulse.is_finite() && w.moment.is_finite(), "{w:?}");
    }
    for t in &state.touches {
        assert!(
            t.impulse.is_finite() && t.moment.is_finite() && t.spring.is_finite(),
            "{t:?}"
        );
    }
}
