//! Block Gauss-Seidel: contact after contact, each solved exactly with the others held.

use super::sweep::ConeSweeps;
use super::{ConeSolver, Judge};
use crate::ladder::RELAXATION;

/// Sweeps (1) of a run that is not bounded otherwise.
const MAX_SWEEPS: u32 = 100_000;
/// Sweeps after which the residual is looked at, at first; then every so many, or this share of those done: a look costs two or
/// three sweeps, and is made by one thread.
const LOOK_AFTER: [u32; 3] = [1, 2, 3];
const LOOK_EVERY: u32 = 10;
const LOOK_SHARE: u32 = 10;

/// The next look after so many sweeps.
fn next_look(done: u32) -> u32 {
    let regular = (done + (done / LOOK_SHARE).max(LOOK_EVERY)) / LOOK_EVERY * LOOK_EVERY;
    LOOK_AFTER
        .into_iter()
        .find(|&look| look > done)
        .unwrap_or(regular)
}

/// See the module.
pub struct GaussSeidel {
    /// Factor on the change of every contact.
    pub relaxation: f64,
    y: Vec<f64>,
    /// The problem of this judge, packed: the next run of the same solve needs it again.
    packed: Option<(u64, ConeSweeps)>,
}

impl Default for GaussSeidel {
    fn default() -> Self {
        GaussSeidel {
            relaxation: RELAXATION,
            y: Vec::new(),
            packed: None,
        }
    }
}

impl ConeSolver for GaussSeidel {
    fn name(&self) -> &'static str {
        "gauss-seidel"
    }

    fn run(&mut self, judge: &mut Judge<'_>, max_iterations: u32) -> u32 {
        let (clock, threads) = (judge.clock(), judge.threads());
        self.y.clone_from(&judge.best);
        let mut sweeps = match self.packed.take() {
            Some((solve, sweeps)) if solve == judge.number() => sweeps,
            _ => ConeSweeps::new(&judge.scaled.problem, threads),
        };
        sweeps.relaxation = self.relaxation;
        sweeps.enter(&self.y);
        let max = max_iterations.min(MAX_SWEEPS);
        let mut done = 0;
        while done < max {
            let look = next_look(done).min(max);
            sweeps.sweep(look - done, || clock.late());
            done = look;
            sweeps.leave(&mut self.y);
            let err = judge.see(&self.y);
            if judge.stop() || !err.is_finite() {
                break;
            }
        }
        self.packed = Some((judge.number(), sweeps));
        done
    }
}

#[cfg(test)]
mod tests {
    use super::next_look;

    #[test]
    fn looks_are_frequent_at_first_and_never_late_by_much() {
        let looks: Vec<u32> = std::iter::successors(Some(0), |&done| Some(next_look(done)))
            .take_while(|&done| done < 10_000)
            .collect();
        assert_eq!(looks[..7], [0, 1, 2, 3, 10, 20, 30]);
        for pair in looks.windows(2) {
            assert!(pair[1] > pair[0] && pair[1] - pair[0] <= 10 + pair[0] / 10);
        }
        assert!(looks.len() < 80);
    }
}
