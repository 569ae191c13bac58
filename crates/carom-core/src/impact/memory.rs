//! What an island's impact problems are solved with: its rows, velocities and accumulated impulses in local nodes.

use super::law::Law;
use super::table::ImpactTable;
use crate::level::speeds::Speeds;
use crate::stepper::Span;
use carom_solve::rows::{RowSystem, NODE_DOF};
use carom_solve::{SolveReport, Status};

/// An island at velocity level, in local nodes and rows.
#[derive(Default)]
pub struct ImpactScratch {
    /// All closed contacts of the island, then its joints.
    pub full: RowSystem,
    pub members: Vec<u32>,
    pub joints: Vec<u32>,
    pub loads: Vec<u32>,
    /// Nodes that a load links: it answers what either of them is given.
    pub(super) linked: Vec<[u32; 2]>,
    /// t_n and t_{n+1}.
    pub span: Span,
    /// `c'` of the joint rows at t_n and t_{n+1}, in the order of `full`.
    pub(super) rates: [Vec<f64>; 2],
    /// Jump of stage J; wrench of the loads it is counted from, and impulse of their change since (6 per node).
    pub(super) settled: Vec<f64>,
    pub(super) settled_joint: Vec<f64>,
    pub(super) load_base: Vec<f64>,
    pub(super) load_impulse: Vec<f64>,
    /// Smooth and old velocities, total jump, jump of the fixed impulses, jump of the loads, `V_minus` (6 per node).
    pub v_check: Vec<f64>,
    pub v_old: Vec<f64>,
    pub jump: Vec<f64>,
    pub fixed: Vec<f64>,
    pub offset: Vec<f64>,
    /// Impulses of the loads, per row of `full`.
    pub(super) offset_impulse: Vec<f64>,
    pub v_minus: Vec<f64>,
    /// Accumulated impulses per row of `full`.
    pub impulse: Vec<f64>,
    /// Where loads are solved once: rows of the frame half-way between both ends of the step, along which they act, and their impulses. Empty elsewhere.
    pub(super) middle: Vec<[[f64; NODE_DOF]; 2]>,
    pub(super) load: Vec<f64>,
    /// There too: speeds at which contacts open at t_n, along the normals of then.
    pub(super) opening: Vec<f64>,
    /// Poisson's law, per row of `full`: least normal impulse of the expansion; measure of slip that it adds.
    pub(super) expansion: Vec<f64>,
    /// Whether the problem at hand is that of the loads along `middle`; the rows of `full` along which it measures.
    pub(super) along_middle: bool,
    pub(super) measured: Vec<[[f64; NODE_DOF]; 2]>,
    /// What moving walls add to the measures of contact rows at t_n and t_{n+1}; empty: none moves.
    pub(super) driven: [Vec<f64>; 2],
    /// The same at t_{n+1} along the rows of `middle`.
    pub(super) driven_middle: Vec<f64>,
    /// Slots (into `members`) of the contacts of the problem at hand.
    pub chosen: Vec<usize>,
    /// Closing tolerance of each contact, m/s, and changes of their walls' normal velocities, where walls move.
    pub closing: Vec<f64>,
    pub(super) wall_loads: Vec<f64>,
    /// Speeds at which these open contacts at t_n along the normal of then, as the paper prints restitution, m/s.
    pub(super) wall_openings: Vec<f64>,
    pub speeds: Speeds,
    /// Of the walls of its contacts.
    pub(super) wall_speeds: Speeds,
    pub problems: u32,
    pub(super) work: Vec<[f64; 4]>,
    /// Work that the residuals explain, by contact, J.
    pub(super) work_explained: Vec<f64>,
    pub(super) status: Vec<Status>,
    pub(super) sub: RowSystem,
    pub(super) lambda: Vec<f64>,
    pub(super) u: Vec<f64>,
    /// Of the problem at hand: its law; what is left of restitution at its contacts, and the work that its residual explains at them.
    pub(super) law: Law,
    pub(super) scale: Vec<f64>,
    pub(super) explained: Vec<f64>,
    /// Share of the tolerance that the solve at hand may leave.
    pub(super) fineness: f64,
    /// Share by which contacts give way in the solve at hand.
    pub(super) softness: f64,
    pub(super) velocity: Vec<f64>,
    pub(super) force: Vec<f64>,
    pub(super) table: ImpactTable,
    pub(super) accept_unconverged: bool,
    /// What the last solve told.
    pub(super) last: SolveReport,
}
