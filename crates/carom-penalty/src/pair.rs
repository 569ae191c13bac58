//! One pair of bodies that may touch: constants, geometry at the present positions, and what happened to it.

use crate::bodies::Bodies;
use crate::elastic::Elastic;
use crate::law::{LawConstants, Laws};
use crate::sums::Sums;
use carom_core::contact::ContactKey;
use carom_core::options::PenaltyFriction;
use carom_core::outcome::ImpactRecord;
use carom_core::state::Touch;
use carom_core::wall::WallTwist;
use carom_core::Model;
use carom_geom::{Proximity, Shape};
use carom_solve::Status;
use glam::DVec3;

/// Longest collision over its contact time; what stays closed for longer is at rest. A free collision with restitution 0.01
/// lasts 7.2: below that it would leave no record. Ten times more, and the last hops of a ball at rest are collisions.
const LONGEST_COLLISION: f64 = 100.0;
/// Share of the speed of a collision at one of its bodies; a contact that closes more slowly takes that speed as its own.
/// Ten times less, and balls that touch in a row are damped too much; ten times more, and slow collisions too little.
const OWN_APPROACH: f64 = 0.05;

/// Share of a sphere's radius that is left between its centre and that of a hollow wall at least: one that fills it has no curvature.
pub const FILLS: f64 = 1e-3;

/// Cosine of the angle between the normals of a disc and at it (1) from which on its face is touched, and not its rim.
const FLAT: f64 = 1.0 - 1e-9;

#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub a: u32,
    /// A sphere, or plane `b - N`.
    pub b: u32,
    /// Index of its contact law; without one the bodies may come near, not touch.
    pub law: Option<u32>,
    pub constants: LawConstants,
    /// Approach speed of its damping, m/s, where that varies.
    pub damped_at: f64,
    pub radii: [f64; 2],
    /// r_c, m.
    pub length: f64,
    /// Place of B among the moving walls.
    pub driven: Option<u32>,
    /// K, N/m^n.
    pub stiffness: f64,
    /// Inverse masses of the normal, sliding and rolling rows.
    pub inv_mass: f64,
    pub inv_mass_sliding: f64,
    pub inv_inertia: f64,
    /// Share of the contact time that its tangential spring leaves.
    pub shear_time: f64,
    /// At the present positions; the normal points from B to A.
    pub gap: f64,
    pub normal: DVec3,
    /// Of a wall at which it is hollow: 1 over the distance of the centre of curvature, 1/m, and the direction in which it is straight.
    pub hollow: f64,
    pub flat: DVec3,
    /// `K d^n`, N.
    pub force: f64,
    pub closed: bool,
    /// What of its wall it would touch lies on another one that is nearer.
    pub covered: bool,
    pub touch: Touch,
    /// Indentation, m, and force, N, where the substep began.
    before: [f64; 2],
    /// In this step, while it is (or was last) closed, and before.
    pub now: Sums,
    pub step: Sums,
    /// mu of the last sweep, and whether the contact slipped in it.
    pub friction: f64,
    pub slips: bool,
    /// From the place of the wall B to the contact, m.
    pub lever: DVec3,
    /// Moment on the wall B about its place, N m s, and work of its motion, J, in this step.
    pub wall_moment: DVec3,
    pub driven_work: f64,
}

