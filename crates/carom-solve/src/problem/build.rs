//! From compressed rows, and from a system of rows over nodes, to a [`Problem`]; what is no problem is refused.

use super::{BlockMatrix, Problem, RowGroup};
use crate::cone::{Bounds, MAX_ROWS};
use crate::rows::{RowContact, RowSystem, WORLD};
use std::fmt;

/// Why data do not make a contact problem.
#[derive(Clone, Debug, PartialEq)]
pub struct ProblemError {
    /// The array, and the place in it.
    pub place: String,
    pub cause: String,
}

impl fmt::Display for ProblemError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.cause)
    }
}

impl std::error::Error for ProblemError {}

fn refuse<T>(place: impl Into<String>, cause: impl Into<String>) -> Result<T, ProblemError> {
    Err(ProblemError {
        place: place.into(),
        cause: cause.into(),
    })
}

/// Where the rows of the given data stand in the problem: rows with bound 0 take no force and have no place.
#[derive(Clone, Debug, Default)]
pub struct RowMap {
    /// Row of the data of each row of the problem; `usize::MAX` for a row that was added (2-D contacts).
    source: Vec<usize>,
    rows: usize,
}

impl RowMap {
    /// From the data's rows to the problem's.
    pub fn enter(&self, data: &[f64]) -> Vec<f64> {
        self.source
            .iter()
            .map(|&k| data.get(k).copied().unwrap_or(0.0))
            .collect()
    }

    /// From the problem's rows to the data's; rows that were left out are 0.
    pub fn leave(&self, values: &[f64]) -> Vec<f64> {
        let mut data = vec![0.0; self.rows];
        for (v, &k) in values.iter().zip(&self.source) {
            if let Some(place) = data.get_mut(k) {
                *place = *v;
            }
        }
        data
    }
}

impl Problem {
    /// From `W` in compressed rows (`ptr`, `col`, `values`; entries of the same place add up), `q`, and the bounds of
    /// contacts that all have `dimension` rows: 2 (N T), 3 (N T1 T2), 5 (with R1 R2) or 6 (with S).
    pub fn from_csr(
        ptr: &[i64],
        col: &[i64],
        values: &[f64],
        q: &[f64],
        dimension: usize,
        bounds: &[Bounds],
    ) -> Result<(Problem, RowMap), ProblemError> {
        check(ptr, col, values, q, dimension, bounds)?;
        let flat = dimension == 2;
        let (groups, map, place) = place_rows(q.len(), dimension, bounds);
        let mut problem = Problem {
            w: pattern_of(&groups, dimension, ptr, col),
            q: map.enter(q),
            groups,
        };
        for row in 0..q.len() {
            if place[row] == usize::MAX {
                continue;
            }
            let i = row / dimension;
            for k in ptr[row] as usize..ptr[row + 1] as usize {
                let (j, c) = (col[k] as usize / dimension, place[col[k] as usize]);
                if c == usize::MAX {
                    continue;
                }
                if let Some(at) = problem.w.find(i, j) {
                    let width = problem.groups[j].dim;
                    problem.w.block_mut(i, at)[place[row] * width + c] += values[k];
                }
            }
        }
        if flat {
            // The second sliding row of a plane contact is alone with itself: it stays at 0.
            for i in 0..problem.groups.len() {
                if problem.groups[i].dim == 3 {
                    let k = problem.w.diagonal[i];
                    let block = problem.w.block_mut(i, k);
                    block[8] = if block[4] > 0.0 { block[4] } else { 1.0 };
                }
            }
        }
        Ok((problem, map))
    }

    /// From rows over nodes, with `q = z - G u` for measures `z` linearised at `u` (both over the system's rows and nodes).
    pub fn from_rows(system: &RowSystem, q: &[f64]) -> Problem {
        let mut problem = Problem::default();
        problem.fill_rows(system, q);
        problem
    }

    /// [`Problem::from_rows`] into an existing problem.
    pub fn fill_rows(&mut self, system: &RowSystem, q: &[f64]) {
        self.groups.clear();
        self.groups
            .extend(system.contacts.iter().map(RowContact::group));
        self.q.clear();
        self.q.extend_from_slice(q);
        let neighbours = system.neighbours();
        let (ptr, col) = (neighbours.0, neighbours.1);
        self.w = BlockMatrix::zeros(&self.groups, ptr, col);
        for (i, ci) in system.contacts.iter().enumerate() {
            for k in self.w.ptr[i]..self.w.ptr[i + 1] {
                let cj = &system.contacts[self.w.col[k] as usize];
                let mut block = [[0.0; MAX_ROWS]; MAX_ROWS];
                system.delassus_block(ci, cj, &mut block);
                let width = cj.dim as usize;
                for (out, row) in self.w.block_mut(i, k).chunks_exact_mut(width).zip(&block) {
                    out.copy_from_slice(&row[..width]);
                }
            }
        }
    }
}

