//! Velocity sub-problem of a pile (eqs. 1f-h): loads first, then the contacts that close together with what the loads press
//! (rule R2), then whatever closes, where it closes (`cascade`).

use super::roll::{self, Turning};
use super::{coarser, is_beyond, node, record, warm::Cursor, Law, Pile, LEFT};
use crate::contact::Contact;
use crate::islands::Island;
use crate::level::velocity::Speeds;
use crate::model::Model;
use crate::options::{Impact, Options};
use crate::report::StepReport;
use crate::scratch::{ImpactRecord, IslandScratch};
use crate::state::{State, Warm};
use crate::stepper::Span;
use carom_solve::rows::WORLD;
use carom_solve::spheres;
use glam::DVec3;

/// No moving wall.
const FIXED: u32 = u32::MAX;

/// A closed contact of the pile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    /// Index among the contacts of the step.
    pub contact: u32,
    pub a: u32,
    pub b: u32,
    /// Place among the velocities of moving walls, [`FIXED`] where none moves.
    pub driven: u32,
    pub normal: DVec3,
    /// Lever arms, m.
    pub arms: [f64; 2],
    pub friction: f64,
    pub restitution: f64,
    pub tangential: f64,
    /// Impulse on A of all problems so far, and of the loads alone.
    pub impulse: DVec3,
    pub load: DVec3,
    /// Work normal and across, J.
    pub work: [f64; 2],
    /// First impact problem in which it closed, 0: none; normal velocity before; impulse of impacts; least restitution scale.
    pub problem: u32,
    pub approach: f64,
    pub hit: DVec3,
    pub scale: f64,
}

/// Nodes and contacts at the velocity level. Velocities are (linear, angular) pairs.
#[derive(Default)]
pub(super) struct Memory {
    pub members: Vec<Member>,
    /// Moments of the members; empty where nothing rolls.
    pub turning: Vec<Turning>,
    pub check: Vec<[DVec3; 2]>,
    pub old: Vec<[DVec3; 2]>,
    pub jump: Vec<[DVec3; 2]>,
    /// Jump of the loads alone.
    pub offset: Vec<[DVec3; 2]>,
    /// Velocities of moving walls at their contacts, at t_n and t_{n+1}: along the normal of the shape, across of the material.
    pub driven: Vec<[DVec3; 2]>,
    pub chosen: Vec<u32>,
    pub tol: f64,
    pub floor: f64,
    /// Largest speed in the island, m/s.
    pub speed: f64,
    /// Terms of eq. 44 of what is solved already in this step.
    pub terms: f64,
    pub cascade: super::cascade::Memory,
    /// Rows of the table of impacts, where every problem has its own.
    pub every: super::every::Rows,
    /// Group of energy of each chosen contact.
    pub group: Vec<u32>,
}

impl Memory {
    /// Closing speed that a solve may leave: clear of what counts as closing, and never below what the tolerance can tell at the
    /// speeds there are.
    pub fn left(&self, o: &Options) -> f64 {
        LEFT * self.tol.max(o.pile_tolerance * self.speed)
    }

    /// Relative velocity of a contact's surfaces, of A against B.
    pub fn relative(m: &Member, v: &[[DVec3; 2]]) -> DVec3 {
        m.relative(|node| v[node as usize])
    }

    /// Velocity of a moving wall at a contact, at t_n (0) or t_{n+1} (1).
    #[inline]
    pub fn wall(&self, m: &Member, end: usize) -> DVec3 {
        let moving = self.driven.get(m.driven as usize);
        moving.map_or(DVec3::ZERO, |v| v[end])
    }

    /// Relative velocity at `v_n`, `v_check` and `v_check + jump`.
    pub fn before(&self, m: &Member) -> DVec3 {
        Self::relative(m, &self.old) - self.wall(m, 0)
    }

    pub fn free(&self, m: &Member) -> DVec3 {
        Self::relative(m, &self.check) - self.wall(m, 1)
    }

    pub fn now(&self, m: &Member) -> DVec3 {
        self.free(m) + Self::relative(m, &self.jump)
    }

    /// `now` along the normal: spins do not count.
    #[inline]
    pub fn normal_speed(&self, m: &Member) -> f64 {
        let at = |node: u32| self.check[node as usize][0] + self.jump[node as usize][0];
        let mut d = at(m.a) - self.wall(m, 1);
        if m.b != WORLD {
            d -= at(m.b);
        }
        d.dot(m.normal)
    }

