//! What method `events` cannot do, said before the run begins.

use crate::meet::JOINS;
use carom_core::options::Method;
use carom_core::wall::Shape;
use carom_core::{InitialState, Model, ModelError};
use glam::DVec3;

/// Roundings (1) of a place that the gap of bodies that touch has to be more than. Smaller: balls go through walls there; larger: scenes are refused that
/// run.
const PLACES: f64 = 4.0;

/// Refuses what has no closed motion between impacts whatever happens.
pub fn check(model: &Model, initial: &InitialState) -> Result<(), ModelError> {
    let far = |(x, r): (&DVec3, &f64)| PLACES * f64::EPSILON * x.length() > JOINS * r;
    if let Some((x, _)) = initial
        .position
        .iter()
        .zip(&model.radius)
        .find(|&of| far(of))
    {
        let text = format!(
            "{} knows places to {JOINS:e} of a radius, but rounding is more at {:.2e} m from the origin; move the scene there, or choose {}",
            Method::Events.name(),
            x.length(),
            Method::Nsga.name(),
        );
        return Err(ModelError::option("method", text));
    }
    let shapes = || model.walls.iter().map(|w| w.shape);
    let found = [
        (!model.joints.is_empty(), "joints"),
        (
            !model.loads.is_empty(),
            "springs or loads beyond the weight",
        ),
        (
            model.walls.iter().any(|w| w.motion.is_some()),
            "walls that move",
        ),
        (!model.periodic.is_none(), "periodic boxes"),
        (!model.flow.inflows.is_empty(), "inflows"),
        (shapes().any(|s| matches!(s, Shape::Cone(_))), "cones"),
        (!model.meshes.is_empty(), "meshes"),
        (model.cohesive_reach() > 0.0, "cohesion"),
        (!model.free_walls.is_empty(), "free walls"),
        (
            has_varying_friction(model),
            "friction on a level wall that depends on the slip",
        ),
    ];
    let Some((_, what)) = found.into_iter().find(|(is_there, _)| *is_there) else {
        return Ok(());
    };
    let text = format!(
        "{} does not know {what}; choose {}, or leave them out",
        Method::Events.name(),
        Method::Nsga.name(),
    );
    Err(ModelError::option("method", text))
}

/// Balls that slide on such a wall do not slow down evenly.
fn has_varying_friction(model: &Model) -> bool {
    let n = model.balls();
    let varies = |i: usize, w: usize| {
        let law = model.law_of(i, n + w);
        law.is_some_and(|law| model.laws[law as usize].friction_law.is_some())
    };
    let carries = |w: usize| match model.walls[w].shape {
        Shape::HalfSpace { normal, .. } => is_level(normal, model.gravity),
        Shape::Rectangle(wall) => is_level(wall.normal, model.gravity),
        Shape::Disc(wall) => is_level(wall.normal, model.gravity),
        _ => false,
    };
    let mut walls = 0..model.walls.len();
    walls.any(|w| carries(w) && (0..n).any(|i| varies(i, w)))
}

/// Whether the weight acts along a normal, on either side.
pub fn is_level(normal: DVec3, gravity: DVec3) -> bool {
    let g = gravity.length();
    g > 0.0 && (gravity - normal * normal.dot(gravity)).length() <= LEVEL * g
}

/// Slope (1) of a surface that counts as level. Larger: balls roll down and are said to be at rest. Smaller: tables that are turned in space are not level.
const LEVEL: f64 = 1e-12;
