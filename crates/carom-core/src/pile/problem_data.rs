//! Problems of piles as data, on request (`carom_core::problem`).

use super::closed_contact::ClosedContact;
use super::record;
use crate::clump::places::Clumps;
use crate::contact::Contact;
use crate::outcome::Level;
use crate::pile::memory::Pile;
use crate::pile::velocities::Velocities;
use crate::problem::Solve;
use crate::rows::Rows;
use crate::workspace::On;
use carom_solve::ladder;
use carom_solve::rows::{RowSystem, NODE_DOF};
use carom_solve::spheres::{Body, Progress};
use carom_solve::SolveReport;
use glam::DVec3;

/// A contact as it was solved: normal, nodes, measures at `u = 0` and impulse.
pub struct Stated {
    pub contact: u32,
    pub nodes: (u32, u32),
    pub normal: DVec3,
    pub slip: DVec3,
    pub impulse: DVec3,
    /// Of rolling and spinning friction: angular measure at `u = 0`, and moment.
    pub turn: DVec3,
    pub moment: DVec3,
}

/// Rows of contacts in the frames at their normals, the contacts with these frames, and their impulses as multipliers.
pub fn rows(on: &On, bodies: &[Body], stated: &[Stated]) -> (RowSystem, Vec<Contact>, Vec<f64>) {
    let mut system = RowSystem::default();
    for body in bodies {
        system.push_node(1.0 / body.inv_mass, 1.0 / body.inv_inertia, body.radius);
    }
    let mut rows = Rows::default();
    let (mut multiplier, mut contacts) = (Vec::new(), Vec::with_capacity(stated.len()));
    for s in stated {
        let mut c = on.scratch.contacts[s.contact as usize];
        record::set_frame(&mut c, s.normal);
        (c.n0, c.n1) = (s.normal, s.normal);
        let dim = c.rows(on.task.model, s.normal, &mut rows);
        let z0 = record::packed(&c, s.normal, s.slip, s.turn);
        let r = record::packed(&c, s.normal, s.impulse, s.moment);
        multiplier.extend_from_slice(&r[..dim]);
        system.push_contact(
            s.nodes.0,
            s.nodes.1,
            c.bounds,
            c.length,
            s.normal.to_array(),
            &rows[..dim],
            &z0[..dim],
        );
        contacts.push(c);
    }
    (system, contacts, multiplier)
}

impl Stated {
    pub fn of(m: &ClosedContact, slip: DVec3, impulse: DVec3, [turn, moment]: [DVec3; 2]) -> Self {
        Self {
            contact: m.contact,
            nodes: (m.a, m.b),
            normal: m.normal,
            slip,
            impulse,
            turn,
            moment,
        }
    }
}

impl Pile {
    /// Keeps a velocity problem whose solution has not yet been added, if it is wanted or was not solved.
    pub(super) fn keep_velocity(&mut self, on: &mut On, index: u32, progress: &Progress) {
        let sweeps = progress.sweeps as u32;
        if progress.converged && !on.scratch.keeper.wants(sweeps) {
            return;
        }
        if self.contacts.is_empty() {
            self.write(on, self.law);
        }
        let stated = self.stated(&self.impulses, &self.moments);
        let motion = self.velocity.velocities();
        let report = report_of(sweeps, progress.residual, progress.converged);
        self.keep(on, (index, report), &stated, &self.corrections, &motion);
    }

    /// Hands a problem to the keeper: its rows in the frames at the normals, `correction` and `motion` of each node.
    pub(super) fn keep(
        &self,
        on: &mut On,
        (index, report): (u32, SolveReport),
        stated: &[Stated],
        correction: &[[f64; NODE_DOF]],
        motion: &[[DVec3; 2]],
    ) {
        let (system, contacts, multiplier) = rows(on, &self.bodies, stated);
        let correction = correction.concat();
        let mut measures = vec![0.0; system.rows()];
        system.linear_measures(&correction, &mut measures);
        let motion = motion.iter().flatten().flat_map(DVec3::to_array);
        on.scratch.keeper.keep(&Solve {
            model: on.task.model,
            contacts: &contacts,
            clumps: &Clumps::default(),
            members: &(0..stated.len() as u32).collect::<Vec<_>>(),
            spheres: &self.spheres,
            system: &system,
            measures: &measures,
            multiplier: &multiplier,
            correction: &correction,
            motion: &motion.collect::<Vec<_>>(),
            level: match on.task.level {
                Level::Position => Level::Position,
                _ => Level::Velocity,
            },
            index,
            report,
            attempts: &[],
            worst: 0,
        });
    }

    /// The chosen contacts as they stand in the problem at hand, with these impulses and moments.
    pub(super) fn stated(&self, impulses: &[[f64; 3]], moments: &[[f64; 3]]) -> Vec<Stated> {
        let memory = &self.velocity;
        let solved = self.contacts.iter().zip(impulses);
        let chosen = memory.chosen.iter().zip(solved).enumerate();
        let stated = chosen.map(|(k, (&slot, (c, r)))| {
            let m = &memory.closed[slot as usize];
            let moment = moments.get(k).filter(|_| !memory.turning.is_empty());
            let normal = DVec3::from(c.normal);
            let turning = moment.map_or([DVec3::ZERO; 2], |&moment| {
                let turn = memory.state_turn(slot, &ClosedContact { normal, ..*m });
                [turn, DVec3::from(moment)]
            });
            Stated {
                normal,
                ..Stated::of(m, DVec3::from(c.slip), DVec3::from(*r), turning)
            }
        });
        stated.collect()
    }
}

/// What a solve by sweeps tells of itself.
pub fn report_of(sweeps: u32, residual: f64, converged: bool) -> SolveReport {
    SolveReport {
        converged,
        iterations: sweeps,
        residual,
        rung: ladder::SPHERES,
        ..SolveReport::default()
    }
}

impl Velocities {
    /// `v_check + jump` of each node.
    pub fn velocities(&self) -> Vec<[DVec3; 2]> {
        let pairs = self.check.iter().zip(&self.jump);
        pairs
            .map(|([v, w], [jv, jw])| [*v + *jv, *w + *jw])
            .collect()
    }
}
