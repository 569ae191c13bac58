//! Threads that take the tasks of one stage after the other.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Spins before a waiting thread offers its core to others.
const SPINS: u32 = 1 << 12;

/// Meets all threads between stages. Stages last tens of microseconds: a barrier that sleeps would cost as much.
struct Barrier {
    threads: usize,
    arrived: AtomicUsize,
    round: AtomicUsize,
    broken: AtomicBool,
}

impl Barrier {
    fn wait(&self) {
        let round = self.round.load(Ordering::Acquire);
        if self.arrived.fetch_add(1, Ordering::AcqRel) + 1 == self.threads {
            self.arrived.store(0, Ordering::Relaxed);
            self.round.store(round + 1, Ordering::Release);
            return;
        }
        let mut spins = 0;
        while self.round.load(Ordering::Acquire) == round {
            assert!(
                !self.broken.load(Ordering::Relaxed),
                "a thread of the sweep has failed"
            );
            spins += 1;
            if spins < SPINS {
                std::hint::spin_loop();
            } else {
                std::thread::yield_now();
            }
        }
    }
}

/// Tells the others when a thread unwinds, so that none waits for ever.
struct Alarm<'a>(&'a Barrier);

impl Drop for Alarm<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.broken.store(true, Ordering::Relaxed);
        }
    }
}

/// Runs `rounds` times all stages in order, `work(task)` for every task of a stage. Tasks of one stage may run at the same
/// time and in any order; a stage starts when the one before is done. Stage `k` has tasks `stages[k]..stages[k + 1]`.
pub fn run(threads: usize, rounds: usize, stages: &[usize], work: impl Fn(usize) + Sync) {
    run_until(threads, rounds, stages, |_, task| work(task), |_| false);
}

/// [`run`] with `work(round, task)`, until `done(round)` after a round. All threads ask, and must be told the same. The rounds
/// that were run.
pub fn run_until(
    threads: usize,
    rounds: usize,
    stages: &[usize],
    work: impl Fn(usize, usize) + Sync,
    done: impl Fn(usize) -> bool + Sync,
) -> usize {
    let widest = stages.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
    let threads = threads.clamp(1, widest.max(1));
    if threads == 1 {
        for round in 0..rounds {
            for task in stages.first().copied().unwrap_or(0)..stages.last().copied().unwrap_or(0) {
                work(round, task);
            }
            if done(round) {
                return round + 1;
            }
        }
        return rounds;
    }
    // A counter per stage, for two rounds in turn: one is set back while the other counts.
    let counters: Vec<AtomicUsize> = (0..2 * stages.len())
        .map(|k| AtomicUsize::new(stages[k % stages.len()]))
        .collect();
    let barrier = Barrier {
        threads,
        arrived: AtomicUsize::new(0),
        round: AtomicUsize::new(0),
        broken: AtomicBool::new(false),
    };
    let member = || {
        let _alarm = Alarm(&barrier);
        for round in 0..rounds {
            for k in 0..stages.len() - 1 {
                let next = &counters[(round % 2) * stages.len() + k];
                loop {
                    let task = next.fetch_add(1, Ordering::Relaxed);
                    if task >= stages[k + 1] {
                        break;
                    }
                    work(round, task);
                }
                // The other round's counter of this stage is at rest.
                counters[((round + 1) % 2) * stages.len() + k].store(stages[k], Ordering::Relaxed);
                barrier.wait();
            }
            if done(round) {
                return round + 1;
            }
        }
        rounds
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(member);
        }
        member()
    })
}

/// `work(item)` of every item, in the order of the items.
pub fn map<T: Send, R: Send>(
    threads: usize,
    items: Vec<T>,
    work: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    let slots: Vec<Mutex<(Option<T>, Option<R>)>> = items
        .into_iter()
        .map(|item| Mutex::new((Some(item), None)))
        .collect();
    run(threads, 1, &[0, slots.len()], |task| {
        let slot = &mut *lock(&slots[task]);
        slot.1 = slot.0.take().map(&work);
    });
    slots
        .into_iter()
        .filter_map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner).1)
        .collect()
}

/// A lock that is never waited for: the stages see to that.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
