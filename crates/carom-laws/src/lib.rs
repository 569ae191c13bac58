//! Laws of one variable: a number, a polynomial, a table or an expression, with value and slope.
//!
//! The variable is the time in loads and joints and the slip speed in friction; nothing here knows which. Slopes are
//! those to the right, so that a kink reached at `t_n` already has the slope of the step that begins there, unless that to
//! the left is asked for.

mod cure;
mod expression;
mod function;
mod parse;

pub use expression::Expression;

/// Names of the functions an expression may use.
pub fn functions() -> impl Iterator<Item = &'static str> {
    function::FUNCTIONS.iter().map(|f| f.0)
}

/// A law `y(x)`.
#[derive(Clone, Debug)]
pub enum Scalar {
    Constant(f64),
    /// Coefficients by rising powers.
    Polynomial(Vec<f64>),
    /// Points `[x, y]` by rising `x`: linear between them, constant outside.
    Table(Vec<[f64; 2]>),
    /// Of at most one variable, whatever its name.
    Expression(Expression),
}

impl Scalar {
    pub fn zero() -> Scalar {
        Scalar::Constant(0.0)
    }

    /// `y(x)`.
    pub fn value(&self, x: f64) -> f64 {
        match self {
            Scalar::Constant(y) => *y,
            Scalar::Polynomial(c) => c.iter().rev().fold(0.0, |y, c| y * x + c),
            Scalar::Table(points) => match points.partition_point(|p| p[0] <= x) {
                0 => points[0][1],
                n if n == points.len() => points[n - 1][1],
                n => points[n - 1][1] + chord(points, n) * (x - points[n - 1][0]),
            },
            Scalar::Expression(e) => e.evaluate(&[x]),
        }
    }

    /// `dy/dx` to the right of `x`.
    pub fn slope(&self, x: f64) -> f64 {
        match self {
            Scalar::Constant(_) => 0.0,
            Scalar::Polynomial(c) => (1..c.len()).rev().fold(0.0, |y, k| y * x + k as f64 * c[k]),
            Scalar::Table(points) => slope_behind(points, |p| p <= x + rounding(x)),
            Scalar::Expression(e) => beside(x, rounding(x), |x| e.slope(&[x], 0)),
        }
    }

    /// `dy/dx` to the left of `x`: at the end of a step that of the step, where the next one begins with a kink.
    pub fn slope_before(&self, x: f64) -> f64 {
        match self {
            Scalar::Table(points) => slope_behind(points, |p| p < x - rounding(x)),
            Scalar::Expression(e) => beside(x, -rounding(x), |x| e.slope_before(&[x], 0)),
            smooth => smooth.slope(x),
        }
    }

    /// True where the form of the law alone says that `y` does not depend on `x`.
    pub fn is_constant(&self) -> bool {
        match self {
            Scalar::Constant(_) => true,
            Scalar::Polynomial(c) => c.iter().skip(1).all(|c| *c == 0.0),
            Scalar::Table(points) => points.iter().all(|p| p[1] == points[0][1]),
            Scalar::Expression(e) => e.variables().is_empty(),
        }
    }

    /// Whether `value` and `slope` may be asked for. The message says what is wrong and what would be right.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Scalar::Constant(y) if !y.is_finite() => Err(format!("{y} is not a finite number")),
            Scalar::Constant(_) => Ok(()),
            Scalar::Polynomial(c) => check_polynomial(c),
            Scalar::Table(points) => check_table(points),
            Scalar::Expression(e) => match e.variables() {
                [] | [_] => Ok(()),
                [a, b, ..] => Err(format!(
                    "a law has one variable, \"{e}\" has {a} and {b}; keep one of them"
                )),
            },
        }
    }

    /// [`Scalar::check`] of a law of the time: the start of the run is the first place it is asked for.
    pub fn check_at_start(&self) -> Result<(), String> {
        self.check()?;
        finite_at_start("value", self.value(0.0))
    }

    /// The same where the slope is asked for too.
    pub fn check_slope_at_start(&self) -> Result<(), String> {
        self.check_at_start()?;
        finite_at_start("slope", self.slope(0.0))
    }
}

