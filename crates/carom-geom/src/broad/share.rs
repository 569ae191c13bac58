//! Work shared by threads: each takes the next piece until none is left.
//!
//! Nothing here decides in which order results stand: callers give every piece its own place for them.

use std::sync::{Mutex, PoisonError};

/// `work(piece)` for every piece, on up to `threads` threads, the calling one among them. They live for this call alone:
/// starting one takes some 20 us, so callers ask for several only where there is more to do than that.
pub(super) fn share<T: Send>(threads: usize, pieces: Vec<T>, work: impl Fn(T) + Sync) {
    let threads = threads.min(pieces.len());
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
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(member);
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

    #[test]
    fn every_piece_is_worked_once() {
        for threads in [1, 2, 5] {
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
        }
    }
}
