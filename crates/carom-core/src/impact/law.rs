//! Newton's impact law: what restitution adds to the measures of a contact (eqs. 16, 24).

use crate::options::Options;

/// Which velocities `V_minus` restitution acts on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Law {
    /// On none: e_N = e_T = 0.
    #[default]
    Plastic,
    /// On those of t_n: the first impact problem.
    First,
    /// On what earlier problems of the step have left of them (eq. 27).
    Later,
    /// As the paper prints it: normal of n, not clipped, e_T always.
    Printed,
}

impl Law {
    /// Whether restitution acts, and the energy safeguard looks at it. (As printed there is none.)
    pub fn has_restitution(self) -> bool {
        matches!(self, Law::First | Law::Later)
    }

    /// Of a contact with `[e_N, e_T]` that approaches by `approach` (m/s, negative: it closes): what is added to the normal
    /// measure, and the factor of the slip of `V_minus` that is added to the tangential ones. Closing counts from `tol` on.
    #[inline]
    pub fn terms(self, [e_n, e_t]: [f64; 2], approach: f64, o: &Options, tol: f64) -> [f64; 2] {
        match self {
            Law::Plastic => [0.0; 2],
            Law::Printed => [e_n * approach, e_t],
            Law::First | Law::Later => {
                let slow = -approach < o.restitution_threshold;
                let e_n = if slow { 0.0 } else { e_n };
                let e_t = if approach < -tol { e_t } else { 0.0 };
                [e_n * approach.min(0.0), e_t]
            }
        }
    }
}
