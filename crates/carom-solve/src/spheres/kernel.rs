//! One step of the sweep: the exact solution of one contact, for the contacts of a group at once.
//!
//! With `s = r w` (surface velocity of a ball) the relative velocity at a contact is
//! `z = v_a - v_b + n x (s_a + s_b) + slip`, and its block of `W = G M^-1 G^T` is diagonal: `w_N = 1/m_a + 1/m_b` along `n`,
//! `w_T = w_N + r_a^2/I_a + r_b^2/I_b` across. So the contact problem of one contact has the closed solution
//!
//! ```text
//! r_N+ = max(0, r_N - z_N / w_N)
//! x    = (r - z / w_T) without its part along n
//! r_T+ = x min(1, mu r_N+ / |x|)
//! ```
//!
//! Impulses are vectors of the world: no tangents are needed. Multiplications and additions are never fused and are in
//! the same order on all instruction sets, so all give the same bits.

use super::lanes::{Lanes, Work, GROUP};
use super::Contact;
use prefetch_index::prefetch_index;
use pulp::Simd;

/// Groups between one that is swept and one whose bodies memory is asked for: what lies beyond the cache comes while others are
/// solved. (Of 2 and 6; piles of 10^5 are swept a tenth faster than without.)
const AHEAD: usize = 2;

/// The same for the groups' own numbers. They lie in order, but the processor sees that only after some lines, and anew on each
/// page of four groups. (Of 4, 8 and 16; with `benches/sweeps.rs`
/// 10^6 balls are swept a third faster than without, 10^5 by two threads a tenth, 1000 as fast.)
const FAR: usize = 8;

/// Velocity correction of a body: one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct State {
    /// Velocity, m/s, and `1/m`, 1/kg.
    pub linear: [f64; 4],
    /// Surface velocity `r w`, m/s, and `r^2/I`, 1/kg.
    pub surface: [f64; 4],
}

/// A number of each contact of a group.
pub type Column = [f64; GROUP];

/// Asks memory for a line. (A slice: an array would be copied, and its copy asked for.)
#[inline(always)]
fn ask<T>(column: &[T]) {
    prefetch_index(column, 0);
}

/// Contacts that share no moving body, column by column. A lane without contact has zeros and both bodies 0.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct ContactLanes {
    pub a: [u32; GROUP],
    pub b: [u32; GROUP],
    /// Impulse on `a`, N s.
    pub impulse: [Column; 3],
    /// Unit normal from `b` to `a`.
    pub normal: [Column; 3],
    /// Measures at `u = 0` as a vector, m/s.
    pub slip: [Column; 3],
    pub friction: Column,
    /// `1/w_N` and `1/w_T`, kg.
    pub mass_normal: Column,
    pub mass_tangential: Column,
    /// `w_N`, 1/kg.
    pub weight: Column,
    /// Of accelerated sweeps: the step before the last sweep and the change in it together, N s.
    pub way: [Column; 3],
}

impl ContactLanes {
    /// Sides `a` and `b` of the lanes: numbers within their chunks, and states.
    #[inline]
    pub fn set_bodies(&mut self, numbers: [[u32; 2]; GROUP], states: [[&State; 2]; GROUP]) {
        let linear = states.map(|[a, b]| a.linear[3] + b.linear[3]);
        let surface = states.map(|[a, b]| a.surface[3] + b.surface[3]);
        // The world on both sides: no contact.
        let inverse = |w: f64| if w > 0.0 { 1.0 / w } else { 0.0 };
        self.a = numbers.map(|[a, _]| a);
        self.b = numbers.map(|[_, b]| b);
        self.mass_normal = linear.map(inverse);
        self.weight = linear;
        self.mass_tangential = std::array::from_fn(|lane| inverse(linear[lane] + surface[lane]));
    }