    /// Measures of a contact at `u = 0` by Newton's law with `V_minus = v_n + jump - offset` (eqs. 24, 27), restitution scaled.
    pub fn measures(&self, model: &Model, m: &Member, law: Law, scale: f64) -> DVec3 {
        let z = self.now(m);
        if law == Law::Plastic {
            return z;
        }
        let mut minus = self.before(m);
        if law == Law::Later {
            minus += Self::relative(m, &self.jump) - Self::relative(m, &self.offset);
        }
        self.newton(
            model,
            m.normal,
            [m.restitution, m.tangential],
            scale,
            z,
            minus,
        )
    }

    /// The measure `z` of a contact with what Newton's law with `[e_N, e_T]` adds for `V_minus`.
    #[inline]
    pub fn newton(
        &self,
        model: &Model,
        normal: DVec3,
        [e_n, e_t]: [f64; 2],
        scale: f64,
        z: DVec3,
        minus: DVec3,
    ) -> DVec3 {
        let approach = minus.dot(normal);
        let e_n = if -approach < model.options.restitution_threshold {
            0.0
        } else {
            e_n
        };
        let mut z = z + scale * e_n * approach.min(0.0) * normal;
        if e_t != 0.0 && approach < -self.tol {
            z += scale * e_t * (minus - approach * normal);
        }
        z
    }

    /// Terms of eq. 44 of all impulses so far.
    pub fn total(&self, bodies: &[spheres::Body]) -> f64 {
        let impulses: f64 = self
            .members
            .iter()
            .map(|m| m.impulse.length_squared())
            .sum();
        let impulses = impulses + self.moments_squared();
        let momenta: f64 = self
            .jump
            .iter()
            .zip(bodies)
            .map(|([v, w], b)| {
                v.length_squared() / b.inv_mass.powi(2)
                    + w.length_squared() / (b.inv_inertia * b.radius).powi(2)
            })
            .sum();
        2.0 * (impulses.sqrt() + momenta.sqrt())
    }

    /// Adds an impulse on A to the jump.
    pub fn push(bodies: &[spheres::Body], m: &Member, r: DVec3, jump: &mut [[DVec3; 2]]) {
        let turn = m.normal.cross(r);
        let mut add = |node: u32, sign: f64, arm: f64| {
            let (body, at) = (&bodies[node as usize], &mut jump[node as usize]);
            at[0] += sign * body.inv_mass * r;
            at[1] -= body.inv_inertia * arm * turn;
        };
        add(m.a, 1.0, m.arms[0]);
        if m.b != WORLD {
            add(m.b, -1.0, m.arms[1]);
        }
    }
}

/// Solves one island; writes the corrections W of its bodies, `lambda` of its contacts, impacts and warm starts. False: nothing is written.
pub fn solve_velocities(
    model: &Model,
    state: &State,
    scratch: &mut IslandScratch,
    island: Island,
    span: Span,
    report: &mut StepReport,
    accept: bool,
) -> bool {
    let mut pile = std::mem::take(scratch.pile);
    pile.keeper = std::mem::take(scratch.keeper);
    pile.accept = accept;
    let solved = pile.impacts(model, state, scratch, island, span, report);
    *scratch.keeper = std::mem::take(&mut pile.keeper);
    *scratch.pile = pile;
    solved
}

impl Pile {
    fn impacts(
        &mut self,
        model: &Model,
        state: &State,
        scratch: &mut IslandScratch,
        island: Island,
        span: Span,
        report: &mut StepReport,
    ) -> bool {
        self.open(model, state, scratch, island, span);
        if self.velocity.tol == 0.0 {
            return true;
        }
        let mut own = StepReport {
            restitution_scale: 1.0,
            ..StepReport::default()
        };
        let problems = match model.options.impact {
            Impact::OneShot => self.one_shot(model, scratch, &mut own),
            _ => self.sequence(model, state, scratch, island, span, &mut own),
        };
        let Some(problems) = problems else {
            return false;
        };
        (own.impact_problems, own.iterations_velocity) = (problems, 1);
        report.join(&own);
        self.close(model, scratch, report);
        true
    }

