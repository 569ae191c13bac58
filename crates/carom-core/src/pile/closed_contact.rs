//! Contacts and spheres of a pile at the velocity level.

use crate::contact::Contact;
use crate::options::Options;
use crate::rows::halves;
use carom_solve::rows::WORLD;
use carom_solve::spheres::Body;
use carom_solve::Status;
use glam::DVec3;

/// No moving wall.
pub(super) const FIXED: u32 = u32::MAX;

/// A closed contact of the pile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ClosedContact {
    /// Index among the contacts of the step.
    pub contact: u32,
    pub a: u32,
    pub b: u32,
    /// Place among the velocities of moving walls, [`FIXED`] where none moves.
    pub driven: u32,
    pub normal: DVec3,
    /// Impulses move B along the normal alone.
    pub guided: bool,
    /// Lever arms, m.
    pub arms: [f64; 2],
    pub friction: f64,
    /// Index among the contact laws of the model.
    pub law: u32,
    /// It closes below minus this normal velocity, m/s.
    pub closing: f64,
    /// Impulse on A of all problems so far, and of the loads alone.
    pub impulse: DVec3,
    pub load: DVec3,
    /// Work normal and across, J.
    pub work: [f64; 2],
    /// First impact problem in which it closed, 0: none; normal velocity before; impulse of impacts; least restitution scale.
    pub problem: u32,
    pub normal_before: f64,
    pub hit: DVec3,
    pub scale: f64,
    /// Work that the residuals of its problems explain, J.
    pub explained: f64,
    /// Poisson's law: measure of slip that its expansion adds, and the least normal impulse of that.
    pub expansion: (DVec3, f64),
    /// Its load was solved anew with an impact.
    pub dropped: bool,
}

/// Along which normals the impulses of a problem act.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Frame {
    /// Those of the contacts.
    #[default]
    End,
    /// Those half-way between both ends of the step: loads that are solved once.
    Middle,
}

impl Frame {
    /// That of the loads of a step.
    pub fn of_loads(options: &Options) -> Self {
        if options.loads_once() {
            Self::Middle
        } else {
            Self::End
        }
    }

    /// A contact as the problem has it.
    #[inline]
    pub fn state(self, contacts: &[Contact], m: &ClosedContact) -> ClosedContact {
        let mut stated = *m;
        if self == Self::Middle {
            stated.normal = contacts[m.contact as usize].middle_normal();
        }
        stated
    }
}

/// What one problem gave a contact.
#[derive(Clone, Copy)]
pub(super) struct ProblemImpulse {
    pub impulse: DVec3,
    pub work: [f64; 2],
    /// Along the normal, before and after.
    pub speed: [f64; 2],
    pub scale: f64,
}

impl ClosedContact {
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

    /// The part of an impulse that moves B.
    #[inline]
    pub fn on_b(&self, r: DVec3) -> DVec3 {
        match self.guided {
            true => r.dot(self.normal) * self.normal,
            false => r,
        }
    }

    /// Of its normal and tangential rows, 1/kg.
    pub fn inverse_masses(&self, bodies: &[Body]) -> [f64; 2] {
        let sides = [(self.a, self.arms[0]), (self.b, self.arms[1])];
        let of = sides.map(|(node, arm)| match bodies.get(node as usize) {
            Some(b) => [b.inv_mass, arm * arm * b.inv_inertia],
            None => [0.0; 2],
        });
        let normal = of[0][0] + of[1][0];
        let across = if self.guided { of[0][0] } else { normal };
        [normal, across + of[0][1] + of[1][1]]
    }

    /// Adds what one problem gave. Contacts that closed enter the table of impacts, those that a load pressed only where that has rows of loads
    /// (`with_loads`); whether this is a part of an impact.
    pub fn add(&mut self, problem: u32, given: &ProblemImpulse, with_loads: bool) -> bool {
        self.impulse += given.impulse;
        self.work[0] += given.work[0];
        self.work[1] += given.work[1];
        if problem == 0 {
            (self.load, self.dropped) = (self.impulse, false);
            return false;
        }
        if given.impulse == DVec3::ZERO {
            return false;
        }
        if self.problem == 0 {
            if given.speed[0] >= -self.closing && !with_loads {
                return false;
            }
            (self.problem, self.normal_before) = (problem, given.speed[0]);
        }
        self.hit += given.impulse;
        self.scale = self.scale.min(given.scale);
        true
    }
}

impl ClosedContact {
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

/// Work of an impulse, normal and across, by the mean of the velocities before and after.
pub(super) fn work(normal: DVec3, r: DVec3, before: DVec3, after: DVec3) -> [f64; 2] {
    let mean = 0.5 * (before + after);
    let (r_n, v_n) = (r.dot(normal), mean.dot(normal));
    [r_n * v_n, r.dot(mean) - r_n * v_n]
}

/// Change of a contact's relative velocity by corrections of the nodes.
pub(super) fn change(m: &ClosedContact, u: &[[f64; 6]]) -> DVec3 {
    m.relative(|node| halves(&u[node as usize]))
}
