//! Sweeps over contacts that roll: what `kernel` does, and the moments of `rolling` after the forces of each group.

use super::bodies::{Bodies, Both, ContactLanes, Read, State};
use super::carry::Along;
use super::groups::{least, ContactBlock};
use super::kernel::{gather, measures};
use super::lanes::{vector, Lanes, GROUP};
use super::rolls::Rolls;
use super::vectors::{add, dot, larger, onto_disc, part, parts, put, scale, sub, V3};
use glam::DVec3;

/// Measures of the moments of the lanes from `at`: relative angular velocities.
#[inline(always)]
fn turns<S: Lanes>(
    s: S,
    bodies: &impl Read,
    group: &ContactLanes,
    rolls: &Rolls,
    at: usize,
) -> V3<S> {
    let lanes = at..at + S::F64_LANES;
    let (ia, ib) = (&group.a[lanes.clone()], &group.b[lanes.clone()]);
    let [ra, rb] = [
        &rolls.per_radius[0][lanes.clone()],
        &rolls.per_radius[1][lanes],
    ];
    let spin = s.columns(
        #[inline(always)]
        |l| {
            let (a, b) = bodies.pair(ia[l], ib[l]);
            s.row_sub(
                s.row_scale(ra[l], s.row(&a.surface)),
                s.row_scale(rb[l], s.row(&b.surface)),
            )
        },
    );
    add(s, spin, parts::<S>(&rolls.turn, at))
}

/// `m - z` times the inertia on the disc of rolling and the interval of spinning that belong to the normal impulse.
#[inline(always)]
fn project<S: Lanes>(
    s: S,
    [m, z, n]: [V3<S>; 3],
    inertia: S::f64s,
    normal: S::f64s,
    rolls: &Rolls,
    at: usize,
) -> V3<S> {
    let zero = s.splat_f64s(0.0);
    let x = sub(s, m, scale(s, inertia, z));
    let along = dot(s, x, n);
    let x = sub(s, x, scale(s, along, n));
    let radius = s.mul_f64s(part::<S>(&rolls.rolling, at), normal);
    let rolling = onto_disc(s, x, dot(s, x, x), radius);
    let most = s.mul_f64s(part::<S>(&rolls.spinning, at), normal);
    let least = s.sub_f64s(zero, most);
    let along = s.select_f64s(s.greater_than_f64s(along, most), most, along);
    add(s, scale(s, larger(s, least, along), n), rolling)
}

/// New moments of the lanes from `at` at the present normal impulses; returns their change.
#[inline(always)]
fn solve<S: Lanes>(
    s: S,
    carry: &mut Along,
    bodies: &impl Read,
    group: &ContactLanes,
    rolls: &mut Rolls,
    at: usize,
) -> V3<S> {
    let n = parts::<S>(&group.normal, at);
    let normal = dot(s, parts::<S>(&group.impulse, at), n);
    let normal = larger(s, normal, s.splat_f64s(0.0));
    let old = carry.step_moments(s, rolls, at);
    let z = turns(s, bodies, group, rolls, at);
    let inertia = part::<S>(&rolls.inertia, at);
    let new = project(s, [old, z, n], inertia, normal, rolls, at);
    let change = sub(s, new, old);
    put::<S>(&mut rolls.moment, at, new);
    carry.note_moments(s, rolls, at, change);
    change
}

/// Adds the changes of the moments of the lanes from `at` to their bodies.
#[inline(always)]
fn scatter<S: Lanes>(
    s: S,
    change: V3<S>,
    bodies: &mut impl Bodies,
    group: &ContactLanes,
    rolls: &Rolls,
    at: usize,
) {
    let lanes = at..at + S::F64_LANES;
    let (ia, ib) = (&group.a[lanes.clone()], &group.b[lanes.clone()]);
    let [ra, rb] = [
        &rolls.per_radius[0][lanes.clone()],
        &rolls.per_radius[1][lanes],
    ];
    s.rows(
        change,
        change,
        #[inline(always)]
        |l, change, _| {
            let a = &mut bodies.a()[ia[l] as usize];
            let turned = s.row_scale(ra[l] * a.surface[3], change);
            a.surface = s.numbers(s.row_add(s.row(&a.surface), turned));
            let b = &mut bodies.b()[ib[l] as usize];
            let turned = s.row_scale(rb[l] * b.surface[3], change);
            b.surface = s.numbers(s.row_sub(s.row(&b.surface), turned));
        },
    );
}

