//! The table of impact laws: what each is, needs and guarantees. The step, piles, the auditor, advice, citations and documents read it.
//!
//! A new law is a variant of [`Impact`], a row of [`Impact::facts`] and an arm of [`solve`]; the compiler asks for both.

mod poisson;

use self::poisson::compress_and_expand;
use super::compliant::through_springs;
use super::sequence::{as_printed, loads_first, one_shot, ImpactIsland};
use crate::options::Impact;

/// Laws of restitution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restitution {
    /// Newton's, on velocities: problem by problem what the auditor expects, and of a lone contact the closed form.
    Newton,
    /// The same as the paper prints it: along the normal of t_n, not clipped, in rows only.
    Printed,
    /// Poisson's, on impulses.
    Poisson,
    /// Energetic: of the work of compression e^2 comes back.
    Energetic,
}

/// What is known of an impact law.
#[derive(Clone, Copy, Debug)]
pub struct LawFacts {
    /// One sentence: what it does. And when to take it.
    pub summary: &'static str,
    pub advice: &'static str,
    /// Loads are solved before impacts, without restitution (rule R2).
    pub loads_first: bool,
    /// Impacts cannot add energy (rule R4), as long as `energy_safeguard` is on.
    pub energy: bool,
    /// What a problem with restitution obeys.
    pub restitution: Restitution,
    /// Impact problems of an island and step at most; 0: as many as its sequence needs.
    pub problems: u32,
    /// Keys of a contact's material that it reads.
    pub needs: &'static [&'static str],
    /// Keys of the sources to cite.
    pub cite: &'static [&'static str],
}

const SPRINGS: LawFacts = LawFacts {
    summary: "all contacts are stiff Hertz springs until the balls are apart",
    advice: "for chains and clusters of some hundred balls of one material",
    loads_first: true,
    energy: true,
    restitution: Restitution::Energetic,
    problems: 2,
    needs: &["friction", "restitution", "stiffness_ratio"],
    cite: &["binary"],
};

const NEWTON: &[&str] = &["friction", "restitution", "tangential_restitution"];

impl Impact {
    /// Whether loads are solved before impacts, without restitution (rule R2).
    pub const fn has_loads_first(self) -> bool {
        self.facts().loads_first
    }

    /// Whether it is the sequence as the paper prints it.
    pub const fn is_printed(self) -> bool {
        matches!(self.facts().restitution, Restitution::Printed)
    }

    /// Whether its problems obey Newton's law.
    pub const fn is_newtons(self) -> bool {
        matches!(
            self.facts().restitution,
            Restitution::Newton | Restitution::Printed
        )
    }

    /// Whether a lone contact of balls obeys it, which has a closed form. (Energetic restitution is the same there.)
    pub const fn has_closed_form(self) -> bool {
        !matches!(self.facts().restitution, Restitution::Poisson)
    }

    /// Whether it reads tangential restitution.
    pub fn restores_slip(self) -> bool {
        self.facts().needs.contains(&"tangential_restitution")
    }

    /// The row of the law in the table.
    pub const fn facts(self) -> LawFacts {
        match self {
            Impact::Sequence => LawFacts {
                summary: "impacts pass from contact to contact; loads are solved first",
                advice: "for rows of equal elastic balls, racks and heaps",
                loads_first: true,
                energy: true,
                restitution: Restitution::Newton,
                problems: 0,
                needs: NEWTON,
                cite: &["sequence"],
            },
            Impact::SequencePaper => LawFacts {
                summary: "the sequence as the paper prints it",
                advice: "to reproduce the paper",
                loads_first: false,
                energy: false,
                restitution: Restitution::Printed,
                problems: 0,
                needs: NEWTON,
                cite: &["sequence"],
            },
            Impact::OneShot => LawFacts {
                summary: "Newton's law on all closed contacts at once",
                advice: "to compare with codes of Moreau's scheme",
                loads_first: false,
                energy: true,
                restitution: Restitution::Newton,
                problems: 1,
                needs: NEWTON,
                cite: &[],
            },
            Impact::Poisson => LawFacts {
                summary: "compression to the end, then each contact gets e times its impulse back",
                advice: "for balls pressed between others or against a floor, which rebound",
                loads_first: true,
                energy: true,
                restitution: Restitution::Poisson,
                problems: 2,
                needs: NEWTON,
                cite: &["poisson"],
            },
            Impact::Compliant => SPRINGS,
            Impact::Binary => LawFacts {
                summary: "the same, but what opens may close again at once",
                advice: "to compare with the law of Liu, Zhao and Brogliato",
                ..SPRINGS
            },
        }
    }
}

/// Solves an island by the law.
#[must_use]
pub fn solve(law: Impact, island: &mut impl ImpactIsland) -> bool {
    match law {
        Impact::Sequence => loads_first(island),
        Impact::SequencePaper => as_printed(island),
        Impact::OneShot => one_shot(island),
        Impact::Poisson => compress_and_expand(island),
        Impact::Compliant | Impact::Binary => through_springs(island),
    }
}
