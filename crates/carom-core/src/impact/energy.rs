//! Energy (rule R4): Newton's law with friction and unequal restitution can gain energy in multiple impacts, and must not.
//!
//! Between the solution without restitution `r0` and the one with it `r1` the work of `r0 + s (r1 - r0)` is a quadratic in `s`, and both the
//! cones and non-penetration are convex. So the largest `s` without a gain is a root, and what belongs to it is in the cones and closes nothing.
//!
//! A collective impact gives back at most e^2 of what `r0` loses, as one contact does: so the work of `r0` counts e^2 times there.

use carom_solve::clusters::{apart, Forest};
use carom_solve::rows::WORLD;
use glam::DVec3;

/// An impact gains energy if its work exceeds this share (1) of its group's kinetic energy, besides what the residual of the solver does. Too
/// small: rounding counts as a gain, and costs a solve. Too large: at 1e-6 the energy of falling heaps rises fifty times as much in a step.
const ROUNDING: f64 = 1e-10;

/// Share (1) of the solver's tolerance that a residual may explain, of a group's energy. Too small: coarse solves cost another one. Too large: each
/// problem may give as much; without a bound a narrow drop of 11 wedged balls ended at 3600 m/s.
const SHARE: f64 = 1e-2;

/// What a problem does at a contact or joint.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContactWork {
    pub a: u32,
    pub b: u32,
    /// Whether it has an impulse, with or without restitution: then it joins its nodes to a group.
    pub is_pressed: bool,
    /// Work along `r0 + s (r1 - r0)`, coefficients of 1, s and s^2, J.
    pub terms: [f64; 3],
    /// Work that the residual of the solution can explain, J.
    pub explained: f64,
    /// Share of what it loses without restitution that it may give back at most (1).
    pub returned: f64,
    /// Of one without an impulse: normal velocity with `r0`, and what `r1` adds to it at A and at B, m/s.
    pub normal: [f64; 3],
}

impl ContactWork {
    pub fn between(a: u32, b: u32) -> Self {
        Self {
            a,
            b,
            ..Self::default()
        }
    }

    /// Adds a row: its measure before all that is judged, and what `r0` and `r1` add to impulse and measure.
    #[inline]
    pub fn add(&mut self, before: f64, impulse: [f64; 2], change: [f64; 2]) {
        let [i, c] = [impulse, change].map(|[of_0, of_1]| of_1 - of_0);
        let sum = 2.0 * before + change[0];
        self.terms[0] += 0.5 * impulse[0] * sum;
        self.terms[1] += 0.5 * (i * sum + impulse[0] * c);
        self.terms[2] += 0.5 * i * c;
    }

    /// Adds what the law cannot have: a normal impulse where the measure `z` is not 0, friction along it.
    #[inline]
    pub fn explain(&mut self, normal: [f64; 2], friction: f64) {
        self.explained += 0.5 * ((normal[0] * normal[1]).abs() + friction.max(0.0));
    }

    /// The same of vectors, axis by axis.
    pub fn add_vectors(&mut self, before: DVec3, impulse: [DVec3; 2], change: [DVec3; 2]) {
        for axis in 0..3 {
            let at = |v: DVec3| v[axis];
            self.add(at(before), impulse.map(at), change.map(at));
        }
    }

    fn done(&self) -> f64 {
        self.terms.iter().sum()
    }
}

/// Goes from one solution towards another by a share; all the way by the whole, to the bit.
pub(crate) fn mix(from: &mut [f64], to: &[f64], share: f64) {
    for (from, to) in from.iter_mut().zip(to) {
        *from = if share == 1.0 {
            *to
        } else {
            *from + share * (to - *from)
        };
    }
}

