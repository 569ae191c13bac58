//! A contact within a step: frames, gaps and rows (eqs. 31-43), and its multipliers.
//!
//! Symbols: `n` normal from B to A; `t1, t2 = n x t1`; lever of A `-r_A n`, of B `+r_B n`. Departures: the rows act on
//! *spatial* angular velocities and rotation increments (erratum E1); rolling and spinning rows are added.

use crate::model::{ContactLaw, Model};
use crate::rows::Rows;
use carom_solve::rows::NODE_DOF;
use carom_solve::{Bounds, Status};
use glam::{DVec3, IVec3};

/// Gap over r_c after the smooth step (1) below which a pair is a candidate contact; others enter when they overlap. Too small: solves are
/// repeated for pairs that join. Too large: islands grow together by contacts that never close, and take longer.
pub const CANDIDATE_MARGIN: f64 = 1e-2;

/// One candidate contact of a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    /// Body A: a sphere.
    pub a: u32,
    /// Body B: a sphere of larger index, or a wall, which are behind balls and clumps.
    pub b: u32,
    pub law: u32,
    /// mu, rho, delta in this step.
    pub bounds: Bounds,
    /// Frame at t_n.
    pub n0: DVec3,
    pub t1: DVec3,
    pub t2: DVec3,
    /// Normal at the corrected positions.
    pub n1: DVec3,
    /// Gap at t_n, after the smooth step, and after the position correction, m.
    pub gap_start: f64,
    pub gap_check: f64,
    pub gap: f64,
    /// r_c, m.
    pub length: f64,
    /// How many images of a periodic box that deforms lie between both centres; 0 in others.
    pub image: IVec3,
    /// Position multipliers, rows packed as in `carom_solve::cone`, kg m.
    pub nu: [f64; 6],
    /// Velocity multipliers accumulated over the step's impact problems, N s.
    pub lambda: [f64; 6],
    /// The part of `lambda` that the loads gave and impacts have not solved anew, where loads are solved once; its rows are those of the
    /// frame half-way between both ends of the step ([`Contact::middle`]).
    pub load: [f64; 6],
    /// The normal with which the loads were solved, and what they have moved the bodies by in positions, as rows of the frame half-way to it, kg m.
    pub load_normal: DVec3,
    pub moved: [f64; 6],
    /// Whether a joint holds one of its bodies: loads then act along the frame of `n1`, as what joints answer does. Where a joint and a contact
    /// nearly hold the same motion, large impulses in the frame half-way would give energy.
    pub jointed: bool,
    /// Whether the loads are solved with this contact ([`crate::level::loads`]).
    pub resting: bool,
    /// Work of the step's impulses: normal, sliding, rolling, spinning, J.
    pub work: [f64; 4],
    pub closed: bool,
    /// Whether `t1`, `t2` and the axis of spinning belong to `n1` (piles, and loads that are solved once), not to `n0`.
    pub end_frame: bool,
    /// Whether all contacts of its bodies were there at t_n, where the loads look for rest.
    pub rested: bool,
    pub status: Status,
}

/// A vector that turns with a normal, from one to another the shortest way.
#[inline]
pub(crate) fn turned(v: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let both = from + to;
    v - v.dot(both) / (1.0 + from.dot(to)) * both + 2.0 * v.dot(from) * to
}

/// World vectors of a multiplier on body A.
#[derive(Clone, Copy, Debug, Default)]
pub struct WorldImpulse {
    pub impulse: DVec3,
    pub moment: DVec3,
}

impl Contact {
    /// Forgets what an earlier step found, faster than by a new contact. Where loads are not solved `once`, nothing writes what belongs to them.
    #[inline(always)]
    pub(crate) fn forget(&mut self, once: bool) {
        (self.nu, self.lambda, self.work) = ([0.0; 6], [0.0; 6], [0.0; 4]);
        (self.closed, self.end_frame) = (false, false);
        (self.rested, self.status) = (false, Status::Gap);
        if once {
            (self.load, self.load_normal, self.resting) = ([0.0; 6], DVec3::ZERO, false);
            self.moved = [0.0; 6];
        }
    }

    /// The multiplier of the normal at the position level that the load stands for, kg m.
    #[inline]
    pub fn of_load(&self, h: f64) -> f64 {
        0.5 * h * self.load[0]
    }

    /// Whether its impact was missed: the smooth motion made it overlap, not the correction of a neighbour, and it opened again at `free` (m/s, beyond `none`)
    /// without an impulse.
    #[inline]
    pub(crate) fn missed(&self, model: &Model, free: f64, none: f64) -> bool {
        let overlapped = self.gap_check < 0.0 && self.nu[0] > 0.0;
        overlapped
            && self.lambda[0] == 0.0
            && free > none
            && self.gap_start > model.options.touching_tolerance * self.length
    }

