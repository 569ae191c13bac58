//! Spheres that friction stops dead where nothing hits them.
//!
//! Where friction is large, wedged spheres may press one another with any force, and hold what slides: of the solutions of Coulomb's law
//! the position level then has one, the velocity level may have another one without such forces. A sphere would stay where it is while its
//! velocity grows with every step (decision record 015). The velocity at `t_n` obeyed the law there: what slides on without being
//! hit is slowed by its loads, not stopped.

use crate::contact::Contact;
use carom_solve::rows::RowSystem;

/// Share (1) of friction that is left to contacts which stop a slide. At 0 bounds would be other rows; much larger, and forces that hold one
/// another stop the slide all the same: balls hang while their velocity grows with `g t` (decision 015).
pub(super) const NEGLIGIBLE_FRICTION: f64 = 1e-9;
/// A slide counts beyond this many times (1) the way of the loads in a step: three times the speed that they give. Too small: what friction
/// rightly brings to rest slides on; at 0 falling heaps have seven times the fallbacks. Too large: a sphere hangs longer before it is let go.
const SLIDE_RATIO: f64 = 6.0;
/// An approach beyond this many ways of the loads (1) is a hit, and may stop a slide. Too small: wedged spheres count as hit and hang; at 0 five of
/// 40 narrow drops gain 1e-3 of their energy in a step, in place of one. Too large: what lands beside a wall loses its friction.
const HIT_RATIO: f64 = 3.0;
/// The same where it began at more than this gap over the length of the contact (1); too small, and rounding of gaps is a hit.
const HIT_GAP: f64 = 1e-6;
/// A slide has been stopped where less than this share (1) of it is left. At 1 what friction only slows counts as stopped, and loses its friction.
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