/// What is no gain of energy.
#[derive(Clone, Copy, Debug)]
pub enum Admit {
    /// Rounding alone.
    Rounding,
    /// And what the residual explains.
    Explained,
    /// And what the residual explains, up to [`SHARE`] of this tolerance of the solver, of the energy: balls that friction wedges hold one another
    /// with any force, and the residual of that explains anything.
    Tolerance(f64),
    /// The same of a collective impact, which gives back no more than its contacts by themselves would ([`ContactWork::returned`]).
    Returned(f64),
}

/// Restitution scale of each node by its group (contacts with impulse joined by nodes); nothing if no group gains. `kinetic`: energy of each
/// node before, with that of walls as fast as they move, J; asked for only where a contact gains.
pub fn scales(
    works: &[ContactWork],
    admit: Admit,
    kinetic: impl FnOnce() -> Vec<f64>,
) -> Option<Vec<f64>> {
    let pressed = || works.iter().filter(|w| w.is_pressed);
    let is_collective = matches!(admit, Admit::Returned(_));
    if !is_collective && pressed().all(|w| w.done() <= 0.0) {
        return None;
    }
    let kinetic = kinetic();
    let mut joined = apart(kinetic.len());
    for w in pressed().filter(|w| w.b != WORLD) {
        joined.join(w.a, w.b);
    }
    let mut terms = vec![[0.0; 3]; kinetic.len()];
    let (mut explained, mut energy) = (vec![0.0; kinetic.len()], vec![0.0; kinetic.len()]);
    let mut returned = vec![0.0f64; kinetic.len()];
    for w in pressed() {
        let group = joined.root(w.a) as usize;
        returned[group] = returned[group].max(w.returned);
        for (sum, term) in terms[group].iter_mut().zip(w.terms) {
            *sum += term;
        }
        explained[group] += w.explained;
    }
    for (node, kinetic) in (0..).zip(&kinetic) {
        energy[joined.root(node) as usize] += kinetic;
    }
    if is_collective {
        for (terms, share) in terms.iter_mut().zip(returned) {
            terms[0] *= share;
        }
    }
    let mut of_group: Vec<f64> = (terms.iter().zip(explained.iter().zip(&energy)))
        .map(|(terms, (explained, energy))| {
            let of_residual = match admit {
                Admit::Rounding => 0.0,
                Admit::Explained => *explained,
                Admit::Tolerance(tolerance) | Admit::Returned(tolerance) => {
                    explained.min(SHARE * tolerance * energy)
                }
            };
            let admitted = ROUNDING * energy + of_residual;
            match terms.iter().sum::<f64>() > admitted {
                true => largest_without_gain(*terms),
                false => 1.0,
            }
        })
        .collect();
    let nodes = 0..kinetic.len() as u32;
    let any = of_group.iter().any(|&s| s < 1.0);
    any.then(|| {
        keep_apart(works, &mut joined, &mut of_group);
        nodes.map(|n| of_group[joined.root(n) as usize]).collect()
    })
}

/// Groups with different scales may close a contact between them that has no impulse, and nothing would open it: they have the lesser scale, by which
/// neither gains.
fn keep_apart(works: &[ContactWork], joined: &mut [u32], of_group: &mut [f64]) {
    let mut again = true;
    while std::mem::take(&mut again) {
        for w in works.iter().filter(|w| !w.is_pressed && w.b != WORLD) {
            let [a, b] = [w.a, w.b].map(|node| joined.root(node) as usize);
            let ([of_a, of_b], [open, by_a, by_b]) = ([of_group[a], of_group[b]], w.normal);
            let rounding = ROUNDING * (open.abs() + by_a.abs() + by_b.abs());
            if a != b && of_a != of_b && open + of_a * by_a + of_b * by_b < -rounding {
                joined.join(w.a, w.b);
                of_group[joined.root(w.a) as usize] = of_a.min(of_b);
                again = true;
            }
        }
    }
}