    /// Whether body B is a wall that stands, or moves as prescribed.
    #[inline]
    pub fn is_wall(&self, model: &Model) -> bool {
        self.b as usize >= model.bodies()
    }

    /// Whether body B is any wall.
    #[inline]
    pub fn meets_wall(&self, model: &Model) -> bool {
        self.b as usize >= model.first_wall()
    }

    /// Whether body B is a free wall, which impulses move along the normal alone.
    #[inline]
    pub fn is_guided(&self, model: &Model) -> bool {
        self.meets_wall(model) && !self.is_wall(model)
    }

    #[inline]
    pub fn law<'m>(&self, model: &'m Model) -> &'m ContactLaw {
        &model.laws[self.law as usize]
    }

    /// Radius of body B, 0 for a wall.
    #[inline]
    pub fn radius_b(&self, model: &Model) -> f64 {
        match self.meets_wall(model) {
            true => 0.0,
            false => model.radius[self.b as usize],
        }
    }

    /// The frame of `t_n` again, where a pile had turned it to that of `t_{n+1}`.
    pub fn set_start_frame(&mut self) {
        if self.end_frame {
            (self.t1, self.t2) = carom_geom::tangent_frame(self.n0);
            self.end_frame = false;
        }
    }

    /// The frame of the normal `n` at the end of the step, turned from that of `t_n` the shortest way.
    pub fn turn_to(&mut self, n: DVec3) {
        self.set_start_frame();
        if n != self.n0 {
            [self.t1, self.t2] = [self.t1, self.t2].map(|t| turned(t, self.n0, n));
        }
        (self.n1, self.end_frame) = (n, true);
    }

    /// The normal half-way between those of both ends of the step: impulses along it move bodies over curved surfaces to second order. Of bodies
    /// with joints: the last one.
    #[inline]
    pub fn middle_normal(&self) -> DVec3 {
        if self.n0 == self.n1 || self.jointed {
            self.n1
        } else {
            (self.n0 + self.n1).normalize()
        }
    }

    /// The contact with the frame of [`Contact::middle_normal`].
    pub fn middle(&self) -> Contact {
        let mut middle = *self;
        if self.n0 != self.n1 && !self.jointed {
            middle.turn_to(self.middle_normal());
        }
        middle
    }

    /// World vector of the impulse of the loads, which acts half-way between both ends of the step, and its part along the normal.
    pub fn impulse_of_loads(&self) -> [DVec3; 2] {
        let middle = self.middle();
        let impulse = middle.to_world(middle.n1, &self.load).impulse;
        [impulse, self.load[0] * middle.n1]
    }

    /// World vectors of all impulses of the step, and the part along the normal.
    pub fn impulse(&self) -> (WorldImpulse, DVec3) {
        let whole = self.to_world(self.n1, &self.lambda);
        let normal = self.lambda[0] * self.n1;
        if self.n0 == self.n1 || self.load == [0.0; 6] {
            return (whole, normal);
        }
        // What the loads gave acts in the frame half-way.
        let middle = self.middle();
        let of_loads = [self, &middle].map(|c| c.to_world(c.n1, &self.load));
        let total = WorldImpulse {
            impulse: whole.impulse + (of_loads[1].impulse - of_loads[0].impulse),
            moment: whole.moment + (of_loads[1].moment - of_loads[0].moment),
        };
        (total, normal + self.load[0] * (middle.n1 - self.n1))
    }

    /// Whether it has given its bodies velocities, or moved them.
    pub fn acts(&self) -> bool {
        self.nu[0] != 0.0 || self.lambda[0] != 0.0 || self.moved[0] != 0.0
    }

    /// World vectors of what has moved the bodies in positions: `nu`, and what the loads have moved them by in place of their normal part in it.
    pub fn position_impulse(&self) -> WorldImpulse {
        let mut position = self.to_world(self.n1, &self.nu);
        if self.moved[0] != 0.0 {
            let mut then = *self;
            then.turn_to(self.load_normal);
            let (middle, mut across) = (then.middle(), self.moved);
            across[0] = 0.0;
            let by_loads = middle.to_world(middle.n1, &across);
            position.impulse += by_loads.impulse + self.moved[0] * (middle.n1 - self.n1);
            position.moment += by_loads.moment;
        }
        position
    }

    /// Axis of the spinning row.
    #[inline]
    fn spin_axis(&self) -> DVec3 {
        if self.end_frame {
            self.n1
        } else {
            self.n0
        }
    }

    /// Jacobian rows with the given normal in the normal row and the contact's frame in all others; returns their number.
    pub fn rows(&self, model: &Model, normal: DVec3, rows: &mut Rows) -> usize {
        let (ra, rb) = (model.radius[self.a as usize], self.radius_b(model));
        let bounds = self.bounds;
        let (n, t1, t2) = (self.spin_axis(), self.t1, self.t2);
        rows[0] = row(normal, DVec3::ZERO, -normal, DVec3::ZERO);
        let mut count = 1;
        if bounds.sliding > 0.0 {
            let sliding = sliding_rows(t1, t2, ra, rb);
            rows[count..count + 2].copy_from_slice(&sliding);
            count += 2;
        }
        if bounds.rolling > 0.0 {
            rows[count] = row(DVec3::ZERO, t1, DVec3::ZERO, -t1);
            rows[count + 1] = row(DVec3::ZERO, t2, DVec3::ZERO, -t2);
            count += 2;
        }
        if bounds.spinning > 0.0 {
            rows[count] = row(DVec3::ZERO, n, DVec3::ZERO, -n);
            count += 1;
        }
        if self.is_guided(model) {
            rows[1..count]
                .iter_mut()
                .for_each(|row| row[1] = [0.0; NODE_DOF]);
        }
        count
    }

    /// World vectors of packed multipliers, the normal one along `normal`.
    pub fn to_world(&self, normal: DVec3, packed: &[f64; 6]) -> WorldImpulse {
        let bounds = self.bounds;
        let mut out = WorldImpulse {
            impulse: packed[0] * normal,
            moment: DVec3::ZERO,
        };
        let mut k = 1;
        if bounds.sliding > 0.0 {
            out.impulse += packed[k] * self.t1 + packed[k + 1] * self.t2;
            k += 2;
        }
        if bounds.rolling > 0.0 {
            out.moment += packed[k] * self.t1 + packed[k + 1] * self.t2;
            k += 2;
        }
        if bounds.spinning > 0.0 {
            out.moment += packed[k] * self.spin_axis();
        }
        out
    }

    /// Packed multipliers of world vectors, projected on this step's frame (warm start, rule R8).
    pub fn to_rows(&self, world: &WorldImpulse, packed: &mut [f64; 6]) {
        let bounds = self.bounds;
        packed[0] = world.impulse.dot(self.n1).max(0.0);
        let mut k = 1;
        if bounds.sliding > 0.0 {
            packed[k] = world.impulse.dot(self.t1);
            packed[k + 1] = world.impulse.dot(self.t2);
            k += 2;
        }
        if bounds.rolling > 0.0 {
            packed[k] = world.moment.dot(self.t1);
            packed[k + 1] = world.moment.dot(self.t2);
            k += 2;
        }
        if bounds.spinning > 0.0 {
            packed[k] = world.moment.dot(self.spin_axis());
        }
    }

    /// Which work column (normal, sliding, rolling, spinning) a packed row belongs to.
    pub fn row_kind(&self, row: usize) -> usize {
        let bounds = self.bounds;
        let mut end = 1;
        for (kind, present) in [(1, bounds.sliding > 0.0), (2, bounds.rolling > 0.0)] {
            if row < end {
                break;
            }
            if present {
                end += 2;
                if row < end {
                    return kind;
                }
            }
        }
        if row == 0 {
            0
        } else {
            3
        }
    }
}

