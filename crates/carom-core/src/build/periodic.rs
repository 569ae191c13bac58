//! Checks of a periodic box: its lengths, and that all walls repeat with it.

use super::ModelInput;
use crate::deformation::course::least_period;
use crate::options::{Method, Options};
use crate::outcome::{Entry, ModelError};
use crate::wall::Wall;
use carom_geom::{DVec3, Periodic, Shape};
use carom_laws::Scalar;

/// A component of a direction along a periodic axis below this is none.
const ALONG: f64 = 1e-9;

/// The box of a model, or what is wrong with it.
pub(super) fn compile(input: &ModelInput, walls: &[Wall]) -> Result<Periodic, ModelError> {
    let world = Entry("world", 0);
    world.finite("periodic", &input.periodic)?;
    world.finite("periodic_origin", &input.periodic_origin)?;
    let least = least_period(input.radius.iter().copied());
    for length in input.periodic {
        if length != 0.0 && length < least {
            let text = format!(
                "has a length of {length} m; it must be 0 (not periodic) or at least {least} m, four of the largest radii and a \
                 margin, or two images of a sphere could touch another at once"
            );
            return Err(world.refused(("periodic", text)));
        }
    }
    let periodic = Periodic::new(
        DVec3::from(input.periodic),
        DVec3::from(input.periodic_origin),
    );
    for (index, wall) in walls.iter().enumerate() {
        if let Some(text) = changes_along(wall, &periodic) {
            return Err(Entry("wall", index).refused(("shape", text.to_owned())));
        }
    }
    Ok(periodic)
}

/// What is wrong with the deformation of the box.
pub(super) fn check_deformation(input: &ModelInput, options: &Options) -> Result<(), ModelError> {
    let Some(given) = &input.deformation else {
        return Ok(());
    };
    let wrong = |text: &str| Err(Entry("world", 0).refused(("deformation", text.to_owned())));
    if !matches!(options.method, Method::Nsga | Method::MoreauJean) {
        return wrong("needs method nsga or moreau");
    }
    if !(input.inflow.is_empty() && input.outlet.is_empty()) {
        return wrong("excludes inflows and outlets");
    }
    // Each body starts with the flow of its own place: what is joined would come apart.
    if !input.joints.is_empty() {
        return wrong("excludes joints");
    }
    let repeats = |axis: usize| input.periodic.get(axis).is_some_and(|l| *l > 0.0);
    let stretched = (0..3).filter(|&k| given.stretch[k].is_some());
    let sheared = given
        .shear
        .iter()
        .flat_map(|_| [given.flow, given.gradient]);
    if !stretched.chain(sheared).all(repeats) || given.flow.max(given.gradient) > 2 {
        return wrong("concerns an axis that does not repeat");
    }
    if given.flow == given.gradient {
        return wrong("has its flow along the gradient");
    }
    let starts = |law: &Option<Scalar>, at: f64| law.iter().all(|law| law.value(0.0) == at);
    if !(given.stretch.iter().all(|law| starts(law, 1.0)) && starts(&given.shear, 0.0)) {
        return wrong("must be none at t = 0");
    }
    Ok(())
}

/// Why a wall does not look the same at every image, if it does not.
fn changes_along(wall: &Wall, periodic: &Periodic) -> Option<&'static str> {
    if periodic.is_none() {
        return None;
    }
    // The part of a direction along periodic axes, and across them.
    let along = |d: DVec3| DVec3::select(periodic.length().cmpgt(DVec3::ZERO), d, DVec3::ZERO);
    let only = |d: DVec3| (d - along(d)).length() < ALONG * d.length();
    let fits = match wall.shape {
        Shape::HalfSpace { normal, .. } => along(normal).length() < ALONG,
        // Along two periodic axes it would change across one of them.
        Shape::Cylinder(c) => {
            c.half.is_infinite() && only(c.axis) && along(DVec3::ONE).length_squared() == 1.0
        }
        _ => false,
    };
    if !fits {
        return Some(
            "must not change along a periodic axis: planes along it and endless cylinders about it stand there, nothing else",
        );
    }
    let motion = wall.motion.as_ref()?;
    let turns = motion.rotation.iter().map(|r| r.axis);
    let turns = turns.chain(motion.surface_rotation.iter().map(|r| r.0));
    // About a periodic axis, the only one.
    let fits = |axis: DVec3| only(axis) && along(DVec3::ONE).length_squared() == 1.0;
    if turns.into_iter().all(fits) {
        return None;
    }
    Some("turns about an axis across a periodic one: then it is not the same at every image")
}
