//! A square matrix of small dense blocks in compressed rows, one block row for each contact.

use super::RowGroup;

/// Blocks `W_ij` of `dim_i x dim_j`, row-major. Those of one block row stand one after another, by ascending column; the
/// diagonal block is always there.
#[derive(Clone, Debug, Default)]
pub struct BlockMatrix {
    /// Blocks of row `i`: `ptr[i]..ptr[i + 1]`.
    pub ptr: Vec<usize>,
    /// Column (contact) of each block.
    pub col: Vec<u32>,
    /// First value of each block.
    pub start: Vec<usize>,
    pub values: Vec<f64>,
    /// Diagonal block of each row: an index into `col`.
    pub diagonal: Vec<usize>,
    /// First row and number of rows of each contact.
    shape: Vec<(u32, u32)>,
    /// All contacts have three rows: products take a shorter way.
    all_three: bool,
}

impl BlockMatrix {
    /// Blocks of zeros at the given columns of each row (ascending, the diagonal among them).
    pub fn zeros(groups: &[RowGroup], ptr: Vec<usize>, col: Vec<u32>) -> BlockMatrix {
        debug_assert_eq!(ptr.len(), groups.len() + 1);
        let mut start = Vec::with_capacity(col.len() + 1);
        let mut diagonal = vec![usize::MAX; groups.len()];
        let mut at = 0;
        for (i, group) in groups.iter().enumerate() {
            for k in ptr[i]..ptr[i + 1] {
                if col[k] as usize == i {
                    diagonal[i] = k;
                }
                start.push(at);
                at += group.dim * groups[col[k] as usize].dim;
            }
        }
        debug_assert!(diagonal.iter().all(|&k| k != usize::MAX));
        BlockMatrix {
            ptr,
            col,
            start,
            values: vec![0.0; at],
            diagonal,
            shape: groups
                .iter()
                .map(|g| (g.row as u32, g.dim as u32))
                .collect(),
            all_three: groups.iter().all(|g| g.dim == 3),
        }
    }

    /// Number of contacts.
    #[inline]
    pub fn len(&self) -> usize {
        self.shape.len()
    }

    #[inline]
    pub fn is_empty(&self) -> bool {
        self.shape.is_empty()
    }

    /// First row and number of rows of a contact.
    #[inline]
    pub fn shape(&self, contact: usize) -> (usize, usize) {
        let (row, dim) = self.shape[contact];
        (row as usize, dim as usize)
    }

    /// Block `k` of row `i`.
    #[inline]
    pub fn block(&self, i: usize, k: usize) -> &[f64] {
        let size = (self.shape[i].1 * self.shape[self.col[k] as usize].1) as usize;
        &self.values[self.start[k]..self.start[k] + size]
    }

    #[inline]
    pub fn block_mut(&mut self, i: usize, k: usize) -> &mut [f64] {
        let size = (self.shape[i].1 * self.shape[self.col[k] as usize].1) as usize;
        &mut self.values[self.start[k]..self.start[k] + size]
    }

    /// Block at row `i` and column `j`, if it is there.
    pub fn find(&self, i: usize, j: usize) -> Option<usize> {
        let row = self.ptr[i]..self.ptr[i + 1];
        self.col[row.clone()]
            .binary_search(&(j as u32))
            .ok()
            .map(|k| row.start + k)
    }

    /// `y += (row i of W) x`, `y` over the rows of contact `i`.
    #[inline]
    pub fn add_row_product(&self, i: usize, x: &[f64], y: &mut [f64]) {
        let row = self.ptr[i]..self.ptr[i + 1];
        if self.all_three {
            let mut sum = [y[0], y[1], y[2]];
            let values = &self.values[9 * row.start..9 * row.end];
            for (w, &j) in values.chunks_exact(9).zip(&self.col[row]) {
                let x = &x[3 * j as usize..3 * j as usize + 3];
                for r in 0..3 {
                    sum[r] += w[3 * r] * x[0] + w[3 * r + 1] * x[1] + w[3 * r + 2] * x[2];
                }
            }
            y.copy_from_slice(&sum);
            return;
        }
        for k in row {
            let (first, dim) = self.shape(self.col[k] as usize);
            let x = &x[first..first + dim];
            let block = self.block(i, k);
            for (y, w) in y.iter_mut().zip(block.chunks_exact(dim)) {
                *y += w.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
            }
        }
    }

    /// `y += W x`.
    pub fn add_product(&self, x: &[f64], y: &mut [f64]) {
        for i in 0..self.len() {
            let (first, dim) = self.shape(i);
            self.add_row_product(i, x, &mut y[first..first + dim]);
        }
    }

    /// Row, column and place among the values of every entry, row by row.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        (0..self.len()).flat_map(move |i| {
            let (row, dim) = self.shape(i);
            let blocks = move |r| (self.ptr[i]..self.ptr[i + 1]).map(move |k| (r, k));
            (0..dim).flat_map(blocks).flat_map(move |(r, k)| {
                let (col, width) = self.shape(self.col[k] as usize);
                (0..width).map(move |c| (row + r, col + c, self.start[k] + r * width + c))
            })
        })
    }

    /// Largest entry of `W - W^T` over the largest of `W`.
    pub fn asymmetry(&self) -> f64 {
        let largest = self.values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut skew = 0.0f64;
        for i in 0..self.len() {
            for k in self.ptr[i]..self.ptr[i + 1] {
                let j = self.col[k] as usize;
                let (di, dj) = (self.shape(i).1, self.shape(j).1);
                let a = self.block(i, k);
                let b = self.find(j, i).map(|m| self.block(j, m));
                for r in 0..di {
                    for c in 0..dj {
                        let other = b.map_or(0.0, |b| b[c * di + r]);
                        skew = skew.max((a[r * dj + c] - other).abs());
                    }
                }
            }
        }
        if largest > 0.0 {
            skew / largest
        } else {
            0.0
        }
    }
}
