//! One pair of bodies that may touch: constants, geometry at the present positions, and what happened to it.

use super::elastic::Elastic;
use super::friction::{damping_ratio, slowed, Spring};
use super::laws;
use super::workspace::Bodies;
use crate::contact::WorldImpulse;
use crate::model::Model;
use crate::options::{Options, PenaltyFriction};
use crate::scratch::ImpactRecord;
use crate::state::ContactKey;
use carom_geom::Proximity;
use carom_solve::{Bounds, Status};
use glam::DVec3;

/// A collision closes and opens again; what stays closed for more than this many times its contact time is a contact at rest.
const LONGEST_COLLISION: f64 = 100.0;
/// A contact that closes with less than this share of the speed of a collision at one of its bodies has none of its own.
const OWN_APPROACH: f64 = 0.05;
/// Substep over the time constant of the damping at the default resolution of 50: with 0.1 a rebound has e to 1e-3.
const DAMPING_SHARE: f64 = 50.0 * 0.1;

/// What a closed contact remembers between steps: part of [`crate::State`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    pub key: ContactKey,
    /// v_in of the damping law, m/s: the largest closing speed since the contact closed. In a free collision that is the
    /// speed at which it closed; it is never 0 where the damping has work to do, and a contact at rest that is hit later
    /// answers to the speed of that hit. A contact that merely touched when a collision reached it has the v_in of that
    /// collision ([`Pair::join`]).
    pub approach: f64,
    /// Time since it closed, s.
    pub age: f64,
    /// Elongation of the tangential spring, world vector of A against B, m.
    pub spring: DVec3,
    /// Impulses on A since it closed, N s and N m s.
    pub impulse: DVec3,
    pub moment: DVec3,
}

/// Impulses on A and work over some time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    pub impulse: DVec3,
    pub moment: DVec3,
    /// The normal part of `impulse`; its direction is the mean normal.
    pub normal_impulse: DVec3,
    /// Normal, sliding, rolling, spinning, J.
    pub work: [f64; 4],
}

impl Sum {
    fn add(&mut self, other: &Sum) {
        self.impulse += other.impulse;
        self.moment += other.moment;
        self.normal_impulse += other.normal_impulse;
        for (a, b) in self.work.iter_mut().zip(other.work) {
            *a += b;
        }
    }
}

/// Constants of the damping and friction of a contact law.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairLaw {
    /// chi.
    pub damping: f64,
    pub bounds: Bounds,
    /// Whether there is sliding friction, as a number or as a law of the slip speed.
    pub slides: bool,
    /// Of the tangential spring, share of critical.
    pub damping_ratio: f64,
}

