//! A contact problem of spheres as data, and what it must not be.

#[cfg(doc)]
use crate::rows::WORLD;
use std::fmt;

/// Bodies or contacts of a problem at most: their numbers have 31 bits, the last two are taken.
const MOST: usize = (1 << 31) - 2;

/// Centre of a body, m.
pub type Place = [f64; 3];

/// A sphere. Both inverses 0: it is fixed, its `u` is 0, and any number of contacts may share it at no cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// 1/m, 1/kg.
    pub inv_mass: f64,
    /// 1/I, 1/(kg m^2).
    pub inv_inertia: f64,
    /// Lever arm of its contacts, m.
    pub radius: f64,
}

impl Body {
    pub fn is_fixed(&self) -> bool {
        self.inv_mass == 0.0
    }
}

/// A contact with sliding friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Bodies; [`WORLD`] or a fixed body on one side.
    pub a: u32,
    pub b: u32,
    /// Unit vector from `b` to `a`.
    pub normal: [f64; 3],
    /// Measures at `u = 0` as a vector of the world, m/s: `z0_N n + z0_T1 t1 + z0_T2 t2`.
    pub slip: [f64; 3],
    /// mu.
    pub friction: f64,
}

/// What a problem must not be.
#[derive(Clone, Debug, PartialEq)]
pub enum SpheresError {
    /// A number of a body is negative or not finite.
    Body { body: usize },
    /// As many places as bodies are needed, all finite.
    Places { body: usize },
    /// A contact names a body that does not exist.
    Index { contact: usize, body: u32 },
    /// A contact of a body with itself, or of two fixed ones.
    Immovable { contact: usize },
    /// A normal that is not a unit vector, a slip that is not finite, or negative friction.
    Contact { contact: usize },
    /// Rolling or spinning friction that is negative or not finite, a turn that is not finite, or a length not above 0.
    Roll { contact: usize },
    /// More contacts or bodies than 2^31 - 2.
    Size,
    /// Other contacts than those of `new`.
    Changed { contact: usize },
}

impl fmt::Display for SpheresError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Body { body } => write!(f, "body {body}: inverse mass, inverse inertia and radius must be finite and at least 0, and what turns must be free to move"),
            Self::Places { body } => write!(f, "body {body}: a place of three finite numbers is needed for each body"),
            Self::Index { contact, body } => write!(f, "contact {contact}: there is no body {body}"),
            Self::Immovable { contact } => write!(f, "contact {contact}: its sides are one body, or none of them can move"),
            Self::Contact { contact } => {
                write!(f, "contact {contact}: the normal must be a unit vector, the slip finite and the friction at least 0")
            }
            Self::Roll { contact } => {
                write!(f, "contact {contact}: rolling and spinning friction must be at least 0, the turn finite and the length above 0")
            }
            Self::Size => write!(f, "more than 2^31 - 2 bodies or contacts"),
            Self::Changed { contact } => write!(f, "contact {contact}: the contacts are not those the sweeps were made for"),
        }
    }
}

impl std::error::Error for SpheresError {}

/// Largest deviation (1) of the squared length of a normal from 1. Larger, impulses are wrong by it and nobody is told.
const UNIT: f64 = 1e-9;

pub fn check(
    bodies: &[Body],
    contacts: usize,
    places: Option<&[Place]>,
) -> Result<(), SpheresError> {
    if bodies.len() > MOST || contacts > MOST {
        return Err(SpheresError::Size);
    }
    let bad = |x: f64| !(0.0..f64::INFINITY).contains(&x);
    let refused = |b: &Body| {
        let turns_only = b.inv_mass == 0.0 && b.inv_inertia > 0.0;
        bad(b.inv_mass) || bad(b.inv_inertia) || bad(b.radius) || turns_only
    };
    if let Some(body) = bodies.iter().position(refused) {
        return Err(SpheresError::Body { body });
    }
    if let Some(places) = places {
        let finite = places
            .iter()
            .take_while(|p| p.iter().all(|x| x.is_finite()))
            .count();
        if finite != places.len() || places.len() != bodies.len() {
            return Err(SpheresError::Places {
                body: finite.min(bodies.len()),
            });
        }
    }
    Ok(())
}

impl Contact {
    /// Whether the numbers of contact `contact` can be used.
    pub(super) fn check(&self, contact: usize) -> Result<(), SpheresError> {
        let [x, y, z] = self.normal;
        let numbers = self.slip.iter().all(|x| x.is_finite())
            && (0.0..f64::INFINITY).contains(&self.friction);
        if numbers && (x * x + y * y + z * z - 1.0).abs() <= UNIT {
            Ok(())
        } else {
            Err(SpheresError::Contact { contact })
        }
    }
}