    /// Asks memory for the numbers that every sweep reads.
    #[inline(always)]
    fn fetch(&self) {
        ask(&self.a);
        for k in 0..3 {
            ask(&self.impulse[k]);
            ask(&self.normal[k]);
            ask(&self.slip[k]);
        }
        ask(&self.friction);
        ask(&self.mass_normal);
        ask(&self.mass_tangential);
    }

    /// Numbers of a lane, of the contact with its sides exchanged where asked for.
    pub fn set_contact(&mut self, lane: usize, contact: &Contact, swapped: bool) {
        let sign = if swapped { -1.0 } else { 1.0 };
        for k in 0..3 {
            self.normal[k][lane] = sign * contact.normal[k];
            self.slip[k][lane] = sign * contact.slip[k];
        }
        self.friction[lane] = contact.friction;
    }

    /// The impulse of a lane, on side `a` of its contact.
    pub fn set_impulse(&mut self, lane: usize, impulse: [f64; 3], swapped: bool) {
        let sign = if swapped { -1.0 } else { 1.0 };
        for k in 0..3 {
            self.impulse[k][lane] = sign * impulse[k];
        }
    }
}

/// Where the bodies of a block are read.
pub trait Read {
    fn pair(&self, a: u32, b: u32) -> (&State, &State);
}

/// Where the bodies of a block lie: both sides in one chunk, or one side in each of two.
pub trait Bodies: Read {
    fn a(&mut self) -> &mut [State];
    fn b(&mut self) -> &mut [State];
    /// Asks memory for the bodies of a group that comes soon.
    fn fetch(&self, group: &ContactLanes);
}

pub struct One<'a>(pub &'a mut [State]);
pub struct Two<'a>(pub &'a mut [State], pub &'a mut [State]);
/// To read only: the sides may be the same.
pub struct Both<'a>(pub &'a [State], pub &'a [State]);

impl Read for Both<'_> {
    #[inline(always)]
    fn pair(&self, a: u32, b: u32) -> (&State, &State) {
        (&self.0[a as usize], &self.1[b as usize])
    }
}

impl Read for One<'_> {
    #[inline(always)]
    fn pair(&self, a: u32, b: u32) -> (&State, &State) {
        (&self.0[a as usize], &self.0[b as usize])
    }
}

#[inline(always)]
fn fetch(states: &[State], numbers: &[u32; GROUP]) {
    for &number in numbers {
        prefetch_index(states, number as usize);
    }
}

impl Bodies for One<'_> {
    #[inline(always)]
    fn fetch(&self, group: &ContactLanes) {
        fetch(self.0, &group.a);
        fetch(self.0, &group.b);
    }
    #[inline(always)]
    fn a(&mut self) -> &mut [State] {
        self.0
    }
    #[inline(always)]
    fn b(&mut self) -> &mut [State] {
        self.0
    }
}

impl Read for Two<'_> {
    #[inline(always)]
    fn pair(&self, a: u32, b: u32) -> (&State, &State) {
        (&self.0[a as usize], &self.1[b as usize])
    }
}

impl Bodies for Two<'_> {
    #[inline(always)]
    fn fetch(&self, group: &ContactLanes) {
        fetch(self.0, &group.a);
        fetch(self.1, &group.b);
    }
    #[inline(always)]
    fn a(&mut self) -> &mut [State] {
        self.0
    }
    #[inline(always)]
    fn b(&mut self) -> &mut [State] {
        self.1
    }
}

pub type V3<S> = [<S as Simd>::f64s; 3];

#[inline(always)]
fn map2<S: Lanes>(x: V3<S>, y: V3<S>, f: impl Fn(S::f64s, S::f64s) -> S::f64s) -> V3<S> {
    [f(x[0], y[0]), f(x[1], y[1]), f(x[2], y[2])]
}

#[inline(always)]
pub fn add<S: Lanes>(s: S, x: V3<S>, y: V3<S>) -> V3<S> {
    map2::<S>(
        x,
        y,
        #[inline(always)]
        |a, b| s.add_f64s(a, b),
    )
}

