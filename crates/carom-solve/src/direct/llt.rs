//! Sparse Cholesky for symmetric positive definite systems: sticking contacts, penalty steps.

use super::sparse::{Factor, Sparse};
use super::DirectError;
use faer::dyn_stack::{MemStack, StackReq};
use faer::sparse::linalg::cholesky::{
    factorize_symbolic_cholesky, LltRef, SymbolicCholesky, SymmetricOrdering,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// Sparse Cholesky (ordering AMD). Give the lower triangle (`row >= column`) or the whole matrix: entries above the
/// diagonal are ignored.
pub type SparseLlt = Sparse<Llt>;

/// faer's factors; see [`SparseLlt`].
#[derive(Default)]
pub struct Llt {
    symbolic: Option<SymbolicCholesky<usize>>,
    values: Vec<f64>,
}

impl Factor for Llt {
    const SYMMETRIC: bool = true;

    fn analyse(&mut self, a: SymbolicSparseColMatRef<'_, usize>) -> Result<StackReq, DirectError> {
        self.symbolic = None;
        let order = SymmetricOrdering::Amd;
        let symbolic = factorize_symbolic_cholesky(a, Side::Lower, order, Default::default())
            .map_err(|_| DirectError::OutOfMemory)?;
        let need = StackReq::or(
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        );
        self.values.clear();
        self.values.resize(symbolic.len_val(), 0.0);
        self.symbolic = Some(symbolic);
        Ok(need)
    }

    fn fill(&self) -> Option<usize> {
        self.symbolic.as_ref().map(SymbolicCholesky::len_val)
    }

    fn factor(
        &mut self,
        a: SparseColMatRef<'_, usize, f64>,
        stack: &mut MemStack,
    ) -> Result<(), DirectError> {
        let symbolic = self.symbolic.as_ref().ok_or(DirectError::NotFactored)?;
        symbolic
            .factorize_numeric_llt(
                &mut self.values,
                a,
                Side::Lower,
                Default::default(),
                Par::Seq,
                stack,
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| DirectError::NotPositiveDefinite)
    }

    fn solve(&self, x: &mut [f64], stack: &mut MemStack) {
        if let Some(symbolic) = &self.symbolic {
            let n = x.len();
            let rhs = MatMut::from_column_major_slice_mut(x, n, 1);
            LltRef::new(symbolic, &self.values).solve_in_place_with_conj(
                Conj::No,
                rhs,
                Par::Seq,
                stack,
            );
        }
    }
}
