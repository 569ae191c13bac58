//! Walls and their motions, from lists of dicts and tuples.

use crate::arrays::{ids, item, vectors};
use crate::coupling::{each, law, list, refuse, three_laws, vector};
use carom_core::clump::body::ClumpInput;
use carom_core::wall::{Ball, Cone, Cylinder, Disc, Mesh, Rectangle, Shape};
use carom_core::wall::{FreeWallInput, Side, WallMotion, WallRotation};
use glam::DVec3;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

/// Shapes behind the planes, each with its material.
pub fn walls(dict: &Bound<'_, PyDict>) -> PyResult<Vec<(Shape, u32)>> {
    each(dict, "walls", |wall| {
        let point = vector(&item(wall, "point")?)?;
        let given = item(wall, "shape")?;
        let material: u32 = item(wall, "material")?.extract()?;
        Ok((shape(point, given.cast::<PyTuple>()?)?, material))
    })
}

fn shape(point: DVec3, given: &Bound<'_, PyTuple>) -> PyResult<Shape> {
    let kind: String = given.get_item(0)?.extract()?;
    let direction = |k: usize| vector(&given.get_item(k)?);
    let number = |k: usize| -> PyResult<f64> { given.get_item(k)?.extract() };
    let truth = |k: usize| -> PyResult<bool> { given.get_item(k)?.extract() };
    Ok(match kind.as_str() {
        "rectangle" => {
            let [a, b]: [f64; 2] = given.get_item(3)?.extract()?;
            Shape::Rectangle(Rectangle {
                centre: point,
                normal: direction(1)?,
                side: direction(2)?,
                half: [0.5 * a, 0.5 * b],
            })
        }
        "disc" => Shape::Disc(Disc {
            centre: point,
            normal: direction(1)?,
            radius: number(2)?,
            hole: number(3)?,
        }),
        "cylinder" => Shape::Cylinder(Cylinder {
            centre: point,
            axis: direction(1)?,
            radius: number(2)?,
            half: 0.5 * number(3)?,
            inside: truth(4)?,
        }),
        "sphere" => Shape::Ball(Ball {
            centre: point,
            radius: number(1)?,
            inside: truth(2)?,
        }),
        "cone" => Shape::Cone(Cone {
            point,
            axis: direction(1)?,
            radius: number(2)?,
            radius_end: number(3)?,
            length: number(4)?,
            inside: truth(5)?,
        }),
        other => return Err(refuse(format!("a wall of shape {other} is not known"))),
    })
}

/// Meshes behind all other walls: `{"point", "material", "vertices": (n, 3), "triangles": (m, 3)}`, in the place in which they are at the start.
pub fn meshes(dict: &Bound<'_, PyDict>) -> PyResult<Vec<(Arc<Mesh>, DVec3, u32)>> {
    list(dict, "meshes")?
        .iter()
        .enumerate()
        .map(|(k, value)| {
            let given = value.cast::<PyDict>()?;
            let vertices = vectors(given, "vertices")?;
            let corners = ids(given, "triangles")?;
            let corners: Vec<[u32; 3]> = corners
                .chunks_exact(3)
                .map(|c| [c[0], c[1], c[2]])
                .collect();
            let mesh = Mesh::new(&vertices, &corners).map_err(|bad| {
                refuse(format!("mesh {k}: triangle {} {}", bad.triangle, bad.why))
            })?;
            let point = vector(&item(given, "point")?)?;
            Ok((Arc::new(mesh), point, item(given, "material")?.extract()?))
        })
        .collect()
}

/// Motions: `(index among all walls, planes first, meshes last, {...})`.
pub fn motions(dict: &Bound<'_, PyDict>) -> PyResult<Vec<(u32, WallMotion)>> {
    list(dict, "wall_motion")?
        .iter()
        .map(|value| {
            let (wall, given): (u32, Bound<'_, PyDict>) = value.extract()?;
            Ok((wall, motion(&given)?))
        })
        .collect()
}

fn motion(given: &Bound<'_, PyDict>) -> PyResult<WallMotion> {
    let part = |name: &str| -> PyResult<Option<Bound<'_, PyAny>>> {
        Ok(given.get_item(name)?.filter(|value| !value.is_none()))
    };
    let mut out = WallMotion::default();
    if let Some(laws) = part("translation")? {
        out.translation = Some(three_laws(&laws)?);
    }
    if let Some(value) = part("rotation")? {
        let (axis, point, angle): (Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>) =
            value.extract()?;
        out.rotation = Some(WallRotation {
            axis: vector(&axis)?,
            point: vector(&point)?,
            angle: law(&angle)?,
        });
    }
    if let Some(value) = part("surface_velocity")? {
        out.surface_velocity = vector(&value)?;
    }
    if let Some(value) = part("surface_rotation")? {
        let (axis, point, rate): (Bound<'_, PyAny>, Bound<'_, PyAny>, f64) = value.extract()?;
        out.surface_rotation = Some((vector(&axis)?, vector(&point)?, rate));
    }
    if let Some(until) = part("until")? {
        out.until = Some(until.extract()?);
    }
    Ok(out)
}

/// Free walls: `{"wall": index among all walls, "mass", "velocity", "weighs", "force": law of time}`.
pub fn free_walls(dict: &Bound<'_, PyDict>) -> PyResult<Vec<FreeWallInput>> {
    each(dict, "free_walls", |given| {
        Ok(FreeWallInput {
            wall: item(given, "wall")?.extract()?,
            mass: item(given, "mass")?.extract()?,
            velocity: item(given, "velocity")?.extract()?,
            weighs: item(given, "weighs")?.extract()?,
            force: law(&item(given, "force")?)?,
            area: match given.get_item("area")? {
                Some(sides) => Some(area(&sides)?),
                None => None,
            },
        })
    })
}

/// Two sides, `("period", axis)` or `("between", wall, wall)`.
fn area(sides: &Bound<'_, PyAny>) -> PyResult<[Side; 2]> {
    let side = |given: &Bound<'_, PyTuple>| -> PyResult<Side> {
        let number = |k: usize| given.get_item(k)?.extract::<u32>();
        match given.get_item(0)?.extract::<String>()?.as_str() {
            "period" => Ok(Side::Period(number(1)? as usize)),
            "between" => Ok(Side::Between(number(1)?, number(2)?)),
            other => Err(refuse(format!("a side of kind {other} is not known"))),
        }
    };
    let [a, b]: [Bound<'_, PyTuple>; 2] = sides.extract()?;
    Ok([side(&a)?, side(&b)?])
}

/// Clumps: `{"balls": (first, stop), "mass", "inertia", "position", "orientation", "velocity", "angular_velocity"}`.
pub fn clumps(dict: &Bound<'_, PyDict>) -> PyResult<Vec<ClumpInput>> {
    each(dict, "clumps", |given| {
        let (first, stop): (usize, usize) = item(given, "balls")?.extract()?;
        let three = |name| item(given, name)?.extract::<[f64; 3]>();
        Ok(ClumpInput {
            balls: first..stop,
            mass: item(given, "mass")?.extract()?,
            inertia: three("inertia")?,
            position: three("position")?,
            orientation: item(given, "orientation")?.extract()?,
            velocity: three("velocity")?,
            angular_velocity: three("angular_velocity")?,
        })
    })
}

/// A wish that is `False` where it is not given.
pub fn wish(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<bool> {
    match dict.get_item(name)? {
        Some(value) => value.extract(),
        None => Ok(false),
    }
}
