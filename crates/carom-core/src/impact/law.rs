//! Newton's impact law: what restitution adds to the measures of a contact (eqs. 16, 24). And Poisson's: what a contact gets back.

use crate::model::ContactLaw;
use crate::options::Options;

/// What a contact has in the expansion: the least normal impulse, and the factor of what friction of the compression gave its slip, which is the
/// measure of slip there. `compressed`: that normal impulse, N s; `inverse` mass along the normal, 1/kg.
pub fn expansion(material: &ContactLaw, compressed: f64, inverse: f64, o: &Options) -> [f64; 2] {
    let speed = compressed * inverse;
    let acts = speed > 0.0 && speed >= o.restitution_threshold;
    let least = if acts {
        material.restitution(speed) * compressed
    } else {
        0.0
    };
    [least, -material.tangential_restitution]
}

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
    /// Poisson's law: what stops the motion before the step, and the expansion that gives e of it back.
    Compression,
    Expansion,
    /// Springs: the impact as a whole, from the velocities of t_n.
    Springs,
    /// As the paper prints it: normal of n, not clipped, e_T always.
    Printed,
}

/// Share of what a contact loses without restitution that an impact by Newton's law may give back (1): e_N^2. All of it where e_N is a law, or where
/// slip comes back too.
pub fn returned(material: &ContactLaw, o: &Options) -> f64 {
    let slips_back = material.tangential_restitution != 0.0 && o.impact.restores_slip();
    match material.restitution_law.is_some() || slips_back {
        true => 1.0,
        false => material.restitution.powi(2),
    }
}

impl Law {
    /// Whether restitution acts, and the energy safeguard looks at it. (As printed there is none.)
    pub fn has_restitution(self) -> bool {
        matches!(
            self,
            Law::First | Law::Later | Law::Expansion | Law::Springs
        )
    }

    /// Whether the energy of its problem counts from the loads on, with impulses of earlier problems.
    pub fn is_first(self) -> bool {
        matches!(self, Law::First | Law::Expansion | Law::Springs)
    }

    /// Of a contact with normal velocity `minus_n` of `V_minus` (m/s, negative: it closes): what is added to the normal
    /// measure, and the factor of the slip of `V_minus` that is added to the tangential ones. Closing counts from `tol` on.
    #[inline]
    pub fn terms(self, material: &ContactLaw, minus_n: f64, o: &Options, tol: f64) -> [f64; 2] {
        let (e_n, e_t) = (
            || material.restitution(-minus_n),
            material.tangential_restitution,
        );
        match self {
            Law::Plastic | Law::Compression | Law::Expansion | Law::Springs => [0.0; 2],
            Law::Printed => [e_n() * minus_n, e_t],
            Law::First | Law::Later => {
                let slow = -minus_n < o.restitution_threshold;
                let e_n = if slow { 0.0 } else { e_n() };
                let restores = minus_n < -tol && o.impact.restores_slip();
                let e_t = if restores { e_t } else { 0.0 };
                [e_n * minus_n.min(0.0), e_t]
            }
        }
    }
}