#[inline(always)]
pub fn sub<S: Lanes>(s: S, x: V3<S>, y: V3<S>) -> V3<S> {
    map2::<S>(
        x,
        y,
        #[inline(always)]
        |a, b| s.sub_f64s(a, b),
    )
}

#[inline(always)]
pub fn scale<S: Lanes>(s: S, f: S::f64s, x: V3<S>) -> V3<S> {
    [
        s.mul_f64s(f, x[0]),
        s.mul_f64s(f, x[1]),
        s.mul_f64s(f, x[2]),
    ]
}

#[inline(always)]
pub fn dot<S: Lanes>(s: S, x: V3<S>, y: V3<S>) -> S::f64s {
    let xy = s.add_f64s(s.mul_f64s(x[0], y[0]), s.mul_f64s(x[1], y[1]));
    s.add_f64s(xy, s.mul_f64s(x[2], y[2]))
}

#[inline(always)]
fn cross<S: Lanes>(s: S, x: V3<S>, y: V3<S>) -> V3<S> {
    let left = [
        s.mul_f64s(x[1], y[2]),
        s.mul_f64s(x[2], y[0]),
        s.mul_f64s(x[0], y[1]),
    ];
    let right = [
        s.mul_f64s(x[2], y[1]),
        s.mul_f64s(x[0], y[2]),
        s.mul_f64s(x[1], y[0]),
    ];
    sub(s, left, right)
}

/// Lanes `at..` of a column.
#[inline(always)]
pub fn part<S: Lanes>(column: &Column, at: usize) -> S::f64s {
    S::as_simd_f64s(column).0[at / S::F64_LANES]
}

#[inline(always)]
pub fn parts<S: Lanes>(columns: &[Column; 3], at: usize) -> V3<S> {
    [
        part::<S>(&columns[0], at),
        part::<S>(&columns[1], at),
        part::<S>(&columns[2], at),
    ]
}

/// Relative velocity without spin, and the sum of surface velocities, of the lanes from `at`. Rows are summed before they are
/// turned to columns: half as many turns, and the same bits.
#[inline(always)]
pub fn gather<S: Lanes>(s: S, bodies: &impl Read, group: &ContactLanes, at: usize) -> [V3<S>; 2] {
    let (ia, ib) = (
        &group.a[at..at + S::F64_LANES],
        &group.b[at..at + S::F64_LANES],
    );
    let linear = s.columns(
        #[inline(always)]
        |l| {
            let (a, b) = bodies.pair(ia[l], ib[l]);
            s.row_sub(s.row(&a.linear), s.row(&b.linear))
        },
    );
    let surface = s.columns(
        #[inline(always)]
        |l| {
            let (a, b) = bodies.pair(ia[l], ib[l]);
            s.row_add(s.row(&a.surface), s.row(&b.surface))
        },
    );
    [linear, surface]
}

/// Measures `z` of the lanes from `at`.
#[inline(always)]
pub fn measures<S: Lanes>(
    s: S,
    [linear, surface]: [V3<S>; 2],
    group: &ContactLanes,
    at: usize,
) -> V3<S> {
    let n = parts::<S>(&group.normal, at);
    let z = add(s, linear, parts::<S>(&group.slip, at));
    add(s, z, cross(s, n, surface))
}

/// `r - m z` on the cone: along `n` on the half-line, with the mass `m_N`, across on the disc that belongs to it, with `m_T`.
#[inline(always)]
pub fn project<S: Lanes>(
    s: S,
    r: V3<S>,
    [r_n, z_n]: [S::f64s; 2],
    z: V3<S>,
    n: V3<S>,
    [mass_n, mass_t]: [S::f64s; 2],
    friction: S::f64s,
) -> V3<S> {
    let zero = s.splat_f64s(0.0);
    let normal = s.sub_f64s(r_n, s.mul_f64s(z_n, mass_n));
    let normal = s.select_f64s(s.greater_than_f64s(normal, zero), normal, zero);
    let x = sub(s, r, scale(s, mass_t, z));
    let x_n = s.sub_f64s(r_n, s.mul_f64s(mass_t, z_n));
    let x = sub(s, x, scale(s, x_n, n));
    let squared = dot(s, x, x);
    let radius = s.mul_f64s(friction, normal);
    let outside = s.greater_than_f64s(squared, s.mul_f64s(radius, radius));
    let ratio = s.div_f64s(radius, s.sqrt_f64s(squared));
    let ratio = s.select_f64s(outside, ratio, s.splat_f64s(1.0));
    add(s, scale(s, normal, n), scale(s, ratio, x))
}

