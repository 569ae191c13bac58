//! Work shared by threads: each takes the next piece until none is left.
//!
//! Nothing here decides in which order results stand: callers give every piece its own place for them.

use std::sync::{Mutex, PoisonError};

/// `work(piece)` for every piece, on up to `threads` threads, the calling one among them: those of the pool of rayon it belongs to. Called
/// from elsewhere, one thread does all; to start others for one search costs as much as a small one.
pub(super) fn share<T: Send>(threads: usize, pieces: Vec<T>, work: impl Fn(T) + Sync) {
    let pool = rayon::current_thread_index().map_or(1, |_| rayon::current_num_threads());
    let threads = threads.min(pieces.len()).min(pool);
    if threads <= 1 {
        pieces.into_iter().for_each(work);
        return;
    }
    let queue = Mutex::new(pieces.into_iter());
    let member = || loop {
        let piece = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
        match piece {
            Some(piece) => work(piece),
            None => break,
        }
    };
    rayon::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|_| member());
        }
        member();
    });
}

/// Cuts `all` into consecutive slices of the given lengths.
pub(super) fn cut<T>(mut all: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    let mut out = Vec::new();
    for length in lengths {
        let (first, rest) = all.split_at_mut(length);
        out.push(first);
        all = rest;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
    use std::time::Instant;

    #[test]
    fn every_piece_is_worked_once_in_a_pool_and_outside() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        let pool = pool.expect("threads");
        for threads in [1, 2, 5] {
            let work = || {
                let mut out = vec![0; 100];
                let pieces: Vec<_> = cut(&mut out, [10, 0, 70, 20].into_iter())
                    .into_iter()
                    .enumerate()
                    .collect();
                share(threads, pieces, |(k, slice)| {
                    for x in slice {
                        *x += k;
                    }
                });
                assert_eq!(out.iter().sum::<usize>(), 140 + 60);
            };
            work();
            pool.install(work);
        }
    }

    /// Two pieces meet only where each has a thread.
    #[test]
    fn threads_of_the_pool_take_part() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        let (here, met) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let work = |()| {
            here.fetch_add(1, Relaxed);
            let begin = Instant::now();
            while here.load(Relaxed) < 2 && begin.elapsed().as_secs() < 20 {
                std::thread::yield_now();
            }
            met.fetch_add(usize::from(begin.elapsed().as_secs() < 20), Relaxed);
        };
        pool.expect("threads")
            .install(|| share(2, vec![(), ()], work));
        assert_eq!(met.into_inner(), 2);
    }
}