impl PairLaw {
    pub fn all(model: &Model) -> Vec<PairLaw> {
        let o = &model.options;
        let law = |l: &crate::model::ContactLaw| PairLaw {
            damping: laws::damping(o.penalty_law, l.restitution, o.penalty_least_restitution),
            bounds: l.bounds,
            slides: l.bounds.sliding > 0.0 || l.friction_law.is_some(),
            damping_ratio: damping_ratio(l.tangential_restitution),
        };
        model.laws.iter().map(law).collect()
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub a: u32,
    /// A sphere, or plane `b - N`.
    pub b: u32,
    /// Index of its contact law; without one the bodies may come near, not touch.
    pub law: Option<u32>,
    pub values: PairLaw,
    radii: [f64; 2],
    /// r_c, m.
    pub length: f64,
    /// K, N/m^n.
    stiffness: f64,
    /// Inverse masses of the normal, sliding and rolling rows.
    inv_mass: f64,
    inv_mass_sliding: f64,
    inv_inertia: f64,
    /// At the present positions; the normal points from B to A.
    pub gap: f64,
    pub normal: DVec3,
    /// `K d^n`, N.
    pub elastic: f64,
    pub closed: bool,
    pub touch: Touch,
    /// In this step, while it is (or was last) closed, and before.
    now: Sum,
    pub step: Sum,
    /// mu of the last sweep, and whether the contact slipped in it.
    friction: f64,
    slips: bool,
    /// Whether its force pushes in this half of the substep.
    active: bool,
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
        let plane = b >= model.spheres();
        let curvature = 1.0 / ra + if plane { 0.0 } else { 1.0 / rb };
        let inv_mass = bodies.inv_mass[a] + bodies.inv_mass[b];
        let inverse = [bodies.inv_inertia[a], bodies.inv_inertia[b]];
        let mut pair = Pair {
            a: key.0,
            b: key.1,
            law,
            values: law.map_or_else(PairLaw::default, |l| laws[l as usize]),
            radii: [ra, rb],
            length: if plane { ra } else { ra.min(rb) },
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
            active: false,
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
            carom_geom::sphere_sphere(x[a], self.radii[0], *xb, self.radii[1])
        } else {
            let plane = &model.planes[b - x.len()];
            carom_geom::sphere_plane(x[a], self.radii[0], plane.point, plane.normal)
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
        let stretch = self.closed && model.options.penalty_friction == PenaltyFriction::Spring;
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
        let m = &bodies.motion;
        self.normal
            .dot(m[self.b as usize][0] - m[self.a as usize][0])
    }

    /// Acceleration by which loads press the pair together, m/s^2; 0 if they pull it apart.
    #[inline]
    fn pressing(&self, smooth: &[[DVec3; 2]]) -> f64 {
        let (a, b) = (self.a as usize, self.b as usize);
        self.normal.dot(smooth[b][0] - smooth[a][0]).max(0.0)
    }

    /// Tangential velocity of A against B at the contact (eqs. 34, 41), m/s.
    #[inline]
    fn slip(&self, bodies: &Bodies) -> DVec3 {
        let [va, wa] = bodies.motion[self.a as usize];
        let [vb, wb] = bodies.motion[self.b as usize];
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

    /// The longest substep that this pair admits: a share of its contact time once it touches, and before that the time in
    /// which it cannot touch. `shortest` is what others ask for already.
    #[inline]
    pub fn longest_substep(
        &self,
        elastic: &Elastic,
        bodies: &Bodies,
        resolution: f64,
        shortest: f64,
    ) -> f64 {
        let s = self.closing_speed(bodies);
        let (speed, free) = if self.closed {
            (s, 0.0)
        } else {
            // The distance of centres is convex in time for straight motion: gap(t) >= gap - s t - a t^2/2.
            let (a, b) = (self.a as usize, self.b as usize);
            let between = bodies.acceleration[a] - bodies.acceleration[b];
            let accel = if b < bodies.position.len() {
                between.length()
            } else {
                (-self.normal.dot(between)).max(0.0)
            };
            let hit = (s * s + 2.0 * accel * self.gap).sqrt();
            let free = if s > 0.0 {
                2.0 * self.gap / (s + hit)
            } else if accel > 0.0 {
                (hit - s) / accel
            } else {
                f64::INFINITY
            };
            if free >= shortest {
                return free;
            }
            (hit, free)
        };
        // The energy of the collision, which stays the same over an elastic one; a contact at rest has that of its load.
        let mut pressed = self.elastic * -self.gap;
        let load = self.pressing(&bodies.smooth) / self.inv_mass;
        if load > self.elastic {
            pressed = load * elastic.indentation(self.stiffness, load);
        }
        let energy = 0.5 * speed * speed / self.inv_mass + elastic.energy(pressed, 1.0);
        let reference = self.touch.approach.max(speed);
        let damped = if self.closed && reference > 0.0 {
            1.0 + self.values.damping * speed.max(0.0) / reference
        } else {
            1.0 + self.values.damping
        };
        let v = (2.0 * energy * self.inv_mass).sqrt();
        let time = elastic.contact_time(self.stiffness, self.inv_mass, v, damped);
        let mut contact = time / resolution;
        // A damping that outruns the motion has a time of its own; not where the load holds the contact at rest.
        if self.closed && self.elastic > 2.0 * load && reference > 0.0 {
            let rate = self.values.damping * self.elastic * self.inv_mass / reference;
            let share = (self.values.damping * speed.abs() / reference).min(1.0);
            contact = contact.min(DAMPING_SHARE / (resolution * rate * share));
        }
        free.max(contact)
    }

    /// Whether the force pushes at the closing speed `s`: faster apart than `v_in/chi` it would pull, and is 0 instead.
    #[inline]
    fn pushes(&self, s: f64) -> bool {
        self.values.damping == 0.0 || s > -self.touch.approach / self.values.damping
    }

    /// The first half of a substep before the kick: the force at the speed of the substep's start.
    #[inline]
    pub fn dissipate_before(
        &mut self,
        bodies: &mut Bodies,
        model: &Model,
        elastic: &Elastic,
        tau: f64,
    ) {
        let s = self.closing_speed(bodies);
        self.touch.approach = self.touch.approach.max(s);
        self.active = self.pushes(s);
        if !self.active {
            self.touch.spring = DVec3::ZERO;
        } else {
            let normal = self.elastic * tau + self.damp(bodies, s, tau);
            self.rub(bodies, model, elastic, normal, tau);
            self.resist_turning(bodies, &model.options, normal);
        }
    }

    /// Half a kick: the elastic impulse over `tau`.
    #[inline]
    pub fn push(&mut self, bodies: &mut Bodies, tau: f64) {
        if self.active {
            let s = self.closing_speed(bodies);
            self.apply_normal(bodies, self.elastic * tau, s);
        }
    }

    /// Half a kick after the drift, from whose speed it follows whether the force pushes.
    #[inline]
    pub fn push_after(&mut self, bodies: &mut Bodies, tau: f64) {
        self.active = self.pushes(self.closing_speed(bodies));
        self.push(bodies, tau);
    }

    /// The mirror image of [`Pair::dissipate_before`].
    #[inline]
    pub fn dissipate_after(
        &mut self,
        bodies: &mut Bodies,
        model: &Model,
        elastic: &Elastic,
        tau: f64,
    ) {
        let s = self.closing_speed(bodies);
        self.touch.approach = self.touch.approach.max(s);
        if !self.active {
            self.touch.spring = DVec3::ZERO;
        } else {
            let normal = self.elastic * tau + self.damp(bodies, s, tau);
            self.resist_turning(bodies, &model.options, normal);
            self.rub(bodies, model, elastic, normal, tau);
        }
    }

    /// Damping over `tau`, the flow of `s' = -D chi F s/v_in`. Returns its impulse, N s.
    #[inline]
    fn damp(&mut self, bodies: &mut Bodies, s: f64, tau: f64) -> f64 {
        if self.values.damping == 0.0 || self.touch.approach == 0.0 {
            return 0.0;
        }
        let rate = self.values.damping * self.elastic * self.inv_mass / self.touch.approach;
        let impulse = -s * (-rate * tau).exp_m1() / self.inv_mass;
        self.apply_normal(bodies, impulse, s);
        impulse
    }

    #[inline]
    fn apply_normal(&mut self, bodies: &mut Bodies, impulse: f64, closing: f64) {
        let vector = impulse * self.normal;
        let (a, b) = (self.a as usize, self.b as usize);
        bodies.motion[a][0] += bodies.inv_mass[a] * vector;
        bodies.motion[b][0] -= bodies.inv_mass[b] * vector;
        self.now.impulse += vector;
        self.now.normal_impulse += vector;
        self.now.work[0] += impulse * (0.5 * impulse * self.inv_mass - closing);
    }

    /// Sliding friction under the normal impulse `normal`, with mu at the slip of this substep.
    fn rub(
        &mut self,
        bodies: &mut Bodies,
        model: &Model,
        elastic: &Elastic,
        normal: f64,
        tau: f64,
    ) {
        let (true, Some(law)) = (self.values.slides, self.law) else {
            return;
        };
        let slip = self.slip(bodies);
        self.friction = model.laws[law as usize].friction(slip.length());
        let bound = self.friction * normal;
        if bound <= 0.0 {
            self.touch.spring = DVec3::ZERO;
            return;
        }
        let o = &model.options;
        let impulse = match o.penalty_friction {
            PenaltyFriction::Regularised => {
                let speed = slip.length();
                if speed == 0.0 {
                    return;
                }
                let drop = bound * self.inv_mass_sliding;
                let slowed = slowed(speed, drop, o.penalty_slip_speed);
                self.slips = speed - slowed > 0.9 * drop;
                slip * ((slowed - speed) / (speed * self.inv_mass_sliding))
            }
            PenaltyFriction::Spring => {
                let slope = elastic.slope(self.elastic, -self.gap);
                let spring = Spring {
                    stiffness: elastic.tangential_ratio * slope,
                    damping_ratio: self.values.damping_ratio,
                    inv_mass: self.inv_mass_sliding,
                };
                let (impulse, slips) = spring.impulse(&mut self.touch.spring, slip, bound, tau);
                self.slips = slips;
                impulse
            }
        };
        let (a, b) = (self.a as usize, self.b as usize);
        let turn = self.normal.cross(impulse);
        bodies.motion[a][0] += bodies.inv_mass[a] * impulse;
        bodies.motion[b][0] -= bodies.inv_mass[b] * impulse;
        bodies.motion[a][1] -= (bodies.inv_inertia[a] * self.radii[0]) * turn;
        bodies.motion[b][1] -= (bodies.inv_inertia[b] * self.radii[1]) * turn;
        self.now.impulse += impulse;
        self.now.work[1] += impulse.dot(slip + 0.5 * self.inv_mass_sliding * impulse);
    }

    /// Rolling and spinning friction under the normal impulse `normal`, regularised at the angular speed `v_s/r_c`.
    fn resist_turning(&mut self, bodies: &mut Bodies, o: &Options, normal: f64) {
        let Bounds {
            rolling, spinning, ..
        } = self.values.bounds;
        if (rolling <= 0.0 && spinning <= 0.0) || normal <= 0.0 {
            return;
        }
        let (rolling, spinning) = (rolling * normal, spinning * normal);
        let scale = o.penalty_slip_speed / self.length;
        let (a, b) = (self.a as usize, self.b as usize);
        let w = bodies.motion[a][1] - bodies.motion[b][1];
        let spin = self.normal.dot(w) * self.normal;
        for (kind, rate, bound) in [(2, w - spin, rolling), (3, spin, spinning)] {
            let speed = rate.length();
            if bound == 0.0 || speed == 0.0 {
                continue;
            }
            let slowed = slowed(speed, bound * self.inv_inertia, scale);
            let moment = rate * ((slowed - speed) / (speed * self.inv_inertia));
            bodies.motion[a][1] += bodies.inv_inertia[a] * moment;
            bodies.motion[b][1] -= bodies.inv_inertia[b] * moment;
            self.now.moment += moment;
            self.now.work[kind] += moment.dot(rate + 0.5 * self.inv_inertia * moment);
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