fn finite_at_start(what: &str, found: f64) -> Result<(), String> {
    if found.is_finite() {
        return Ok(());
    }
    Err(format!(
        "has the {what} {found} at t = 0; it must be finite from there on"
    ))
}

/// Times of steps, `n h` and `t_n + h`, and the kink that is meant may differ by so much.
fn rounding(x: f64) -> f64 {
    8.0 * f64::EPSILON * x.abs()
}

/// A slope so far `off` that a kink within rounding is behind it; where the formula ends there, that at `x` itself.
fn beside(x: f64, off: f64, slope: impl Fn(f64) -> f64) -> f64 {
    let found = slope(x + off);
    if found.is_finite() {
        found
    } else {
        slope(x)
    }
}

/// Slope behind the last point that has been `reached`.
fn slope_behind(points: &[[f64; 2]], reached: impl Fn(f64) -> bool) -> f64 {
    match points.partition_point(|p| reached(p[0])) {
        0 => 0.0,
        n if n == points.len() => 0.0,
        n => chord(points, n),
    }
}

/// Slope between the points `n - 1` and `n`.
fn chord(points: &[[f64; 2]], n: usize) -> f64 {
    (points[n][1] - points[n - 1][1]) / (points[n][0] - points[n - 1][0])
}

fn check_polynomial(coefficients: &[f64]) -> Result<(), String> {
    if coefficients.is_empty() {
        return Err("the polynomial has no coefficient; give at least [c0]".into());
    }
    match coefficients.iter().position(|c| !c.is_finite()) {
        Some(k) => Err(format!(
            "coefficient {} of the polynomial is {}, not a finite number",
            k + 1,
            coefficients[k]
        )),
        None => Ok(()),
    }
}

