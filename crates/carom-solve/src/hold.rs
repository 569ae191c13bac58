//! Multipliers that hold everything, where there are such.

use crate::problem::natural::project_cone;
use crate::problem::{Problem, Scaled};
use crate::rows::{RowContact, RowSystem};
use crate::solver::{fill, InteriorPoint};

/// Velocity left over that of the loads (1) at which conjugate gradients end: a little above rounding. Smaller, they go on
/// until their steps are spent.
const LEFT: f64 = 1e-13;
/// The same at which path following ends. (Above rounding: gaps are differences of coordinates.) Smaller, things at rest creep
/// or are held by no forces; the next number is what is accepted at worst.
const ENOUGH: f64 = 1e-8;
/// The same accepted at most, where measures contradict one another by what earlier steps left. Large, what slides slowly is
/// held; small, piles at rest are solved anew in each step.
const MOST: f64 = 1e-5;
/// Growth of the residual over its least (1) after which conjugate gradients stop: it does not fall again.
const LOST: f64 = 1e3;
/// Steps of conjugate gradients over rows (1) at most; bounds their time. In exact arithmetic 1 is enough.
const STEPS_PER_ROW: usize = 2;
/// Numbers (1, of 8 bytes) in Cholesky factors of W up to which path following is asked. Larger, one answer takes the time of a
/// hundred steps; smaller, pyramids of some thousand spheres fall that friction can hold.
const MAX_FILL: usize = 3_000_000;

/// Looks for multipliers within the cones of `chosen` contacts and of all joints under which none of their measures `z` (without multipliers)
/// is left: near those of `lambda`, else by [`InteriorPoint::hold`]. `lambda` takes them, 0 for all other contacts. False: none were found,
/// `lambda` is as it was.
pub fn hold(
    system: &RowSystem,
    z: &[f64],
    chosen: impl Fn(usize, &RowContact) -> bool,
    lambda: &mut [f64],
) -> bool {
    let mut part = RowSystem {
        inv_mass: system.inv_mass.clone(),
        inv_inertia: system.inv_inertia.clone(),
        node_length: system.node_length.clone(),
        ..RowSystem::default()
    };
    let mut rows = Vec::new();
    for (slot, c) in system.contacts.iter().enumerate() {
        if !(c.bilateral || chosen(slot, c)) {
            continue;
        }
        let range = c.rows();
        part.contacts.push(RowContact {
            row: rows.len() as u32,
            ..*c
        });
        part.jac.extend_from_slice(&system.jac[range.clone()]);
        part.z0.extend_from_slice(&z[range.clone()]);
        rows.extend(range);
    }
    if rows.is_empty() {
        return false;
    }
    let problem = Problem::from_rows(&part, &part.z0);
    let scaled = Scaled::new(&problem);
    let given: Vec<f64> = rows.iter().map(|&row| lambda[row]).collect();
    let mut y = vec![0.0; rows.len()];
    scaled.enter(&given, &mut y);
    let near = given.iter().any(|&r| r != 0.0) && settle(&scaled.problem, &mut y);
    if !near {
        if fill(&scaled.problem).is_none_or(|fill| fill > MAX_FILL) {
            return false;
        }
        let found = InteriorPoint::default().hold(&scaled.problem, ENOUGH, MOST);
        let Some(found) = found else {
            return false;
        };
        y.copy_from_slice(&found);
        // What is left of the last step of the path.
        let mut finer = y.clone();
        if settle(&scaled.problem, &mut finer) {
            y = finer;
        }
    }
    let mut r = given;
    scaled.leave(&y, &mut r);
    lambda.fill(0.0);
    for (&row, r) in rows.iter().zip(&r) {
        lambda[row] = *r;
    }
    true
}

/// Comes as near to `W y + q = 0` as conjugate gradients do from `y`: W is singular, but holds q where measures do not contradict one another.
/// False: not near enough, or not within the cones.
fn settle(problem: &Problem, y: &mut [f64]) -> bool {
    let n = problem.rows();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let loads = dot(&problem.q, &problem.q);
    let (mut residual, mut product) = (vec![0.0; n], vec![0.0; n]);
    problem.velocity(y, &mut residual);
    residual.iter_mut().for_each(|r| *r = -*r);
    let (mut direction, mut at) = (residual.clone(), y.to_vec());
    let mut square = dot(&residual, &residual);
    let mut least = square;
    for _ in 0..STEPS_PER_ROW * n {
        if square <= LEFT * LEFT * loads || square > LOST * LOST * least {
            break;
        }
        product.fill(0.0);
        problem.w.add_product(&direction, &mut product);
        let length = square / dot(&direction, &product);
        if !(length > 0.0 && length.is_finite()) {
            break;
        }
        for k in 0..n {
            at[k] += length * direction[k];
            residual[k] -= length * product[k];
        }
        let next = dot(&residual, &residual);
        for k in 0..n {
            direction[k] = residual[k] + next / square * direction[k];
        }
        square = next;
        if square < least {
            least = square;
            y.copy_from_slice(&at);
        }
    }
    least <= ENOUGH * ENOUGH * loads && is_inside(problem, y)
}

/// Whether every contact's forces are in its cone.
fn is_inside(problem: &Problem, y: &[f64]) -> bool {
    problem.groups.iter().all(|group| {
        let mut projected = y[group.rows()].to_vec();
        project_cone(group, &mut projected);
        projected == y[group.rows()]
    })
}
