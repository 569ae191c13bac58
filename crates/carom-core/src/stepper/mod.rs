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
    /// No step, but a moment: `h` only says how large loads are.
    pub moment: bool,
}

impl Span {
    pub fn new(start: f64, h: f64) -> Span {
        Span {
            start,
            end: start + h,
            h,
            smallest: false,
            moment: false,
        }
    }

    /// A moment, with loads as large as those of a step `h`.
    pub fn moment(time: f64, h: f64) -> Span {
        Span {
            moment: true,
            ..Span::new(time, h)
        }
    }

    /// The speed that opens such a gap in this step, m/s: none in a moment, in which nothing opens.
    pub fn opening(&self, gap: f64) -> f64 {
        if self.moment {
            0.0
        } else {
            gap / self.h
        }
    }
}
