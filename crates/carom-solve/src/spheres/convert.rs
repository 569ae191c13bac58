//! Problems of spheres that come as rows.

use super::{Body, Contact};
use crate::rows::{RowContact, RowSystem, NODE_DOF, WORLD};
use glam::DVec3;

/// Largest deviation of a row from that of a sphere, relative to its lever arm.
const TOLERANCE: f64 = 1e-12;

/// A problem of spheres from rows, in the order of its nodes and contacts.
#[derive(Clone, Debug)]
pub struct Spheres {
    pub bodies: Vec<Body>,
    pub contacts: Vec<Contact>,
}

/// The problem as spheres; nothing where rows are other than those of spheres with sliding friction: joints, rolling or spinning
/// rows, loads that follow the motion, tangents that are not orthogonal to the normal (the velocity level has its normals at the
/// end of the step and its tangents at the start), lever arms other than the length of the node. Measures count as linear.
pub fn as_spheres(system: &RowSystem) -> Option<Spheres> {
    if system.has_load() {
        return None;
    }
    let body = |node: usize| Body {
        inv_mass: system.inv_mass[node],
        inv_inertia: system.inv_inertia[node],
        radius: system.node_length[node],
    };
    let contacts = system
        .contacts
        .iter()
        .map(|c| contact(system, c))
        .collect::<Option<Vec<_>>>()?;
    Some(Spheres {
        bodies: (0..system.nodes()).map(body).collect(),
        contacts,
    })
}

fn contact(system: &RowSystem, c: &RowContact) -> Option<Contact> {
    let first = c.row as usize;
    let plain = !c.bilateral && c.bounds.rolling <= 0.0 && c.bounds.spinning <= 0.0;
    let radius = |node: u32| {
        if node == WORLD {
            0.0
        } else {
            system.node_length[node as usize]
        }
    };
    let arms = [radius(c.node_a), radius(c.node_b)];
    let n = axis(system, first);
    if !plain
        || !is_row(system, c, first, n, DVec3::ZERO, arms)
        || (n.length_squared() - 1.0).abs() > TOLERANCE
    {
        return None;
    }
    let mut slip = system.z0[first] * n;
    if c.dim == 3 {
        let (t1, t2) = (axis(system, first + 1), axis(system, first + 2));
        let frame = [
            n.dot(t1),
            n.dot(t2),
            t1.dot(t2),
            t1.length_squared() - 1.0,
            t2.length_squared() - 1.0,
        ];
        let turned = |row: usize, t: DVec3| is_row(system, c, row, t, t.cross(n), arms);
        if frame.iter().any(|x| x.abs() > TOLERANCE)
            || !turned(first + 1, t1)
            || !turned(first + 2, t2)
        {
            return None;
        }
        slip += system.z0[first + 1] * t1 + system.z0[first + 2] * t2;
    }
    Some(Contact {
        a: c.node_a,
        b: c.node_b,
        normal: n.to_array(),
        slip: slip.to_array(),
        friction: c.bounds.sliding,
    })
}

/// Direction of a row: what it takes of the velocity of body A.
fn axis(system: &RowSystem, row: usize) -> DVec3 {
    DVec3::from_slice(&system.jac[row][0][..3])
}

/// Whether a row is `t.(v_A - v_B) + turn.(r_A w_A + r_B w_B)`.
fn is_row(
    system: &RowSystem,
    c: &RowContact,
    row: usize,
    t: DVec3,
    turn: DVec3,
    arms: [f64; 2],
) -> bool {
    let side = |k: usize, sign: f64| {
        let expected = [(sign * t).to_array(), (arms[k] * turn).to_array()].concat();
        (0..NODE_DOF).all(|i| {
            let size = if i < 3 { 1.0 } else { arms[k] };
            (system.jac[row][k][i] - expected[i]).abs() <= TOLERANCE * size
        })
    };
    side(0, 1.0) && (c.node_b == WORLD || side(1, -1.0))
}

impl Spheres {
    /// Multipliers of the rows from impulses.
    pub fn multipliers(&self, system: &RowSystem, impulses: &[[f64; 3]], lambda: &mut [f64]) {
        for (c, r) in system.contacts.iter().zip(impulses) {
            for row in c.row as usize..(c.row + c.dim) as usize {
                lambda[row] = axis(system, row).dot(DVec3::from_array(*r));
            }
        }
    }

    /// Impulses from multipliers of the rows.
    pub fn impulses(&self, system: &RowSystem, lambda: &[f64]) -> Vec<[f64; 3]> {
        let sum = |c: &RowContact| {
            let rows = c.row as usize..(c.row + c.dim) as usize;
            rows.map(|row| lambda[row] * axis(system, row))
                .sum::<DVec3>()
                .to_array()
        };
        system.contacts.iter().map(sum).collect()
    }
}
