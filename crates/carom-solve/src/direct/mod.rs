//! Linear systems, solved directly, and never on trust.
//!
//! Two kinds: small dense matrices in place ([`dense`]: the contact islands of a few balls, up to about 80 rows) and
//! sparse ones ([`SparseLu`], [`SparseLlt`]), a thin layer over faer. A factorisation that returned without an error
//! may still be worthless - faer divides by a zero pivot without a word - so every sparse solve measures its residual,
//! refines, and returns what it achieved; the dense one refuses pivots that are rounding noise.
//!
//! Matrices are square. Sparse ones are compressed columns: `col_ptr` (n+1), `row_idx` (nnz, ascending in each
//! column), `values` (nnz). Units are the caller's.
//!
//! The dense routines give the same bits on every machine. faer picks its kernels by processor, so a sparse solve
//! repeats bit for bit on one machine, for any number of threads of ours (it uses one), but not across machines.

pub mod dense;
mod entries;
mod gram;
mod llt;
mod lu;
mod pattern;
mod sparse;

pub use dense::Singular;
pub use entries::Entries;
pub use gram::{Gram, Touched};
pub use llt::{Llt, SparseLlt};
pub use lu::{Lu, SparseLu};
pub use sparse::{Factor, Sparse, REFINEMENTS, WORST_RESIDUAL};

use std::fmt;

/// What a solve achieved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveQuality {
    /// `max|b - A x| / max|b|` (0 for `b = 0`): how well the equations hold.
    pub residual: f64,
    /// `max|b - A x| / (|A|_inf max|x| + max|b|)`: the smallest relative change of the data that makes `x` exact.
    /// Rounding level unless the factorisation itself went wrong.
    pub backward_error: f64,
    /// Refinement steps that were taken and helped.
    pub refinements: u32,
}

/// Why there is no solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DirectError {
    /// The arrays do not describe a square matrix in compressed columns.
    BadPattern(&'static str),
    /// A matrix entry or the right-hand side is NaN or infinite.
    NotFinite,
    /// No usable pivot; the column where that was noticed, if known. Shift the diagonal and try again.
    Singular {
        /// Column of the original (dense) or permuted (sparse) matrix.
        column: Option<usize>,
    },
    /// Cholesky met a pivot that is not positive.
    NotPositiveDefinite,
    /// The best residual, relative to the right-hand side, is above [`WORST_RESIDUAL`].
    Inaccurate {
        /// `max|b - A x| / max|b|`.
        residual: f64,
    },
    /// `solve` before a successful `refactor`.
    NotFactored,
    /// The factors do not fit into memory.
    OutOfMemory,
}

impl fmt::Display for DirectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BadPattern(why) => write!(f, "not a square matrix in compressed columns: {why}"),
            Self::NotFinite => write!(f, "the linear system holds a number that is not finite"),
            Self::Singular { column: Some(c) } => write!(f, "the matrix is singular at column {c}"),
            Self::Singular { column: None } => write!(f, "the matrix is singular"),
            Self::NotPositiveDefinite => write!(f, "the matrix is not positive definite"),
            Self::Inaccurate { residual } => {
                write!(
                    f,
                    "the solution of the linear system leaves a residual of {residual:.1e}"
                )
            }
            Self::NotFactored => write!(f, "solve was called before a matrix was factored"),
            Self::OutOfMemory => write!(f, "the factors of the matrix do not fit into memory"),
        }
    }
}

impl std::error::Error for DirectError {}

impl From<Singular> for DirectError {
    fn from(s: Singular) -> Self {
        Self::Singular {
            column: Some(s.column),
        }
    }
}
