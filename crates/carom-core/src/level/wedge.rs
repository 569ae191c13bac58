//! Spheres that friction stops dead where nothing hits them.
//!
//! Where friction is large, wedged spheres may press one another with any force, and hold what slides: of the solutions of Coulomb's law
//! the position level then has one, the velocity level may have another one without such forces. A sphere would stay where it is while its
//! velocity grows with every step (decision record 020). The velocity at `t_n` obeyed the law there: what slides on without being
//! hit is slowed by its loads, not stopped.

use crate::contact::Contact;
use carom_solve::rows::RowSystem;

/// Share of friction that is left to contacts which stop a slide. (Bounds of 0 would be other rows.)
pub(super) const NEGLIGIBLE_FRICTION: f64 = 1e-9;
/// A slide counts beyond this many times the way of the loads in a step: three times the speed that they give.
const SLIDE_RATIO: f64 = 6.0;
/// An approach is a hit beyond this many of them, or where it began at more than this gap, over the length of the contact.
const HIT_RATIO: f64 = 3.0;
const HIT_GAP: f64 = 1e-6;
/// And has been stopped where less than this share of it is left.
const STOPPED_SHARE: f64 = 0.5;

/// Contacts of an island, solved at the position level, that stop a slide although nothing was hit, by more than all loads together. `way`:
/// the largest of a sphere by the loads of the step, m; `load`: the sum of these times the masses, kg m; `measures` and `nu` those of the
/// solution.
pub(super) fn stopped(
    contacts: &[Contact],
    members: &[u32],
    system: &RowSystem,
    [way, load]: [f64; 2],
    [measures, nu]: [&[f64]; 2],
) -> Vec<bool> {
    let each = || {
        members
            .iter()
            .map(|&m| &contacts[m as usize])
            .zip(&system.contacts)
    };
    let hit = each().any(|(c, row)| {
        let closes =
            c.gap_start > HIT_GAP * c.length || c.gap_start - c.gap_check > HIT_RATIO * way;
        nu[row.row as usize] > 0.0 && closes
    });
    if hit || way == 0.0 {
        return Vec::new();
    }
    each()
        .map(|(c, row)| {
            let slide = row.row as usize + 1..row.row as usize + 3;
            let length = |z: &[f64]| z[slide.clone()].iter().map(|z| z * z).sum::<f64>().sqrt();
            c.bounds.sliding > 0.0
                && nu[row.row as usize] > load
                && length(&system.z0) > SLIDE_RATIO * way
                && length(measures) < STOPPED_SHARE * length(&system.z0)
        })
        .collect()
}
