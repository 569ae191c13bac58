//! Sparse LU for the unsymmetric tangent of sliding contacts.

use super::sparse::{Factor, Sparse};
use super::DirectError;
use faer::dyn_stack::{MemStack, StackReq};
use faer::sparse::linalg::lu::{factorize_symbolic_lu, LuRef, NumericLu, SymbolicLu};
use faer::sparse::linalg::LuError;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};

/// Sparse LU with partial pivoting (column ordering COLAMD) of a general square matrix.
pub type SparseLu = Sparse<Lu>;

/// faer's factors; see [`SparseLu`].
#[derive(Default)]
pub struct Lu {
    symbolic: Option<SymbolicLu<usize>>,
    numeric: NumericLu<usize, f64>,
}

impl Factor for Lu {
    const SYMMETRIC: bool = false;

    fn analyse(&mut self, a: SymbolicSparseColMatRef<'_, usize>) -> Result<StackReq, DirectError> {
        self.symbolic = None;
        // faer 0.24.4 panics when the factors of a larger matrix are reused for a smaller one.
        self.numeric = NumericLu::new();
        let symbolic =
            factorize_symbolic_lu(a, Default::default()).map_err(|_| DirectError::OutOfMemory)?;
        let need = StackReq::or(
            symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        );
        self.symbolic = Some(symbolic);
        Ok(need)
    }

    fn factor(
        &mut self,
        a: SparseColMatRef<'_, usize, f64>,
        stack: &mut MemStack,
    ) -> Result<(), DirectError> {
        let symbolic = self.symbolic.as_ref().ok_or(DirectError::NotFactored)?;
        let done = symbolic.factorize_numeric_lu(
            &mut self.numeric,
            a,
            Par::Seq,
            stack,
            Default::default(),
        );
        match done {
            Ok(_) => Ok(()),
            Err(error) => {
                // Half-made factors are not reused.
                self.numeric = NumericLu::new();
                Err(match error {
                    LuError::SymbolicSingular { index } => DirectError::Singular {
                        column: Some(index),
                    },
                    LuError::Generic(_) => DirectError::OutOfMemory,
                })
            }
        }
    }

    fn solve(&self, x: &mut [f64], stack: &mut MemStack) {
        if let Some(symbolic) = &self.symbolic {
            let n = x.len();
            let rhs = MatMut::from_column_major_slice_mut(x, n, 1);
            LuRef::new_unchecked(symbolic, &self.numeric).solve_in_place_with_conj(
                Conj::No,
                rhs,
                Par::Seq,
                stack,
            );
        }
    }
}
