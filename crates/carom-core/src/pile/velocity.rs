//! Velocity sub-problem of a pile (eqs. 1f-h): the spheres that [`crate::impact::sequence`] works on.

use super::chunks;
use super::closed_contact::{work, ClosedContact, Frame, FIXED};
use super::energy_gain::SphereSolution;
use crate::contact::Contact;
use crate::impact::energy::Admit;
use crate::impact::law::Law;
use crate::impact::laws;
use crate::impact::sequence::{loads, ImpactIsland, Start};
use crate::level::speeds::{opening, Speeds};
use crate::level::{companion, Demand, Task};
use crate::options::Problems;
use crate::outcome::Level;
use crate::pile::limits::{node, tolerance};
use crate::pile::memory::Pile;
use crate::pile::turning::{any_rolls, Turning};
use crate::pile::velocities::Velocities;
use crate::report::StepReport;
use crate::workspace::On;
use carom_solve::rows::WORLD;
use carom_solve::team;
use glam::DVec3;
use std::ops::Range;

/// Solves the velocities of one island, or its loads before positions are; writes the corrections W of its bodies, `lambda` (of loads: `load`) of its
/// contacts, impacts and warm starts. False: nothing is written.
pub fn solve_velocities(on: &mut On) -> bool {
    let mut pile = std::mem::take(on.scratch.pile);
    pile.accept = on.task.demand == Demand::Accepted;
    pile.companion = companion(&on.task.model.options, false).is_some();
    let solved = pile.impacts(on);
    *on.scratch.pile = pile;
    solved
}

impl Pile {
    fn impacts(&mut self, on: &mut On) -> bool {
        let Task { model, level, .. } = *on.task;
        self.open(on);
        if self.velocity.speed == 0.0 {
            return true;
        }
        // Joined to the step's where the island is solved.
        let mut own = StepReport {
            restitution_scale: 1.0,
            iterations_velocity: 1,
            ..StepReport::default()
        };
        let mut spheres = SphereIsland {
            pile: self,
            again: level == Level::Velocity && model.options.loads_once(),
            on: On {
                task: on.task,
                island: on.island,
                scratch: on.scratch,
                report: &mut own,
            },
        };
        if level == Level::Loads {
            let Some([resting, _]) = loads(&mut spheres) else {
                return false;
            };
            on.report.join(&own);
            self.close_loads(on, &resting);
            return true;
        }
        if !laws::solve(model.options.impact, &mut spheres) {
            return false;
        }
        on.report.join(&own);
        self.close(on);
        true
    }

    /// Collects the island.
    fn open(&mut self, on: &mut On) {
        self.begin(on);
        self.velocity.known.clear();
        self.velocity.table.begin(on.task.model.every_impact);
        self.velocity.terms = 0.0;
        let mut speeds = Speeds::default();
        self.take_contacts(on, &mut speeds);
        self.take_motion(on, &mut speeds);
        self.set_tolerances(on.task, &speeds);
    }

    /// The closed contacts, with the velocities of walls that move.
    fn take_contacts(&mut self, on: &On, speeds: &mut Speeds) {
        let (scratch, Task { model, state, .. }) = (&*on.scratch, *on.task);
        let (contacts, walls, list) = (&*scratch.contacts, scratch.walls, on.island.contacts);
        let memory = &mut self.velocity;
        let twists = |c: &Contact| walls.twists(model, c, state, scratch.position[c.a as usize]);
        memory.driven.clear();
        memory.driven_middle.clear();
        let mut places = Vec::new();
        if walls.any_moves() {
            places.extend(list.iter().map(|&index| {
                let c = &contacts[index as usize];
                let Some([old, new]) = twists(c) else {
                    return FIXED;
                };
                speeds.add_wall(&old, &new);
                memory.driven.push([old, new].map(|t| t.at(c.n1)));
                if model.options.loads_once() {
                    let centre = [&state.position, &*scratch.position].map(|x| x[c.a as usize]);
                    let there = walls.twist_half_way(model, c, centre).unwrap_or_default();
                    memory.driven_middle.push(there.at(c.middle_normal()));
                }
                memory.driven.len() as u32 - 1
            }));
        }
        let (threads, node_of) = (self.sweeps.threads, &scratch.solve.node_of);
        chunks::refill(threads, &mut memory.closed, list.len(), |k| {
            let index = list[k];
            let c = &contacts[index as usize];
            ClosedContact {
                contact: index,
                a: node(model, node_of, c.a),
                b: node(model, node_of, c.b),
                driven: places.get(k).copied().unwrap_or(FIXED),
                normal: c.n1,
                guided: c.is_guided(model),
                arms: [model.radius[c.a as usize], c.radius_b(model)],
                friction: c.bounds.sliding,
                law: c.law,
                scale: 1.0,
                ..ClosedContact::default()
            }
        });
        memory.turning.clear();
        if any_rolls(model, contacts, list) {
            memory.turning.extend(list.iter().map(|&index| {
                let c = &contacts[index as usize];
                Turning::new(c, twists(c).map_or([DVec3::ZERO; 2], |t| t.map(|t| t.spin)))
            }));
        }
    }

