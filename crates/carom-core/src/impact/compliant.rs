//! Impact through Hertz springs in the limit of stiffness. Bodies stay where they are, contacts are springs `F = k d^(3/2)` with Coulomb friction, and the impact lasts until nothing is compressed and
//! nothing closes. Only ratios of the stiffnesses matter, `k` goes with `sqrt(R)` of both curvatures. Energetic restitution: with `v` the
//! normal velocity
//!
//! ```text
//! d' = -v / e^2   while d > 0 and v > 0:  of the work that went in, e^2 comes back,
//! d' = -v         else.
//! ```
//!
//! By `compliant` d may be a gap, of the size of the compressions. By `binary` it is never below 0, and what has opened may close again at once: the
//! law of Liu, Zhao and Brogliato (Proc. R. Soc. A 464, 3193, 2008). They take an impulse as the time, `dP_j/dP_i = F_j/F_i`; `dP = F dt` is the same
//! system, and regular where an impact begins. Half a drift, a kick, half a drift; friction of a kick is implicit, so that what sticks stays.
//! Joints keep what they do before the impact: they are eliminated, and inverse masses are those that they leave.

use super::course::Courses;
use super::law::Law;
use super::reduced::Reduced;
use super::sequence::{end, loads, loads_first, solve_problem, ImpactIsland, Start};
use crate::contact::Contact;
use crate::model::{ContactLaw, Model};
use crate::options::{Impact, Options};
use carom_solve::disc::on_disc;
use carom_solve::rows::{RowContact, RowSystem, NODE_DOF};

/// Steps for each unit `(m/k)^(2/5) v^(-1/5)` of time, of which a free collision takes 3.2. The error goes with its square: at 500 the last of ten
/// balls is right to 1e-6. It goes with the speeds too, so fewer do where those of a contact have died out, down to the second: below, a spring is no
/// spring.
const RESOLUTION: f64 = 500.0;
const LEAST_RESOLUTION: f64 = 30.0;
/// Steps from which on an impact is cut as soon as nothing is compressed, so that no spring keeps energy, and at all. Fewer cut impacts that run through
/// long chains; more cost seconds each.
const MANY_STEPS: usize = 1_000_000;
const MOST_STEPS: usize = 2 * MANY_STEPS;
/// Closing speed over the greatest one at the start (1) from which on a contact is compressed again. At 0 rounding is a collision.
const CLOSING: f64 = 1e-8;
/// Sweeps over the friction of a kick at most, and the change over its normal impulses (1) that ends them. What is left of all kicks may be the second
/// share of all their impulses; beyond that the impact is not solved. (The last kicks are next to nothing, and so is what is left of them.)
const SWEEPS: usize = 100;
const SETTLED: f64 = 1e-11;
const UNSETTLED: f64 = 1e-6;
/// Kicks (1) whose friction has not settled after which what is left of all so far is judged: about those of an impact. More: what will not be solved takes longer.
const MANY_UNSETTLED: usize = 2_000;

/// Share (1) from which on inverse masses of friction differ by direction. At 0 the rounding of those of balls is such a difference.
const UNEVEN: f64 = 1e-9;

/// Loads, then the impact as a whole, then what the loads have closed meanwhile. An impact that was cut goes on by Newton's law.
#[must_use]
pub fn through_springs(island: &mut impl ImpactIsland) -> bool {
    // Where a normal impulse leaves the slip as it is, or nothing rubs, this is Newton's law, which has a closed form.
    if island.slots() == 1 && (island.is_of_balls() || island.contact(0).bounds.sliding == 0.0) {
        return loads_first(island);
    }
    if loads(island).is_none() {
        return false;
    }
    let before = island.report().truncated;
    for (problem, law) in [(1, Law::Springs), (2, Law::Plastic)] {
        if !island.flags(|slot| island.closes(slot)).contains(&true) {
            return true;
        }
        if island.report().truncated > before {
            let later = island.later(Law::Later, problem);
            let ended = end(island, Law::Later, later);
            // However often it was cut, it is one sequence.
            island.report().truncated = before + 1;
            return ended;
        }
        island.choose(|_| true);
        if !solve_problem(island, law, problem, Start::Nothing) {
            return false;
        }
    }
    true
}

/// A contact as a spring.
#[derive(Clone, Copy)]
pub struct ContactSpring<'a> {
    law: &'a ContactLaw,
    /// Of any unit.
    stiffness: f64,
}

