//! Threads that take the tasks of one stage after the other.
//!
//! A stage is over when its tasks are done, not when all threads have arrived: a thread that the machine keeps away holds nothing
//! up but the task it has, and one that comes late joins in. So nothing depends on how many threads there are, and nothing waits for one
//! that has not started. A team within a task is one thread. The threads are those of a pool: to start one costs as much as some hundred sweeps of a thousand contacts.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Spins (1) before a waiting thread offers its core to others. Few, each stage waits for the system; many, other
/// programs wait for us.
const SPINS: u32 = 1 << 14;
/// Bits of the next task in a ticket; the stage is above them.
const TASK_BITS: u32 = 32;
/// No stage has this number: all are over.
const OVER: u64 = u64::MAX >> TASK_BITS;

thread_local! {
    /// Whether this thread is at a task. A team in it would be that thread alone: while it waited for others it might be given a
    /// share in the team that waits for its task.
    static AT_TASK: Cell<bool> = const { Cell::new(false) };
}

/// Stages on their way.
struct StageProgress {
    /// The stage, counted over all rounds, and its next task.
    ticket: AtomicU64,
    /// Tasks of the stage that are done.
    completed: AtomicUsize,
    broken: AtomicBool,
    /// Rounds that were run.
    rounds: AtomicUsize,
}

/// Tells the others when a thread unwinds, so that none waits for ever.
struct Alarm<'a>(&'a StageProgress);

impl Drop for Alarm<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            AT_TASK.set(false);
            self.0.broken.store(true, Ordering::Relaxed);
        }
    }
}

/// What a team does.
struct Plan<'a, W, D> {
    rounds: usize,
    /// First task and number of tasks of the stages that have any.
    stages: &'a [(usize, usize)],
    work: &'a W,
    done: &'a D,
}

impl<W: Fn(usize, usize) + Sync, D: Fn(usize) -> bool + Sync> Plan<'_, W, D> {
    /// Works until all stages are over.
    fn join(&self, progress: &StageProgress) {
        let _alarm = Alarm(progress);
        loop {
            let ticket = progress.ticket.fetch_add(1, Ordering::AcqRel);
            let (stage, task) = (
                ticket >> TASK_BITS,
                (ticket & (u64::MAX >> TASK_BITS)) as usize,
            );
            if stage == OVER {
                return;
            }
            let (first, count) = self.stages[stage as usize % self.stages.len()];
            if task >= count {
                progress.wait(stage);
                continue;
            }
            AT_TASK.set(true);
            (self.work)(stage as usize / self.stages.len(), first + task);
            AT_TASK.set(false);
            if progress.completed.fetch_add(1, Ordering::AcqRel) + 1 == count {
                self.close(progress, stage);
            }
        }
    }

    /// Ends a stage; the one thread that has done its last task does so.
    fn close(&self, progress: &StageProgress, stage: u64) {
        progress.completed.store(0, Ordering::Relaxed);
        let mut next = stage + 1;
        if next % self.stages.len() as u64 == 0 {
            let round = stage as usize / self.stages.len();
            if (self.done)(round) || round + 1 == self.rounds {
                progress.rounds.store(round + 1, Ordering::Relaxed);
                next = OVER;
            }
        }
        progress.ticket.store(next << TASK_BITS, Ordering::Release);
    }
}

