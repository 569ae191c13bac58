//! Impulses of the last step, found by key.

use crate::contact::ContactKey;
use crate::state::Warm;

/// Finds keys that are asked for in ascending order: steps that grow from where the last one was.
pub struct Cursor<'a> {
    rest: &'a [Warm],
}

impl<'a> Cursor<'a> {
    /// `warm` sorted by key.
    pub fn new(warm: &'a [Warm]) -> Self {
        Self { rest: warm }
    }

    pub fn find(&mut self, key: ContactKey) -> Option<&'a Warm> {
        let (mut low, mut step) = (0, 1);
        while low + step <= self.rest.len() && self.rest[low + step - 1].key < key {
            low += step;
            step *= 2;
        }
        let high = (low + step).min(self.rest.len());
        low += self.rest[low..high].partition_point(|w| w.key < key);
        self.rest = &self.rest[low..];
        self.rest.first().filter(|w| w.key == key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn ascending_keys_are_found_as_by_any_search() {
        let warm: Vec<Warm> = (0..200u32)
            .filter(|i| i % 3 != 1 && !(50..120).contains(i))
            .map(|i| Warm {
                key: (i / 7, i),
                impulse: DVec3::splat(f64::from(i)),
                moment: DVec3::ZERO,
            })
            .collect();
        for stride in [1, 2, 5, 17, 60] {
            let mut cursor = Cursor::new(&warm);
            for i in (0..230u32).step_by(stride) {
                let key = (i / 7, i);
                let expected = warm.iter().find(|w| w.key == key);
                assert_eq!(cursor.find(key), expected, "{i}");
            }
        }
    }
}