/// The largest s in [0, 1] at which `c0 + c1 s + c2 s^2`, convex and above 0 at 1, is not above 0; 0 where it is so even there.
fn largest_without_gain([c0, c1, c2]: [f64; 3]) -> f64 {
    if c0 >= 0.0 {
        return 0.0;
    }
    let root = (c1 * c1 - 4.0 * c0 * c2).max(0.0).sqrt();
    let s = if c1 > 0.0 {
        -2.0 * c0 / (c1 + root)
    } else {
        (root - c1) / (2.0 * c2)
    };
    s.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(a: u32, b: u32, terms: [f64; 3]) -> ContactWork {
        ContactWork {
            is_pressed: true,
            terms,
            ..ContactWork::between(a, b)
        }
    }

    #[test]
    fn gains_are_those_of_groups_and_not_hidden_by_others() {
        let kinetic = || vec![1.0; 4];
        // 0 and 1 lose more than 2 and 3 gain: w(s) = -0.1 + 0.25 s^2 is 0 at sqrt 0.4.
        let works = [
            at(0, 1, [-1.0, 0.0, 0.0]),
            at(2, 3, [-0.1, 0.0, 0.2]),
            at(2, WORLD, [0.0, 0.0, 0.05]),
        ];
        let found = scales(&works, Admit::Explained, kinetic).unwrap();
        assert_eq!(found[..2], [1.0, 1.0]);
        assert!((found[2] - 0.4_f64.sqrt()).abs() < 1e-15 && found[3] == found[2]);
        // Joined by a contact they are one group.
        let joined = [works[0], works[1], works[2], at(1, 2, [0.0; 3])];
        assert!(scales(&joined, Admit::Explained, kinetic).is_none());
        // What the residual explains is no gain.
        let mut explained = works;
        explained[1].explained = 0.2;
        assert!(scales(&explained, Admit::Explained, kinetic).is_none());
        // But only as far as the tolerance goes.
        assert!(scales(&explained, Admit::Tolerance(0.05 / SHARE), kinetic).is_some());
    }

    #[test]
    fn groups_that_would_close_a_contact_between_them_have_the_lesser_share() {
        let kinetic = || vec![1.0; 5];
        let mut between = ContactWork {
            // Open as little as the one side takes of it, of which the other has less.
            normal: [0.0, -1.0, 1.5],
            ..ContactWork::between(1, 2)
        };
        let gains = [
            at(0, 1, [-1.0, 0.0, 0.0]),
            at(2, 3, [-0.1, 0.0, 0.2]),
            at(4, WORLD, [-1.0, 0.0, 0.0]),
        ];
        let with = |between| [gains[0], gains[1], gains[2], between];
        let root = 0.5_f64.sqrt();
        let found = scales(&with(between), Admit::Explained, kinetic).unwrap();
        assert!((found[2] - root).abs() < 1e-15 && found[0] == 1.0 && found[4] == 1.0);
        between.normal[2] = 1.1;
        let found = scales(&with(between), Admit::Explained, kinetic).unwrap();
        assert!(found[..4].iter().all(|s| (s - root).abs() < 1e-15) && found[4] == 1.0);
    }

    #[test]
    fn the_work_of_a_row_is_that_of_its_mean_velocity_and_the_root_has_none() {
        let mut work = ContactWork::between(0, WORLD);
        let (before, impulse, change) = (-1.5, [1.2, 2.9], [1.5, 3.5]);
        work.add(before, impulse, change);
        for s in [0.0, 0.3, 1.0] {
            let mix = |[of_0, of_1]: [f64; 2]| of_0 + s * (of_1 - of_0);
            let exact = mix(impulse) * (before + 0.5 * mix(change));
            let [c0, c1, c2] = work.terms;
            assert!((c0 + s * (c1 + s * c2) - exact).abs() < 1e-15);
        }
        let s = largest_without_gain(work.terms);
        let [c0, c1, c2] = work.terms;
        assert!(0.0 < s && s < 1.0 && (c0 + s * (c1 + s * c2)).abs() < 1e-15);
        assert_eq!(largest_without_gain([0.1, 0.0, 0.2]), 0.0);
    }
}
