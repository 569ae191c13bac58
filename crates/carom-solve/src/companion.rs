//! The convex companion of a contact problem: what is left where Coulomb's law has no solution, or none that is found.
//!
//! `min 1/2 r.(W + sigma) r + q.r` over the cones has exactly one solution for every q. It gives no energy, and is that of Coulomb's law
//! where nothing slides; what slides moves apart with mu times its slip (Cadoux, thesis, Grenoble 2009; Anitescu, Math. Program. 105, 113, 2006).

use crate::cone::{Bounds, Disc, Status};
use crate::problem::{Problem, Scaled};
use crate::rows::RowSystem;
use crate::solver::InteriorPoint;

/// sigma over the diagonal of W (1). Larger: contacts give way by a larger share of what the loads do. Smaller: where measures
/// contradict one another forces grow to its inverse, and rounding keeps the path from them.
const SIGMA: f64 = 1e-6;
/// Forces over the largest one (1) that are those of a contact which parts: the path ends inside of the cones.
const PARTED: f64 = 1e-8;
/// The same over the speed at which it parts (1).
const PARTING: f64 = 1e-3;
/// Share (1) by which friction may miss the boundary of its disc where it slips, for the same reason.
const ON_BOUNDARY: f64 = 1e-5;

/// Solves for the multipliers of the measures `q` (without multipliers), with this share of the friction. False:
/// rounding kept the path from it, `lambda` is as it was.
pub fn solve(system: &RowSystem, q: &[f64], friction: f64, lambda: &mut [f64]) -> bool {
    let mut problem = Problem::from_rows(system, q);
    for group in &mut problem.groups {
        group.bounds = group.bounds.scaled(friction);
    }
    let scaled = Scaled::new(&problem);
    let found = InteriorPoint::default().companion(&shifted(&scaled.problem));
    let Some(mut y) = found else {
        return false;
    };
    let mut u = vec![0.0; y.len()];
    scaled.problem.velocity(&y, &mut u);
    let largest = y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    for group in scaled.problem.groups.iter().filter(|g| !g.bilateral) {
        if y[group.row] <= PARTED * largest || y[group.row] <= PARTING * u[group.row] {
            y[group.rows()].fill(0.0);
        }
    }
    scaled.leave(&y, lambda);
    true
}

/// The problem with sigma in its contacts.
fn shifted(problem: &Problem) -> Problem {
    let mut shifted = problem.clone();
    for (i, group) in problem.groups.iter().enumerate() {
        if group.bilateral {
            continue;
        }
        let k = shifted.w.diagonal[i];
        let block = shifted.w.block_mut(i, k);
        for r in 0..group.dim {
            block[r * group.dim + r] *= 1.0 + SIGMA;
        }
    }
    shifted
}

/// What a companion moves a contact apart by, with these measures.
pub(crate) fn moved_apart(bounds: &Bounds, z: &[f64]) -> f64 {
    let slip = |d: Disc| {
        let z = &z[d.start..d.start + d.dim];
        d.bound * z.iter().map(|z| z * z).sum::<f64>().sqrt()
    };
    bounds.discs().map(slip).sum()
}

/// What a contact does under multipliers of a companion: by them alone, since what slides moves apart.
pub fn status(system: &RowSystem, slot: usize, lambda: &[f64]) -> Status {
    let c = &system.contacts[slot];
    let l = &lambda[c.rows()];
    if c.bilateral {
        return Status::Stick;
    }
    if l[0] == 0.0 {
        return Status::Gap;
    }
    let slides =
        c.bounds.sliding > 0.0 && l[1].hypot(l[2]) >= (1.0 - ON_BOUNDARY) * c.bounds.sliding * l[0];
    if slides {
        Status::Slip
    } else {
        Status::Stick
    }
}
