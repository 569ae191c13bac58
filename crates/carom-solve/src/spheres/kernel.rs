//! One step of the sweep: the exact solution of one contact, for the contacts of a group at once.
//!
//! With `s = r w` (surface velocity of a ball) the relative velocity at a contact is
//! `z = v_a - v_b + n x (s_a + s_b) + slip`, and its block of `W = G M^-1 G^T` is diagonal: `w_N = 1/m_a + 1/m_b` along `n`,
//! `w_T = w_N + r_a^2/I_a + r_b^2/I_b` across. So the contact problem of one contact has the closed solution
//!
//! ```text
//! r_N+ = max(0, r_N - z_N / w_N)           (or a least impulse in place of 0)
//! x    = (r - z / w_T) without its part along n
//! r_T+ = x min(1, mu r_N+ / |x|)
//! ```
//!
//! Where mu > 1 the step along the normal is `1/(mu w_N)`: a longer one changes the disc of friction by more than itself, and
//! sweeps cycle where friction holds grains from all sides (deposits with mu = 3).
//!
//! The convex companion (`companion`) has the same `x` with the nearest point of the whole cone, by `w`, in place of that of the disc.
//!
//! Impulses are vectors of the world: no tangents are needed. Multiplications and additions are never fused and are in
//! the same order on all instruction sets, so all give the same bits.

use super::bodies::{Bodies, ContactLanes, Read};
use super::carry::Along;
use super::goal::Projection;
use super::lanes::{Column, Lanes, Work, GROUP};
use super::vectors::{add, cross, dot, larger, onto_disc, part, parts, put, scale, sub, V3};

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

/// `r - m z` on the cone: along `n` on the half-line from `least` on, with the mass `m_N`, across on the disc that belongs to it, with `m_T`.
#[inline(always)]
pub fn project<S: Lanes>(
    s: S,
    r: V3<S>,
    [r_n, z_n]: [S::f64s; 2],
    z: V3<S>,
    n: V3<S>,
    [mass_n, mass_t]: [S::f64s; 2],
    ([friction, least], law): ([S::f64s; 2], Projection),
) -> V3<S> {
    let normal = s.sub_f64s(r_n, s.mul_f64s(z_n, mass_n));
    let x = sub(s, r, scale(s, mass_t, z));
    let x_n = s.sub_f64s(r_n, s.mul_f64s(mass_t, z_n));
    let x = sub(s, x, scale(s, x_n, n));
    let squared = dot(s, x, x);
    let normal = match law {
        Projection::Discs => normal,
        Projection::Companion => {
            let length = s.sqrt_f64s(squared);
            let stiff = s.mul_f64s(friction, mass_n);
            let over = s.add_f64s(mass_t, s.mul_f64s(friction, stiff));
            let sum = s.add_f64s(s.mul_f64s(mass_t, normal), s.mul_f64s(stiff, length));
            let outside = s.greater_than_f64s(length, s.mul_f64s(friction, normal));
            s.select_f64s(outside, s.div_f64s(sum, over), normal)
        }
    };
    let normal = larger(s, normal, least);
    let across = onto_disc(s, x, squared, s.mul_f64s(friction, normal));
    add(s, scale(s, normal, n), across)
}

/// New impulses of the lanes from `at`; returns their change `d` and `n x d`. Before, an accelerated sweep takes the step that its
/// bodies have taken already.
#[inline(always)]
fn solve<S: Lanes>(
    s: S,
    carry: &mut Along,
    bodies: [V3<S>; 2],
    (group, least): (&mut ContactLanes, &Column),
    at: usize,
) -> [V3<S>; 2] {
    let n = parts::<S>(&group.normal, at);
    let old = carry.step(s, group, at);
    let z = measures(s, bodies, group, at);
    let (old_n, z_n) = (dot(s, old, n), dot(s, z, n));
    let step_n = match carry.law {
        Projection::Discs => part::<S>(&group.step_normal, at),
        Projection::Companion => group.mass_normal(s, at),
    };
    let masses = [step_n, part::<S>(&group.mass_tangential, at)];
    let bounds = [part::<S>(&group.friction, at), part::<S>(least, at)];
    let new = project(s, old, [old_n, z_n], z, n, masses, (bounds, carry.law));
    let change = sub(s, new, old);
    put::<S>(&mut group.impulse, at, new);
    carry.note(s, group, at, change, z_n);
    [change, cross(s, n, change)]
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

/// Solves the contacts of a group.
#[inline(always)]
pub fn sweep_group<S: Lanes>(
    simd: S,
    carry: &mut Along,
    bodies: &mut impl Bodies,
    group: &mut ContactLanes,
    least: &Column,
) {
    // Two sets of lanes at a time: each is one long chain of dependent operations.
    for at in (0..GROUP).step_by(2 * S::F64_LANES) {
        let next = at + S::F64_LANES;
        let (one, two) = (
            gather(simd, bodies, group, at),
            gather(simd, bodies, group, next),
        );
        let one = solve(simd, carry, one, (group, least), at);
        let two = solve(simd, carry, two, (group, least), next);
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
