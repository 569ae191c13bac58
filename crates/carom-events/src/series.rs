//! Power series of a part of a slide that turns, in a time of its own: `curved.rs` has the equations.

/// Terms of a series. More: fewer parts, each with more work.
const TERMS: usize = 20;
/// Size of what is left out of a velocity at the end of a part, over the speeds of the ball (1). Larger: not exact; smaller: more parts.
const LAST: f64 = 5e-15;
/// The same over each size itself, and of angles (1): beyond, a series of a small one means nothing. Larger: turning that passes through nothing is wrong.
const LAST_OWN: f64 = 1e-7;
/// Steps of Newton's method for the moment of a time: it takes about four.
const MOST_STEPS: usize = 64;

/// What takes from velocity and turning in a slide, m/s^2: friction on the centre `a`, on turning `c`, rolling resistance on turning `b`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rates {
    pub a: f64,
    pub b: f64,
    pub c: f64,
}

/// Time, share of the slip in both sizes, cosine and sine of the angle between slip and turning, their sizes, direction of the slip (2), velocity (2), way (2), its
/// sum over time (2), ways of slip and turning. Times and ways are from the begin of a part on, all of it in SI units.
pub type Values = [f64; 16];
pub const TIME: usize = 0;

/// A part of a slide: series, and from when to when in its own time they hold, which takes `dt` seconds.
#[derive(Clone)]
pub struct Part {
    /// On the heap: a part is moved about.
    terms: Box<[Values; TERMS]>,
    pub begin: f64,
    pub end: f64,
    pub dt: f64,
}

/// Products of two series each, many at once.
struct Products<const L: usize> {
    left: [[f64; L]; TERMS],
    right: [[f64; L]; TERMS],
}

impl<const L: usize> Products<L> {
    fn new() -> Products<L> {
        Products {
            left: [[0.0; L]; TERMS],
            right: [[0.0; L]; TERMS],
        }
    }

    /// Of term `k` what earlier terms give: it need not wait for the last.
    #[inline]
    fn before(&self, k: usize) -> [f64; L] {
        let mut sums = [0.0; L];
        for n in 1..k {
            let (left, right) = (&self.left[n], &self.right[k - n]);
            for i in 0..L {
                sums[i] += left[i] * right[i];
            }
        }
        sums
    }

    /// Term `k`, from that and the last factors.
    #[inline]
    fn term(&mut self, k: usize, before: [f64; L], left: [f64; L], right: [f64; L]) -> [f64; L] {
        (self.left[k], self.right[k]) = (left, right);
        let (first, other) = (&self.left[0], &self.right[0]);
        std::array::from_fn(|i| {
            let ends = first[i] * right[i];
            let ends = if k > 0 {
                ends + left[i] * other[i]
            } else {
                ends
            };
            before[i] + ends
        })
    }
}

impl Part {
    /// From what is known at its begin, with the speed to which errors are compared.
    pub fn new(first: Values, speed: f64, rates: Rates) -> Part {
        let Rates { a, b, c } = rates;
        let mut terms = Box::new([[0.0; 16]; TERMS]);
        terms[0] = first;
        let [_, _, _, _, s, p, ..] = first;
        terms[0][1] = s / (s + p);
        // Of turning, which is not the rounding of 1 less the other.
        let mut rest = p / (s + p);
        let (mut one, mut two) = (Products::<8>::new(), Products::<16>::new());
        for k in 0..TERMS - 1 {
            let before = (one.before(k), two.before(k));
            let [_, f, cos, sin, s, p, ux, uy, vx, vy, x, y, ..] = terms[k];
            let (left, right) = (
                [f, cos, cos, sin, sin, s, 0.0, 0.0],
                [rest, rest, f, rest, f, rest, 0.0, 0.0],
            );
            let [both, cos_rest, cos_f, sin_rest, sin_f, time, ..] =
                one.term(k, before.0, left, right);
            let (slip, turning) = (-(a + c) * rest - b * cos_rest, -b * f - c * cos_f);
            let (opens, turns) = (c * sin_f + b * sin_rest, -b * sin_rest);
            let left = [
                time, both, sin, cos, s, p, uy, ux, ux, uy, vx, vy, x, y, s, p,
            ];
            let mut right = [time; 16];
            right[1..8].copy_from_slice(&[
                slip - turning,
                opens,
                opens,
                slip,
                turning,
                turns,
                turns,
            ]);
            let mut next = two.term(k, before.1, left, right);
            next[0] = time;
            for i in [2, 6] {
                next[i] = -next[i];
            }
            next[8] *= -a;
            next[9] *= -a;
            // In units of the rates, times that numbers have.
            let unit = 1.0 / ((a + b + c) * (k + 1) as f64);
            terms[k + 1] = next.map(|d| unit * d);
            rest = -terms[k + 1][1];
        }
        let holds = |k: usize| holds(&terms, k, speed, (a + b + c) / speed);
        let end = holds(TERMS - 1).min(holds(TERMS - 2)).min(holds(TERMS - 3));
        let mut part = Part {
            terms,
            begin: 0.0,
            end,
            dt: 0.0,
        };
        part.dt = part.at(end)[TIME];
        part
    }

    /// All values at a moment of its own time.
    pub fn at(&self, own: f64) -> Values {
        self.first_at(own)
    }

    /// The first of them.
    pub fn first_at<const L: usize>(&self, own: f64) -> [f64; L] {
        let mut values = [0.0; L];
        for terms in self.terms.iter().rev() {
            for i in 0..L {
                values[i] = values[i] * own + terms[i];
            }
        }
        values
    }

    /// The moment in its own time `dt` seconds after its begin.
    pub fn moment(&self, dt: f64) -> f64 {
        if dt >= self.dt {
            return self.end;
        }
        let value = |t: f64| {
            let terms = self.terms.iter().rev();
            terms.fold((0.0, 0.0), |(v, s), c| (v * t + c[TIME], s * t + v))
        };
        let at = value(self.begin).0 + dt;
        let (mut low, mut high) = (self.begin, self.end);
        let mut t = low + (high - low) * (dt / self.dt);
        for _ in 0..MOST_STEPS {
            let (v, slope) = value(t);
            if v < at {
                low = t;
            } else {
                high = t;
            }
            let newton = t + (at - v) / slope;
            let inside = newton >= low && newton <= high;
            let next = if inside { newton } else { 0.5 * (low + high) };
            if (next - t).abs() <= 4.0 * f64::EPSILON * t {
                return next;
            }
            t = next;
        }
        t
    }
}

/// Up to which moment of its own time a series holds by its term `k`. `by`: rates over the speed to which errors are compared.
fn holds(terms: &[Values; TERMS], k: usize, speed: f64, by: f64) -> f64 {
    let (first, d) = (&terms[0], &terms[k]);
    let [_, _, _, _, s, p, ..] = *first;
    // Speeds, and what is off by a speed over the rates: products of series that fall fast, which fall slower than these.
    let sizes = [
        d[4],
        d[5],
        p * d[2],
        p * d[3],
        s * d[6],
        s * d[7],
        by * d[10],
        by * d[11],
    ];
    let share = (s / (s + p)).min(p / (s + p));
    let own = [
        d[1] / share,
        d[2],
        d[3] / first[3],
        d[4] / s,
        d[5] / p,
        d[6],
        d[7],
    ];
    let most = |sizes: &[f64]| sizes.iter().fold(0.0, |most, d| f64::max(most, d.abs()));
    let within = (LAST * speed / most(&sizes)).min(LAST_OWN / most(&own));
    within.powf(1.0 / k as f64)
}
