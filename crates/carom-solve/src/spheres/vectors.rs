//! Vectors of the contacts of some lanes. Nothing is fused, and the order of sums is the same on all instruction sets.

use super::lanes::{Column, Lanes};
use pulp::Simd;

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

/// The larger of two numbers, the second where they are equal.
#[inline(always)]
pub fn larger<S: Lanes>(s: S, x: S::f64s, y: S::f64s) -> S::f64s {
    s.select_f64s(s.greater_than_f64s(x, y), x, y)
}

/// A vector with the square of its length, cut to a disc of this radius.
#[inline(always)]
pub fn onto_disc<S: Lanes>(s: S, x: V3<S>, squared: S::f64s, radius: S::f64s) -> V3<S> {
    let outside = s.greater_than_f64s(squared, s.mul_f64s(radius, radius));
    let ratio = s.div_f64s(radius, s.sqrt_f64s(squared));
    scale(s, s.select_f64s(outside, ratio, s.splat_f64s(1.0)), x)
}

#[inline(always)]
pub fn cross<S: Lanes>(s: S, x: V3<S>, y: V3<S>) -> V3<S> {
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

#[inline(always)]
pub fn put<S: Lanes>(columns: &mut [Column; 3], at: usize, value: V3<S>) {
    for k in 0..3 {
        S::as_mut_simd_f64s(&mut columns[k]).0[at / S::F64_LANES] = value[k];
    }
}
