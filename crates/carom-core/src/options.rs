//! Numerical options: the one place where their names and defaults are stated.
//!
//! Python reads this table (`carom._core.defaults()`), the scenario format takes its keys from it, and a value that
//! is unusable is refused here.

use crate::ModelError;

/// A value as it crosses the border.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Float(f64),
    Int(u64),
    Bool(bool),
    Text(String),
}

trait Field: Sized {
    fn to_value(&self) -> Value;
    fn from_value(value: &Value) -> Option<Self>;
}

impl Field for f64 {
    fn to_value(&self) -> Value {
        Value::Float(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Float(x) => Some(*x),
            Value::Int(i) => Some(*i as f64),
            _ => None,
        }
    }
}

impl Field for u32 {
    fn to_value(&self) -> Value {
        Value::Int(u64::from(*self))
    }
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Int(i) => u32::try_from(*i).ok(),
            _ => None,
        }
    }
}

impl Field for bool {
    fn to_value(&self) -> Value {
        Value::Bool(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Bool(b) => Some(*b),
            _ => None,
        }
    }
}

macro_rules! named_choice {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $text:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$vdoc])* $variant),+ }

        impl $name {
            /// Names in scenario files.
            pub const NAMES: &'static [&'static str] = &[$($text),+];
            pub const ALL: &'static [Self] = &[$($name::$variant),+];

            pub fn name(self) -> &'static str {
                match self { $($name::$variant => $text),+ }
            }
        }

        impl Field for $name {
            fn to_value(&self) -> Value {
                Value::Text(self.name().to_owned())
            }
            fn from_value(value: &Value) -> Option<Self> {
                match value {
                    Value::Text(text) => match text.as_str() { $($text => Some($name::$variant),)+ _ => None },
                    _ => None,
                }
            }
        }
    };
}

named_choice! {
    /// Time-stepping method.
    Method {
        /// Nonsmooth generalized-alpha (Algorithm 1).
        Nsga = "nsga",
        /// Moreau-Jean: velocity level only, contacts by the predicted gap.
        MoreauJean = "moreau",
        /// Continuous contact forces, explicit substeps (crate `carom-penalty`).
        Penalty = "penalty",
        /// No step: closed motion from one impact to the next (crate `carom-events`).
        Events = "events",
    }
}

named_choice! {
    /// Impact law over the velocity sub-problems; [`crate::impact::laws`] says what each is.
    Impact {
        /// Sequence with load offset, restitution at the normal of n+1, energy safeguard (rules R2-R4).
        Sequence = "sequence",
        /// The sequence as printed in the paper (eqs. 24-29).
        SequencePaper = "sequence-paper",
        /// All closed contacts at once by Newton's law (eqs. 16-17).
        OneShot = "one-shot",
        /// Compression, then expansion (Poisson).
        Poisson = "poisson",
        /// Stiff Hertz springs in all contacts at once.
        Compliant = "compliant",
        /// The same without the gaps that open meanwhile (Liu, Zhao and Brogliato).
        Binary = "binary",
    }
}

named_choice! {
    /// Where friction of the loads acts on positions (method `nsga`; law `sequence-paper` has it as printed).
    PositionFriction {
        /// As printed: a position sub-problem with friction of its own (eq. 37), beside the velocity sub-problem of the loads.
        Paper = "paper",
        /// The loads are solved once, with friction; positions follow their velocities and are corrected along normals.
        Once = "once",
    }
}

named_choice! {
    /// How contact problems are solved.
    Solver {
        /// Closed form, dense Newton or sparse Newton by island size.
        Auto = "auto",
        /// Newton for every island, also for one contact (to compare iteration counts with the paper's).
        Newton = "newton",
    }
}

named_choice! {
    /// Damping of the contact force of method `penalty`: chi of `F = K d^n (1 + chi d'/v_in)` from e_N.
    PenaltyLaw {
        HuntCrossley = "hunt-crossley",
        HerbertMcWhannell = "herbert-mcwhannell",
        LeeWang = "lee-wang",
        LankaraniNikravesh = "lankarani-nikravesh",
        Gonthier = "gonthier",
        ZhiyingQishao = "zhiying-qishao",
        Flores = "flores",
        HuGuo = "hu-guo",
        /// The chi with which a free collision has restitution e_N.
        Exact = "exact",
    }
}

