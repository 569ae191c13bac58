//! What an expression can do with numbers: operators and functions, with their slopes.

use std::f64::consts::LN_10;

/// Of one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unary {
    Negate,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sqrt,
    Exp,
    Ln,
    Log10,
    Abs,
    Floor,
    Ceil,
    Sign,
}

/// Of two arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Atan2,
    Min,
    Max,
}

/// A function by its name in the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Function {
    One(Unary),
    Two(Binary),
    /// Two arguments or more, taken in pairs from the left.
    Many(Binary),
}

/// Every function, in the order in which messages and documents list them.
pub const FUNCTIONS: [(&str, Function); 17] = [
    ("sin", Function::One(Unary::Sin)),
    ("cos", Function::One(Unary::Cos)),
    ("tan", Function::One(Unary::Tan)),
    ("asin", Function::One(Unary::Asin)),
    ("acos", Function::One(Unary::Acos)),
    ("atan", Function::One(Unary::Atan)),
    ("atan2", Function::Two(Binary::Atan2)),
    ("sqrt", Function::One(Unary::Sqrt)),
    ("exp", Function::One(Unary::Exp)),
    ("ln", Function::One(Unary::Ln)),
    ("log10", Function::One(Unary::Log10)),
    ("abs", Function::One(Unary::Abs)),
    ("min", Function::Many(Binary::Min)),
    ("max", Function::Many(Binary::Max)),
    ("floor", Function::One(Unary::Floor)),
    ("ceil", Function::One(Unary::Ceil)),
    ("sign", Function::One(Unary::Sign)),
];

impl Function {
    /// Its name in the text; empty for operators.
    pub fn name(self) -> &'static str {
        FUNCTIONS.iter().find(|f| f.1 == self).map_or("", |f| f.0)
    }
}

impl Unary {
    pub fn value(self, x: f64) -> f64 {
        match self {
            Unary::Negate => -x,
            Unary::Sin => x.sin(),
            Unary::Cos => x.cos(),
            Unary::Tan => x.tan(),
            Unary::Asin => x.asin(),
            Unary::Acos => x.acos(),
            Unary::Atan => x.atan(),
            Unary::Sqrt => x.sqrt(),
            Unary::Exp => x.exp(),
            Unary::Ln => x.ln(),
            Unary::Log10 => x.log10(),
            Unary::Abs => x.abs(),
            Unary::Floor => x.floor(),
            Unary::Ceil => x.ceil(),
            // That of zero is zero, unlike `f64::signum`.
            Unary::Sign if x == 0.0 => 0.0,
            Unary::Sign => x.signum(),
        }
    }

    /// Derivative to the right along a path on which `x` changes at the rate `dx`. Jumps count as level.
    pub fn slope(self, x: f64, dx: f64) -> f64 {
        // What does not change has no slope, even where the function has an infinite one.
        if dx == 0.0 {
            return 0.0;
        }
        dx * match self {
            Unary::Negate => -1.0,
            Unary::Sin => x.cos(),
            Unary::Cos => -x.sin(),
            Unary::Tan => 1.0 + x.tan().powi(2),
            Unary::Asin => 1.0 / ((1.0 - x) * (1.0 + x)).sqrt(),
            Unary::Acos => -1.0 / ((1.0 - x) * (1.0 + x)).sqrt(),
            Unary::Atan => 1.0 / (1.0 + x * x),
            Unary::Sqrt => 0.5 / x.sqrt(),
            Unary::Exp => x.exp(),
            Unary::Ln => 1.0 / x,
            Unary::Log10 => 1.0 / (x * LN_10),
            Unary::Abs if x == 0.0 => dx.signum(),
            Unary::Abs => x.signum(),
            Unary::Floor | Unary::Ceil | Unary::Sign => 0.0,
        }
    }
}

impl Binary {
    pub fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Binary::Add => a + b,
            Binary::Subtract => a - b,
            Binary::Multiply => a * b,
            Binary::Divide => a / b,
            Binary::Power => a.powf(b),
            Binary::Atan2 => a.atan2(b),
            // `f64::min` passes over what is not a number; an error must not vanish.
            Binary::Min if a.is_nan() || b.is_nan() => f64::NAN,
            Binary::Max if a.is_nan() || b.is_nan() => f64::NAN,
            Binary::Min => a.min(b),
            Binary::Max => a.max(b),
        }
    }

    /// Derivative to the right along a path on which the arguments change at the rates `da` and `db`.
    pub fn slope(self, a: f64, b: f64, da: f64, db: f64) -> f64 {
        match self {
            Binary::Add => da + db,
            Binary::Subtract => da - db,
            Binary::Multiply => da * b + a * db,
            Binary::Divide => (da - a / b * db) / b,
            Binary::Power => power_slope(a, b, da, db),
            Binary::Atan2 => (da * b - a * db) / (a * a + b * b),
            Binary::Min if a == b => da.min(db),
            Binary::Max if a == b => da.max(db),
            Binary::Min => {
                if a < b {
                    da
                } else {
                    db
                }
            }
            Binary::Max => {
                if a > b {
                    da
                } else {
                    db
                }
            }
        }
    }

    /// Between its arguments in the text, where it stands there.
    pub fn sign(self) -> Option<char> {
        match self {
            Binary::Add => Some('+'),
            Binary::Subtract => Some('-'),
            Binary::Multiply => Some('*'),
            Binary::Divide => Some('/'),
            Binary::Power => Some('^'),
            Binary::Atan2 | Binary::Min | Binary::Max => None,
        }
    }
}

/// Each of the two terms is left out where its rate is zero: there the other factor need not be a number.
fn power_slope(a: f64, b: f64, da: f64, db: f64) -> f64 {
    let base = if da == 0.0 || b == 0.0 {
        0.0
    } else {
        b * a.powf(b - 1.0) * da
    };
    let exponent = if db == 0.0 || (a == 0.0 && b > 0.0) {
        0.0
    } else {
        a.powf(b) * a.ln() * db
    };
    base + exponent
}
