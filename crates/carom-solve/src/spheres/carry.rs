//! What a sweep does beside solving contacts: before, a step further on the way that it came (`accelerate`); after, it sums what it changed.

use super::bodies::{ask, ContactLanes};
use super::goal::Projection;
use super::lanes::{Column, Lanes};
use super::rolls::Rolls;
use super::vectors::{add, dot, larger, part, parts, put, scale, V3};

/// A sweep that first goes on the way it came: `p <- beta (p + d)`, `r <- r + p` with the change `d` of the last sweep.
pub struct Along {
    /// `beta`, and 0 if the group's `p + d` is of another problem, else 1.
    pub beta: f64,
    pub kept: f64,
    pub law: Projection,
    /// Per lane: `|d|^2` over the masses, and the largest `-z_N` that was met.
    pub squared: Column,
    pub closing: Column,
}

impl Along {
    pub fn new([beta, kept]: [f64; 2], law: Projection) -> Along {
        Along {
            beta,
            kept,
            law,
            squared: Default::default(),
            closing: Default::default(),
        }
    }

    /// `beta (p + d)` of `p + d`.
    #[inline(always)]
    fn way<S: Lanes>(&self, s: S, way: V3<S>) -> V3<S> {
        let (beta, kept) = (s.splat_f64s(self.beta), s.splat_f64s(self.kept));
        scale(s, beta, scale(s, kept, way))
    }

    /// Asks memory for what it reads of a group beside what the kernel does.
    #[inline(always)]
    pub fn fetch(group: &ContactLanes) {
        ask(&group.weight);
        for column in &group.way {
            ask(column);
        }
    }

    /// Impulses from which the lanes are solved.
    #[inline(always)]
    pub fn step<S: Lanes>(&mut self, s: S, group: &mut ContactLanes, at: usize) -> V3<S> {
        let p = self.way(s, parts::<S>(&group.way, at));
        put::<S>(&mut group.way, at, p);
        add(s, parts::<S>(&group.impulse, at), p)
    }

    /// Looks at the change, and at the normal measures before it.
    #[inline(always)]
    pub fn note<S: Lanes>(
        &mut self,
        s: S,
        group: &mut ContactLanes,
        at: usize,
        change: V3<S>,
        z_n: S::f64s,
    ) {
        let lane = at / S::F64_LANES;
        let weighted = s.mul_f64s(dot(s, change, change), part::<S>(&group.weight, at));
        let squared = &mut S::as_mut_simd_f64s(&mut self.squared).0[lane];
        *squared = s.add_f64s(*squared, weighted);
        let closing = &mut S::as_mut_simd_f64s(&mut self.closing).0[lane];
        *closing = larger(s, s.sub_f64s(s.splat_f64s(0.0), z_n), *closing);
        let way = add(s, parts::<S>(&group.way, at), change);
        put::<S>(&mut group.way, at, way);
    }

    /// Moments from which the lanes are solved.
    #[inline(always)]
    pub fn step_moments<S: Lanes>(&mut self, s: S, rolls: &mut Rolls, at: usize) -> V3<S> {
        let p = self.way(s, parts::<S>(&rolls.way, at));
        put::<S>(&mut rolls.way, at, p);
        add(s, parts::<S>(&rolls.moment, at), p)
    }

    /// Looks at their change.
    #[inline(always)]
    pub fn note_moments<S: Lanes>(&mut self, s: S, rolls: &mut Rolls, at: usize, change: V3<S>) {
        let weighted = s.mul_f64s(dot(s, change, change), part::<S>(&rolls.weight, at));
        let squared = &mut S::as_mut_simd_f64s(&mut self.squared).0[at / S::F64_LANES];
        *squared = s.add_f64s(*squared, weighted);
        let way = add(s, parts::<S>(&rolls.way, at), change);
        put::<S>(&mut rolls.way, at, way);
    }
}
