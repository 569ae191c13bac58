//! Time-stepping schemes. Each is arithmetic on state arrays; the order of the phases is `step.rs`.

pub mod generalized_alpha;
pub mod method;
pub mod moreau;

pub use generalized_alpha::{Coefficients, Prediction};

/// A step in time: t_n, t_{n+1} and h itself, which their difference only rounds to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    pub start: f64,
    pub end: f64,
    pub h: f64,
    /// A part of a step that is halved no more if it fails.
    pub smallest: bool,
}

impl Span {
    pub fn new(start: f64, h: f64) -> Span {
        Span {
            start,
            end: start + h,
            h,
            smallest: false,
        }
    }
}
