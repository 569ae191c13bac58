//! What the contact laws of a model come to in this method.

use crate::damping;
use crate::elastic::Elastic;
use crate::friction::damping_ratio;
use carom_core::model::ContactLaw;
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
    /// Of the tangential spring, share of critical.
    pub damping_ratio: f64,
}

impl Laws {
    pub fn new(model: &Model) -> Laws {
        let o = &model.options;
        let constants = |l: &ContactLaw| LawConstants {
            damping: damping::chi(o.penalty_law, l.restitution, o.penalty_least_restitution),
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