/// Solves the moments of a group.
#[inline(always)]
pub fn sweep_moments<S: Lanes>(
    s: S,
    carry: &mut Along,
    bodies: &mut impl Bodies,
    group: &ContactLanes,
    rolls: &mut Rolls,
) {
    for at in (0..GROUP).step_by(2 * S::F64_LANES) {
        let next = at + S::F64_LANES;
        let one = solve(s, carry, bodies, group, rolls, at);
        let two = solve(s, carry, bodies, group, rolls, next);
        scatter(s, one, bodies, group, rolls, at);
        scatter(s, two, bodies, group, rolls, next);
    }
}

/// What moments add to the sums of eq. 44: residual rows and moments over the reference length of their contact.
#[inline(always)]
pub fn norms<S: Lanes>(s: S, block: &ContactBlock, bodies: &Both, penalty_scale: f64) -> [f64; 3] {
    let mut sums = [[0.0; GROUP]; 3];
    let scale_of = s.splat_f64s(penalty_scale);
    let groups = block.groups.iter().zip(&block.rolls).enumerate();
    for (k, (group, rolls)) in groups.filter(|(_, (_, rolls))| rolls.any) {
        let least = least(&block.least, k);
        for at in (0..GROUP).step_by(S::F64_LANES) {
            let n = parts::<S>(&group.normal, at);
            // Discs belong to the augmented normal impulse, as in `residual`.
            let force = measures(s, gather(s, bodies, group, at), group, at);
            let mass = s.mul_f64s(scale_of, group.mass_normal(s, at));
            let r_n = dot(s, parts::<S>(&group.impulse, at), n);
            let normal = s.sub_f64s(r_n, s.mul_f64s(mass, dot(s, force, n)));
            let m = parts::<S>(&rolls.moment, at);
            let z = turns(s, bodies, group, rolls, at);
            let inertia = s.mul_f64s(scale_of, part::<S>(&rolls.inertia, at));
            let least = part::<S>(least, at);
            let normal = larger(s, normal, least);
            let phi = project(s, [m, z, n], inertia, normal, rolls, at);
            let over = part::<S>(&rolls.per_length, at);
            let over = s.mul_f64s(over, over);
            for (sum, x) in sums.iter_mut().zip([sub(s, phi, m), phi, m]) {
                let sum = &mut S::as_mut_simd_f64s(sum).0[at / S::F64_LANES];
                *sum = s.add_f64s(*sum, s.mul_f64s(over, dot(s, x, x)));
            }
        }
    }
    sums.map(|sum| sum.iter().sum())
}

/// Lanes of a block that may have moments.
fn lanes(block: &ContactBlock) -> impl Iterator<Item = (&ContactLanes, &Rolls, usize)> {
    let groups = block.groups.iter().zip(&block.rolls);
    let groups = groups.filter(|(_, rolls)| rolls.any);
    groups.flat_map(|(group, rolls)| (0..GROUP).map(move |lane| (group, rolls, lane)))
}

/// Adds the moments' `M^-1 G^T m` to the states.
pub fn push(block: &ContactBlock, left: &mut [State], mut right: Option<&mut [State]>) {
    for (group, rolls, lane) in lanes(block) {
        let m: DVec3 = vector(&rolls.moment, lane);
        let add = |state: &mut State, factor: f64| {
            for k in 0..3 {
                state.surface[k] += factor * state.surface[3] * m[k];
            }
        };
        let [ra, rb] = [0, 1].map(|side: usize| rolls.per_radius[side][lane]);
        add(&mut left[group.a[lane] as usize], ra);
        let b = group.b[lane] as usize;
        match &mut right {
            Some(right) => add(&mut right[b], -rb),
            None => add(&mut left[b], -rb),
        }
    }
}
