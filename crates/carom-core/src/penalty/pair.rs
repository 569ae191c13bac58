//! One pair of bodies that may touch: constants, geometry at the present positions, and what happened to it.

use super::elastic::Elastic;
use super::touch::{PairLaw, Sum, Touch};
use crate::contact::{ContactKey, WorldImpulse};
use crate::model::Model;
use crate::options::PenaltyFriction;
use crate::outcome::ImpactRecord;
use crate::penalty::bodies::Bodies;
use crate::wall::WallTwist;
use carom_geom::Proximity;
use carom_solve::{Bounds, Status};
use glam::DVec3;

/// A collision closes and opens again; what stays closed for more than this many times its contact time is a contact at rest.
const LONGEST_COLLISION: f64 = 100.0;
/// A contact that closes with less than this share of the speed of a collision at one of its bodies has none of its own.
const OWN_APPROACH: f64 = 0.05;
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub a: u32,
    /// A sphere, or plane `b - N`.
    pub b: u32,
    /// Index of its contact law; without one the bodies may come near, not touch.
    pub law: Option<u32>,
    pub values: PairLaw,
    pub(super) radii: [f64; 2],
    /// r_c, m.
    pub length: f64,
    /// Place of B among the moving walls.
    driven: Option<u32>,
    /// K, N/m^n.
    pub(super) stiffness: f64,
    /// Inverse masses of the normal, sliding and rolling rows.
    pub(super) inv_mass: f64,
    pub(super) inv_mass_sliding: f64,
    pub(super) inv_inertia: f64,
    /// At the present positions; the normal points from B to A.
    pub gap: f64,
    pub normal: DVec3,
    /// `K d^n`, N.
    pub elastic: f64,
    pub closed: bool,
    pub touch: Touch,
    /// In this step, while it is (or was last) closed, and before.
    pub(super) now: Sum,
    pub step: Sum,
    /// mu of the last sweep, and whether the contact slipped in it.
    pub(super) friction: f64,
    pub(super) slips: bool,
    /// Work of the moving wall in this step, J.
    pub driven_work: f64,
}

impl Pair {
    /// A pair at the bodies' present positions; `touch`: it has been closed since an earlier step.
    pub fn new(
        model: &Model,
        elastic: &Elastic,
        laws: &[PairLaw],
        bodies: &Bodies,
        key: ContactKey,
        touch: Option<Touch>,
    ) -> Pair {
        let (a, b) = (key.0 as usize, key.1 as usize);
        let law = model.law_of(a, b);
        let [ra, rb] = [bodies.radius[a], bodies.radius[b]];
        let wall = (b >= model.spheres()).then(|| model.wall(key.1));
        let of_b = wall.map_or_else(|| 1.0 / rb, |w| w.curvature());
        // A sphere that fills its hollow wall has none left.
        let curvature = (1.0 / ra + of_b).max(1e-3 / ra);
        let inv_mass = bodies.inv_mass[a] + bodies.inv_mass[b];
        let inverse = [bodies.inv_inertia[a], bodies.inv_inertia[b]];
        let mut pair = Pair {
            a: key.0,
            b: key.1,
            law,
            values: law.map_or_else(PairLaw::default, |l| laws[l as usize]),
            radii: [ra, rb],
            length: if wall.is_some() { ra } else { ra.min(rb) },
            driven: wall.and_then(|w| w.slot()),
            stiffness: elastic.stiffness(curvature),
            inv_mass,
            inv_mass_sliding: inv_mass + ra * ra * inverse[0] + rb * rb * inverse[1],
            inv_inertia: inverse[0] + inverse[1],
            gap: 0.0,
            normal: DVec3::ZERO,
            elastic: 0.0,
            closed: touch.is_some(),
            touch: touch.unwrap_or(Touch {
                key,
                approach: 0.0,
                age: 0.0,
                spring: DVec3::ZERO,
                impulse: DVec3::ZERO,
                moment: DVec3::ZERO,
            }),
            now: Sum::default(),
            step: Sum::default(),
            friction: 0.0,
            slips: false,
            driven_work: 0.0,
        };
        pair.place(model, elastic, bodies);
        pair
    }

    pub fn key(&self) -> ContactKey {
        (self.a, self.b)
    }

    /// Whether anything happened to it in this step.
    pub fn has_record(&self) -> bool {
        self.closed || self.step.normal_impulse != DVec3::ZERO
    }