    /// Collects the island.
    fn open(
        &mut self,
        model: &Model,
        state: &State,
        scratch: &mut IslandScratch,
        island: Island,
        span: Span,
    ) {
        let IslandScratch {
            contacts,
            position,
            linear,
            angular,
            solve,
            walls,
            ..
        } = scratch;
        self.begin(
            model,
            contacts,
            island.contacts,
            &mut solve.node_of,
            position,
        );
        let memory = &mut self.velocity;
        memory.every.begin(model.every_impact);
        let mut speeds = Speeds::default();
        let driven = &mut memory.driven;
        driven.clear();
        memory.members.clear();
        memory.members.extend(island.contacts.iter().map(|&index| {
            let c = &contacts[index as usize];
            let law = c.law(model);
            let i = c.a as usize;
            let mut place = FIXED;
            if let (Some(old), Some(new)) = (
                walls.start_twist(model, c, state.position[i]),
                walls.end_twist(model, c, position[i]),
            ) {
                place = driven.len() as u32;
                driven.push([old, new].map(|t| t.at(c.n1)));
                speeds.add_wall(&old, &new);
            }
            Member {
                contact: index,
                a: node(model, &solve.node_of, c.a),
                b: node(model, &solve.node_of, c.b),
                driven: place,
                normal: c.n1,
                arms: [model.radius[c.a as usize], c.radius_b(model)],
                friction: c.bounds.sliding,
                restitution: law.restitution,
                tangential: law.tangential_restitution,
                impulse: DVec3::ZERO,
                load: DVec3::ZERO,
                work: [0.0; 2],
                problem: 0,
                approach: 0.0,
                hit: DVec3::ZERO,
                scale: 1.0,
            }
        }));
        memory.turning.clear();
        let turns = |&index: &u32| roll::rolls(&contacts[index as usize]);
        if island.contacts.iter().any(turns) {
            memory.turning.extend(island.contacts.iter().map(|&index| {
                let c = &contacts[index as usize];
                let wall = walls.end_twist(model, c, position[c.a as usize]);
                Turning::new(c, wall.map_or(DVec3::ZERO, |t| t.spin))
            }));
        }
        let nodes = self.spheres.len();
        for v in [&mut memory.check, &mut memory.old] {
            v.clear();
        }
        for v in [&mut memory.jump, &mut memory.offset] {
            v.clear();
            v.resize(nodes, [DVec3::ZERO; 2]);
        }
        for &body in &self.spheres {
            let i = body as usize;
            memory.check.push([linear[i].velocity, angular[i].velocity]);
            memory
                .old
                .push([state.velocity[i], state.angular_velocity[i]]);
            speeds.add(model, state, linear[i].velocity, i);
        }
        let o = &model.options;
        memory.terms = 0.0;
        let contacts = memory.members.len();
        memory.tol = coarser(o, contacts) * speeds.closing_tolerance(o, contacts);
        let share = o.touching_tolerance / span.h;
        let floor = self.mean(|i| model.mass[i] * share * model.radius[i]);
        let mass = self.mean(|i| model.mass[i]);
        let speed = speeds.speed.max(speeds.load);
        self.velocity.floor = floor.max(o.tolerance_floor * mass * speed);
        self.velocity.speed = speed;
    }

