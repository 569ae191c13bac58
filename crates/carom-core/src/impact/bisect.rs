//! The largest restitution scale at which an impact problem gains no energy (rule R4), and what counts as a gain.

/// An impact problem gains energy if its work exceeds this share (1) of the island's kinetic energy (rule R4). Too small: the residual of the
/// solver counts as a gain and takes restitution. Too large: at 1e-6 the energy of falling heaps rises fifty times as much in a step.
pub const GAIN_TOLERANCE: f64 = 1e-10;

/// Bisections of the restitution scale (rule R4): it is found to 2^-12. Fewer lose as much restitution where a problem gains; more cost a solve each.
pub const BISECTIONS: u32 = 12;

/// The same in islands with joints: there a gain of 1e-9 of the energy may be only the turn of a rod within the step, and must
/// not take 2e-4 off e.
pub const BISECTIONS_JOINTS: u32 = 30;

/// Largest scale found in [0, 1] at which `admissible` holds, keeping the admissible end; 0 is taken as admissible.
pub fn bisect_scale(count: u32, mut admissible: impl FnMut(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..count {
        let middle = 0.5 * (low + high);
        if admissible(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