/// The spring of a contact.
pub fn spring<'a>(model: &'a Model, c: &Contact) -> ContactSpring<'a> {
    let of_b = match c.meets_wall(model) {
        true => model.wall(c.b).curvature(),
        false => 1.0 / model.radius[c.b as usize],
    };
    let radius = model.radius[c.a as usize];
    // A sphere that fills its hollow wall has no curvature left.
    let curvature = (1.0 / radius + of_b).max(1e-3 / radius);
    ContactSpring {
        law: c.law(model),
        stiffness: c.law(model).stiffness * curvature.sqrt().recip(),
    }
}

/// Impulses of an impact, per row of contacts: `system` has the measures before it, of contacts and then of joints, `springs` what [`spring`] says.
/// And whether it was cut. Nothing: its friction was not solved. What joints answer is left to the caller.
pub fn impulses(
    system: &RowSystem,
    springs: &[ContactSpring],
    o: &Options,
    courses: &mut Courses,
) -> Option<(Vec<f64>, bool)> {
    let contacts = &system.contacts[..springs.len()];
    let reduced = Reduced::new(system, springs.len());
    let speed = (contacts.iter()).fold(0.0, |v, c| f64::max(v, -reduced.free[c.row as usize]));
    let least = CLOSING * speed;
    let mut at = Springs {
        system,
        planes: contacts
            .iter()
            .map(|c| plane(system, &reduced, c))
            .collect(),
        reduced,
        springs,
        keeps_gaps: o.impact != Impact::Binary,
        least,
        exponent: o.impact_exponent,
        u: vec![0.0; NODE_DOF * system.nodes()],
        lambda: vec![0.0; system.rows()],
        depth: vec![0.0; contacts.len()],
        restitution: vec![1.0; contacts.len()],
        top: vec![0.0; contacts.len()],
        given: vec![[0.0; 3]; contacts.len()],
    };
    let ([mut given, mut left], mut unsettled) = ([0.0; 2], 0);
    for k in 0..MOST_STEPS {
        let dt = (0..contacts.len()).fold(f64::INFINITY, |dt, i| dt.min(at.step(i, least)));
        if dt.is_infinite() {
            return (left <= UNSETTLED * given).then_some((at.lambda, false));
        }
        let is_free = at.depth.iter().all(|&d| d <= 0.0);
        if is_free && k > MANY_STEPS {
            break;
        }
        if is_free {
            // Nothing happens before the first gap is closed.
            let closing = (0..contacts.len()).map(|i| (at.depth[i], at.measure(i, 0)));
            let flights = closing.filter(|(_, v)| *v < -least).map(|(d, v)| d / v);
            at.drift(flights.fold(f64::INFINITY, f64::min));
        }
        at.drift(0.5 * dt);
        let of_kick = at.kick(dt);
        given += of_kick[0];
        left += of_kick[1];
        unsettled += usize::from(of_kick[1] > UNSETTLED * of_kick[0]);
        if unsettled > MANY_UNSETTLED && left > UNSETTLED * given {
            return None;
        }
        at.drift(0.5 * dt);
        courses.add(dt, contacts.iter().map(|c| at.lambda[c.row as usize]));
    }
    (left <= UNSETTLED * given).then_some((at.lambda, true))
}

/// Inverse masses of the friction of a contact where its directions differ, as of clumps and by joints; of balls alone they do not.
fn plane(system: &RowSystem, reduced: &Reduced, c: &RowContact) -> Option<[f64; 3]> {
    let of = (c.bounds.sliding > 0.0).then(|| reduced.friction(system, c))?;
    let [xx, xy, yy] = of;
    ((xx - yy).abs().max(xy.abs()) > UNEVEN * xx.max(yy)).then_some(of)
}

struct Springs<'a> {
    system: &'a RowSystem,
    /// What [`plane`] says of each contact.
    planes: Vec<Option<[f64; 3]>>,
    reduced: Reduced,
    springs: &'a [ContactSpring<'a>],
    keeps_gaps: bool,
    /// Speed below which nothing closes, and nothing slips along what joints hold.
    least: f64,
    exponent: f64,
    u: Vec<f64>,
    lambda: Vec<f64>,
    depth: Vec<f64>,
    /// e_N of what was compressed: by the speed that all of its work makes.
    restitution: Vec<f64>,
    /// Square of the largest speed of each contact so far.
    top: Vec<f64>,
    /// Impulses of the kick at hand.
    given: Vec<[f64; 3]>,
}