named_choice! {
    /// Sliding friction of method `penalty`.
    PenaltyFriction {
        /// `mu F tanh(u/v_s)`.
        Regularised = "regularised",
        /// A tangential spring and dashpot that slip at `mu F`.
        Spring = "spring",
    }
}

named_choice! {
    /// What a step that does not converge does, after every fallback.
    OnNonconvergence {
        Stop = "stop",
        Warn = "warn",
    }
}

macro_rules! options {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $default:expr),+ $(,)?) => {
        /// Options of a run. Times in s, lengths relative where said.
        #[derive(Clone, Debug)]
        pub struct Options { $($(#[$doc])* pub $name: $type),+ }

        impl Default for Options {
            fn default() -> Self {
                Options { $($name: $default),+ }
            }
        }

        impl Options {
            /// Every option with its current value.
            pub fn entries(&self) -> Vec<(&'static str, Value)> {
                vec![$((stringify!($name), self.$name.to_value())),+]
            }

            /// Sets one option by name.
            pub fn set(&mut self, name: &str, value: &Value) -> Result<(), ModelError> {
                match name {
                    $(stringify!($name) => {
                        self.$name = Field::from_value(value)
                            .ok_or_else(|| ModelError::option(name, format!("cannot be {value:?}")))?;
                    })+
                    _ => return Err(ModelError::option(name, "is not an option of the core".to_owned())),
                }
                Ok(())
            }
        }
    };
}

/// Some options with their names.
macro_rules! named {
    ($of:ident: $($name:ident),+ $(,)?) => { [$((stringify!($name), $of.$name)),+] };
}

/// Bounds of an impact sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Problems {
    /// Number of its last problem; the one that ends a sequence which is cut has the next number.
    pub most: u32,
    /// Contacts that its problems may solve in all before it is cut.
    pub work: u64,
}

/// Numbers of impact problems that anyone may ask for, and those of sequences that are bounded by their work.
const MOST_PROBLEMS: u32 = 100_000;
/// Contacts that the impact problems of an island may solve for each contact it has. A blow that runs through a cradle solves each
/// contact once; a quarter of this cuts piles that are being hit, ten times as much lets impacts that never end take most of the time.
const PROBLEMS_PER_CONTACT: u64 = 200;

const DEFAULT_HALVINGS: u32 = 4;
/// Halvings where the run would stop otherwise, at the default of `max_halvings`. Twice as many would make a hopeless step endless.
pub(crate) const MOST_HALVINGS_TRIED: u32 = 8;

options! {
    /// Step size h, s.
    step: f64 = 1e-3,
    /// Time-stepping method.
    method: Method = Method::Nsga,
    /// rho_inf of eq. 7, in [0, 1).
    spectral_radius: f64 = 0.8,
    /// Weight of the new values in the theta rule of `moreau`, in (0, 1].
    theta: f64 = 0.5,
    /// Whether `moreau` removes penetration after each step by the position sub-problem.
    position_projection: bool = false,
    /// tol_r of eq. 44 in islands of up to `dense_contacts` contacts.
    tolerance: f64 = 1e-8,
    /// tol_r in larger islands, where rounding sits nearer; never below `tolerance`.
    pile_tolerance: f64 = 1e-7,
    /// Absolute floor of eq. 44 over m r (position, kg m) and m V (velocity, kg m/s); in larger islands at least
    /// `touching_tolerance`, over h for velocities.
    tolerance_floor: f64 = 1e-12,
    /// |gap| of closed contacts after the position solve, over r_c: asked in islands of up to `dense_contacts` contacts, aimed at in
    /// those above that are no piles.
    gap_tolerance: f64 = 1e-10,
    /// Gap over r_c up to which a contact without multiplier counts as closed.
    touching_tolerance: f64 = 1e-9,
    /// Impact law.
    impact: Impact = Impact::Sequence,
    /// Whether positions have a sub-problem with friction of their own.
    position_friction: PositionFriction = PositionFriction::Once,
    /// Impact problems per island and step before one simultaneous problem ends them; 0: by the size of the island
    /// ([`Options::problems`]).
    max_problems: u32 = 0,
    /// Closing tolerance of a contact over the change that loads make to the velocities of its bodies in the step (rule R3), at most: it is 1e5
    /// times the tolerance of the island where that is less.
    closing_tolerance_load: f64 = 0.1,
    /// Closing tolerance over the speed in the island (rule R3).
    closing_tolerance_speed: f64 = 1e-6,
    /// Scale restitution where an impact problem would gain energy (rule R4).
    energy_safeguard: bool = true,
    /// Approach speed below which e_N = 0, m/s; 0: never.
    restitution_threshold: f64 = 0.0,
    /// n of the springs `F = k d^n` of impacts through springs: Hertz's 3/2, or 1.
    impact_exponent: f64 = 1.5,
    /// Contact solver.
    solver: Solver = Solver::Auto,
    /// Newton iterations per solve and rung.
    max_iterations: u32 = 50,
    /// p D_cc (rule R1); below 2.
    penalty_scale: f64 = 0.5,
    /// Proximal shift of the multiplier block over its diagonal (rule R11).
    proximal_shift: f64 = 1e-4,
    /// Whether Newton shortens steps that raise the residual.
    line_search: bool = true,
    /// Reductions per iteration.
    max_line_search: u32 = 10,
    /// 0: Newton's method alone in islands that are no piles. Other numbers: other methods where it fails.
    gauss_seidel_sweeps: u32 = 15,
    /// Islands of up to this many contacts have a dense matrix, with the exact Hessian.
    dense_contacts: u32 = 10,
    /// Islands of more contacts than this are solved by sweeps over spheres, from the impulses of the last step (`auto` takes over
    /// where these do not converge); with a `pile_tolerance` of 1e-5 and more all those above `dense_contacts` are.
    pile_contacts: u32 = 100,
    /// How often a step that fails may be halved; at the default a part that nothing solves is halved on, up to
    /// [`MOST_HALVINGS_TRIED`] times in all.
    max_halvings: u32 = DEFAULT_HALVINGS,
    /// stop or warn.
    on_nonconvergence: OnNonconvergence = OnNonconvergence::Stop,
    /// Method penalty: damping law.
    penalty_law: PenaltyLaw = PenaltyLaw::Exact,
    /// Young's modulus of every body, Pa, with Poisson's ratio the source of Hertz's stiffness.
    penalty_young_modulus: f64 = 5.5e9,
    penalty_poisson_ratio: f64 = 0.34,
    /// K of every contact, N/m^n, in place of Hertz's; 0: Hertz's.
    penalty_stiffness: f64 = 0.0,
    /// n of the elastic force K d^n.
    penalty_exponent: f64 = 1.5,
    /// Restitution below which a law whose chi grows without bound is read as this one.
    penalty_least_restitution: f64 = 1e-2,
    /// Sliding friction.
    penalty_friction: PenaltyFriction = PenaltyFriction::Regularised,
    /// v_s: slip speed of the regularisation, m/s; over r_c that of rolling and spinning.
    penalty_slip_speed: f64 = 1e-3,
    /// Substeps per contact time.
    penalty_resolution: u32 = 50,
    /// Method events: longest step of `nsga` while bodies press one another, s.
    pressing_step: f64 = 1e-4,
    /// Worker threads of the search for pairs and candidates, of islands side by side, and of sweeps and impact cascades in large ones;
    /// results never depend on this number.
    threads: u32 = 1,
    /// Contacts of an island for each thread that sweeps it: below, another thread costs more than it gives.
    contacts_per_thread: u32 = 2_048,
    /// Contacts and joints of all islands that are shared out among threads, for each of these: below, starting another thread
    /// costs more than it gives.
    shared_contacts_per_thread: u32 = 48,
}

impl Options {
    /// Whether the loads of a step are solved once, for velocities and positions.
    pub fn loads_once(&self) -> bool {
        self.position_friction == PositionFriction::Once
            && self.method == Method::Nsga
            && !self.impact.is_printed()
    }

    /// Whether positions have a sub-problem with friction, as printed (eq. 37).
    pub fn is_printed(&self) -> bool {
        self.method == Method::Nsga && !self.loads_once()
    }

    /// A speed whose way in a step is the rounding of a length, m/s: what closes more slowly closes nothing (rule R3). What an impact leaves is a share of
    /// what it had, and would else be an impact in every step, down to the least number there is.
    #[inline]
    pub fn moves_nothing(&self, length: f64) -> f64 {
        f64::EPSILON * length / self.step
    }

    /// What the impact sequence of an island of so many contacts may take.
    pub fn problems(&self, contacts: usize) -> Problems {
        match self.max_problems {
            0 => Problems {
                most: MOST_PROBLEMS,
                work: PROBLEMS_PER_CONTACT * contacts as u64,
            },
            given => Problems {
                most: given,
                work: u64::MAX,
            },
        }
    }

    /// Halvings of a step after which a failure stops the run. Whoever sets `max_halvings` gets that number.
    pub fn deepest(&self) -> u32 {
        match self.max_halvings {
            DEFAULT_HALVINGS => MOST_HALVINGS_TRIED,
            given => given,
        }
    }

    /// Refuses values with which the scheme cannot work.
    pub fn validate(&self) -> Result<(), ModelError> {
        for (name, value) in named!(
            self: step, tolerance, pile_tolerance, tolerance_floor, gap_tolerance, touching_tolerance,
            closing_tolerance_load, closing_tolerance_speed, penalty_scale,
            proximal_shift, penalty_young_modulus, penalty_slip_speed, pressing_step,
        ) {
            if !(value > 0.0 && value.is_finite()) {
                let text = format!("is {value:e}; it must be finite and above 0");
                return Err(ModelError::option(name, text));
            }
        }
        let o = self;
        let (n, k, least) = (
            o.penalty_exponent,
            o.penalty_stiffness,
            o.penalty_least_restitution,
        );
        // The square of the step and the inverse of that are numbers too.
        let step = (1e-100..=1e100).contains(&o.step);
        let (rho, theta) = (o.spectral_radius, o.theta);
        let threshold = o.restitution_threshold;
        let (nu, resolution) = (o.penalty_poisson_ratio, o.penalty_resolution);
        #[rustfmt::skip]
        let ranges = [
            ("step", step, format!("is {:e}; it must lie between 1e-100 and 1e100", o.step)),
            ("spectral_radius", (0.0..1.0).contains(&rho), format!("is {rho}; it must lie in [0, 1)")),
            ("theta", theta > 0.0 && theta <= 1.0, format!("is {theta}; it must lie in (0, 1]")),
            ("penalty_scale", o.penalty_scale < 2.0, format!("is {}; at 2 and above Newton can cycle (rule R1)", o.penalty_scale)),
            ("restitution_threshold", threshold >= 0.0 && threshold.is_finite(), "must be finite and not negative".to_owned()),
            ("impact_exponent", (1.0..=4.0).contains(&o.impact_exponent), format!("is {}; it must lie in [1, 4]", o.impact_exponent)),
            ("penalty_poisson_ratio", -1.0 < nu && nu <= 0.5, format!("is {nu}; it must lie in (-1, 0.5]")),
            ("penalty_stiffness", k >= 0.0 && k.is_finite(), format!("is {k}; it must be finite and not negative")),
            ("penalty_exponent", (1.0..=4.0).contains(&n), format!("is {n}; it must lie in [1, 4]")),
            ("penalty_exponent", n == 1.5 || k != 0.0,
             format!("is {n}, but moduli give a stiffness for 1.5 alone; set penalty_stiffness (N/m^{n})")),
            ("penalty_least_restitution", least > 0.0 && least < 1.0, format!("is {least}; it must lie in (0, 1)")),
            ("penalty_resolution", (4..=100_000).contains(&resolution), format!("is {resolution}; it must lie between 4 and 100000")),
        ];
        if let Some((name, _, text)) = ranges.into_iter().find(|(_, fits, _)| !fits) {
            return Err(ModelError::option(name, text));
        }
        // Upper bounds: no input may make a step endless or fill the memory.
        #[rustfmt::skip]
        let counts = [
            ("max_iterations", self.max_iterations, 1, 100_000),
            ("threads", self.threads, 1, u32::MAX),
            ("contacts_per_thread", self.contacts_per_thread, 1, u32::MAX),
            ("shared_contacts_per_thread", self.shared_contacts_per_thread, 1, u32::MAX),
            ("max_halvings", self.max_halvings, 0, 20),
            ("max_problems", self.max_problems, 0, MOST_PROBLEMS),
            ("max_line_search", self.max_line_search, 0, 60),
            ("gauss_seidel_sweeps", self.gauss_seidel_sweeps, 0, 1000),
            ("dense_contacts", self.dense_contacts, 0, 500),
        ];
        for (name, value, least, most) in counts {
            if value < least {
                let text = format!("must be at least {least}");
                return Err(ModelError::option(name, text));
            }
            if value > most {
                let text = format!("is {value}; it must be at most {most}");
                return Err(ModelError::option(name, text));
            }
        }
        Ok(())
    }
}
