//! The ladder: all ways to solve a contact problem, when each is tried, how far it goes and why.
//!
//! The code runs these tables. [`ISLAND`] is climbed by [`crate::Newton`] for rows over nodes, whose measures may depend on the
//! correction; each rung begins at the same start. [`AUTO`] is climbed by [`crate::solver::Auto`] for `u = W r + q`; each rung begins at
//! the best iterate so far. The first rung that converges ends the climb, and every attempt is recorded by the name of its rung.
//!
//! What is chosen where a problem is stated (`carom-core`) comes before them or after: [`CLOSED_FORM`], [`SPHERES`], [`HELD`].

use std::fmt;

/// One way to solve, and when it is tried.
#[derive(Clone, Copy, Debug)]
pub struct Rung<Way, When> {
    pub name: &'static str,
    pub way: Way,
    /// Iterations, sweeps, rounds or linear problems at most.
    pub budget: u32,
    pub when: When,
    pub why: &'static str,
}

/// A try of a rung, and what is left after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    pub rung: &'static str,
    pub iterations: u32,
    /// Relative residual of eq. 44.
    pub residual: f64,
    pub converged: bool,
}

/// A lone contact of a sphere with a plane ([`crate::single`]): exact, at once.
pub const CLOSED_FORM: &str = "closed form";
/// Sweeps over contacts of spheres ([`crate::spheres`]): many contacts, neither joints nor loads that depend on the motion.
pub const SPHERES: &str = "sweeps of spheres";
/// Multipliers that hold everything ([`crate::hold`]): where all was at rest and another way moves it, or finds nothing.
pub const HELD: &str = "held at rest";
/// Ways to solve an island of rows.
#[derive(Clone, Copy, Debug)]
pub enum IslandWay {
    /// Sweeps over the rows.
    Sweeps,
    /// Alternating directions, then sweeps.
    Split,
    /// Linear cone problems, one after the other, each by [`AUTO`].
    Linearised,
    /// Newton's method.
    Newton,
    /// The convex problem beside the one that is stated: always solvable, and no more than near it.
    Companion,
}

/// When an island is solved so.
#[derive(Clone, Copy, Debug)]
pub enum IslandWhen {
    Always,
    /// A large island, and a tolerance from [`COARSE_TOLERANCE`] on.
    Coarse,
    /// Velocities that sweeps have not found, up to [`crate::solver::SPLIT_CONTACTS`] contacts.
    Swept,
    /// The options allow linear problems in its place.
    Linearised,
    /// The options take what is near a solution.
    Last,
}

/// Ways to solve `u = W r + q`.
#[derive(Clone, Copy, Debug)]
pub enum Method {
    /// Block Gauss-Seidel with this over-relaxation: up to so many lots, while each makes err [`WORTHWHILE`] times as large at most.
    Sweeps { relaxation: f64, lots: u32 },
    /// Semi-smooth Newton, given up after so many iterations that do not halve err.
    Newton { patience: u32 },
    /// One lot of sweeps, and then Newton.
    Round { relaxation: f64, patience: u32 },
    /// The interior point from scratch.
    Path,
    /// Alternating directions.
    Split,
}

/// When [`AUTO`] takes a rung.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    Always,
    /// Up to [`SMALL_ROWS`] rows, or a start with err below [`WARM`].
    SmallOrWarm,
    /// Cholesky factors of W would hold more than [`MAX_FILL`] numbers. The climb ends with it.
    Full,
    /// Until sweeps of such a rung make err no smaller than [`GAIN`] times what it was.
    Gaining,
    /// W is unsymmetric by [`UNSYMMETRIC`] at most, and sweeps are not bounded, or do not know what is stated.
    Symmetric,
    /// Sweeps are not bounded.
    Unbounded,
}