impl Springs<'_> {
    fn measure(&self, i: usize, r: usize) -> f64 {
        let c = &self.system.contacts[i];
        let row = c.row as usize + r;
        self.reduced.free[row] + self.system.row_velocity(c, row, &self.u)
    }

    /// How long a step a contact admits that is compressed or closes, by the speed that it has, and would have without its spring; others any.
    fn step(&mut self, i: usize, least: f64) -> f64 {
        let (v, d, inverse) = (self.measure(i, 0), self.depth[i], self.inverse(i));
        let squared = v * v + self.squared(i);
        let moves = squared > least * least && (d > 0.0 || v < 0.0) && inverse > 0.0;
        let n = self.exponent + 1.0;
        if !moves {
            return f64::INFINITY;
        }
        self.top[i] = self.top[i].max(squared);
        let resolution = RESOLUTION * (squared / self.top[i]).sqrt().sqrt();
        let unit = inverse.powf(-1.0 / n) * squared.powf((2.0 - n) / (2.0 * n));
        unit / resolution.max(LEAST_RESOLUTION)
    }

    /// `k d^n`.
    fn bent(&self, k: f64, d: f64) -> f64 {
        if self.exponent == 1.5 {
            k * d * d.sqrt()
        } else {
            k * d.powf(self.exponent)
        }
    }

    /// Inverse mass times stiffness.
    fn inverse(&self, i: usize) -> f64 {
        self.reduced.inverse[self.system.contacts[i].row as usize] * self.springs[i].stiffness
    }

    /// Square of the speed that the work of compression makes.
    fn squared(&self, i: usize) -> f64 {
        let d = self.depth[i].max(0.0);
        self.bent(2.0 / (self.exponent + 1.0) * self.inverse(i) * d, d)
    }

    fn drift(&mut self, dt: f64) {
        for (i, spring) in self.springs.iter().enumerate() {
            let (v, d) = (self.measure(i, 0), self.depth[i]);
            if v <= 0.0 || d <= 0.0 {
                self.restitution[i] = spring.law.restitution(self.squared(i).sqrt());
            }
            let e = self.restitution[i];
            // Time that is left when it is no longer compressed.
            let opens = d > 0.0 && v > 0.0;
            let left = if opens { dt - d * e * e / v } else { dt };
            self.depth[i] = match (opens, left >= 0.0) {
                (true, true) => -v * left,
                (true, false) => d - v / (e * e) * dt,
                _ => d - v * dt,
            };
            if !self.keeps_gaps {
                self.depth[i] = self.depth[i].max(0.0);
            }
        }
    }

    fn give(&mut self, i: usize, r: usize, impulse: f64) {
        let c = &self.system.contacts[i];
        let row = c.row as usize + r;
        self.lambda[row] += impulse;
        self.given[i][r] += impulse;
        self.reduced.push(self.system, c, row, impulse, &mut self.u);
    }

    /// Its largest normal impulse, and by how much its friction still changes.
    fn kick(&mut self, dt: f64) -> [f64; 2] {
        let mut most = 0.0;
        for i in 0..self.depth.len() {
            let [before, x, y] = std::mem::take(&mut self.given[i]);
            let d = self.depth[i];
            if d > 0.0 {
                let impulse = self.bent(self.springs[i].stiffness, d) * dt;
                most = f64::max(most, impulse);
                self.give(i, 0, impulse);
                // Friction begins with its share of the last kick.
                if x != 0.0 || y != 0.0 {
                    let share = impulse / before;
                    self.give(i, 1, share * x);
                    self.give(i, 2, share * y);
                }
            }
        }
        let mut change = 0.0;
        for _ in 0..SWEEPS {
            change = (0..self.depth.len()).fold(0.0, |most, i| f64::max(most, self.rub(i)));
            if change <= SETTLED * most {
                break;
            }
        }
        [most, change]
    }

    /// Friction of a contact in the kick at hand, all others given; its change.
    fn rub(&mut self, i: usize) -> f64 {
        let (c, [normal, x, y]) = (&self.system.contacts[i], self.given[i]);
        let most = c.bounds.sliding * normal;
        if most <= 0.0 {
            return 0.0;
        }
        let slip = [1, 2].map(|r| self.measure(i, r));
        let wanted = if let Some(plane @ [xx, xy, yy]) = self.planes[i] {
            let free = [slip[0] - xx * x - xy * y, slip[1] - xy * x - yy * y];
            on_disc(plane, free, most, self.least)
        } else {
            let inverse = &self.reduced.inverse[c.rows()];
            if inverse[1] <= 0.0 {
                return 0.0;
            }
            let wanted = [x - slip[0] / inverse[1], y - slip[1] / inverse[2]];
            let size = wanted[0].hypot(wanted[1]);
            let scale = if size > most { most / size } else { 1.0 };
            wanted.map(|w| scale * w)
        };
        let change = [wanted[0] - x, wanted[1] - y];
        self.give(i, 1, change[0]);
        self.give(i, 2, change[1]);
        change[0].hypot(change[1])
    }
}
