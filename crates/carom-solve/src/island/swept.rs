//! Large islands by sweeps over their rows: one contact after the other, with the momentum of [`crate::spheres`]. A sweep costs as much as there are
//! rows, and no factorisation fills up, whatever the bodies are.
//!
//! A sweep takes each contact to `P(r - D^-1 z)`. `D` is diagonal and at least the contact's block of `W` ([`divisors`]): the step is exact
//! for spheres, and too short rather than too long where rows act on one another.

use crate::cone::{self, Block, MAX_ROWS};
use crate::rows::{RowContact, RowSystem};
use crate::spheres::{GROWTH, RAMP};

/// Workspace.
#[derive(Default)]
pub(super) struct RowSweeps {
    /// `1/D` of each row.
    steps: Vec<f64>,
    /// Measures without multipliers.
    free: Vec<f64>,
    /// Multipliers and corrections after the sweep before the last one.
    last: Vec<f64>,
    /// Sweeps since the momentum was dropped, and what the last one changed.
    age: u32,
    changed: f64,
}

impl RowSweeps {
    /// The problem linearised where the measures are `z` and the corrections `u`; loads stay as they are there.
    pub fn open(&mut self, system: &RowSystem, z: &[f64], u: &[f64]) {
        self.free = system.free(z, u);
        self.steps.clear();
        self.age = 0;
        for c in &system.contacts {
            let mut block = Block::default();
            system.delassus_block(c, c, &mut block);
            let divisors = divisors(c, &block);
            let divisors = &divisors[..c.dim as usize];
            self.steps.extend(divisors.iter().map(|d| 1.0 / d));
        }
    }

    /// One sweep, of multipliers and the corrections that they alone give: first a step on the way that the last ones came. What it changed over what
    /// there is, in the square.
    pub fn once(&mut self, system: &RowSystem, x: &mut [f64]) -> f64 {
        let k = f64::from(self.age.saturating_sub(1));
        let beta = k / (k + RAMP);
        if self.age == 0 {
            // Of another problem.
            self.last.clear();
            self.last.extend_from_slice(x);
        }
        for (x, last) in x.iter_mut().zip(&mut self.last) {
            let way = *x - *last;
            *last = *x;
            *x += beta * way;
        }
        let (lambda, u) = x.split_at_mut(system.rows());
        let [mut changed, mut size] = [0.0; 2];
        for c in &system.contacts {
            let rows = c.rows();
            let (mut xi, mut new) = ([0.0; MAX_ROWS], [0.0; MAX_ROWS]);
            let (xi, new) = (&mut xi[..rows.len()], &mut new[..rows.len()]);
            for (xi, row) in xi.iter_mut().zip(rows.clone()) {
                let z = self.free[row] + c.along(&system.jac[row], u);
                *xi = lambda[row] - self.steps[row] * z;
            }
            cone::project_from(&c.bounds, c.least, xi, new);
            for (new, row) in new.iter().zip(rows) {
                let change = new - lambda[row];
                size += new * new * system.diag[row];
                if change != 0.0 {
                    changed += change * change * system.diag[row];
                    lambda[row] = *new;
                    system.push_row(c, row, change, u);
                }
            }
        }
        self.age = match self.age {
            0 => 1,
            _ if changed > GROWTH * self.changed => 1,
            age => age + 1,
        };
        self.changed = changed;
        if size > 0.0 {
            changed / size
        } else {
            0.0
        }
    }
}

/// `D` of a contact: the sums of the sizes of the entries in each row of its block, moments over the length, the same in both rows of a disc. So
/// `D - W` has no negative eigenvalue. Where friction is above 1 the normal step is shorter by it, since a longer one changes discs by more than itself.
fn divisors(c: &RowContact, block: &Block) -> [f64; MAX_ROWS] {
    let (dim, translational) = (c.dim as usize, c.translational as usize);
    let scale = |row: usize| if row < translational { 1.0 } else { c.length };
    let mut sums = [0.0; MAX_ROWS];
    for (row, sum) in sums.iter_mut().enumerate().take(dim) {
        let sizes = (0..dim).map(|column| block[row][column].abs() * scale(column));
        *sum = sizes.sum::<f64>() / scale(row);
    }
    for disc in c.bounds.discs() {
        let rows = &mut sums[disc.start..disc.start + disc.dim];
        let most = rows.iter().copied().fold(0.0, f64::max);
        rows.fill(most);
    }
    sums[0] *= c.bounds.sliding.max(1.0);
    sums
}