impl Pair {
    /// A pair at the bodies' present positions; `touch`: it has been closed since an earlier step.
    pub fn new(
        model: &Model,
        laws: &Laws,
        bodies: &Bodies,
        key: ContactKey,
        touch: Option<Touch>,
    ) -> Pair {
        let (a, b) = (key.0 as usize, key.1 as usize);
        let law = model.law_of(a, b);
        let [ra, rb] = [bodies.radius[a], bodies.radius[b]];
        let wall = (b >= model.bodies()).then(|| model.wall(key.1));
        let of_b = wall.map_or_else(|| 1.0 / rb, |w| w.curvature());
        let curvature = (1.0 / ra + of_b).max(FILLS / ra);
        let inv_mass = bodies.inv_mass[a] + bodies.inv_mass[b];
        let inverse = [bodies.inv_inertia[a], bodies.inv_inertia[b]];
        let inv_mass_sliding = inv_mass + ra * ra * inverse[0] + rb * rb * inverse[1];
        let constants = law.map_or_else(LawConstants::default, |l| laws.contacts[l as usize]);
        let springs = model.options.penalty_friction == PenaltyFriction::Spring;
        let shear_time = match constants.slides && springs {
            true => laws.elastic.shear_time(inv_mass, inv_mass_sliding).min(1.0),
            false => 1.0,
        };
        let mut pair = Pair {
            a: key.0,
            b: key.1,
            law,
            damped_at: 0.0,
            constants,
            radii: [ra, rb],
            length: if wall.is_some() { ra } else { ra.min(rb) },
            driven: wall.and_then(|w| w.slot()),
            stiffness: laws.elastic.stiffness(curvature),
            inv_mass,
            inv_mass_sliding,
            inv_inertia: inverse[0] + inverse[1],
            shear_time,
            gap: 0.0,
            normal: DVec3::ZERO,
            hollow: 0.0,
            flat: DVec3::ZERO,
            force: 0.0,
            closed: touch.is_some(),
            covered: false,
            touch: touch.unwrap_or(Touch::new(key, 0.0)),
            before: [0.0; 2],
            now: Sums::default(),
            step: Sums::default(),
            friction: 0.0,
            slips: false,
            lever: DVec3::ZERO,
            wall_moment: DVec3::ZERO,
            driven_work: 0.0,
        };
        pair.place(model, &laws.elastic, bodies);
        pair.damping_of_approach(model);
        pair
    }