/// `pile_tolerance` (1) from which on large islands are swept. Smaller: sweeps, which converge linearly, crawl in islands that Newton's method solves
/// faster. Larger: scenes of piles pay for factorisations of each small island.
pub const COARSE_TOLERANCE: f64 = 1e-5;
/// Sweeps (1) over the rows of an island at most. Small, other ways solve what they would have; large, what they cannot solve costs as many.
pub(crate) const SWEEPS: u32 = 2_000;
/// Rows (1) up to which a matrix is dense, and Newton's method begins: a dense factorisation costs no more than some sweeps.
/// Only time hangs on it.
pub const SMALL_ROWS: usize = 96;
/// `err` (1) below which a start is warm, and Newton's method begins. Large, it wastes its iterations far from the solution; 0,
/// the impulses of the last step are of no use to it.
pub const WARM: f64 = 1e-3;
/// Numbers (1, of 8 bytes) in Cholesky factors of W up to which factorising methods are asked: bounds memory and the time of one iteration. Larger, a problem seems to hang; smaller, hard ones end with sweeps alone.
pub const MAX_FILL: usize = 8_000_000;
/// Largest entry of `W - W^T` over that of W (1): alternating directions see the symmetric part alone. Larger, they converge to
/// another problem's solution, which the judge refuses.
pub const UNSYMMETRIC: f64 = 1e-6;
/// A lot of sweeps was worth another one if it made `err` at most so many times (1) as large: near 1, sweeps where Newton's
/// method is faster.
pub const WORTHWHILE: f64 = 0.1;
/// The same of a round of sweeps and Newton's method.
pub const GAIN: f64 = 0.5;
/// Iterations (1) of Newton's method that end what another method began. With few, it is cut off before its quadratic end.
pub const POLISH: u32 = 30;
/// Over-relaxation: what is best lies between 1.2 and 1.5; 1.5 is faster on most piles at rest and keeps others from converging (measured).
pub const RELAXATION: f64 = 1.3;
/// The stronger one, in turn with [`RELAXATION`]: what goes round in circles with one of them need not with the other.
const STRONG: f64 = 1.5;
/// Iterations (1) without a better `err` before Newton's method gives up, where other means are near.
const QUICK: u32 = 8;
/// The same where they are not. Small, it gives up while the status of contacts still changes; large, only time.
const PATIENT: u32 = 12;

const fn rung<Way: Copy, When: Copy>(
    name: &'static str,
    way: Way,
    budget: u32,
    when: When,
    why: &'static str,
) -> Rung<Way, When> {
    Rung {
        name,
        way,
        budget,
        when,
        why,
    }
}

const fn sweeps(lots: u32) -> Method {
    let relaxation = RELAXATION;
    Method::Sweeps { relaxation, lots }
}

const fn newton(patience: u32) -> Method {
    Method::Newton { patience }
}

const fn round(relaxation: f64, patience: u32) -> Method {
    Method::Round {
        relaxation,
        patience,
    }
}

/// Islands of rows. Newton's method has as many iterations as the options say.
#[rustfmt::skip]
pub const ISLAND: [Rung<IslandWay, IslandWhen>; 5] = [
    rung("sweeps",     IslandWay::Sweeps,     SWEEPS,   IslandWhen::Coarse, "many contacts, whose factors fill up, and a tolerance that sweeps reach"),
    rung("split",      IslandWay::Split,      12,       IslandWhen::Swept, "sweeps crawl: alternating directions tell which forces hold one another"),
    rung("newton",     IslandWay::Newton,     u32::MAX, IslandWhen::Always, "quadratic, from the statuses of the start"),
    rung("linearised", IslandWay::Linearised, 12,       IslandWhen::Linearised, "hyperstatic islands, where Newton goes round in circles"),
    rung("companion",  IslandWay::Companion,  12,       IslandWhen::Last,   "no solution, or none that is found: what slides moves apart"),
];

