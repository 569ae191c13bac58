//! Shapes as they are given: unit vectors made of directions, numbers that are none refused.

use carom_geom::{Ball, Cone, Cylinder, DVec3, Disc, Rectangle, Shape};

/// What is wrong with which quantity.
pub type Refusal = (&'static str, String);

/// The shape with unit vectors, or what is wrong with it.
pub fn checked(shape: &Shape) -> Result<Shape, Refusal> {
    Ok(match *shape {
        Shape::HalfSpace { point, normal } => Shape::HalfSpace {
            point: finite("point", point)?,
            normal: unit("normal", normal)?,
        },
        Shape::Rectangle(w) => {
            let normal = unit("normal", w.normal)?;
            let side = unit("side", w.side)?;
            let side = side - normal * normal.dot(side);
            if side.length() < 1e-6 {
                let text = format!("is {}, along the normal; it must lie in the plane", w.side);
                return Err(("side", text));
            }
            positive("size", w.half[0])?;
            positive("size", w.half[1])?;
            Shape::Rectangle(Rectangle {
                centre: finite("point", w.centre)?,
                normal,
                side: side.normalize(),
                half: w.half,
            })
        }
        Shape::Disc(w) => {
            positive("radius", w.radius)?;
            if !(0.0..w.radius).contains(&w.hole) {
                let text = format!("is {}; it must be below the radius of {}", w.hole, w.radius);
                return Err(("hole", text));
            }
            Shape::Disc(Disc {
                centre: finite("point", w.centre)?,
                normal: unit("normal", w.normal)?,
                ..w
            })
        }
        Shape::Cylinder(w) => {
            positive("radius", w.radius)?;
            if w.half != f64::INFINITY {
                positive("length", w.half)?;
            }
            Shape::Cylinder(Cylinder {
                centre: finite("point", w.centre)?,
                axis: unit("axis", w.axis)?,
                ..w
            })
        }
        Shape::Ball(w) => {
            positive("radius", w.radius)?;
            Shape::Ball(Ball {
                centre: finite("point", w.centre)?,
                ..w
            })
        }
        Shape::Cone(w) => {
            positive("length", w.length)?;
            for (name, radius) in [("radius", w.radius), ("radius_end", w.radius_end)] {
                if radius != 0.0 {
                    positive(name, radius)?;
                }
            }
            positive("radius", w.radius.max(w.radius_end))?;
            Shape::Cone(Cone {
                point: finite("point", w.point)?,
                axis: unit("axis", w.axis)?,
                ..w
            })
        }
        Shape::Triangle(_) | Shape::Sheet(_) | Shape::Line(_) => {
            let text = "is a part of a mesh; give the mesh".to_owned();
            return Err(("shape", text));
        }
    })
}

/// Sizes (m) that have squares, and quotients of these, that are numbers. Wider, gaps of a wall are infinite or NaN and the run
/// ends there; narrower, scenes in other units are refused.
const SIZES: std::ops::RangeInclusive<f64> = 1e-75..=1e75;

/// A size that can be told from 0.
pub fn positive(name: &'static str, value: f64) -> Result<(), Refusal> {
    if SIZES.contains(&value) {
        return Ok(());
    }
    let (least, most) = (SIZES.start(), SIZES.end());
    let text = format!("is {value:e}; it must be above 0, between {least:e} m and {most:e} m");
    Err((name, text))
}

/// A place.
pub fn finite(name: &'static str, v: DVec3) -> Result<DVec3, Refusal> {
    if v.is_finite() && v.abs().max_element() <= *SIZES.end() {
        return Ok(v);
    }
    let most = SIZES.end();
    // Hundreds of digits are no help: `Debug` writes powers of ten.
    let text = format!(
        "is {:?}; it must be finite, and not above {most:e} m",
        v.to_array()
    );
    Err((name, text))
}

/// A distance or a coordinate: of either sign, or none.
pub fn length(name: &'static str, value: f64) -> Result<(), Refusal> {
    if value.abs() <= *SIZES.end() {
        return Ok(());
    }
    let most = SIZES.end();
    let text = format!("is {value:e}; it must be finite, and not above {most:e} m");
    Err((name, text))
}

/// Scaled before it is normalised: the square of a huge component is infinite.
fn unit(name: &'static str, v: DVec3) -> Result<DVec3, Refusal> {
    if !v.is_finite() {
        return Err((name, format!("is {v}; it must be finite")));
    }
    let scaled = v / v.abs().max_element();
    let size = scaled.length();
    if !size.is_finite() {
        return Err((name, "is zero".to_owned()));
    }
    Ok(scaled / size)
}