/// The two sliding rows (eq. 41).
#[inline]
fn sliding_rows(t1: DVec3, t2: DVec3, ra: f64, rb: f64) -> [[[f64; NODE_DOF]; 2]; 2] {
    [
        row(t1, -ra * t2, -t1, -rb * t2),
        row(t2, ra * t1, -t2, rb * t1),
    ]
}

/// Tangential increment of two spheres over a step (eq. 37) and the tangents of t_n: the sliding rows on displacements and
/// rotation increments. Centres at t_n, displacements, increments and radii of A and B.
pub fn tangential_increment(
    centres: [DVec3; 2],
    displacements: [DVec3; 2],
    rot_incr_world: [DVec3; 2],
    [ra, rb]: [f64; 2],
) -> ([f64; 2], [DVec3; 2]) {
    let n = carom_geom::sphere_sphere(centres[0], ra, centres[1], rb).normal;
    let (t1, t2) = carom_geom::tangent_frame(n);
    let rows = sliding_rows(t1, t2, ra, rb);
    let mut gap = [0.0; 2];
    for (g, row) in gap.iter_mut().zip(&rows) {
        for (side, (x, psi)) in row.iter().zip(displacements.iter().zip(&rot_incr_world)) {
            let parts = [x.to_array(), psi.to_array()].concat();
            *g += side.iter().zip(&parts).map(|(j, d)| j * d).sum::<f64>();
        }
    }
    (gap, [t1, t2])
}

#[inline]
fn row(va: DVec3, wa: DVec3, vb: DVec3, wb: DVec3) -> [[f64; NODE_DOF]; 2] {
    [
        [va.x, va.y, va.z, wa.x, wa.y, wa.z],
        [vb.x, vb.y, vb.z, wb.x, wb.y, wb.z],
    ]
}

/// Stable key of a contact: body indices, walls after spheres.
pub type ContactKey = (u32, u32);
