//! Friction in a plane whose two directions resist differently, with its largest size given.

/// Steps of Newton's method at most; it takes fewer than ten.
const STEPS: usize = 50;

/// Inverse mass along one axis over that along the other (1) up to which friction moves nothing along it. Smaller: the sign of rounding decides; larger:
/// light bodies beside heavy ones slide on.
const HELD: f64 = 1e-9;

/// The minimiser of `l . A l / 2 + b . l` over `|l| <= radius`; `a`: `[A_xx, A_xy, A_yy]`, positive semidefinite. Along an axis that is held, as by
/// joints, a `b` of at most `still` is rounding, and has no friction.
///
/// In the axes of A: `l_i = -b_i / (a_i + t)`, with t = 0 or the one that gives `|l|` its largest value (Moré and Sorensen's trust region).
/// Newton's method for `1/|l| = 1/radius` comes to it from below.
#[must_use]
pub fn on_disc([xx, xy, yy]: [f64; 3], b: [f64; 2], radius: f64, still: f64) -> [f64; 2] {
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let large = mean + half.hypot(xy);
    if large <= 0.0 {
        return [0.0; 2];
    }
    let small = ((xx * yy - xy * xy) / large).max(0.0);
    let (sin, cos) = (0.5 * xy.atan2(half)).sin_cos();
    let mut p = [-cos * b[0] - sin * b[1], sin * b[0] - cos * b[1]];
    if small <= HELD * large && p[1].abs() <= still {
        p[1] = 0.0;
    }
    let at = |t: f64| {
        [
            p[0] / (large + t),
            if p[1] == 0.0 { 0.0 } else { p[1] / (small + t) },
        ]
    };
    let size = |l: [f64; 2]| l[0].hypot(l[1]);
    let mut l = at(0.0);
    if size(l) > radius {
        let mut t = [0.0, size(p) / radius - large, p[1].abs() / radius - small]
            .into_iter()
            .fold(0.0, f64::max);
        for _ in 0..STEPS {
            l = at(t);
            let slope = l[0] * l[0] / (large + t) + l[1] * l[1] / (small + t);
            let step = size(l).powi(2) / slope * (size(l) / radius - 1.0);
            if step <= f64::EPSILON * (large + t) {
                break;
            }
            t += step;
        }
        let scale = radius / size(l);
        l = l.map(|x| scale * x);
    }
    [cos * l[0] - sin * l[1], sin * l[0] + cos * l[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points around the disc, and the same with other axes: none is better.
    #[test]
    fn no_point_of_the_disc_is_better() {
        for ratio in [1.0, 0.3, 1e-2, 1e-6, 1e-12, 0.0] {
            for k in 0..40 {
                let (turn, to, radius) = (
                    0.7 * f64::from(k),
                    1.3 * f64::from(k),
                    10f64.powi(k % 7 - 3),
                );
                let (s, c) = turn.sin_cos();
                let a = [
                    c * c + ratio * s * s,
                    (1.0 - ratio) * s * c,
                    s * s + ratio * c * c,
                ];
                let b = [to.cos(), to.sin()];
                let cost = |l: [f64; 2]| {
                    let of_a = a[0] * l[0] * l[0] + 2.0 * a[1] * l[0] * l[1] + a[2] * l[1] * l[1];
                    0.5 * of_a + b[0] * l[0] + b[1] * l[1]
                };
                let found = on_disc(a, b, radius, 0.0);
                assert!(found[0].hypot(found[1]) <= radius * (1.0 + 1e-14));
                let (least, rounding) = (cost(found), 1e-14 * radius * (1.0 + radius));
                for j in 0..3600 {
                    let (s, c) = (f64::from(j) * 0.001_745).sin_cos();
                    for share in [1.0, 0.999, 0.5] {
                        assert!(cost([share * radius * c, share * radius * s]) >= least - rounding);
                    }
                }
                let [x, y] = found;
                for (dx, dy) in [(1e-4, 0.0), (-1e-4, 0.0), (0.0, 1e-4), (0.0, -1e-4)] {
                    let near = [x + dx * radius, y + dy * radius];
                    let inside = near[0].hypot(near[1]) <= radius;
                    assert!(!inside || cost(near) >= least - rounding);
                }
            }
        }
    }

    #[test]
    fn what_nothing_resists_is_not_held() {
        assert_eq!(on_disc([0.0; 3], [1.0, 0.0], 2.0, 0.0), [0.0; 2]);
        assert_eq!(on_disc([2.0, 0.0, 0.0], [1.0, 0.0], 2.0, 0.0), [-0.5, 0.0]);
        // In turned axes nothing is 0, but rounding; a slip that is there is rubbed all the same.
        for k in 1..100 {
            let (s, c) = f64::from(k).sin_cos();
            let a = [c * c, s * c, s * s];
            let [x, y] = on_disc(a, [3.0 * c, 3.0 * s], 5.0, 1e-8);
            assert!((x + 3.0 * c).hypot(y + 3.0 * s) < 1e-14);
            let [x, y] = on_disc(a, [-1e-3 * s, 1e-3 * c], 5.0, 1e-8);
            assert!((x - 5.0 * s).hypot(y + 5.0 * c) < 1e-12);
        }
    }
}