/// New impulses of the lanes from `at`; returns their change `d` and `n x d`. Before, an accelerated sweep takes the step that its
/// bodies have taken already.
#[inline(always)]
fn solve<S: Lanes, C: Carry>(
    s: S,
    carry: &mut C,
    bodies: [V3<S>; 2],
    group: &mut ContactLanes,
    at: usize,
) -> [V3<S>; 2] {
    let n = parts::<S>(&group.normal, at);
    let old = carry.step(s, group, at);
    let z = measures(s, bodies, group, at);
    let (old_n, z_n) = (dot(s, old, n), dot(s, z, n));
    let masses = [
        part::<S>(&group.mass_normal, at),
        part::<S>(&group.mass_tangential, at),
    ];
    let friction = part::<S>(&group.friction, at);
    let new = project(s, old, [old_n, z_n], z, n, masses, friction);
    let change = sub(s, new, old);
    put::<S>(&mut group.impulse, at, new);
    carry.note(s, group, at, change, z_n);
    [change, cross(s, n, change)]
}

#[inline(always)]
pub fn put<S: Lanes>(columns: &mut [Column; 3], at: usize, value: V3<S>) {
    for k in 0..3 {
        S::as_mut_simd_f64s(&mut columns[k]).0[at / S::F64_LANES] = value[k];
    }
}

/// What a sweep does beside solving contacts.
pub trait Carry {
    /// Impulses from which the lanes are solved.
    fn step<S: Lanes>(&mut self, s: S, group: &mut ContactLanes, at: usize) -> V3<S>;
    /// Asks memory for what it reads of a group beside what every sweep does.
    fn fetch(group: &ContactLanes);
    /// Looks at the change, and at the normal measures before it.
    fn note<S: Lanes>(
        &mut self,
        s: S,
        group: &mut ContactLanes,
        at: usize,
        change: V3<S>,
        z_n: S::f64s,
    );
}

/// A plain sweep.
pub struct Plain;

impl Carry for Plain {
    #[inline(always)]
    fn fetch(_: &ContactLanes) {}

    #[inline(always)]
    fn step<S: Lanes>(&mut self, _s: S, group: &mut ContactLanes, at: usize) -> V3<S> {
        parts::<S>(&group.impulse, at)
    }

    #[inline(always)]
    fn note<S: Lanes>(&mut self, _: S, _: &mut ContactLanes, _: usize, _: V3<S>, _: S::f64s) {}
}

/// A sweep that first goes on the way it came: `p <- beta (p + d)`, `r <- r + p` with the change `d` of the last sweep.
pub struct Along {
    /// `beta`, and 0 if the group's `p + d` is of another problem, else 1.
    pub beta: f64,
    pub kept: f64,
    /// Per lane: `|d|^2` over the masses, and the largest `-z_N` that was met.
    pub squared: Column,
    pub closing: Column,
}

impl Along {
    /// `beta (p + d)` of `p + d`.
    #[inline(always)]
    pub fn way<S: Lanes>(&self, s: S, way: V3<S>) -> V3<S> {
        let (beta, kept) = (s.splat_f64s(self.beta), s.splat_f64s(self.kept));
        scale(s, beta, scale(s, kept, way))
    }
}

impl Carry for Along {
    #[inline(always)]
    fn fetch(group: &ContactLanes) {
        ask(&group.weight);
        for column in &group.way {
            ask(column);
        }
    }