    /// Velocities of the spheres.
    fn take_motion(&mut self, on: &On, speeds: &mut Speeds) {
        let Task { model, state, .. } = *on.task;
        let (linear, angular) = (on.scratch.linear, on.scratch.angular);
        let (threads, memory) = (self.sweeps.threads, &mut self.velocity);
        let (spheres, nodes) = (&self.spheres, self.spheres.len());
        chunks::refill(threads, &mut memory.check, nodes, |k| {
            let i = spheres[k] as usize;
            [linear[i].velocity, angular[i].velocity]
        });
        chunks::refill(threads, &mut memory.old, nodes, |k| {
            let i = spheres[k] as usize;
            [state.velocity[i], state.angular_velocity[i]]
        });
        for v in [&mut memory.jump, &mut memory.offset] {
            v.clear();
            v.resize(nodes, [DVec3::ZERO; 2]);
        }
        let own = |range: Range<usize>| {
            let mut own = Speeds::default();
            for &body in &spheres[range] {
                let i = body as usize;
                own.add(model, state, linear[i].velocity, i);
            }
            own
        };
        let join = |mut all: Speeds, own| {
            all.join(&own);
            all
        };
        speeds.join(&chunks::reduce(threads, nodes, own, join));
    }

    /// What counts as closing, and the floor of residuals, by the speeds of the island.
    fn set_tolerances(&mut self, task: &Task, speeds: &Speeds) {
        let Task { model, span, .. } = *task;
        let o = &model.options;
        let share = span.opening(o.touching_tolerance);
        // The harmonic mean, as of rows.
        let mass = 1.0 / self.mean(|i| model.inv_mass[i]);
        let floor = mass * self.mean(|i| share * model.radius[i]);
        let speed = speeds.largest();
        self.velocity.floor = floor.max(o.tolerance_floor * mass * speed);
        (self.velocity.speed, self.velocity.load) = (speed, speeds.load);
        self.velocity.wall_load = speeds.wall_load;
        let threads = self.sweeps.threads;
        let memory = &mut self.velocity;
        let change =
            |node: u32| (memory.check[node as usize][0] - memory.old[node as usize][0]).length();
        let tolerance = |m: &ClosedContact| {
            let of_b = if m.b == WORLD { 0.0 } else { change(m.b) };
            let of_wall = (memory.wall(m, 1) - memory.wall(m, 0)).dot(m.normal).abs();
            speeds.closing_tolerance(
                o,
                span,
                memory.closed.len(),
                change(m.a).max(of_b).max(of_wall),
            )
        };
        let mut closing = Vec::new();
        chunks::refill(threads, &mut closing, memory.closed.len(), |slot| {
            tolerance(&memory.closed[slot])
        });
        memory.closing = closing.iter().copied().fold(f64::INFINITY, f64::min);
        for (m, closing) in memory.closed.iter_mut().zip(closing) {
            m.closing = closing;
        }
    }

    /// Forgets the impulses of the loads at the chosen contacts; the kept ones' work is restated.
    fn drop_chosen(&mut self, on: &On) {
        let contacts = &*on.scratch.contacts;
        let options = &on.task.model.options;
        let (threads, frame) = (self.sweeps.threads, Frame::of_loads(options));
        let memory = &mut self.velocity;
        for &slot in &memory.chosen {
            let closed_contact = &mut memory.closed[slot as usize];
            let dropped = std::mem::take(&mut closed_contact.impulse);
            closed_contact.dropped = true;
            if dropped != DVec3::ZERO {
                let m = frame.state(contacts, closed_contact);
                Velocities::push(&self.bodies, &m, -dropped, &mut memory.jump);
            }
        }
        if !memory.turning.is_empty() {
            memory.drop_moments(&self.bodies);
        }
        let mut members = std::mem::take(&mut memory.closed);
        team::each(threads, &mut members, |m| {
            let stated = frame.state(contacts, m);
            let before = memory.free(&stated);
            m.work = work(stated.normal, m.impulse, before, memory.now(&stated));
        });
        memory.closed = members;
        memory.restate_turning_work(contacts, frame);
    }
}

/// The island in its impact problems.
struct SphereIsland<'p, 'r, 's> {
    pile: &'p mut Pile,
    on: On<'r, 's>,
    /// The loads have been solved before positions were.
    again: bool,
}

