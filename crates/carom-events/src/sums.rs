//! What contacts gave in a step: impulses of impacts, and of surfaces that carry balls.

use crate::motion::{Motion, Passage, Support};
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

/// What a surface gave a ball: along the normal, all of it, and the moment about the contact.
pub struct Given {
    pub along: DVec3,
    pub impulse: DVec3,
    pub moment: DVec3,
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

    /// A share of what others have summed later, that was given evenly.
    pub fn join(&mut self, later: &Sums, share: f64) {
        for (&key, of) in &later.of {
            let sum = self.of.entry(key).or_default();
            (sum.law, sum.normal, sum.status) = (of.law, of.normal, of.status);
            sum.along += share * of.along;
            sum.impulse += share * of.impulse;
            sum.moment += share * of.moment;
            sum.position.impulse += share * of.position.impulse;
            sum.position.moment += share * of.position.moment;
            for (sum, part) in sum.work.iter_mut().zip(of.work) {
                *sum += share * part;
            }
        }
    }

    /// What the surface under ball `i` gave it in a passage of `dt` seconds.
    pub fn add_support(
        &mut self,
        model: &Model,
        i: usize,
        motion: &Motion,
        support: &Support,
        (dt, passage): (f64, &Passage),
    ) -> Given {
        let (n, r, m) = (support.normal, model.radius[i], model.mass[i]);
        let load = m * support.g;
        let along = load * dt * n;
        let bounds = model.laws[support.law as usize].bounds;
        let [dv, dw] = passage.changes;
        let friction = m * dv;
        let rest = model.inertia[i] * dw + r * n.cross(friction);
        // What is not there is not left to rounding.
        let about = n * n.dot(rest);
        let moment = [(rest - about, bounds.rolling), (about, bounds.spinning)]
            .into_iter()
            .filter(|(_, bound)| *bound > 0.0)
            .map(|(part, _)| part)
            .sum::<DVec3>();
        let sum = self.of.entry((i as u32, support.wall)).or_default();
        (sum.law, sum.normal) = (support.law, n);
        let slides = motion.mode == Mode::Slide;
        sum.status = if slides { Status::Slip } else { Status::Stick };
        sum.along += along;
        sum.impulse += along + friction;
        sum.moment += moment;
        // Forces that keep their size act against slip, turning and spin.
        let [slipped, rolled, spun] = passage.ways;
        if slides {
            sum.work[1] -= bounds.sliding * load * slipped;
        }
        sum.work[2] -= bounds.rolling * load * rolled;
        sum.work[3] -= bounds.spinning * load * spun;
        Given {
            along,
            impulse: along + friction,
            moment,
        }
    }

    /// A ball that hardly leaves its surface, or comes to it, has gone on along it: the impulse that takes, and the work of its friction.
    pub fn add_rest(&mut self, i: usize, support: &Support, impulse: DVec3, work: f64) {
        let sum = self.of.entry((i as u32, support.wall)).or_default();
        (sum.law, sum.normal) = (support.law, support.normal);
        sum.along += impulse.dot(support.normal) * support.normal;
        sum.impulse += impulse;
        sum.work[1] += work;
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
                None => carom_geom::sphere_sphere(
                    state.position[i],
                    model.radius[i],
                    state.position[j],
                    model.radius[j],
                ),
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
                gap: met.gap,
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
