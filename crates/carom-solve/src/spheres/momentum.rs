//! What accelerated sweeps keep from one to the next.

use super::bodies::State;

/// Bodies after the sweep before the last one; what the last sweep changed.
#[derive(Debug, Default)]
pub struct Memory {
    pub states: Vec<State>,
    pub last: Change,
    pub age: u64,
}

/// What a sweep changed: `|d|^2` over the masses, and the largest `-z_N` that it met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Change {
    pub squared: f64,
    pub closing: f64,
}
