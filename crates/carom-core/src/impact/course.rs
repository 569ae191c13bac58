//! Impulses of an impact that takes a time, kept over that time.

use crate::outcome::ImpulseCurve;

/// Points that are kept, at most twice this. Fewer: curves of chains of twenty balls show corners.
const POINTS: usize = 256;

/// What an observer of an impact keeps: every `stride`-th step, and when each contact began.
#[derive(Debug, Default)]
pub struct Courses {
    wanted: bool,
    steps: usize,
    stride: usize,
    time: f64,
    times: Vec<f64>,
    impulses: Vec<Vec<f64>>,
    begun: Vec<Option<f64>>,
}

impl Courses {
    pub fn new(wanted: bool) -> Courses {
        Courses {
            wanted,
            stride: 1,
            ..Courses::default()
        }
    }

    /// Takes the normal impulses of the contacts after a step of `dt`.
    pub fn add(&mut self, dt: f64, impulses: impl Iterator<Item = f64>) {
        if !self.wanted {
            return;
        }
        let before = self.time;
        self.time += dt;
        self.steps += 1;
        let impulses: Vec<f64> = impulses.collect();
        self.begun.resize(impulses.len(), None);
        for (begun, &impulse) in self.begun.iter_mut().zip(&impulses) {
            if impulse > 0.0 {
                begun.get_or_insert(before);
            }
        }
        if self.steps % self.stride != 0 {
            return;
        }
        self.times.push(self.time);
        self.impulses.push(impulses);
        if self.times.len() > 2 * POINTS {
            self.stride *= 2;
            let mut kept = (0..).map(|k| k % 2 == 1);
            self.times.retain(|_| kept.next() == Some(true));
            let mut kept = (0..).map(|k| k % 2 == 1);
            self.impulses.retain(|_| kept.next() == Some(true));
        }
    }

    /// The course of each contact that had an impulse, with its number: from its begin on, in shares of the whole time.
    pub fn of_contacts(&self) -> impl Iterator<Item = (usize, ImpulseCurve)> + '_ {
        let begun = self.begun.iter().enumerate();
        let begun = begun.filter_map(|(i, begun)| Some((i, (*begun)?)));
        begun.map(|(i, begun)| {
            let later = self.times.iter().zip(&self.impulses);
            let later = later.filter(|(&t, _)| t > begun).map(|(t, p)| [*t, p[i]]);
            let points = std::iter::once([begun, 0.0]).chain(later);
            (i, points.map(|[t, p]| [t / self.time, p]).collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn courses_begin_where_contacts_do_and_are_thinned() {
        let mut courses = Courses::new(true);
        for k in 0..5000 {
            courses.add(
                0.5,
                [f64::from(k + 1), f64::from((k - 999).max(0))].into_iter(),
            );
        }
        let found: Vec<_> = courses.of_contacts().collect();
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].1[0], [0.0, 0.0]);
        assert_eq!(found[1].1[0], [0.2, 0.0]);
        for (_, course) in &found {
            assert!((100..=2 * POINTS + 1).contains(&course.len()));
            assert!(course
                .windows(2)
                .all(|w| w[0][0] < w[1][0] && w[0][1] <= w[1][1]));
        }
        assert!((found[0].1.iter()).all(|[t, p]| (p - 5000.0 * t).abs() < 1e-9));
    }

    #[test]
    fn nothing_is_kept_unless_wanted() {
        let mut courses = Courses::default();
        courses.add(1.0, [1.0].into_iter());
        assert_eq!(courses.of_contacts().count(), 0);
    }
}
