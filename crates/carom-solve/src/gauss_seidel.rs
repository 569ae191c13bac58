//! Projected Gauss-Seidel sweeps: the slow, unfailing way to a starting point for Newton (rule R1).

use crate::rows::{RowSystem, Subproblem, NODE_DOF, WORLD};

/// Runs `count` sweeps on `(lambda, u)` in place. Gradients are refreshed before each sweep; within a sweep the
/// measures are linear. Each disc takes its own minimiser with the
/// others held: exact for a sphere without rolling rows, one more sweep of the same kind where sliding and rolling couple.
pub fn sweeps<P: Subproblem>(
    system: &mut RowSystem,
    problem: &mut P,
    count: u32,
    lambda: &mut [f64],
    u: &mut [f64],
    z: &mut [f64],
) {
    let mut base = vec![0.0; u.len()];
    let mut force = vec![0.0; u.len()];
    for _ in 0..count {
        problem.evaluate(system, u, z);
        // Normals may have turned: momentum balance with the present ones.
        system.momentum(lambda, &mut force);
        system.apply_inverse_mass(&force, u);
        problem.evaluate(system, u, z);
        base.copy_from_slice(u);
        for index in 0..system.contacts.len() {
            let c = system.contacts[index];
            let row = c.row as usize;
            let measure = |system: &RowSystem, u: &[f64], r: usize| {
                z[r] + system.row_velocity(&c, r, u) - system.row_velocity(&c, r, &base)
            };
            if c.bilateral {
                for r in row..row + c.dim as usize {
                    let delta = -measure(system, u, r) / system.diag[r];
                    update(system, &c, r, delta, u);
                    lambda[r] += delta;
                }
                continue;
            }
            let normal = (lambda[row] - measure(system, u, row) / system.diag[row]).max(0.0);
            update(system, &c, row, normal - lambda[row], u);
            lambda[row] = normal;
            for disc in c.bounds.discs() {
                let first = row + disc.start;
                let mut target = [0.0; 2];
                let mut length = 0.0;
                for k in 0..disc.dim {
                    let r = first + k;
                    target[k] = lambda[r] - measure(system, u, r) / system.diag[r];
                    length += target[k] * target[k];
                }
                let (length, radius) = (length.sqrt(), disc.bound * normal);
                let scale = if length > radius {
                    radius / length
                } else {
                    1.0
                };
                for k in 0..disc.dim {
                    let r = first + k;
                    update(system, &c, r, scale * target[k] - lambda[r], u);
                    lambda[r] = scale * target[k];
                }
            }
        }
    }
}

/// `u += M^-1 J_row^T delta`.
fn update(system: &RowSystem, c: &crate::rows::RowContact, row: usize, delta: f64, u: &mut [f64]) {
    for (side, node) in [(0, c.node_a), (1, c.node_b)] {
        if node == WORLD {
            continue;
        }
        let node = node as usize;
        let jac = &system.jac[row][side];
        for k in 0..NODE_DOF {
            let inverse = if k < 3 {
                system.inv_mass[node]
            } else {
                system.inv_inertia[node]
            };
            u[NODE_DOF * node + k] += inverse * jac[k] * delta;
        }
    }
}