    /// Rule R2. The number of problems, or nothing if one was not solved.
    fn sequence(
        &mut self,
        model: &Model,
        state: &State,
        scratch: &IslandScratch,
        island: Island,
        span: Span,
        report: &mut StepReport,
    ) -> Option<u32> {
        let mut problems = 0;
        let memory = &mut self.velocity;
        let tol = memory.tol;
        let resting: Vec<bool> = memory
            .members
            .iter()
            .map(|m| memory.before(m).dot(m.normal) >= -tol)
            .collect();
        let loaded: Vec<bool> = memory
            .members
            .iter()
            .zip(&resting)
            .map(|(m, &resting)| resting && memory.normal_speed(m) < -tol)
            .collect();
        // Stage 0: the load of this step on contacts that were not approaching, without restitution.
        if loaded.contains(&true) {
            problems += 1;
            memory.choose(|slot, _| resting[slot]);
            let ratio = span.h / state.warm_step;
            let mut cursor = Cursor::new(&state.warm);
            self.start.clear();
            self.start_moments.clear();
            let (members, rolls) = (&self.velocity.members, !self.velocity.turning.is_empty());
            for &slot in &self.velocity.chosen {
                let c = &scratch.contacts[members[slot as usize].contact as usize];
                let warm = cursor.find((c.a, c.b));
                let mut start =
                    warm.map_or([DVec3::ZERO; 2], |w| [ratio * w.impulse, ratio * w.moment]);
                // What holds a sphere in its place holds its velocity too.
                let holding = record::position(c, c.n1).map(|nu| 2.0 / span.h * nu);
                if is_beyond(holding[0], start[0]) {
                    start = holding;
                }
                let [impulse, moment] = start;
                self.start.push(impulse.to_array());
                if rolls {
                    self.start_moments.push(moment.to_array());
                }
            }
            debug_assert_eq!(island.contacts.len(), members.len());
            self.solve_chosen(model, scratch.contacts, Law::Plastic, 0, report)?;
            let memory = &mut self.velocity;
            for &slot in &memory.chosen {
                let member = &mut memory.members[slot as usize];
                member.load = member.impulse;
                if let Some(turning) = memory.turning.get_mut(slot as usize) {
                    turning.load = turning.moment;
                }
            }
            memory.offset.clone_from(&memory.jump);
        }
        // Stage 1: what closes now, together with the resting contacts that the load closes.
        let memory = &mut self.velocity;
        let closing: Vec<bool> = memory
            .members
            .iter()
            .map(|m| memory.normal_speed(m) < -tol)
            .collect();
        if !closing.contains(&true) {
            return Some(problems);
        }
        problems += 1;
        memory.choose(|slot, _| closing[slot] || loaded[slot]);
        self.drop_chosen();
        let memory = &mut self.velocity;
        self.start.clear();
        self.start_moments.clear();
        for &slot in &memory.chosen {
            self.start
                .push(memory.members[slot as usize].load.to_array());
            let moments = memory.turning.get(slot as usize);
            self.start_moments
                .extend(moments.map(|t| t.load.to_array()));
        }
        self.solve_chosen(model, scratch.contacts, Law::First, 1, report)?;
        // Later problems, where something closes.
        let (last, done) = self.cascade(model, scratch.contacts, report);
        problems += last - 1;
        if done {
            return Some(problems);
        }
        report.truncated += 1;
        self.choose_all();
        self.solve_chosen(model, scratch.contacts, Law::Plastic, last + 1, report)?;
        let bound = model.options.max_problems;
        self.velocity.every.renumber(last + 1, bound + 1);
        Some(problems + 1)
    }

    /// All closed contacts, started from nothing.
    fn choose_all(&mut self) {
        self.velocity.choose(|_, _| true);
        for start in [&mut self.start, &mut self.start_moments] {
            start.clear();
            start.resize(self.velocity.chosen.len(), [0.0; 3]);
        }
    }

    /// Newton's law on all closed contacts at once.
    fn one_shot(
        &mut self,
        model: &Model,
        scratch: &IslandScratch,
        report: &mut StepReport,
    ) -> Option<u32> {
        self.choose_all();
        self.solve_chosen(model, scratch.contacts, Law::First, 1, report)?;
        // Without stage 0 rest is solved as an impact.
        let memory = &mut self.velocity;
        let resting = |m: &Member| memory.before(m).dot(m.normal) >= -memory.tol;
        if memory.members.iter().all(resting) {
            memory.every.forget();
        }
        Some(1)
    }

    /// Forgets the impulses of the chosen contacts; the kept ones' work is restated.
    fn drop_chosen(&mut self) {
        let memory = &mut self.velocity;
        for &slot in &memory.chosen {
            memory.members[slot as usize].impulse = DVec3::ZERO;
            if let Some(turning) = memory.turning.get_mut(slot as usize) {
                turning.moment = DVec3::ZERO;
            }
        }
        memory.jump.fill([DVec3::ZERO; 2]);
        for m in &memory.members {
            if m.impulse != DVec3::ZERO {
                Memory::push(&self.bodies, m, m.impulse, &mut memory.jump);
            }
        }
        memory.push_moments(&self.bodies);
        memory.restate_turning_work();
        for slot in 0..memory.members.len() {
            let m = memory.members[slot];
            let before = memory.free(&m);
            let work = work(m.normal, m.impulse, before, memory.now(&m));
            memory.members[slot].work = work;
        }
    }

