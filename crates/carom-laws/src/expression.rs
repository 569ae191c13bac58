//! An expression as a list of operations on a stack, with value and slope.

use super::function::{Binary, Function, Unary};
use std::fmt;

/// One operation: puts a number on the stack or replaces those on top by its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Op {
    Number(f64),
    Variable(usize),
    One(Unary),
    Two(Binary),
}

/// A formula of named variables: read once, evaluated often.
#[derive(Clone, Debug)]
pub struct Expression {
    pub(super) text: String,
    pub(super) variables: Vec<String>,
    pub(super) operations: Vec<Op>,
    /// Column of each operation in the text, for messages.
    pub(super) columns: Vec<usize>,
    /// Most numbers on the stack at any time.
    pub(super) depth: usize,
}

/// Deeper stacks than this are allocated.
const USUAL_DEPTH: usize = 16;

/// A number and its rate of change along the variable asked for.
#[derive(Clone, Copy, Default)]
struct Dual {
    value: f64,
    slope: f64,
}

impl Expression {
    /// Names that are neither functions nor constants, in the order of their first appearance.
    pub fn variables(&self) -> &[String] {
        &self.variables
    }

    /// Value for the variables in the order of [`Expression::variables`]; further numbers are not looked at,
    /// fewer panic.
    ///
    /// Outside the domain of a function the result is not a number; [`Expression::check_at`] says where.
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        self.run(|stack, top, op| match op {
            Op::Number(x) => stack[top] = x,
            Op::Variable(k) => stack[top] = values[k],
            Op::One(f) => stack[top] = f.value(stack[top]),
            Op::Two(f) => stack[top] = f.value(stack[top], stack[top + 1]),
        })
    }

    /// Partial derivative along a variable (index in [`Expression::variables`]), to the right; zero if there is none.
    ///
    /// Exact but for rounding: value and slope are carried through the operations together.
    pub fn slope(&self, values: &[f64], variable: usize) -> f64 {
        self.slope_on(values, variable, 1.0)
    }

    /// The same to the left.
    pub fn slope_before(&self, values: &[f64], variable: usize) -> f64 {
        -self.slope_on(values, variable, -1.0)
    }

    /// Rate of change on a path on which the variable changes at the rate `way`, 1 or -1.
    fn slope_on(&self, values: &[f64], variable: usize, way: f64) -> f64 {
        let result: Dual = self.run(|stack: &mut [Dual], top, op| {
            stack[top] = match op {
                Op::Number(value) => Dual { value, slope: 0.0 },
                Op::Variable(k) => Dual {
                    value: values[k],
                    slope: if k == variable { way } else { 0.0 },
                },
                Op::One(f) => {
                    let x = stack[top];
                    Dual {
                        value: f.value(x.value),
                        slope: f.slope(x.value, x.slope),
                    }
                }
                Op::Two(f) => {
                    let (a, b) = (stack[top], stack[top + 1]);
                    Dual {
                        value: f.value(a.value, b.value),
                        slope: f.slope(a.value, b.value, a.slope, b.slope),
                    }
                }
            }
        });
        result.slope
    }

    /// The value if it is a finite number; otherwise the first operation that gives none, and its column.
    pub fn check_at(&self, values: &[f64]) -> Result<f64, String> {
        let mut fault = None;
        let mut columns = self.columns.iter();
        let value = self.run(|stack: &mut [f64], top, op| {
            let (a, b) = (stack[top], stack.get(top + 1).copied().unwrap_or(0.0));
            let (result, what) = match op {
                Op::Number(x) => (x, x.to_string()),
                Op::Variable(k) => (values[k], self.variables[k].clone()),
                Op::One(f) => (f.value(a), describe_one(f, a)),
                Op::Two(f) => (f.value(a, b), describe_two(f, a, b)),
            };
            let column = columns.next().copied().unwrap_or(0);
            if !result.is_finite() && fault.is_none() {
                let kind = if result.is_nan() {
                    "not a number"
                } else {
                    "not finite"
                };
                fault = Some(format!("column {column}: {what} is {kind}"));
            }
            stack[top] = result;
        });
        match fault {
            Some(message) => Err(message),
            None => Ok(value),
        }
    }

    /// Runs the operations. `apply(stack, top, op)` reads its arguments from `stack[top..]` and writes to `stack[top]`.
    fn run<T: Copy + Default>(&self, apply: impl FnMut(&mut [T], usize, Op)) -> T {
        if self.depth <= USUAL_DEPTH {
            self.run_on(&mut [T::default(); USUAL_DEPTH], apply)
        } else {
            self.run_on(&mut vec![T::default(); self.depth], apply)
        }
    }

    fn run_on<T: Copy>(&self, stack: &mut [T], mut apply: impl FnMut(&mut [T], usize, Op)) -> T {
        let mut length = 0;
        for op in &self.operations {
            length = length + 1 - op.arguments();
            apply(stack, length - 1, *op);
        }
        stack[0]
    }
}

impl Op {
    /// How many numbers it takes from the stack.
    pub fn arguments(self) -> usize {
        match self {
            Op::Number(_) | Op::Variable(_) => 0,
            Op::One(_) => 1,
            Op::Two(_) => 2,
        }
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text.trim())
    }
}

/// A number for a message: as it is, or with an exponent where it had very many digits.
fn short(x: f64) -> String {
    if x != 0.0 && !(1e-6..1e16).contains(&x.abs()) {
        format!("{x:e}")
    } else {
        x.to_string()
    }
}

fn describe_one(f: Unary, x: f64) -> String {
    match f {
        Unary::Negate => format!("-({})", short(x)),
        f => format!("{}({})", Function::One(f).name(), short(x)),
    }
}

fn describe_two(f: Binary, x: f64, y: f64) -> String {
    let (a, b) = (short(x), short(y));
    match f.sign() {
        Some(sign) if y < 0.0 => format!("{a} {sign} ({b})"),
        Some(sign) => format!("{a} {sign} {b}"),
        None if f == Binary::Atan2 => format!("{}({a}, {b})", Function::Two(f).name()),
        None => format!("{}({a}, {b})", Function::Many(f).name()),
    }
}
