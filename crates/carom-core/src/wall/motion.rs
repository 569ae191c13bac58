//! Laws by which a wall moves, and its velocity at a point.

use super::place;
use crate::rows::{along, Rows};
use carom_geom::Displacement;
use carom_laws::Scalar;
use glam::{DQuat, DVec3};

/// Share (1) of a step by which a wall may be taken away early: times of steps are rounded. With 0 some stay a step too long.
const ON_TIME: f64 = 1e-6;

/// Turning about an axis through a point (which the translation takes along).
#[derive(Clone, Debug)]
pub struct WallRotation {
    /// Unit vector.
    pub axis: DVec3,
    pub point: DVec3,
    /// Angle from the given place, rad.
    pub angle: Scalar,
}

/// Motion of a wall, and of its material along it.
#[derive(Clone, Debug, Default)]
pub struct WallMotion {
    /// Displacement from the given place, m.
    pub translation: Option<[Scalar; 3]>,
    pub rotation: Option<WallRotation>,
    /// Of the material, m/s; turns with the wall.
    pub surface_velocity: DVec3,
    /// Of the material about an axis (unit vector) through a point, rad/s; both move with the wall.
    pub surface_rotation: Option<(DVec3, DVec3, f64)>,
    /// When the wall is taken away, s: it holds what lies on it until then, and meets nobody in the steps from then on.
    pub until: Option<f64>,
}

/// A moving wall at one time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Instant {
    /// Point that the rotation is about, its velocity, and the wall's angular velocity.
    pub centre: DVec3,
    pub velocity: DVec3,
    pub spin: DVec3,
    pub angle: f64,
    /// Material against the shape: velocity at `surface_centre`, angular velocity.
    pub surface: DVec3,
    pub surface_centre: DVec3,
    pub surface_spin: DVec3,
}

/// Velocity of a wall at a point: of its shape, of its material, and the material's angular velocity.
#[derive(Clone, Copy, Debug, Default)]
pub struct WallTwist {
    pub shape: DVec3,
    pub material: DVec3,
    pub spin: DVec3,
}

impl WallTwist {
    /// What the wall adds to the velocity measures of a contact's rows: side B of each row, the normal one on the shape.
    #[inline]
    pub fn measures(&self, rows: &Rows, dim: usize, out: &mut [f64]) {
        out[0] = along(&rows[0][1], self.shape, DVec3::ZERO);
        for (z, row) in out.iter_mut().zip(&rows[..dim]).skip(1) {
            *z = along(&row[1], self.material, self.spin);
        }
    }

    /// Velocity that a contact with this normal sees: along it of the shape, across of the material.
    #[inline]
    pub fn at(&self, normal: DVec3) -> DVec3 {
        self.material + normal * normal.dot(self.shape - self.material)
    }

    pub(crate) fn mean(&self, other: &WallTwist) -> WallTwist {
        WallTwist {
            shape: 0.5 * (self.shape + other.shape),
            material: 0.5 * (self.material + other.material),
            spin: 0.5 * (self.spin + other.spin),
        }
    }
}

impl Instant {
    pub fn twist(&self, p: DVec3) -> WallTwist {
        let shape = self.velocity + self.spin.cross(p - self.centre);
        let along = self.surface + self.surface_spin.cross(p - self.surface_centre);
        WallTwist {
            shape,
            material: shape + along,
            spin: self.spin + self.surface_spin,
        }
    }
}

impl WallMotion {
    /// Whether the wall has been taken away before a step of `h` that begins at `start`, s.
    pub(super) fn is_over(&self, start: f64, h: f64) -> bool {
        self.until.is_some_and(|until| until <= start + ON_TIME * h)
    }

    /// Place against the given one, and motion, at a time. At a kink the motion is that after it.
    pub(crate) fn at(&self, t: f64) -> (Displacement, Instant) {
        self.by(t, &|law| law.slope(t))
    }

    /// The same at the end of a step: at a kink the motion is that of the step. A gate that is drawn away from then on has held
    /// what lies on it until then.
    pub(super) fn at_end(&self, t: f64) -> (Displacement, Instant) {
        self.by(t, &|law| law.slope_before(t))
    }

    fn by(&self, t: f64, slope: &dyn Fn(&Scalar) -> f64) -> (Displacement, Instant) {
        let three = |f: &dyn Fn(&Scalar) -> f64| match &self.translation {
            Some([x, y, z]) => DVec3::new(f(x), f(y), f(z)),
            None => DVec3::ZERO,
        };
        let shift = three(&|law| law.value(t));
        let mut by = Displacement {
            turn: DQuat::IDENTITY,
            about: DVec3::ZERO,
            shift,
        };
        let mut now = Instant {
            velocity: three(slope),
            ..Instant::default()
        };
        if let Some(r) = &self.rotation {
            now.angle = r.angle.value(t);
            by.turn = DQuat::from_axis_angle(r.axis, now.angle);
            by.about = r.point;
            now.spin = slope(&r.angle) * r.axis;
        }
        now.centre = by.about + shift;
        now.surface = by.turn * self.surface_velocity;
        if let Some((axis, point, rate)) = self.surface_rotation {
            now.surface_spin = rate * (by.turn * axis);
            now.surface_centre = by.point(point);
        }
        (by, now)
    }

    /// Refuses laws that cannot be asked for: quantity and what is wrong.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        for law in self.translation.iter().flatten() {
            law.check_slope_at_start()
                .map_err(|text| ("translation", text))?;
        }
        let mut axes = Vec::new();
        if let Some(r) = &self.rotation {
            r.angle
                .check_slope_at_start()
                .map_err(|text| ("rotation", text))?;
            axes.push(("rotation", r.axis, r.point));
        }
        if let Some((axis, point, rate)) = self.surface_rotation {
            if !rate.is_finite() {
                let text = format!("has the rate {rate}; it must be finite");
                return Err(("surface_rotation", text));
            }
            axes.push(("surface_rotation", axis, point));
        }
        if let Some(until) = self.until {
            if !(until > 0.0 && until.is_finite()) {
                return Err((
                    "until",
                    format!("is {until}; it must be finite and above 0"),
                ));
            }
        }
        for (name, axis, point) in axes {
            place(name, point)?;
            let unit = (axis.length() - 1.0).abs() < 1e-9;
            if !unit {
                return Err((name, format!("needs a unit axis, not {axis}")));
            }
        }
        if !self.surface_velocity.is_finite() {
            let text = format!("is {}; it must be finite", self.surface_velocity);
            return Err(("surface_velocity", text));
        }
        Ok(())
    }
}