    #[inline(always)]
    fn step<S: Lanes>(&mut self, s: S, group: &mut ContactLanes, at: usize) -> V3<S> {
        let p = self.way(s, parts::<S>(&group.way, at));
        put::<S>(&mut group.way, at, p);
        add(s, parts::<S>(&group.impulse, at), p)
    }

    #[inline(always)]
    fn note<S: Lanes>(
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
        let z = s.sub_f64s(s.splat_f64s(0.0), z_n);
        *closing = s.select_f64s(s.greater_than_f64s(z, *closing), z, *closing);
        let way = add(s, parts::<S>(&group.way, at), change);
        put::<S>(&mut group.way, at, way);
    }
}

/// Adds the changes of the lanes from `at` to their bodies.
#[inline(always)]
fn scatter<S: Lanes>(
    s: S,
    [change, turn]: [V3<S>; 2],
    bodies: &mut impl Bodies,
    group: &ContactLanes,
    at: usize,
) {
    let (ia, ib) = (
        &group.a[at..at + S::F64_LANES],
        &group.b[at..at + S::F64_LANES],
    );
    s.rows(
        change,
        turn,
        #[inline(always)]
        |l, change, turn| {
            let a = &mut bodies.a()[ia[l] as usize];
            a.linear = s.numbers(s.row_add(s.row(&a.linear), s.row_scale(a.linear[3], change)));
            a.surface = s.numbers(s.row_sub(s.row(&a.surface), s.row_scale(a.surface[3], turn)));
            let b = &mut bodies.b()[ib[l] as usize];
            b.linear = s.numbers(s.row_sub(s.row(&b.linear), s.row_scale(b.linear[3], change)));
            b.surface = s.numbers(s.row_sub(s.row(&b.surface), s.row_scale(b.surface[3], turn)));
        },
    );
}

/// One pass over groups, in order.
pub struct Pass<'a, B, C> {
    pub bodies: B,
    pub groups: &'a mut [ContactLanes],
    pub carry: C,
}

impl<B: Bodies, C: Carry> Work for Pass<'_, B, C> {
    type Output = C;

    #[inline(always)]
    fn run<S: Lanes>(mut self, simd: S) -> C {
        for k in 0..self.groups.len() {
            if let Some(next) = self.groups.get(k + FAR) {
                next.fetch();
                C::fetch(next);
            }
            if let Some(next) = self.groups.get(k + AHEAD) {
                self.bodies.fetch(next);
            }
            let group = &mut self.groups[k];
            sweep_group(simd, &mut self.carry, &mut self.bodies, group);
        }
        self.carry
    }
}

/// Solves the contacts of a group.
#[inline(always)]
pub fn sweep_group<S: Lanes>(
    simd: S,
    carry: &mut impl Carry,
    bodies: &mut impl Bodies,
    group: &mut ContactLanes,
) {
    // Two sets of lanes at a time: each is one long chain of dependent operations.
    for at in (0..GROUP).step_by(2 * S::F64_LANES) {
        let next = at + S::F64_LANES;
        let (one, two) = (
            gather(simd, bodies, group, at),
            gather(simd, bodies, group, next),
        );
        let one = solve(simd, carry, one, group, at);
        let two = solve(simd, carry, two, group, next);
        scatter(simd, one, bodies, group, at);
        scatter(simd, two, bodies, group, next);
    }
}

/// Adds `M^-1 G^T r` of the groups' impulses to their bodies.
pub struct Push<'a, B> {
    pub bodies: B,
    pub groups: &'a [ContactLanes],
}

impl<B: Bodies> Work for Push<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(mut self, simd: S) {
        for group in self.groups {
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let n = parts::<S>(&group.normal, at);
                let r = parts::<S>(&group.impulse, at);
                let turn = cross(simd, n, r);
                scatter(simd, [r, turn], &mut self.bodies, group, at);
            }
        }
    }
}
