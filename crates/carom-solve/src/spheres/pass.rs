//! One pass over the groups of a block, and `u` of their impulses.

use super::bodies::{Bodies, ContactLanes, One, State, Two};
use super::carry::Along;
use super::groups::{least, ContactBlock};
use super::kernel::{sweep_group, Push};
use super::lanes::{Column, Instructions, Lanes, Work};
use super::moments::{self, sweep_moments};
use super::rolls::Rolls;

/// Groups between one that is swept and one whose bodies memory is asked for: what lies beyond the cache comes while others are
/// solved. (Of 2 and 6; piles of 10^5 are swept a tenth faster than without.)
const AHEAD: usize = 2;

/// The same for the groups' own numbers. They lie in order, but the processor sees that only after some lines, and anew on each
/// page of four groups. (Of 4, 8 and 16; with `benches/sweeps.rs`
/// 10^6 balls are swept a third faster than without, 10^5 by two threads a tenth, 1000 as fast.)
const FAR: usize = 8;

/// The groups in order, the moments of each after its forces where something rolls.
struct Pass<'a, B> {
    bodies: B,
    groups: &'a mut [ContactLanes],
    /// As many, or none.
    rolls: &'a mut [Rolls],
    /// As many, or none.
    least: &'a [Column],
    carry: Along,
}

impl<B: Bodies> Work for Pass<'_, B> {
    type Output = Along;

    #[inline(always)]
    fn run<S: Lanes>(mut self, simd: S) -> Along {
        if self.rolls.is_empty() {
            for k in 0..self.groups.len() {
                if let Some(next) = self.groups.get(k + FAR) {
                    next.fetch();
                    Along::fetch(next);
                }
                if let Some(next) = self.groups.get(k + AHEAD) {
                    self.bodies.fetch(next);
                }
                let group = &mut self.groups[k];
                let least = least(self.least, k);
                sweep_group(simd, &mut self.carry, &mut self.bodies, group, least);
            }
            return self.carry;
        }
        for (k, (group, rolls)) in self.groups.iter_mut().zip(self.rolls).enumerate() {
            let least = least(self.least, k);
            sweep_group(simd, &mut self.carry, &mut self.bodies, group, least);
            if rolls.any {
                sweep_moments(simd, &mut self.carry, &mut self.bodies, group, rolls);
            }
        }
        self.carry
    }
}

/// One pass over the groups of a block.
pub(super) fn pass(
    instructions: Instructions,
    block: &mut ContactBlock,
    left: &mut [State],
    right: Option<&mut [State]>,
    carry: Along,
) -> Along {
    let ContactBlock {
        groups,
        rolls,
        least,
        ..
    } = block;
    match right {
        None => instructions.run(Pass {
            bodies: One(left),
            groups,
            rolls,
            least,
            carry,
        }),
        Some(right) => instructions.run(Pass {
            bodies: Two(left, right),
            groups,
            rolls,
            least,
            carry,
        }),
    }
}

/// Adds `M^-1 G^T r` of a block to its bodies.
pub(super) fn push(
    instructions: Instructions,
    block: &ContactBlock,
    left: &mut [State],
    mut right: Option<&mut [State]>,
) {
    let groups = &block.groups[..];
    match right.as_deref_mut() {
        None => instructions.run(Push {
            bodies: One(left),
            groups,
        }),
        Some(right) => instructions.run(Push {
            bodies: Two(left, right),
            groups,
        }),
    }
    moments::push(block, left, right);
}