fn check_table(points: &[[f64; 2]]) -> Result<(), String> {
    if points.is_empty() {
        return Err("the table has no point; give at least [[x, y]]".into());
    }
    for (k, point) in points.iter().enumerate() {
        if point.iter().any(|x| !x.is_finite()) {
            let [x, y] = point;
            return Err(format!(
                "point {} of the table is [{x}, {y}]; both numbers must be finite",
                k + 1
            ));
        }
        if k > 0 && points[k - 1][0] >= point[0] {
            return Err(format!(
                "the table goes from x = {} to x = {} at point {}; x must rise from point to point (a jump: two points close \
                 to each other)",
                points[k - 1][0],
                point[0],
                k + 1
            ));
        }
        if k > 0 && !chord(points, k).is_finite() {
            return Err(format!(
                "the table rises too steeply before point {}: the slope is no finite number; move the points apart",
                k + 1
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Scalar {
        Scalar::Table(vec![[0.0, 1.0], [2.0, 5.0], [3.0, 4.0]])
    }

    fn expression(text: &str) -> Scalar {
        Scalar::Expression(Expression::parse(text).unwrap())
    }

    #[test]
    fn polynomial_by_rising_powers() {
        let p = Scalar::Polynomial(vec![1.0, -2.0, 3.0]);
        assert_eq!(p.value(2.0), 9.0);
        assert_eq!(p.slope(2.0), 10.0);
        assert_eq!(Scalar::Polynomial(vec![4.0]).slope(7.0), 0.0);
    }

    #[test]
    fn table_is_linear_between_constant_outside_and_right_continuous() {
        let values = [
            (-1.0, 1.0),
            (0.0, 1.0),
            (0.5, 2.0),
            (2.0, 5.0),
            (2.5, 4.5),
            (3.0, 4.0),
            (9.0, 4.0),
        ];
        let slopes = [
            (-1.0, 0.0),
            (0.0, 2.0),
            (1.9, 2.0),
            (2.0, -1.0),
            (3.0, 0.0),
            (9.0, 0.0),
        ];
        for (x, y) in values {
            assert_eq!(table().value(x), y, "value at {x}");
        }
        for (x, y) in slopes {
            assert_eq!(table().slope(x), y, "slope at {x}");
        }
    }

    #[test]
    fn slopes_to_the_left_differ_at_kinks_alone() {
        let kink = expression("min(0, 2*(0.15 - t))");
        let smooth = expression("sin(3*t)");
        for (x, left, right) in [
            (0.0, 0.0, 2.0),
            (1.0, 2.0, 2.0),
            (2.0, 2.0, -1.0),
            (3.0, -1.0, 0.0),
        ] {
            assert_eq!((table().slope_before(x), table().slope(x)), (left, right));
        }
        // As steps of 1e-3 reach it.
        for x in [0.15, 0.149 + 1e-3, 150.0 * 1e-3] {
            assert_eq!((kink.slope_before(x), kink.slope(x)), (0.0, -2.0), "{x:e}");
        }
        let late = expression("max(0, t - 0.03)");
        assert_eq!(late.slope_before(0.029 + 1e-3), 0.0);
        let sum = expression("max(0, t - 0.1 - 0.05)");
        assert_eq!((sum.slope_before(0.15), sum.slope(0.15)), (0.0, 1.0));
        let early = 5.0 * 3e-4;
        assert!(early < 0.0015);
        assert_eq!(expression("max(0, t - 0.0015)").slope(early), 1.0);
        // Formulas that end at 1, and that begin there.
        let ends = expression("(1 - t)^1.5").slope(1.0);
        let begins = expression("(t - 1)^1.5").slope_before(1.0);
        assert_eq!((ends, begins), (0.0, 0.0));
        for third in [0.1 + 0.2, 0.3] {
            let table = Scalar::Table(vec![[0.0, 0.0], [0.3, 0.0], [1.0, 0.7]]);
            assert_eq!((table.slope_before(third), table.slope(third)), (0.0, 1.0));
        }
        for x in [0.1, 0.2, 5.0] {
            let apart = (smooth.slope_before(x) - smooth.slope(x)).abs();
            assert!(apart < 9.0 * 2.1 * rounding(x), "{apart:e}");
            let p = Scalar::Polynomial(vec![1.0, -2.0, 3.0]);
            assert_eq!(p.slope_before(x), p.slope(x));
        }
    }

    #[test]
    fn constant_is_seen_from_the_form() {
        assert!(Scalar::zero().is_constant() && Scalar::zero().value(3.0) == 0.0);
        assert!(Scalar::Polynomial(vec![2.0, 0.0]).is_constant());
        assert!(!Scalar::Polynomial(vec![2.0, 1.0]).is_constant());
        assert!(Scalar::Table(vec![[1.0, 2.0]]).is_constant());
        assert!(!table().is_constant());
        assert!(expression("2*pi").is_constant());
        assert!(!expression("0*t").is_constant());
    }

    #[test]
    fn the_variable_may_have_any_name() {
        assert_eq!(expression("20*t").value(0.5), 10.0);
        assert_eq!(expression("20*v").slope(0.5), 20.0);
        assert_eq!(expression("3").value(0.5), 3.0);
        assert_eq!(expression("3").slope(0.5), 0.0);
    }

    #[test]
    fn unusable_laws_are_refused_with_the_cure() {
        let refused = [
            (Scalar::Constant(f64::NAN), "not a finite number"),
            (Scalar::Polynomial(vec![]), "at least [c0]"),
            (
                Scalar::Polynomial(vec![0.0, f64::INFINITY]),
                "coefficient 2",
            ),
            (Scalar::Table(vec![]), "at least [[x, y]]"),
            (Scalar::Table(vec![[0.0, f64::NAN]]), "point 1"),
            (Scalar::Table(vec![[0.0, 1.0], [0.0, 2.0]]), "x must rise"),
            (Scalar::Table(vec![[1.0, 1.0], [0.0, 2.0]]), "point 2"),
            (
                Scalar::Table(vec![[0.0, -1e308], [1.0, 1e308]]),
                "too steeply",
            ),
            (expression("t + v"), "t and v"),
        ];
        for (law, part) in refused {
            let message = law.check().unwrap_err();
            assert!(message.contains(part), "{message}");
        }
        for law in [
            table(),
            expression("t"),
            Scalar::zero(),
            Scalar::Polynomial(vec![1.0]),
        ] {
            assert_eq!(law.check(), Ok(()));
        }
    }
}