impl StageProgress {
    /// Until the stage is another.
    fn wait(&self, stage: u64) {
        let mut spins = 0;
        while self.ticket.load(Ordering::Acquire) >> TASK_BITS == stage {
            assert!(
                !self.broken.load(Ordering::Relaxed),
                "a thread of the team has failed"
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

/// Runs `rounds` times all stages in order, `work(task)` for every task of a stage. Tasks of one stage may run at the same
/// time and in any order; a stage starts when the one before is done. Stage `k` has tasks `stages[k]..stages[k + 1]`.
pub fn run(threads: usize, rounds: usize, stages: &[usize], work: impl Fn(usize) + Sync) {
    run_until(threads, rounds, stages, |_, task| work(task), |_| false);
}

/// [`run`] with `work(round, task)`, until `done(round)` after a round. The rounds that were run.
pub fn run_until(
    threads: usize,
    rounds: usize,
    stages: &[usize],
    work: impl Fn(usize, usize) + Sync,
    done: impl Fn(usize) -> bool + Sync,
) -> usize {
    let widest = stages.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
    let asked = threads;
    let threads = threads.clamp(1, widest.max(1));
    if threads == 1 || AT_TASK.get() || !has_threads(asked) {
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
    if rounds == 0 {
        return 0;
    }
    let stages: Vec<(usize, usize)> = stages
        .windows(2)
        .filter(|w| w[1] > w[0])
        .map(|w| (w[0], w[1] - w[0]))
        .collect();
    let plan = Plan {
        rounds,
        stages: &stages,
        work: &work,
        done: &done,
    };
    let progress = StageProgress {
        ticket: AtomicU64::new(0),
        completed: AtomicUsize::new(0),
        broken: AtomicBool::new(false),
        rounds: AtomicUsize::new(0),
    };
    within(asked, || {
        rayon::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(|_| plan.join(&progress));
            }
            plan.join(&progress);
        });
    });
    progress.rounds.into_inner()
}

/// Runs `work` on a thread of the pool of so many threads: the teams in it start without waking one. On such a thread already, or for one
/// thread, it runs where it is.
pub fn within<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    if threads < 2 || rayon::current_thread_index().is_some() {
        return work();
    }
    match pool(threads) {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Whether a team may have more than one thread: a machine may give none.
fn has_threads(threads: usize) -> bool {
    rayon::current_thread_index().is_some() || pool(threads).is_some()
}

/// The pool of so many threads of this process. A fork has none of the threads of its parent, so it makes its own.
fn pool(threads: usize) -> Option<Arc<ThreadPool>> {
    type Pools = BTreeMap<(u32, usize), Arc<ThreadPool>>;
    static POOLS: OnceLock<Mutex<Pools>> = OnceLock::new();
    let mut pools = lock(POOLS.get_or_init(Mutex::default));
    let key = (std::process::id(), threads);
    if let Some(pool) = pools.get(&key) {
        return Some(pool.clone());
    }
    let name = |k| format!("carom-{k}");
    let built = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(name)
        .build();
    let pool = Arc::new(built.ok()?);
    pools.insert(key, pool.clone());
    Some(pool)
}

/// `work(item)` of every item, in the order of the items.
pub fn map<T: Send, R: Send>(
    threads: usize,
    items: Vec<T>,
    work: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    if threads < 2 || items.len() < 2 {
        return items.into_iter().map(work).collect();
    }
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

/// Items (1) that a thread takes at a time from a list of small ones. Few, threads quarrel about the ticket; many, one works
/// while others wait. Sums over shares follow their order: another value changes results in their last bits.
pub const SHARE: usize = 2_048;

/// Slices, of which several may be cut at the same place.
pub trait Cut: Sized + Send {
    fn cut(self, at: usize) -> (Self, Self);
}

impl<T: Send> Cut for &mut [T] {
    fn cut(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl<T: Sync> Cut for &[T] {
    fn cut(self, at: usize) -> (Self, Self) {
        self.split_at(at)
    }
}

impl Cut for Range<usize> {
    fn cut(self, at: usize) -> (Self, Self) {
        let middle = self.start + at;
        (self.start..middle, middle..self.end)
    }
}

impl<A: Cut, B: Cut> Cut for (A, B) {
    fn cut(self, at: usize) -> (Self, Self) {
        let (a, b) = (self.0.cut(at), self.1.cut(at));
        ((a.0, b.0), (a.1, b.1))
    }
}

impl<A: Cut, B: Cut, C: Cut> Cut for (A, B, C) {
    fn cut(self, at: usize) -> (Self, Self) {
        let (a, b, c) = (self.0.cut(at), self.1.cut(at), self.2.cut(at));
        ((a.0, b.0, c.0), (a.1, b.1, c.1))
    }
}

/// `work(first, share)` of shares of `whole`, which are `count` places, from place `first` on; what they give is joined in their
/// order. Shares do not depend on the threads, and so no result does.
#[inline(always)]
pub fn reduce<S: Cut, R: Send + Default>(
    threads: usize,
    count: usize,
    whole: S,
    work: impl Fn(usize, S) -> R + Sync,
    join: impl Fn(R, R) -> R,
) -> R {
    // Small scenes have no more than one share, and their work where it is asked for.
    if count <= SHARE {
        return work(0, whole);
    }
    in_shares(threads, count, whole, &work, join)
}

#[inline(never)]
fn in_shares<S: Cut, R: Send + Default>(
    threads: usize,
    count: usize,
    whole: S,
    work: &(impl Fn(usize, S) -> R + Sync),
    join: impl Fn(R, R) -> R,
) -> R {
    let mut shares = Vec::with_capacity(count.div_ceil(SHARE));
    let (mut first, mut rest) = (0, whole);
    while count - first > SHARE {
        let (share, behind) = rest.cut(SHARE);
        shares.push((first, share));
        (first, rest) = (first + SHARE, behind);
    }
    shares.push((first, rest));
    let found = map(threads, shares, |(first, share)| work(first, share));
    found.into_iter().reduce(join).unwrap_or_default()
}

/// The larger of the largest so far, which is a number, and of another: `f64::max` asks first whether the largest is one, and takes
/// seven instructions instead of one.
#[inline(always)]
pub fn larger(largest: f64, x: f64) -> f64 {
    if x > largest {
        x
    } else {
        largest
    }
}

/// `value(k)` for every place `k` of `out`.
#[inline(always)]
pub fn fill<T: Send>(threads: usize, out: &mut [T], value: impl Fn(usize) -> T + Sync) {
    let work = |first, share: &mut [T]| {
        for (place, index) in share.iter_mut().zip(first..) {
            *place = value(index);
        }
    };
    reduce(threads, out.len(), out, work, |(), ()| ());
}

/// `work` on every item.
#[inline(always)]
pub fn each<T: Send>(threads: usize, items: &mut [T], work: impl Fn(&mut T) + Sync) {
    let all = |_, share: &mut [T]| {
        for item in share {
            work(item);
        }
    };
    reduce(threads, items.len(), items, all, |(), ()| ());
}

/// A lock that is never waited for: the stages see to that.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
