//! What the contact laws of a model come to in this method.

use crate::damping;
use crate::elastic::Elastic;
use crate::friction::damping_ratio;
use carom_core::model::ContactLaw;
use carom_core::options::Options;
use carom_core::Model;
use carom_solve::Bounds;

/// Laws of all contacts of a run.
pub struct Laws {
    pub elastic: Elastic,
    /// In the order of the model's contact laws.
    pub contacts: Vec<LawConstants>,
}

/// Constants of the damping and friction of a contact law.
#[derive(Clone, Copy, Debug, Default)]
pub struct LawConstants {
    /// chi.
    pub damping: f64,
    pub bounds: Bounds,
    /// Whether there is sliding friction, as a number or as a law of the slip speed.
    pub slides: bool,
    /// Whether the damping depends on the approach speed.
    pub varies: bool,
    /// Of the tangential spring, share of critical.
    pub damping_ratio: f64,
}

/// chi of a contact that closed at the speed `approach`, m/s.
pub fn damping(o: &Options, law: &ContactLaw, approach: f64) -> f64 {
    let e = law.restitution(approach);
    damping::chi(o.penalty_law, e, o.penalty_least_restitution)
}

impl Laws {
    pub fn new(model: &Model) -> Laws {
        let o = &model.options;
        let constants = |l: &ContactLaw| LawConstants {
            damping: damping(o, l, 0.0),
            varies: l.restitution_law.is_some(),
            bounds: l.bounds,
            slides: l.bounds.sliding > 0.0 || l.friction_law.is_some(),
            damping_ratio: damping_ratio(l.tangential_restitution),
        };
        Laws {
            elastic: Elastic::new(o),
            contacts: model.laws.iter().map(constants).collect(),
        }
    }
}