impl ImpactIsland for SphereIsland<'_, '_, '_> {
    type Solution = SphereSolution;

    fn slots(&self) -> usize {
        self.pile.velocity.closed.len()
    }

    fn closing_tolerance(&self, slot: usize) -> f64 {
        self.pile.velocity.closed[slot].closing
    }

    fn speed_before(&self, slot: usize) -> f64 {
        let Task { model, state, .. } = *self.on.task;
        if model.options.loads_once() {
            return opening(model, state, self.on.scratch.walls, self.contact(slot));
        }
        let (velocity, m) = (&self.pile.velocity, &self.pile.velocity.closed[slot]);
        velocity.before(m).dot(m.normal)
    }

    fn contact(&self, slot: usize) -> &Contact {
        &self.on.scratch.contacts[self.pile.velocity.closed[slot].contact as usize]
    }

    fn is_of_balls(&self) -> bool {
        true
    }

    fn again(&self) -> bool {
        self.again
    }

    fn speed(&self, slot: usize) -> f64 {
        let velocity = &self.pile.velocity;
        velocity.normal_speed(&velocity.closed[slot])
    }

    fn is_pressed(&self, slot: usize) -> bool {
        self.pile.velocity.closed[slot].impulse != DVec3::ZERO
    }

    fn flags(&self, test: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
        let mut flags = Vec::new();
        chunks::refill(self.pile.sweeps.threads, &mut flags, self.slots(), test);
        flags
    }

    fn choose(&mut self, select: impl Fn(usize) -> bool) {
        self.pile.velocity.choose(select);
    }

    fn solve(&mut self, law: Law, problem: u32, start: Start) -> bool {
        let Task {
            model, state, span, ..
        } = *self.on.task;
        let contacts = &*self.on.scratch.contacts;
        match start {
            Start::Nothing => self.pile.start_nothing(),
            Start::Loads => self.pile.start_first(),
            Start::LastLoads if self.again => self.pile.start_known_loads(contacts),
            Start::LastLoads => {
                self.pile.start_loads(&self.on);
                let linear = self.on.scratch.linear;
                let gained = |i: usize| (linear[i].velocity - state.velocity[i]).length();
                let of_walls = self.pile.velocity.wall_load;
                (self.pile).start_sound(|i| model.mass[i] * gained(i).max(of_walls));
            }
            Start::Positions => self.pile.start_last(contacts, span),
        }
        let mut chosen = self.pile.velocity.chosen.iter();
        let closed = self.again
            || model.options.impact.has_loads_first()
            || chosen.any(|&slot| self.approaches(slot as usize));
        self.pile.velocity.table.begin_problem(problem, closed);
        if law == Law::Springs {
            return self.pile.press(&mut self.on);
        }
        (self.pile)
            .solve_chosen(&mut self.on, law, problem)
            .is_some()
    }

    fn solve_without_restitution(&mut self, problem: u32) -> bool {
        (self.pile)
            .solve_without_restitution(&mut self.on, problem)
            .is_some()
    }

    fn compress(&mut self) -> Option<bool> {
        self.pile.compress(&mut self.on)
    }

    fn add(&mut self, problem: u32) {
        self.on.report.impact_problems += 1;
        let o = &self.on.task.model.options;
        let all = o.loads_once() || !o.impact.is_newtons();
        self.pile.commit(&self.on, problem, all);
    }

    fn has_safeguard(&self) -> bool {
        self.on.task.model.options.energy_safeguard
    }

    fn limits(&self, with: Option<&SphereSolution>, admit: Admit) -> Option<Vec<f64>> {
        self.pile.limits(self.on.task.model, with, admit)
    }

    fn tolerance(&self) -> f64 {
        tolerance(self.on.task.model)
    }

    fn solve_finely(&mut self, problem: u32) {
        self.pile.solve_finely(&mut self.on, problem);
    }

    fn take_solution(&mut self) -> SphereSolution {
        self.pile.solution()
    }

    fn mix(&mut self, with: SphereSolution, limits: Option<Vec<f64>>) {
        self.pile.mix(with, limits);
    }

    fn give_up_restitution(&mut self) {
        self.pile.scales = vec![0.0; self.pile.bodies.len()];
    }

    fn drop_chosen(&mut self) {
        self.pile.drop_chosen(&self.on);
    }

    fn forget_all(&mut self, problem: u32) {
        self.on.report.impact_problems -= 1;
        self.pile.forget_all(problem);
    }

    fn mark_loads(&mut self) {
        let memory = &mut self.pile.velocity;
        for turning in &mut memory.turning {
            turning.load = turning.moment;
        }
        memory.offset.clone_from(&memory.jump);
    }

    fn gains_energy(&self) -> bool {
        self.pile.gains_energy(self.on.task.model)
    }

    fn later(&mut self, _: Law, first: u32) -> Option<bool> {
        let (last, done) = self.pile.cascade(&mut self.on);
        if last >= first {
            self.pile.velocity.table.begin_problem(last, true);
            self.on.report.impact_problems += last + 1 - first;
        }
        Some(done)
    }

    fn bounds(&self) -> Problems {
        self.on.task.model.options.problems(self.slots())
    }

    fn report(&mut self) -> &mut StepReport {
        self.on.report
    }
}
