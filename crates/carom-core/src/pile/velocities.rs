//! Nodes and contacts of a pile at the velocity level.

use crate::contact::{turned, Contact};
use crate::impact::law::Law;
use crate::impact::table::{ImpactRow, ImpactTable};
use crate::level::speeds::closing_left;
use crate::model::Model;
use crate::options::Options;
use crate::pile::chunks;
use crate::pile::closed_contact::{change, work, ClosedContact, Frame, ProblemImpulse};
use crate::pile::turning::Turning;
use carom_solve::rows::WORLD;
use carom_solve::spheres;
use glam::DVec3;

/// Nodes and contacts at the velocity level. Velocities are (linear, angular) pairs.
#[derive(Default)]
pub(super) struct Velocities {
    pub closed: Vec<ClosedContact>,
    /// Moments of the closed contacts; empty where nothing rolls.
    pub turning: Vec<Turning>,
    pub check: Vec<[DVec3; 2]>,
    pub old: Vec<[DVec3; 2]>,
    pub jump: Vec<[DVec3; 2]>,
    /// Jump of the loads alone; and the one that they had before positions were solved, where that is known.
    pub offset: Vec<[DVec3; 2]>,
    pub known: Vec<[DVec3; 2]>,
    /// Velocities of moving walls at their contacts, at t_n and t_{n+1}: along the normal of the shape, across of the material.
    pub driven: Vec<[DVec3; 2]>,
    /// The same at t_{n+1} where loads act that are solved once, along the normal there.
    pub driven_middle: Vec<DVec3>,
    pub chosen: Vec<u32>,
    /// The least closing tolerance of a contact, m/s.
    pub closing: f64,
    pub floor: f64,
    /// Largest speed in the island, and that of the loads alone, m/s.
    pub speed: f64,
    pub load: f64,
    /// Of walls that change their velocity.
    pub wall_load: f64,
    /// Terms of eq. 44 of what is solved already in this step.
    pub terms: f64,
    /// Rows of the table of impacts, where every problem has its own.
    pub table: ImpactTable,
}

impl Velocities {
    /// Closing speed that a solve may leave: clear of what counts as closing (but for the worst of very many contacts, `Goal::worst`), and never
    /// below what the tolerance can tell at the speeds there are.
    pub fn left(&self, o: &Options) -> f64 {
        closing_left(self.closing, o.pile_tolerance, self.speed)
    }

    /// Relative velocity of a contact's surfaces, of A against B.
    pub fn relative(m: &ClosedContact, v: &[[DVec3; 2]]) -> DVec3 {
        m.relative(|node| v[node as usize])
    }

    /// Velocity of a moving wall at a contact, at t_n (0) or t_{n+1} (1).
    #[inline]
    pub fn wall(&self, m: &ClosedContact, end: usize) -> DVec3 {
        let moving = self.driven.get(m.driven as usize);
        moving.map_or(DVec3::ZERO, |v| v[end])
    }

    /// Relative velocity at `v_n`, `v_check` and `v_check + jump`.
    pub fn before(&self, m: &ClosedContact) -> DVec3 {
        Self::relative(m, &self.old) - self.wall(m, 0)
    }

    pub fn free(&self, m: &ClosedContact) -> DVec3 {
        Self::relative(m, &self.check) - self.wall(m, 1)
    }

    pub fn now(&self, m: &ClosedContact) -> DVec3 {
        self.free(m) + Self::relative(m, &self.jump)
    }

    /// `now` along the normal: spins do not count.
    #[inline]
    pub fn normal_speed(&self, m: &ClosedContact) -> f64 {
        let at = |node: u32| self.check[node as usize][0] + self.jump[node as usize][0];
        let mut d = at(m.a) - self.wall(m, 1);
        if m.b != WORLD {
            d -= at(m.b);
        }
        d.dot(m.normal)
    }

    /// Measures of a contact at `u = 0` by Newton's law with `V_minus = v_n + jump - offset` (eqs. 24, 27).
    pub fn measures(&self, model: &Model, m: &ClosedContact, law: Law) -> DVec3 {
        let z = self.now(m);
        match law {
            Law::Plastic | Law::Springs => return z,
            Law::Compression => return self.before(m),
            Law::Expansion => return z + m.expansion.0,
            Law::First | Law::Later | Law::Printed => {}
        }
        let mut minus = self.before(m);
        if law == Law::Later {
            minus += Self::relative(m, &self.jump) - Self::relative(m, &self.offset);
        }
        self.newton(model, (m.normal, m.closing), m.law, z, minus)
    }

