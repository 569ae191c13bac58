//! What the first impact problem keeps of stage 0 must not give energy.
//!
//! Rule R2 keeps the impulses of the loads at contacts that neither close nor are pressed by the loads. Where contacts are redundant (a ball in a
//! corner of three rough walls) these may hold one another with any force; of a part of them the rest would throw the ball out.

use carom_solve::clusters::{apart, Forest};
use carom_solve::rows::WORLD;

/// A contact with impulse: its nodes, and the work of all it has been given since the smooth step, J.
#[derive(Clone, Copy, Debug)]
pub struct ContactWork {
    pub a: u32,
    pub b: u32,
    pub work: f64,
}

/// Whether the contacts of a group (joined by spheres) have done more work together than `share` of its energy. `kinetic`: the energy of
/// each node after the smooth step, and of walls that move as fast as theirs, J.
pub fn gains_energy(contacts: &[ContactWork], kinetic: &[f64], share: f64) -> bool {
    let mut joined = apart(kinetic.len());
    for c in contacts.iter().filter(|c| c.b != WORLD) {
        joined.join(c.a, c.b);
    }
    let mut sums = vec![[0.0f64; 2]; kinetic.len()];
    for c in contacts {
        sums[joined.root(c.a) as usize][0] += c.work;
    }
    for (node, of_node) in (0..).zip(kinetic) {
        sums[joined.root(node) as usize][1] += of_node;
    }
    sums.iter().any(|[work, kinetic]| *work > share * kinetic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_those_of_groups_and_not_hidden_by_others() {
        let at = |a, b, work| ContactWork { a, b, work };
        let kinetic = [1.0, 1.0, 1.0, 1.0];
        // 0 and 1 lose more than 2 and 3 gain.
        let contacts = [at(0, 1, -1.0), at(2, 3, 0.1), at(2, WORLD, 0.05)];
        assert!(gains_energy(&contacts, &kinetic, 0.07));
        assert!(!gains_energy(&contacts, &kinetic, 0.08));
        // Joined by a contact they are one group.
        let joined = [contacts[0], contacts[1], contacts[2], at(1, 2, 0.0)];
        assert!(!gains_energy(&joined, &kinetic, 1e-10));
    }
}