    /// Gap, normal and elastic force at the present positions.
    #[inline]
    fn place(&mut self, model: &Model, elastic: &Elastic, bodies: &Bodies) {
        let (a, b) = (self.a as usize, self.b as usize);
        let x = &bodies.position;
        let Proximity { gap, normal, .. } = if let Some(xb) = x.get(b) {
            model
                .periodic
                .sphere_sphere(x[a], self.radii[0], *xb, self.radii[1])
        } else {
            bodies.walls.meet(model, self.a, self.b, x[a])
        };
        (self.gap, self.normal) = (gap, normal);
        self.elastic = if gap < 0.0 {
            elastic.force(self.stiffness, -gap)
        } else {
            0.0
        };
    }

    /// Follows the bodies, which have moved for `dt`: opens, closes, stretches the spring. Returns the completed collision.
    #[inline]
    pub fn follow(
        &mut self,
        model: &Model,
        elastic: &Elastic,
        bodies: &Bodies,
        dt: f64,
    ) -> Option<ImpactRecord> {
        let (depth, force) = (-self.gap, self.elastic);
        let springs = model.options.penalty_friction == PenaltyFriction::Spring;
        let stretch = self.closed && self.values.slides && springs;
        if stretch {
            self.touch.spring += dt * self.slip(bodies);
        }
        self.place(model, elastic, bodies);
        if self.gap < 0.0 {
            if !self.closed {
                self.close(bodies);
            } else if stretch {
                self.carry_spring(elastic, depth, force);
            }
            self.touch.age += dt;
            return None;
        }
        if !self.closed {
            return None;
        }
        self.open(elastic, bodies)
    }

    /// v_in, if the contact is in a collision: m/s.
    pub fn collision_speed(&self, elastic: &Elastic) -> Option<f64> {
        let v = self.touch.approach;
        let time = elastic.contact_time(self.stiffness, self.inv_mass, v, 1.0);
        (self.closed && v > 0.0 && self.touch.age <= LONGEST_COLLISION * time).then_some(v)
    }

    /// Takes the speed of a collision at one of its bodies, if it has just closed without one of its own or has touched
    /// unloaded before. True: it did.
    pub fn join(&mut self, model: &Model, speed: f64, dt: f64) -> bool {
        let unloaded = -self.gap <= model.options.touching_tolerance * self.length;
        let fresh = self.closed && (self.touch.age <= dt || unloaded);
        let joins = fresh && self.touch.approach < OWN_APPROACH * speed;
        if joins {
            self.touch.approach = speed;
        }
        joins
    }

    /// Starts a contact at the present speed.
    pub fn close(&mut self, bodies: &Bodies) {
        self.closed = true;
        self.touch = Touch {
            key: self.key(),
            approach: self.closing_speed(bodies).max(0.0),
            age: 0.0,
            spring: DVec3::ZERO,
            impulse: DVec3::ZERO,
            moment: DVec3::ZERO,
        };
    }

    fn open(&mut self, elastic: &Elastic, bodies: &Bodies) -> Option<ImpactRecord> {
        let speed = self.collision_speed(elastic);
        self.closed = false;
        let record = ImpactRecord {
            problem: 1,
            a: self.a,
            b: self.b,
            status: self.status() as u8,
            normal: self.normal,
            impulse: self.touch.impulse + self.now.impulse,
            moment: self.touch.moment + self.now.moment,
            approach: -self.touch.approach,
            separation: -self.closing_speed(bodies),
            restitution_scale: 1.0,
        };
        self.step.add(&self.now);
        self.now = Sum::default();
        // Small hops of a ball at rest under its weight are no collisions either.
        speed
            .filter(|&v| {
                let time = elastic.contact_time(self.stiffness, self.inv_mass, v, 1.0);
                self.pressing(&bodies.smooth) * time <= v
            })
            .map(|_| record)
    }

    /// The spring turns with the normal and keeps its length. Where the contact grows stiffer its force stays, and where
    /// it grows softer its elongation: both ways no energy is made (`k_T` follows the indentation).
    fn carry_spring(&mut self, elastic: &Elastic, depth: f64, force: f64) {
        let spring = &mut self.touch.spring;
        let length = spring.length();
        *spring -= spring.dot(self.normal) * self.normal;
        let flat = spring.length();
        if flat > 0.0 {
            *spring *= length / flat;
        }
        let (old, new) = (
            elastic.slope(force, depth),
            elastic.slope(self.elastic, -self.gap),
        );
        if new > old {
            *spring *= old / new;
        }
    }

