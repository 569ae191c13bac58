//! What the sparse factorisations share: the pattern cache, refinement and the final judgement.

use super::pattern::Pattern;
use super::{DirectError, SolveQuality};
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// Refinement steps (1) per solve at most: two gain what double precision allows; more only cost.
pub const REFINEMENTS: u32 = 2;
/// Residual over the right-hand side (1) above which a solve is an error: no direction for Newton. Larger, its line search
/// fails without a reason in the report.
pub const WORST_RESIDUAL: f64 = 1e-3;
/// Backward error (1) at which a solution is left alone: LU without trouble is below. Smaller, each solve is refined in vain.
const GOOD: f64 = 1e-14;

/// One factorisation of faer, without judgement; [`Sparse`] adds that.
pub trait Factor: Default {
    /// Only the lower triangle is read, and stands for the whole matrix.
    const SYMMETRIC: bool;

    /// Plans for a pattern; returns the scratch memory that factoring and solving need.
    fn analyse(&mut self, a: SymbolicSparseColMatRef<'_, usize>) -> Result<StackReq, DirectError>;

    /// Numbers in the factors of the analysed pattern, where the plan tells.
    fn fill(&self) -> Option<usize> {
        None
    }

    /// Factors values of the analysed pattern.
    fn factor(
        &mut self,
        a: SparseColMatRef<'_, usize, f64>,
        stack: &mut MemStack,
    ) -> Result<(), DirectError>;

    /// `x <- A^-1 x`, whatever comes out.
    fn solve(&self, x: &mut [f64], stack: &mut MemStack);
}

/// A sparse direct solver around one kind of [`Factor`]; use it as [`super::SparseLu`] or [`super::SparseLlt`].
pub struct Sparse<F: Factor> {
    factor: F,
    pattern: Pattern,
    state: FactorState,
    /// The matrix itself, for residuals.
    values: Vec<f64>,
    /// `|A|_inf`, the largest row sum.
    norm: f64,
    scratch: MemBuffer,
    residual: Vec<f64>,
    correction: Vec<f64>,
    trial: Vec<f64>,
    analyses: u64,
}

#[derive(Clone, Copy, PartialEq)]
enum FactorState {
    Empty,
    Analysed,
    Factored,
}

impl<F: Factor> Default for Sparse<F> {
    fn default() -> Self {
        Self {
            factor: F::default(),
            pattern: Pattern::default(),
            state: FactorState::Empty,
            values: Vec::new(),
            norm: 0.0,
            scratch: MemBuffer::new(StackReq::EMPTY),
            residual: Vec::new(),
            correction: Vec::new(),
            trial: Vec::new(),
            analyses: 0,
        }
    }
}

impl<F: Factor> Sparse<F> {
    /// Nothing analysed yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Symbolic analyses so far: grows only when the pattern changes.
    pub fn analyses(&self) -> u64 {
        self.analyses
    }

    /// Numbers in the factors of the analysed pattern: what a factorisation costs (Cholesky only).
    pub fn fill(&self) -> Option<usize> {
        self.factor.fill()
    }

    /// Orders and plans the factorisation of an `n x n` pattern. Does nothing if it is the one at hand.
    pub fn analyse(
        &mut self,
        n: usize,
        col_ptr: &[usize],
        row_idx: &[usize],
    ) -> Result<(), DirectError> {
        if self.state != FactorState::Empty && self.pattern.is(n, col_ptr, row_idx) {
            return Ok(());
        }
        self.state = FactorState::Empty;
        self.pattern.set(n, col_ptr, row_idx)?;
        let need = self.factor.analyse(self.pattern.as_faer())?;
        self.scratch = MemBuffer::try_new(need).map_err(|_| DirectError::OutOfMemory)?;
        self.state = FactorState::Analysed;
        self.analyses += 1;
        Ok(())
    }

    /// Factors new values; analyses first if the pattern is new.
    pub fn refactor(
        &mut self,
        n: usize,
        col_ptr: &[usize],
        row_idx: &[usize],
        values: &[f64],
    ) -> Result<(), DirectError> {
        self.analyse(n, col_ptr, row_idx)?;
        self.state = FactorState::Analysed;
        if values.len() != row_idx.len() {
            return Err(DirectError::BadPattern(
                "values and row_idx differ in length",
            ));
        }
        // faer promises nothing about NaN: keep it out.
        if !values.iter().all(|v| v.is_finite()) {
            return Err(DirectError::NotFinite);
        }
        self.values.clear();
        self.values.extend_from_slice(values);
        self.norm = self.row_sum_norm();
        let matrix = SparseColMatRef::new(self.pattern.as_faer(), &self.values[..]);
        self.factor
            .factor(matrix, MemStack::new(&mut self.scratch))?;
        self.state = FactorState::Factored;
        Ok(())
    }

