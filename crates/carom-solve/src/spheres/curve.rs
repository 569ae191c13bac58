//! Bodies in the order of a space-filling curve: neighbours in space become neighbours in memory.

use super::{Body, Place};
use crate::team;

/// Key of a body that does not move: after all others.
const FIXED: u64 = u64::MAX;

/// Memory of the sort.
#[derive(Debug, Default)]
pub struct Curve {
    keys: Vec<u64>,
    sorted: Vec<u64>,
    starts: Vec<u32>,
}

impl Curve {
    /// Moving bodies along a Morton curve through the places; in the given order without places.
    pub fn order(
        &mut self,
        bodies: &[Body],
        places: Option<&[Place]>,
        threads: usize,
    ) -> impl ExactSizeIterator<Item = u32> + '_ {
        let name = usize::BITS - bodies.len().leading_zeros();
        self.sorted.clear();
        match places {
            Some(places) => self.sort(bodies, places, name, threads),
            None => {
                let moving = (0u64..).zip(bodies).filter(|(_, b)| !b.is_fixed());
                self.sorted.extend(moving.map(|(body, _)| body));
            }
        }
        let body = move |key: &u64| (key & ((1 << name) - 1)) as u32;
        self.sorted.iter().map(body)
    }

    /// Makes `sorted` of keys that end with the number of their body, in `name` bits.
    fn sort(&mut self, bodies: &[Body], places: &[Place], name: u32, threads: usize) {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for (place, _) in places.iter().zip(bodies).filter(|(_, b)| !b.is_fixed()) {
            for (k, x) in place.iter().enumerate() {
                low[k] = low[k].min(*x);
                high[k] = high[k].max(*x);
            }
        }
        let span = (0..3).fold(0.0f64, |s, k| s.max(high[k] - low[k]));
        // Key and body in one number: as fine a grid as the bits beside the body allow.
        let axis = ((u64::BITS - name) / 3).min(21);
        let cells = ((1u64 << axis) - 1) as f64;
        let scale = if span > 0.0 { cells / span } else { 0.0 };
        self.keys.resize(bodies.len(), FIXED);
        team::fill(threads, &mut self.keys, |body| {
            if bodies[body].is_fixed() {
                return FIXED;
            }
            let cell = |k: usize| spread(((places[body][k] - low[k]) * scale) as u64);
            (cell(0) << 2 | cell(1) << 1 | cell(2)) << name | body as u64
        });
        self.keys.retain(|&key| key != FIXED);
        self.scatter(3 * axis + name);
        // Keys are unique: there is one order, whatever the sort.
        for run in self.starts.windows(2).filter(|run| run[1] > run[0] + 1) {
            self.sorted[run[0] as usize..run[1] as usize].sort_unstable();
        }
    }

    /// Sends keys of so many bits to `sorted` by their leading ones, about as many values as there are keys.
    fn scatter(&mut self, bits: u32) {
        let leading = (self.keys.len() + 1).ilog2().min(bits);
        let of = |key: u64| (key >> (bits - leading)) as usize;
        self.starts.clear();
        self.starts.resize((1 << leading) + 1, 0);
        for &key in &self.keys {
            self.starts[of(key) + 1] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.sorted.resize(self.keys.len(), 0);
        // A run's start moves to its end, which is the start of the next.
        for &key in &self.keys {
            let start = &mut self.starts[of(key)];
            self.sorted[*start as usize] = key;
            *start += 1;
        }
        self.starts.insert(0, 0);
    }
}

/// The lower 21 bits, each followed by two zeros.
fn spread(x: u64) -> u64 {
    let x = x & 0x1f_ffff;
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_the_keys_wherever_bodies_lie() {
        let body = |inv_mass| Body {
            inv_mass,
            inv_inertia: 0.0,
            radius: 1.0,
        };
        let bodies: Vec<Body> = (0..5000)
            .map(|k| body(if k % 7 == 3 { 0.0 } else { 1.0 }))
            .collect();
        // A cube, a line, and all but one in a single place.
        let ways: [&dyn Fn(u64) -> Place; 3] = [
            &|k| [k * 7919 % 1009, k * 104_729 % 997, k * 31 % 991].map(|x| x as f64),
            &|k| [0.0, (k * 7919 % 5003) as f64, 0.0],
            &|k| [if k == 0 { 1.0 } else { 0.0 }; 3],
        ];
        let mut curve = Curve::default();
        for way in ways {
            let places: Vec<Place> = (0..5000).map(way).collect();
            let order: Vec<u32> = curve.order(&bodies, Some(&places), 3).collect();
            let mut sorted: Vec<u64> = curve.keys.clone();
            sorted.sort_unstable();
            assert!(curve.sorted == sorted);
            let moving = (0..5000).filter(|&k| k % 7 != 3);
            let mut all = order.clone();
            all.sort_unstable();
            assert!(all == moving.collect::<Vec<u32>>());
        }
    }
}