/// Problems `u = W r + q`.
#[rustfmt::skip]
pub const AUTO: [Rung<Method, When>; 16] = [
    rung("start",  newton(PATIENT),            20,      When::SmallOrWarm, "a dense factorisation costs little, a warm start is near"),
    rung("sweeps", sweeps(20),                 60,      When::Always,      "sweeps are cheap and find most of the active set"),
    rung("sweeps", sweeps(1),                  100_000, When::Full,        "the factors of all other methods would not fit"),
    rung("polish", newton(QUICK),              POLISH,  When::Always,      "Newton's quadratic end"),
    rung("rounds", round(RELAXATION, QUICK),   240,     When::Gaining,     "Newton stalled: another start for it"),
    rung("rounds", round(RELAXATION, QUICK),   960,     When::Gaining,     "Newton stalled: another start for it"),
    rung("path",   Method::Path,               200,     When::Always,      "sweeps and Newton stalled"),
    rung("polish", newton(PATIENT),            POLISH,  When::Always,      "Newton's quadratic end"),
    rung("rounds", round(STRONG, PATIENT),     1000,    When::Always,      "the path stalled: another start for Newton"),
    rung("rounds", round(RELAXATION, PATIENT), 2000,    When::Always,      "stalled: another start for Newton"),
    rung("rounds", round(STRONG, PATIENT),     5000,    When::Always,      "stalled: another start for Newton"),
    rung("rounds", round(RELAXATION, PATIENT), 10_000,  When::Always,      "stalled: another start for Newton"),
    rung("rounds", round(STRONG, PATIENT),     30_000,  When::Always,      "stalled: another start for Newton"),
    rung("split",  Method::Split,              5000,    When::Symmetric,   "stalled: one factorisation, then products alone"),
    rung("polish", newton(PATIENT),            POLISH,  When::Symmetric,   "Newton's quadratic end"),
    rung("last",   sweeps(1),                  100_000, When::Unbounded,   "stalled: whatever time is left"),
];

/// [`AUTO`] in words, a line for each rung.
pub fn rule() -> String {
    let mut text = String::from(
        "Rungs of auto: each starts from the best iterate so far, and the first that reaches the tolerance ends the run. Best is\n\
         judged by the larger of two: err, and err of the problem scaled to diagonals of 1. In parentheses: relaxation of sweeps, and\n\
         iterations of Newton that do not halve err before it gives up.\n",
    );
    for rung in &AUTO {
        let (name, budget, when, why) = (rung.name, rung.budget, rung.when, rung.why);
        text += &format!(
            "{name:<7} {budget:>6} {:<55} {when}{why}\n",
            rung.way.to_string()
        );
    }
    text.truncate(text.trim_end().len());
    text
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sweeps { relaxation, lots } => {
                write!(f, "sweeps ({relaxation})")?;
                match lots {
                    1 => Ok(()),
                    _ => write!(f, ", up to {lots} times while err falls tenfold"),
                }
            }
            Self::Newton { patience } => {
                write!(f, "iterations of Newton ({patience})")
            }
            Self::Round {
                relaxation,
                patience,
            } => write!(f, "sweeps ({relaxation}), then Newton ({patience})"),
            Self::Path => write!(f, "iterations of the interior point"),
            Self::Split => write!(f, "iterations of ADMM"),
        }
    }
}

/// A condition and a colon, or nothing.
impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Always => Ok(()),
            Self::SmallOrWarm => write!(f, "up to {SMALL_ROWS} rows, or err below {WARM:e}: "),
            Self::Full => write!(f, "factors of W above {:e} numbers: ", MAX_FILL as f64),
            Self::Gaining => write!(f, "while rounds halve err: "),
            Self::Symmetric => write!(f, "W symmetric to {UNSYMMETRIC:e}: "),
            Self::Unbounded => write!(f, "no bound on sweeps: "),
        }
    }
}

impl fmt::Display for Attempt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Attempt {
            rung,
            iterations,
            residual,
            ..
        } = self;
        write!(
            f,
            "{rung}: {iterations} iterations, residual {residual:.1e}"
        )
    }
}
