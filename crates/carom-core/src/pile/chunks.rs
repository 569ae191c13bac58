//! Lists of contacts and spheres cut into chunks of a fixed size: threads take them in turn, and sums over them are the same for any
//! number of threads.

use carom_solve::team::{self, SHARE};
use std::ops::Range;

/// A part of an ascending list of places in a slice, with the part of the slice that they are in.
pub(super) struct Chunk<'a, T> {
    /// Where the list has its first one.
    pub first: usize,
    pub list: &'a [u32],
    items: &'a mut [T],
    offset: usize,
}

impl<T> Chunk<'_, T> {
    /// The item that `place`, one of the list, names.
    #[inline]
    pub fn item(&mut self, place: u32) -> &mut T {
        &mut self.items[place as usize - self.offset]
    }
}

/// Cuts `list`, ascending places in `items`.
pub(super) fn cut<'a, T>(list: &'a [u32], mut items: &'a mut [T]) -> Vec<Chunk<'a, T>> {
    let (mut offset, mut chunks) = (0, Vec::with_capacity(list.len().div_ceil(SHARE)));
    for (number, part) in list.chunks(SHARE).enumerate() {
        let first = SHARE * number;
        let next = list.get(first + SHARE);
        let end = next.map_or(offset + items.len(), |&place| place as usize);
        let (own, rest) = items.split_at_mut(end - offset);
        chunks.push(Chunk {
            first,
            list: part,
            items: own,
            offset,
        });
        (items, offset) = (rest, end);
    }
    chunks
}

/// What `work` gives for shares of `0..count`, joined in their order.
pub(super) fn reduce<R: Send + Default>(
    threads: usize,
    count: usize,
    work: impl Fn(Range<usize>) -> R + Sync,
    join: impl Fn(R, R) -> R,
) -> R {
    team::reduce(threads, count, 0..count, |_, range| work(range), join)
}

/// Sum of `value` over `0..count`, share by share.
pub(super) fn sum(threads: usize, count: usize, value: impl Fn(usize) -> f64 + Sync) -> f64 {
    let part = |range: Range<usize>| range.map(&value).sum::<f64>();
    reduce(threads, count, part, |a, b| a + b)
}

/// Whether `test` holds of any of `0..count`.
pub(super) fn any(threads: usize, count: usize, test: impl Fn(usize) -> bool + Sync) -> bool {
    reduce(threads, count, |mut range| range.any(&test), |a, b| a || b)
}

/// Makes `out` as long as `count` and fills it with `value` of every place, whatever it held.
pub(super) fn refill<T: Send + Clone>(
    threads: usize,
    out: &mut Vec<T>,
    count: usize,
    value: impl Fn(usize) -> T + Sync,
) {
    out.truncate(count);
    if out.len() < count {
        out.resize(count, value(0));
    }
    team::fill(threads, out, value);
}

/// `work(place, item)` on every item.
pub(super) fn each<T: Send>(threads: usize, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    let all = |first: usize, share: &mut [T]| {
        for (place, item) in (first..).zip(share) {
            work(place, item);
        }
    };
    team::reduce(threads, items.len(), items, all, |(), ()| ());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_of_the_list_is_in_one_chunk() {
        for (count, every) in [(0, 1), (5, 3), (SHARE, 1), (3 * SHARE + 7, 1), (9000, 2)] {
            let list: Vec<u32> = (0..count as u32).map(|k| every * k + 1).collect();
            let mut items = vec![0u32; every as usize * count + 2];
            let chunks = cut(&list, &mut items);
            team::map(2, chunks, |mut chunk| {
                let list = chunk.list;
                for (k, &place) in (chunk.first..).zip(list) {
                    *chunk.item(place) += 1 + k as u32;
                }
            });
            let mut expected = vec![0; items.len()];
            for (k, &place) in list.iter().enumerate() {
                expected[place as usize] = 1 + k as u32;
            }
            assert_eq!(items, expected);
        }
    }

    #[test]
    fn sums_do_not_depend_on_threads() {
        let value = |k: usize| 1.0 / (k as f64 + 0.1);
        let one = sum(1, 10_000, value);
        for threads in 2..5 {
            assert_eq!(sum(threads, 10_000, value).to_bits(), one.to_bits());
        }
        assert!((one - (0..10_000).map(value).sum::<f64>()).abs() < 1e-12 * one);
        let mut out = vec![7.0; 3];
        refill(2, &mut out, 5000, value);
        assert!(out.iter().enumerate().all(|(k, &x)| x == value(k)));
    }
}