    /// Writes the island's result into the step's scratch.
    fn close(&mut self, model: &Model, scratch: &mut IslandScratch, report: &mut StepReport) {
        let huge = self.velocity.members.len() >= super::HUGE;
        if huge {
            self.sweeps = spheres::Sweeps::empty();
        }
        let memory = &self.velocity;
        for (&body, jump) in self.spheres.iter().zip(&memory.jump) {
            scratch.corrections.set(body, *jump);
        }
        for (slot, m) in memory.members.iter().enumerate() {
            // Of a contact without moments.
            let nothing = Turning::default();
            let turning = memory.turning.get(slot).unwrap_or(&nothing);
            let c: &mut Contact = &mut scratch.contacts[m.contact as usize];
            record::turn_frame(c, m.normal);
            c.lambda = record::packed(c, m.normal, m.impulse, turning.moment);
            c.work = [m.work[0], m.work[1], turning.work[0], turning.work[1]];
            c.status = m.status(m.impulse);
            if m.load != DVec3::ZERO || c.nu[0] > 0.0 {
                let [position, position_moment] = record::position(c, m.normal);
                scratch.warm.push(Warm {
                    key: (c.a, c.b),
                    impulse: m.load,
                    moment: turning.load,
                    position,
                    position_moment,
                });
            }
            let free = memory.free(m).dot(m.normal);
            let touching = c.gap_start <= model.options.touching_tolerance * c.length;
            if c.gap_check < 0.0 && c.nu[0] > 0.0 && free > memory.tol && !touching {
                report.missed_impacts += 1;
            }
            if m.problem == 0 || memory.every.wanted {
                continue;
            }
            scratch.impacts.push(ImpactRecord {
                problem: m.problem,
                a: c.a,
                b: c.b,
                status: c.status as u8,
                normal: m.normal,
                impulse: m.hit,
                moment: turning.hit,
                approach: m.approach,
                separation: memory.normal_speed(m),
                restitution_scale: m.scale,
            });
        }
        memory
            .every
            .hand_over(&memory.members, scratch.contacts, scratch.impacts);
        if huge {
            self.velocity = Memory::default();
        }
    }
}

impl Memory {
    fn choose(&mut self, select: impl Fn(usize, &Member) -> bool) {
        self.chosen.clear();
        let members = self.members.iter().enumerate();
        self.chosen.extend(
            members
                .filter(|(slot, m)| select(*slot, m))
                .map(|(slot, _)| slot as u32),
        );
    }
}

impl Member {
    /// Relative velocity of the surfaces, of A against B, by the velocities of nodes.
    #[inline]
    pub fn relative(&self, at: impl Fn(u32) -> [DVec3; 2]) -> DVec3 {
        let [mut d, wa] = at(self.a);
        let mut spin = self.arms[0] * wa;
        if self.b != WORLD {
            let [lb, wb] = at(self.b);
            d -= lb;
            spin += self.arms[1] * wb;
        }
        d + self.normal.cross(spin)
    }

    /// Adds what one problem gave. Contacts that closed enter the table of impacts, those that a load pressed do not; whether this
    /// is a part of an impact.
    pub fn add(
        &mut self,
        problem: u32,
        r: DVec3,
        before: f64,
        work: [f64; 2],
        scale: f64,
        tol: f64,
    ) -> bool {
        self.impulse += r;
        self.work[0] += work[0];
        self.work[1] += work[1];
        if problem == 0 || r == DVec3::ZERO {
            return false;
        }
        if self.problem == 0 {
            if before >= -tol {
                return false;
            }
            (self.problem, self.approach) = (problem, before);
        }
        self.hit += r;
        self.scale = self.scale.min(scale);
        true
    }
}

/// Work of an impulse, normal and across, by the mean of the velocities before and after.
pub(super) fn work(normal: DVec3, r: DVec3, before: DVec3, after: DVec3) -> [f64; 2] {
    let mean = 0.5 * (before + after);
    let (r_n, v_n) = (r.dot(normal), mean.dot(normal));
    [r_n * v_n, r.dot(mean) - r_n * v_n]
}

/// Change of a contact's relative velocity by corrections of the nodes.
pub(super) fn change(m: &Member, u: &[[f64; 6]]) -> DVec3 {
    let part = |node: u32| {
        let u = &u[node as usize];
        (DVec3::new(u[0], u[1], u[2]), DVec3::new(u[3], u[4], u[5]))
    };
    let (mut d, wa) = part(m.a);
    let mut spin = m.arms[0] * wa;
    if m.b != WORLD {
        let (v, w) = part(m.b);
        d -= v;
        spin += m.arms[1] * w;
    }
    d + m.normal.cross(spin)
}