impl RowSystem {
    /// Contacts that share a node with each contact, itself among them, ascending: pointers and columns.
    pub fn neighbours(&self) -> (Vec<usize>, Vec<u32>) {
        let nodes = |c: &RowContact| {
            let both = [c.node_a, c.node_b].into_iter();
            both.filter(|&n| n != WORLD).map(|n| n as usize)
        };
        let mut of_node = vec![Vec::new(); self.nodes()];
        for (i, c) in self.contacts.iter().enumerate() {
            nodes(c).for_each(|n| of_node[n].push(i as u32));
        }
        let (mut ptr, mut col, mut seen) = (vec![0], Vec::new(), Vec::new());
        for c in &self.contacts {
            seen.clear();
            nodes(c).for_each(|n| seen.extend_from_slice(&of_node[n]));
            seen.sort_unstable();
            seen.dedup();
            col.extend_from_slice(&seen);
            ptr.push(col.len());
        }
        (ptr, col)
    }
}

/// Refuses what is no problem.
fn check(
    ptr: &[i64],
    col: &[i64],
    values: &[f64],
    q: &[f64],
    dimension: usize,
    bounds: &[Bounds],
) -> Result<(), ProblemError> {
    let n = q.len();
    if ![2, 3, 5, 6].contains(&dimension) {
        return refuse("dimension", format!("{dimension} is none of 2, 3, 5, 6"));
    }
    if bounds.len() * dimension != n {
        let contacts = bounds.len();
        return refuse(
            "q",
            format!("{n} rows for {contacts} contacts of {dimension} rows"),
        );
    }
    let descends = ptr.windows(2).any(|w| w[1] < w[0]);
    if ptr.len() != n + 1
        || ptr[0] != 0
        || descends
        || ptr[n] != col.len() as i64
        || col.len() != values.len()
    {
        return refuse("W", "its arrays are not those of compressed rows");
    }
    if let Some(k) = col.iter().position(|&c| c < 0 || c >= n as i64) {
        return refuse(
            "W",
            format!("column {} of entry {k} is out of range", col[k]),
        );
    }
    for (name, array) in [("W", values), ("q", q)] {
        if let Some(k) = array.iter().position(|v| !v.is_finite()) {
            return refuse(name, format!("{} as value {k} (from 0)", array[k]));
        }
    }
    for (c, b) in bounds.iter().enumerate() {
        for (name, v) in [("mu", b.sliding), ("mu_r", b.rolling), ("mu_s", b.spinning)] {
            if !(v >= 0.0 && v.is_finite()) {
                return refuse(name, format!("{v} at contact {c} (from 0)"));
            }
        }
    }
    Ok(())
}

/// The contacts, where their rows come from, and the place of each row of the data within its contact.
fn place_rows(
    rows: usize,
    dimension: usize,
    bounds: &[Bounds],
) -> (Vec<RowGroup>, RowMap, Vec<usize>) {
    let mut groups = Vec::with_capacity(bounds.len());
    let mut map = RowMap {
        source: Vec::with_capacity(rows),
        rows,
    };
    let mut place = vec![usize::MAX; rows];
    for (c, b) in bounds.iter().enumerate() {
        let bounds = Bounds {
            sliding: b.sliding,
            rolling: if dimension > 3 { b.rolling } else { 0.0 },
            spinning: if dimension > 5 { b.spinning } else { 0.0 },
        };
        let row = map.source.len();
        let discs = [
            (bounds.sliding, 1..dimension.min(3)),
            (bounds.rolling, 3..5),
            (bounds.spinning, 5..6),
        ];
        let discs = discs.into_iter().filter(|(bound, _)| *bound > 0.0);
        for r in std::iter::once(0).chain(discs.flat_map(|(_, rows)| rows)) {
            place[c * dimension + r] = map.source.len() - row;
            map.source.push(c * dimension + r);
        }
        if dimension == 2 && bounds.sliding > 0.0 {
            map.source.push(usize::MAX);
        }
        groups.push(RowGroup {
            row,
            dim: bounds.dim(),
            bounds,
            bilateral: false,
            least: 0.0,
        });
    }
    (groups, map, place)
}

/// Blocks that hold an entry, those opposite to them, and the diagonal.
fn pattern_of(groups: &[RowGroup], dimension: usize, ptr: &[i64], col: &[i64]) -> BlockMatrix {
    let contacts = groups.len();
    let mut of_row: Vec<Vec<u32>> = (0..contacts as u32).map(|i| vec![i]).collect();
    for i in 0..contacts {
        for k in ptr[i * dimension] as usize..ptr[(i + 1) * dimension] as usize {
            let j = col[k] as usize / dimension;
            if j != i {
                of_row[i].push(j as u32);
                of_row[j].push(i as u32);
            }
        }
        // Entries of one block follow one another: keep the lists short on the way.
        if of_row[i].len() > 64 {
            of_row[i].sort_unstable();
            of_row[i].dedup();
        }
    }
    let (mut starts, mut columns) = (vec![0], Vec::new());
    for row in &mut of_row {
        row.sort_unstable();
        row.dedup();
        columns.extend_from_slice(row);
        starts.push(columns.len());
    }
    BlockMatrix::zeros(groups, starts, columns)
}