    /// `out = A^-1 rhs`; on an error `out` holds nothing of use. Refines until the backward error is 1e-14 or a step no longer helps, at most
    /// [`REFINEMENTS`] times; [`DirectError::Inaccurate`] above [`WORST_RESIDUAL`].
    ///
    /// # Panics
    /// If `rhs` or `out` do not have `n` entries.
    pub fn solve(&mut self, rhs: &[f64], out: &mut [f64]) -> Result<SolveQuality, DirectError> {
        let n = self.pattern.n;
        if self.state != FactorState::Factored {
            return Err(DirectError::NotFactored);
        }
        assert!(
            rhs.len() == n && out.len() == n,
            "right-hand side and solution of the matrix's size"
        );
        if !rhs.iter().all(|v| v.is_finite()) {
            return Err(DirectError::NotFinite);
        }
        let scale = largest(rhs);
        // Numbers that small have no digits to judge a solution by.
        if scale < f64::MIN_POSITIVE {
            out.fill(0.0);
            return Ok(SolveQuality {
                residual: 0.0,
                backward_error: 0.0,
                refinements: 0,
            });
        }
        out.copy_from_slice(rhs);
        self.factor.solve(out, MemStack::new(&mut self.scratch));
        let mut left = self.residual_of(rhs, out);
        if !left.is_finite() {
            return Err(DirectError::Singular { column: None });
        }
        let mut refinements = 0;
        while refinements < REFINEMENTS && left > GOOD * (self.norm * largest(out) + scale) {
            self.correction.clear();
            self.correction.extend_from_slice(&self.residual);
            self.factor
                .solve(&mut self.correction, MemStack::new(&mut self.scratch));
            self.trial.clear();
            self.trial
                .extend(out.iter().zip(&self.correction).map(|(x, d)| x + d));
            let trial = std::mem::take(&mut self.trial);
            let new = self.residual_of(rhs, &trial);
            let helped = new < left;
            if helped {
                out.copy_from_slice(&trial);
                left = new;
                refinements += 1;
            }
            self.trial = trial;
            if !helped {
                break;
            }
        }
        let residual = left / scale;
        if residual.is_nan() || residual > WORST_RESIDUAL {
            return Err(DirectError::Inaccurate { residual });
        }
        let backward_error = left / (self.norm * largest(out) + scale);
        Ok(SolveQuality {
            residual,
            backward_error,
            refinements,
        })
    }

    /// `self.residual = rhs - A x`; its largest entry, NaN if any is.
    fn residual_of(&mut self, rhs: &[f64], x: &[f64]) -> f64 {
        self.residual.clear();
        self.residual.extend_from_slice(rhs);
        let r = &mut self.residual;
        for (j, entries) in self.pattern.columns() {
            let mut mirrored = 0.0;
            for k in entries {
                let (i, v) = (self.pattern.row_idx[k], self.values[k]);
                if !F::SYMMETRIC || i >= j {
                    r[i] -= v * x[j];
                    if F::SYMMETRIC && i > j {
                        mirrored += v * x[i];
                    }
                }
            }
            if F::SYMMETRIC {
                r[j] -= mirrored;
            }
        }
        largest(r)
    }

    fn row_sum_norm(&mut self) -> f64 {
        let sums = &mut self.residual;
        sums.clear();
        sums.resize(self.pattern.n, 0.0);
        for (j, entries) in self.pattern.columns() {
            for k in entries {
                let (i, v) = (self.pattern.row_idx[k], self.values[k].abs());
                if !F::SYMMETRIC || i >= j {
                    sums[i] += v;
                    if F::SYMMETRIC && i > j {
                        sums[j] += v;
                    }
                }
            }
        }
        largest(sums)
    }
}

/// Largest magnitude; unlike a fold with `f64::max` it does not lose a NaN.
fn largest(v: &[f64]) -> f64 {
    let mut m = 0.0;
    for x in v {
        let x = x.abs();
        if x > m || x.is_nan() {
            m = x;
            if x.is_nan() {
                break;
            }
        }
    }
    m
}