    /// Speed at which the gap shrinks, m/s.
    #[inline]
    pub fn closing_speed(&self, bodies: &Bodies) -> f64 {
        let [now, _] = self.wall_motion(bodies);
        self.normal
            .dot(now.shape - bodies.motion[self.a as usize][0])
    }

    /// Velocity of B at the contact, now and at t_{n+1}; of a sphere that of its centre, as its radius enters elsewhere.
    #[inline]
    pub(super) fn wall_motion(&self, bodies: &Bodies) -> [WallTwist; 2] {
        if let Some(slot) = self.driven {
            let point = bodies.position[self.a as usize] - self.radii[0] * self.normal;
            return bodies.walls.twists(slot, point);
        }
        let [shape, spin] = bodies.motion[self.b as usize];
        [WallTwist {
            shape,
            material: shape,
            spin,
        }; 2]
    }

    /// Speed at which the gap shrinks when the wall has its velocity of t_{n+1}, if that is more.
    #[inline]
    pub(super) fn fastest_closing(&self, bodies: &Bodies) -> f64 {
        let now = self.closing_speed(bodies);
        if self.driven.is_none() {
            return now;
        }
        let [_, end] = self.wall_motion(bodies);
        now.max(
            self.normal
                .dot(end.shape - bodies.motion[self.a as usize][0]),
        )
    }

    /// Counts the work of a moving wall: what it gave A at its own velocity.
    #[inline]
    pub(super) fn drive(&mut self, bodies: &Bodies, normal: DVec3, friction: DVec3, moment: DVec3) {
        if self.driven.is_some() {
            let [wall, _] = self.wall_motion(bodies);
            self.driven_work +=
                normal.dot(wall.shape) + friction.dot(wall.material) + moment.dot(wall.spin);
        }
    }

    /// Tangential velocity of A against B at the contact (eqs. 34, 41), m/s.
    #[inline]
    pub(super) fn slip(&self, bodies: &Bodies) -> DVec3 {
        let [va, wa] = bodies.motion[self.a as usize];
        let [wall, _] = self.wall_motion(bodies);
        let (vb, wb) = (wall.material, wall.spin);
        let v = va - vb;
        let n = self.normal;
        v - n.dot(v) * n + n.cross(self.radii[0] * wa + self.radii[1] * wb)
    }

    fn status(&self) -> Status {
        if self.slips || !self.values.slides {
            Status::Slip
        } else {
            Status::Stick
        }
    }

    /// Ends the step: its sums are complete, and a contact that stays closed remembers its impulses.
    pub fn end_step(&mut self) {
        if self.closed {
            self.touch.impulse += self.now.impulse;
            self.touch.moment += self.now.moment;
        }
        self.step.add(&self.now);
        self.now = Sum::default();
    }

    /// Stored energy, J.
    pub fn energy(&self, elastic: &Elastic) -> f64 {
        if !self.closed {
            return 0.0;
        }
        let slope = elastic.slope(self.elastic, -self.gap);
        let sheared = elastic.tangential_ratio * slope * self.touch.spring.length_squared();
        elastic.energy(self.elastic, -self.gap) + 0.5 * sheared
    }

    /// The step's impulses as a contact of the step, in the frame of their mean normal.
    pub fn contact(&self, law: u32) -> crate::contact::Contact {
        let n = self.step.normal_impulse.normalize_or(self.normal);
        let (t1, t2) = carom_geom::tangent_frame(n);
        let mut contact = crate::contact::Contact {
            a: self.a,
            b: self.b,
            law,
            n0: n,
            t1,
            t2,
            n1: n,
            gap_start: self.gap,
            gap_check: self.gap,
            bounds: Bounds {
                // The rows are there although the law may give 0 just now.
                sliding: if self.values.slides {
                    self.friction.max(f64::MIN_POSITIVE)
                } else {
                    0.0
                },
                ..self.values.bounds
            },
            gap: self.gap,
            length: self.length,
            nu: [0.0; 6],
            lambda: [0.0; 6],
            work: self.step.work,
            closed: self.closed,
            end_frame: false,
            held: false,
            rested: false,
            status: self.status(),
        };
        let world = WorldImpulse {
            impulse: self.step.impulse,
            moment: self.step.moment,
        };
        let mut packed = [0.0; 6];
        contact.to_rows(&world, &mut packed);
        contact.lambda = packed;
        contact
    }
}
