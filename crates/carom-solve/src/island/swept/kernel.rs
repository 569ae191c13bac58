//! One sweep over rows: some contacts that share no node at a time, one row or disc after the other.

use crate::spheres::lanes::{Column, GROUP};
use crate::spheres::vectors::{add, dot, larger, part, parts, scale, V3};
use crate::spheres::{Lanes, State, Work};

/// A row of each contact of a group.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Row {
    /// Over velocity and angular velocity of node a, and of node b.
    pub jac: [[Column; 3]; 4],
    /// Measures without multipliers.
    pub free: Column,
    /// Multipliers, and between sweeps those after the sweep before the last one.
    pub lambda: Column,
    pub last: Column,
    /// Its diagonal of `W`.
    pub weight: Column,
}

/// A disc of each contact of a group: two rows, the second empty where there is one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DiscRows {
    pub rows: [Row; 2],
    /// `1/w`, and the radius over the normal multiplier.
    pub step: Column,
    pub bound: Column,
}

/// Contacts that share no node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Group {
    /// Their numbers, [`crate::spheres::lanes::EMPTY`] in lanes without, and their nodes among the states, 0 for the world.
    pub ids: [u32; GROUP],
    pub nodes: [[u32; GROUP]; 2],
    /// Inverse mass and inertia of node a, and of node b.
    pub inverse: [Column; 4],
    pub normal: Row,
    /// Of the normal row: `1/w`, and the least multiplier.
    pub step: Column,
    pub least: Column,
}

/// A sweep over all groups.
pub(super) struct Sweep<'a> {
    pub groups: &'a mut [Group],
    pub discs: &'a mut [DiscRows],
    pub each: usize,
    pub states: &'a mut [State],
    pub beta: f64,
}

/// Velocities of both nodes of some contacts, and the inverse masses to them.
struct Nodes<S: Lanes> {
    u: [V3<S>; 4],
    inverse: [S::f64s; 4],
}

impl Work for Sweep<'_> {
    type Output = [f64; 2];

    /// What it changes, and what there is then, in the square over the masses.
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) -> [f64; 2] {
        let mut sums = [[0.0; GROUP]; 2];
        let beta = s.splat_f64s(self.beta);
        for (k, group) in self.groups.iter_mut().enumerate() {
            let discs = &mut self.discs[self.each * k..][..self.each];
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let mut nodes = gather(s, self.states, group, at);
                let [r, z] = group.normal.state(s, &nodes, beta, at);
                let r_n = s.sub_f64s(r, s.mul_f64s(part::<S>(&group.step, at), z));
                let r_n = larger(s, r_n, part::<S>(&group.least, at));
                group.normal.take(s, &mut nodes, [r, r_n], at, &mut sums);
                for disc in discs.iter_mut() {
                    let step = part::<S>(&disc.step, at);
                    let radius = s.mul_f64s(part::<S>(&disc.bound, at), r_n);
                    let [one, two] = &mut disc.rows;
                    let states = [
                        one.state(s, &nodes, beta, at),
                        two.state(s, &nodes, beta, at),
                    ];
                    let [x, y] = states.map(
                        #[inline(always)]
                        |[r, z]| s.sub_f64s(r, s.mul_f64s(step, z)),
                    );
                    let squared = s.add_f64s(s.mul_f64s(x, x), s.mul_f64s(y, y));
                    let outside = s.greater_than_f64s(squared, s.mul_f64s(radius, radius));
                    let share = s.div_f64s(radius, s.sqrt_f64s(squared));
                    let share = s.select_f64s(outside, share, s.splat_f64s(1.0));
                    for ((row, [r, _]), new) in disc.rows.iter_mut().zip(states).zip([x, y]) {
                        let new = s.mul_f64s(share, new);
                        row.take(s, &mut nodes, [r, new], at, &mut sums);
                    }
                }
                scatter(s, self.states, group, nodes.u, at);
            }
        }
        sums.map(|sum| sum.iter().sum())
    }
}

impl Row {
    /// Multipliers of the lanes from `at` a step further on their way, and measures.
    #[inline(always)]
    fn state<S: Lanes>(
        &mut self,
        s: S,
        nodes: &Nodes<S>,
        beta: S::f64s,
        at: usize,
    ) -> [S::f64s; 2] {
        let (lambda, last) = (part::<S>(&self.lambda, at), part::<S>(&self.last, at));
        S::as_mut_simd_f64s(&mut self.last).0[at / S::F64_LANES] = lambda;
        let r = s.add_f64s(lambda, s.mul_f64s(beta, s.sub_f64s(lambda, last)));
        let mut z = part::<S>(&self.free, at);
        for (jac, u) in self.jac.iter().zip(nodes.u) {
            z = s.add_f64s(z, dot(s, parts::<S>(jac, at), u));
        }
        [r, z]
    }

    /// New multipliers in place of others: the nodes follow.
    #[inline(always)]
    fn take<S: Lanes>(
        &mut self,
        s: S,
        nodes: &mut Nodes<S>,
        [r, new]: [S::f64s; 2],
        at: usize,
        sums: &mut [Column; 2],
    ) {
        S::as_mut_simd_f64s(&mut self.lambda).0[at / S::F64_LANES] = new;
        let (change, weight) = (s.sub_f64s(new, r), part::<S>(&self.weight, at));
        for (sum, x) in sums.iter_mut().zip([change, new]) {
            let sum = &mut S::as_mut_simd_f64s(sum).0[at / S::F64_LANES];
            *sum = s.add_f64s(*sum, s.mul_f64s(weight, s.mul_f64s(x, x)));
        }
        let halves = nodes.u.iter_mut().zip(nodes.inverse);
        for ((u, inverse), jac) in halves.zip(&self.jac) {
            let push = scale(s, s.mul_f64s(inverse, change), parts::<S>(jac, at));
            *u = add(s, *u, push);
        }
    }
}

#[inline(always)]
fn gather<S: Lanes>(s: S, states: &[State], group: &Group, at: usize) -> Nodes<S> {
    let [a, b] = group.nodes;
    let linear = |nodes: [u32; GROUP]| {
        s.columns(
            #[inline(always)]
            |l| s.row(&states[nodes[at + l] as usize].linear),
        )
    };
    let angular = |nodes: [u32; GROUP]| {
        s.columns(
            #[inline(always)]
            |l| s.row(&states[nodes[at + l] as usize].surface),
        )
    };
    Nodes {
        u: [linear(a), angular(a), linear(b), angular(b)],
        inverse: [0, 1, 2, 3].map(
            #[inline(always)]
            |half: usize| part::<S>(&group.inverse[half], at),
        ),
    }
}

/// Velocities back to their nodes. What the world gets is 0.
#[inline(always)]
fn scatter<S: Lanes>(s: S, states: &mut [State], group: &Group, u: [V3<S>; 4], at: usize) {
    let [va, wa, vb, wb] = u;
    for (nodes, v, w) in [(&group.nodes[0], va, wa), (&group.nodes[1], vb, wb)] {
        s.rows(
            v,
            w,
            #[inline(always)]
            |l, v, w| {
                let state = &mut states[nodes[at + l] as usize];
                let inverse = [state.linear[3], state.surface[3]];
                (state.linear, state.surface) = (s.numbers(v), s.numbers(w));
                (state.linear[3], state.surface[3]) = (inverse[0], inverse[1]);
            },
        );
    }
}