    pub fn key(&self) -> ContactKey {
        (self.a, self.b)
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
            let met = bodies.walls.meet(model, self.a, self.b, x[a]);
            self.bend(&model.wall(self.b).shape, &met);
            if model.record_walls {
                self.lever = bodies.walls.arm(model, self.b, x[a]) - self.radii[0] * met.normal;
            }
            met
        };
        (self.gap, self.normal, self.covered) = (gap, normal, false);
        self.force = elastic.force(self.stiffness, (-gap).max(0.0));
    }

    /// Stored energy of a closed contact whose wall has just been taken away, J.
    pub fn taken(&self, model: &Model, elastic: &Elastic, bodies: &Bodies) -> f64 {
        if self.gap < f64::INFINITY {
            return 0.0;
        }
        let wall = &bodies.walls.now[self.b as usize - model.first_wall()];
        let met = wall.meet(bodies.position[self.a as usize], self.radii[0]);
        let mut there = *self;
        there.gap = met.gap.min(0.0);
        there.force = elastic.force(self.stiffness, -there.gap);
        there.energy(elastic)
    }

    #[inline]
    fn bend(&mut self, shape: &Shape, met: &Proximity) {
        // On the axis of what is round there is no direction, and no curvature is told.
        let is_flat = match shape {
            Shape::Ball(_) | Shape::Cylinder(_) | Shape::Cone(_) => false,
            Shape::Disc(disc) => met.normal.dot(disc.normal).abs() > FLAT,
            _ => true,
        };
        self.hollow = match met.curvature {
            0.0 if is_flat => 0.0,
            0.0 => f64::INFINITY,
            k => (-k).max(k * (met.flat.length_squared() - 1.0)).max(0.0),
        };
        if matches!(shape, Shape::Cylinder(_)) && met.curvature < 0.0 {
            self.flat = met.flat;
        }
    }

    /// Whether it has a tangential spring.
    #[inline]
    fn stretches(&self, model: &Model) -> bool {
        let springs = model.options.penalty_friction == PenaltyFriction::Spring;
        self.closed && self.constants.slides && springs
    }

    /// Goes along with the bodies, which have moved for `dt`, and stretches the spring.
    #[inline]
    pub fn follow(&mut self, model: &Model, elastic: &Elastic, bodies: &Bodies, dt: f64) {
        self.before = [-self.gap, self.force];
        if self.stretches(model) {
            self.touch.spring += dt * self.slip(bodies);
        }
        self.place(model, elastic, bodies);
    }

    /// What of its wall is nearest to the sphere, m.
    pub fn point(&self, bodies: &Bodies) -> DVec3 {
        bodies.position[self.a as usize] - (self.radii[0] + self.gap) * self.normal
    }

    /// Takes over what another pair of the sphere was, whose wall is covered by the wall of this one.
    pub fn take_over(&mut self, other: &mut Pair) {
        other.covered = true;
        if !other.closed {
            return;
        }
        other.closed = false;
        if !self.closed {
            self.closed = true;
            self.before = other.before;
            self.touch = Touch {
                key: self.key(),
                impulse: other.touch.impulse + other.now.impulse,
                moment: other.touch.moment + other.now.moment,
                ..other.touch
            };
        }
        other.end_sums();
    }

    /// Opens or closes where the bodies are now, after a substep of `dt`. Returns the completed collision.
    #[inline]
    pub fn open_or_close(
        &mut self,
        model: &Model,
        elastic: &Elastic,
        bodies: &Bodies,
        dt: f64,
    ) -> Option<ImpactRecord> {
        if self.touches() {
            if !self.closed {
                self.close(bodies);
            } else if self.stretches(model) {
                self.carry_spring(elastic);
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

    /// Whether the bodies overlap here.
    #[inline]
    pub fn touches(&self) -> bool {
        self.gap < 0.0 && !self.covered
    }

    /// Starts a contact at the present speed.
    pub fn close(&mut self, bodies: &Bodies) {
        self.closed = true;
        self.touch = Touch::new(self.key(), self.closing_speed(bodies).max(0.0));
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
            normal_before: -self.touch.approach,
            separation: -self.closing_speed(bodies),
            restitution_scale: 1.0,
            course: None,
        };
        self.end_sums();
        // Small hops of a ball at rest under its weight are no collisions either.
        speed
            .filter(|&v| {
                let time = elastic.contact_time(self.stiffness, self.inv_mass, v, 1.0);
                self.pressing(bodies) * time <= v
            })
            .map(|_| record)
    }

    /// The spring turns with the normal and keeps its length. Where the contact grows stiffer its force stays, and where
    /// it grows softer its elongation: both ways no energy is made (`k_T` follows the indentation).
    fn carry_spring(&mut self, elastic: &Elastic) {
        let [depth, force] = self.before;
        let spring = &mut self.touch.spring;
        let length = spring.length();
        *spring -= spring.dot(self.normal) * self.normal;
        let flat = spring.length();
        if flat > 0.0 {
            *spring *= length / flat;
        }
        let (old, new) = (
            elastic.slope(force, depth),
            elastic.slope(self.force, -self.gap),
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
    pub fn wall_motion(&self, bodies: &Bodies) -> [WallTwist; 2] {
        if let Some(slot) = self.driven {
            let point = bodies.position[self.a as usize] - self.radii[0] * self.normal;
            return bodies.walls.twists_of(slot, point);
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
    pub fn fastest_closing(&self, bodies: &Bodies) -> f64 {
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

    /// Counts what B is given where it is a wall, and the work of that: what it gives A at its own velocity.
    #[inline]
    pub fn drive(&mut self, bodies: &Bodies, normal: DVec3, friction: DVec3, moment: DVec3) {
        if self.b as usize >= bodies.position.len() {
            self.wall_moment -= moment + self.lever.cross(normal + friction);
        }
        if self.driven.is_some() {
            let [wall, _] = self.wall_motion(bodies);
            self.driven_work +=
                normal.dot(wall.shape) + friction.dot(wall.material) + moment.dot(wall.spin);
        }
    }

    /// Tangential velocity of A against B at the contact (eqs. 34, 41), m/s.
    #[inline]
    pub fn slip(&self, bodies: &Bodies) -> DVec3 {
        let [va, wa] = bodies.motion[self.a as usize];
        let [wall, _] = self.wall_motion(bodies);
        let (vb, wb) = (wall.material, wall.spin);
        let v = va - vb;
        let n = self.normal;
        v - n.dot(v) * n + n.cross(self.radii[0] * wa + self.radii[1] * wb)
    }

    /// Adds what happened while it was closed to the step.
    pub fn end_sums(&mut self) {
        self.step.add(&self.now);
        self.now = Sums::default();
    }

    pub fn status(&self) -> Status {
        if self.slips || !self.constants.slides {
            Status::Slip
        } else {
            Status::Stick
        }
    }
}
