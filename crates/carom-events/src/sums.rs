//! What contacts gave in a step: impulses of impacts, and of surfaces that carry balls.

use crate::motion::{Motion, Support};
use carom_core::contact::{Contact, ContactKey, WorldImpulse};
use carom_core::transition::Mode;
use carom_core::{Model, State};
use carom_solve::Status;
use glam::DVec3;
use std::collections::BTreeMap;

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    law: u32,
    normal: DVec3,
    status: Status,
    /// The parts of the impulses along the normals; all of them; moments.
    along: DVec3,
    impulse: DVec3,
    moment: DVec3,
    /// Of steps that took over: the corrections of positions, kg m and kg m^2.
    position: WorldImpulse,
    work: [f64; 4],
}

#[derive(Clone, Debug, Default)]
pub struct Sums {
    of: BTreeMap<ContactKey, Sum>,
}

impl Sums {
    pub fn clear(&mut self) {
        self.of.clear();
    }

    /// The contacts of an impact, or of a step.
    pub fn add(&mut self, contacts: &[Contact]) {
        let acts = |c: &&Contact| c.lambda != [0.0; 6] || c.nu != [0.0; 6];
        for c in contacts.iter().filter(acts) {
            let (world, along) = c.impulse();
            let position = c.to_world(c.n1, &c.nu);
            let sum = self.of.entry((c.a, c.b)).or_default();
            (sum.law, sum.normal, sum.status) = (c.law, c.n1, c.status);
            sum.along += along;
            sum.impulse += world.impulse;
            sum.moment += world.moment;
            sum.position.impulse += position.impulse;
            sum.position.moment += position.moment;
            for (sum, part) in sum.work.iter_mut().zip(c.work) {
                *sum += part;
            }
        }
    }

    /// What the surface under ball `i` gave it from the start of its motion to `t`: the impulse, and the moment about the contact.
    pub fn add_support(
        &mut self,
        model: &Model,
        i: usize,
        motion: &Motion,
        t: f64,
    ) -> WorldImpulse {
        let (Some(support), dt) = (motion.support, t - motion.start) else {
            return WorldImpulse::default();
        };
        let (n, r, m) = (support.normal, model.radius[i], model.mass[i]);
        let along = m * support.g * dt * n;
        let bounds = model.laws[support.law as usize].bounds;
        let [dv, dw] = motion.changes(dt);
        let friction = m * dv;
        let rest = model.inertia[i] * dw + r * n.cross(friction);
        // What is not there is not left to rounding.
        let about = n * n.dot(rest);
        let moment = [(rest - about, bounds.rolling), (about, bounds.spinning)]
            .into_iter()
            .filter(|(_, bound)| *bound > 0.0)
            .map(|(part, _)| part)
            .sum::<DVec3>();
        // Forces that keep their size act against slip and turning: of the means of these by Simpson's rule, exact where they change evenly.
        let rates = |t: f64| {
            let [v, w] = motion.velocities(t);
            let spin = n.dot(w);
            [
                (v + r * n.cross(w)).length(),
                (w - spin * n).length(),
                spin.abs(),
            ]
        };
        let [first, middle, last] = [motion.start, motion.start + 0.5 * dt, t].map(rates);
        let mean = |k: usize| (first[k] + 4.0 * middle[k] + last[k]) / 6.0;
        let load = m * support.g * dt;
        let sum = self.of.entry((i as u32, support.wall)).or_default();
        (sum.law, sum.normal) = (support.law, n);
        sum.status = if motion.mode == Mode::Slide {
            Status::Slip
        } else {
            Status::Stick
        };
        sum.along += along;
        sum.impulse += along + friction;
        sum.moment += moment;
        if motion.mode == Mode::Slide {
            sum.work[1] -= bounds.sliding * load * mean(0);
        }
        sum.work[2] -= bounds.rolling * load * mean(1);
        sum.work[3] -= bounds.spinning * load * mean(2);
        WorldImpulse {
            impulse: along + friction,
            moment,
        }
    }

    /// A ball that hardly leaves its surface, or comes to it, has gone on along it: what that takes.
    pub fn add_rest(&mut self, i: usize, support: &Support, impulse: f64) {
        let sum = self.of.entry((i as u32, support.wall)).or_default();
        (sum.law, sum.normal) = (support.law, support.normal);
        sum.along += impulse * support.normal;
        sum.impulse += impulse * support.normal;
    }

    /// As the contacts of the step, in the frames of their mean normals.
    pub fn hand_over(&self, model: &Model, state: &State, contacts: &mut Vec<Contact>) {
        contacts.clear();
        contacts.extend(self.of.iter().map(|(&(a, b), sum)| {
            let n = sum.along.normalize_or(sum.normal);
            let (t1, t2) = carom_geom::tangent_frame(n);
            let (i, j) = (a as usize, b as usize);
            let met = match model.walls.get(j.wrapping_sub(model.bodies())) {
                Some(wall) => wall.shape.meet(state.position[i], model.radius[i]),
                None => Some(carom_geom::sphere_sphere(
                    state.position[i],
                    model.radius[i],
                    state.position[j],
                    model.radius[j],
                )),
            };
            let mut contact = Contact {
                a,
                b,
                law: sum.law,
                bounds: model.laws[sum.law as usize].bounds,
                n0: n,
                n1: n,
                t1,
                t2,
                gap: met.map_or(0.0, |p| p.gap),
                length: model.radius[i].min(model.radius.get(j).copied().unwrap_or(f64::INFINITY)),
                work: sum.work,
                closed: true,
                status: sum.status,
                ..Contact::default()
            };
            if model.laws[sum.law as usize].friction_law.is_some() {
                // The rows of friction are there, whatever its coefficient was at each impact.
                contact.bounds.sliding = contact.bounds.sliding.max(f64::MIN_POSITIVE);
            }
            let world = WorldImpulse {
                impulse: sum.impulse,
                moment: sum.moment,
            };
            let (mut lambda, mut nu) = ([0.0; 6], [0.0; 6]);
            contact.to_rows(&world, &mut lambda);
            contact.to_rows(&sum.position, &mut nu);
            Contact {
                lambda,
                nu,
                ..contact
            }
        }));
    }
}
