//! Where the system is linearised.

use crate::cone::{Block, Status};

/// The iterate at which the system is linearised.
pub struct Iterate<'a> {
    pub penalty: &'a [f64],
    pub phi: &'a [f64],
    pub tangents: &'a [Block],
    pub statuses: &'a [Status],
    pub lambda: &'a [f64],
    pub u: &'a [f64],
    /// Share of the diagonal by which contacts give way.
    pub softness: f64,
}
