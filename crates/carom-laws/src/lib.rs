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