    /// A contact and its measures at `u = 0` as a problem has them, whose impulses act in `frame`. Its law is asked for along the contact's own normal: of
    /// the jump of loads that are known nearly ([`Self::known`]) that tells the difference, of what is left it is of second order.
    #[inline]
    pub fn state(
        &self,
        model: &Model,
        contacts: &[Contact],
        m: &ClosedContact,
        law: Law,
        frame: Frame,
    ) -> (ClosedContact, DVec3) {
        let (stated, mut z) = (frame.state(contacts, m), self.measures(model, m, law));
        if stated.normal == m.normal {
            return (stated, z);
        }
        let of_known = |m: &ClosedContact| match self.known.is_empty() {
            true => DVec3::ZERO,
            false => Self::relative(m, &self.known),
        };
        z = turned(z + of_known(m), m.normal, stated.normal) - of_known(&stated);
        (stated, z)
    }

    /// The measure `z` of a contact with what Newton's law adds for `V_minus`.
    #[inline]
    pub fn newton(
        &self,
        model: &Model,
        (normal, closing): (DVec3, f64),
        law: u32,
        z: DVec3,
        minus: DVec3,
    ) -> DVec3 {
        let minus_n = minus.dot(normal);
        let [along, across] =
            Law::Later.terms(&model.laws[law as usize], minus_n, &model.options, closing);
        let z = z + along * normal;
        if across == 0.0 {
            return z;
        }
        z + across * (minus - minus_n * normal)
    }

    /// What the impulse `r` of a problem that changes the velocities by `u` does at a contact.
    pub fn given(&self, m: &ClosedContact, r: DVec3, u: &[[f64; 6]], scale: f64) -> ProblemImpulse {
        let before = self.now(m);
        let after = before + change(m, u);
        ProblemImpulse {
            impulse: r,
            work: work(m.normal, r, before, after),
            speed: [before.dot(m.normal), after.dot(m.normal)],
            scale,
        }
    }

    /// The same of loads that act half-way; speeds are those along the normal of the end, as the table tells them.
    pub fn loaded(
        &self,
        middle: &ClosedContact,
        end: &ClosedContact,
        r: DVec3,
        u: &[[f64; 6]],
        scale: f64,
    ) -> ProblemImpulse {
        let mut before = self.now(middle);
        if let Some(wall) = self.driven_middle.get(middle.driven as usize) {
            before += self.wall(middle, 1) - *wall;
        }
        ProblemImpulse {
            work: work(middle.normal, r, before, before + change(middle, u)),
            ..self.given(end, r, u, scale)
        }
    }

    /// Keeps what a problem gave a contact for the table of impacts, where every problem is wanted there.
    #[inline]
    pub fn tell(&mut self, slot: u32, problem: u32, moment: DVec3, given: &ProblemImpulse) {
        let (m, r) = (&self.closed[slot as usize], given.impulse);
        if r != DVec3::ZERO {
            self.table.push(|| ImpactRow {
                slot,
                problem,
                status: m.status(r),
                given: [r, moment],
                speed: given.speed,
                scale: given.scale,
            });
        }
    }

    /// Terms of eq. 44 of all impulses so far.
    pub fn total(&self, bodies: &[spheres::Body], threads: usize) -> f64 {
        let closed = &self.closed;
        let impulses = chunks::sum(threads, closed.len(), |k| {
            closed[k].impulse.length_squared()
        });
        let impulses = impulses + self.moments_squared();
        let momenta = chunks::sum(threads, bodies.len(), |i| {
            let ([v, w], b) = (self.jump[i], &bodies[i]);
            v.length_squared() / b.inv_mass.powi(2)
                + w.length_squared() / (b.inv_inertia * b.radius).powi(2)
        });
        2.0 * (impulses.sqrt() + momenta.sqrt())
    }

    /// Adds an impulse on A to the jump.
    pub fn push(bodies: &[spheres::Body], m: &ClosedContact, r: DVec3, jump: &mut [[DVec3; 2]]) {
        let turn = m.normal.cross(r);
        let mut add = |node: u32, r: DVec3, arm: f64| {
            let (body, at) = (&bodies[node as usize], &mut jump[node as usize]);
            at[0] += body.inv_mass * r;
            at[1] -= body.inv_inertia * arm * turn;
        };
        add(m.a, r, m.arms[0]);
        if m.b != WORLD {
            add(m.b, -m.on_b(r), m.arms[1]);
        }
    }

    /// Chooses the contacts that `select` takes.
    pub fn choose(&mut self, select: impl Fn(usize) -> bool) {
        self.chosen.clear();
        let slots = 0..self.closed.len() as u32;
        self.chosen
            .extend(slots.filter(|&slot| select(slot as usize)));
    }
}
