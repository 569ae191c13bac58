//! Rows of the table of impacts in an island: one for each problem and contact with an impulse in it.
//!
//! The simultaneous problem that ends a sequence has the number behind the bound of the sequence: its law has no restitution, and the
//! number tells it.

use crate::outcome::{ImpactRecord, ImpulseCurve};
use carom_solve::Status;
use glam::DVec3;
use std::collections::BTreeMap;

/// The problem that springs take the place of.
pub const SPRINGS: u32 = 1;

/// What one problem gave a contact.
#[derive(Clone, Copy, Debug)]
pub struct ImpactRow {
    pub slot: u32,
    pub problem: u32,
    pub status: Status,
    /// Impulse and moment on A, N s and N m s.
    pub given: [DVec3; 2],
    /// Normal velocity before and after the problem, m/s.
    pub speed: [f64; 2],
    pub scale: f64,
}

/// The rows of the island at hand; none are kept unless they are wanted.
#[derive(Debug, Default)]
pub struct ImpactTable {
    pub wanted: bool,
    rows: Vec<ImpactRow>,
    has_impact: bool,
    /// Of the impact through springs, by slot; empty unless asked for.
    pub courses: BTreeMap<u32, ImpulseCurve>,
}

impl ImpactTable {
    pub fn begin(&mut self, wanted: bool) {
        self.wanted = wanted;
        self.rows.clear();
        self.courses.clear();
        self.has_impact = false;
    }

    #[inline]
    pub fn push(&mut self, row: impl FnOnce() -> ImpactRow) {
        if self.wanted {
            self.rows.push(row());
        }
    }

    /// Whether a problem is an impact: not that of the loads, nor a first one in which only loads act (laws without a problem of
    /// loads have rest in it). `closed`: the loads had a problem of their own, or a contact of this one was closing at t_n.
    pub fn begin_problem(&mut self, problem: u32, closed: bool) {
        self.has_impact |= problem > 1 || (problem == 1 && closed);
    }

    pub fn has_impact(&self) -> bool {
        self.has_impact
    }

    /// Forgets a problem that is solved anew, the first impact or the loads before it.
    pub fn forget_problem(&mut self, problem: u32) {
        self.rows.retain(|row| row.problem != problem);
        self.has_impact = false;
    }

    /// The least restitution scale of the rows, 1 where there are none.
    pub fn least_scale(&self) -> f64 {
        self.rows.iter().map(|row| row.scale).fold(1.0, f64::min)
    }

    /// Appends the rows to the table of the step. Those of the loads enter it only if an impact follows. `of`: bodies and normal of a
    /// slot.
    pub fn hand_over(
        &self,
        of: impl Fn(usize) -> ([u32; 2], DVec3),
        impacts: &mut Vec<ImpactRecord>,
    ) {
        if !self.has_impact {
            return;
        }
        impacts.extend(self.rows.iter().map(|row| {
            let ([a, b], normal) = of(row.slot as usize);
            ImpactRecord {
                problem: row.problem,
                a,
                b,
                status: row.status as u8,
                normal,
                impulse: row.given[0],
                moment: row.given[1],
                normal_before: row.speed[0],
                separation: row.speed[1],
                restitution_scale: row.scale,
                course: match row.problem {
                    SPRINGS => self.courses.get(&row.slot).cloned(),
                    _ => None,
                },
            }
        }));
    }
}
