//! Rows of the table of impacts for every problem of a pile's sequence (`Model::every_impact`), as small islands have them.
//!
//! A row per problem and contact with an impulse in it. The simultaneous problem that ends a sequence has the number behind the
//! bound of the sequence, as in `impact::sequence`: its law has no restitution, and the number tells it.

use super::member::Member;
use crate::contact::Contact;
use crate::outcome::ImpactRecord;
use carom_solve::Status;
use glam::DVec3;

/// What one problem gave a contact.
#[derive(Clone, Copy, Debug)]
struct Row {
    slot: u32,
    problem: u32,
    /// Impulse and moment on A, N s and N m s.
    given: [DVec3; 2],
    /// Normal velocity before and after the problem, m/s.
    approach: f64,
    separation: f64,
    scale: f64,
}

/// The rows of the island at hand; none are kept unless they are wanted.
#[derive(Debug, Default)]
pub(super) struct Rows {
    pub wanted: bool,
    rows: Vec<Row>,
}

impl Rows {
    pub fn begin(&mut self, wanted: bool) {
        self.wanted = wanted;
        self.rows.clear();
    }

    /// Keeps the impulse and moment that a problem gave a contact; `speed` along the normal before and after it.
    #[inline]
    pub fn push(
        &mut self,
        slot: u32,
        problem: u32,
        given: [DVec3; 2],
        speed: [f64; 2],
        scale: f64,
    ) {
        if !self.wanted || given[0] == DVec3::ZERO {
            return;
        }
        let [approach, separation] = speed;
        self.rows.push(Row {
            slot,
            problem,
            given,
            approach,
            separation,
            scale,
        });
    }

    /// Forgets a problem in which only loads acted.
    pub fn forget(&mut self) {
        self.rows.clear();
    }

    /// Forgets a problem that is solved anew.
    pub fn forget_problem(&mut self, problem: u32) {
        self.rows.retain(|row| row.problem != problem);
    }

    /// The least restitution scale of the rows, 1 where there are none.
    pub fn least_scale(&self) -> f64 {
        self.rows.iter().map(|row| row.scale).fold(1.0, f64::min)
    }

    /// Appends the rows to the table. Those of the loads enter it only if an impact follows.
    pub fn hand_over(
        &self,
        members: &[Member],
        contacts: &[Contact],
        impacts: &mut Vec<ImpactRecord>,
    ) {
        if self.rows.iter().all(|row| row.problem == 0) {
            return;
        }
        impacts.extend(self.rows.iter().map(|row| {
            let m = &members[row.slot as usize];
            let c = &contacts[m.contact as usize];
            ImpactRecord {
                problem: row.problem,
                a: c.a,
                b: c.b,
                status: m.status(row.given[0]) as u8,
                normal: m.normal,
                impulse: row.given[0],
                moment: row.given[1],
                approach: row.approach,
                separation: row.separation,
                restitution_scale: row.scale,
            }
        }));
    }
}

impl Member {
    /// Whether an impulse of the contact is none, holds it or slides.
    pub fn status(&self, impulse: DVec3) -> Status {
        let normal = impulse.dot(self.normal);
        if normal <= 0.0 {
            Status::Gap
        } else if impulse.reject_from_normalized(self.normal).length()
            >= self.friction * normal * (1.0 - 1e-9)
        {
            Status::Slip
        } else {
            Status::Stick
        }
    }
}
