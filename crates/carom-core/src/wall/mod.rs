//! Walls: bodies N.. of a model, fixed or moved by laws of time. `docs/theory/algorithm.md` section 10.
//!
//! A moving wall is a body whose motion is given: gaps use its place at t_{n+1}, sliding and rolling rows its displacement at
//! the contact over the step, velocity rows its velocity there. The *shape* moves by the pose; the *material* may move along
//! it besides (a conveyor, a drum that turns in itself), which sliding, rolling and spinning rows see and the normal row not.

mod check;
mod motion;

pub use carom_geom::{Ball, Cone, Cylinder, Disc, Rectangle, Shape};
pub use check::{checked, finite as place, length, positive as size};
pub use motion::{WallMotion, WallRotation, WallTwist};

use crate::blow_up::{within_bounds, FASTEST};
use crate::contact::Contact;
use crate::force::LoadError;
use crate::model::Model;
use crate::state::State;
use crate::stepper::Span;
use carom_geom::{sphere_plane, Proximity};
use glam::DVec3;
use motion::Instant;

/// No entry among the moving walls.
const FIXED: u32 = u32::MAX;

/// A wall where it stands before any motion.
#[derive(Clone, Debug)]
pub struct Wall {
    pub shape: Shape,
    pub material: u32,
    /// Fixed tangents of a plane, `normal x tangent1 = tangent2`.
    pub tangent1: DVec3,
    pub tangent2: DVec3,
    pub motion: Option<Box<WallMotion>>,
    /// Place among the moving walls.
    slot: u32,
    fixed_plane: bool,
    steady_plane: bool,
}

impl Wall {
    pub fn new(shape: Shape, material: u32) -> Wall {
        let (tangent1, tangent2) = match shape {
            Shape::HalfSpace { normal, .. } => carom_geom::tangent_frame(normal),
            _ => (DVec3::ZERO, DVec3::ZERO),
        };
        Wall {
            shape,
            material,
            tangent1,
            tangent2,
            motion: None,
            slot: FIXED,
            fixed_plane: matches!(shape, Shape::HalfSpace { .. }),
            steady_plane: matches!(shape, Shape::HalfSpace { .. }),
        }
    }

    /// The same wall with a motion, at a place among those that have one.
    fn take(&mut self, slot: u32) {
        self.slot = slot;
        self.fixed_plane = false;
        self.steady_plane &= self.motion.as_ref().is_none_or(|m| m.rotation.is_none());
    }

    /// Mean curvature of the surface, 1/m, positive where it bulges towards the spheres. Edges count as the face.
    pub fn curvature(&self) -> f64 {
        let sign = |inside: bool| if inside { -1.0 } else { 1.0 };
        match self.shape {
            Shape::Ball(w) => sign(w.inside) / w.radius,
            Shape::Cylinder(w) => 0.5 * sign(w.inside) / w.radius,
            Shape::Cone(w) => sign(w.inside) / (w.radius + w.radius_end),
            Shape::HalfSpace { .. } | Shape::Rectangle(_) | Shape::Disc(_) => 0.0,
            Shape::Sphere { .. } => 0.0, // no wall
        }
    }

    /// Its place among the moving walls.
    pub fn slot(&self) -> Option<u32> {
        (self.slot != FIXED).then_some(self.slot)
    }

    /// A plane that never moves: normal and frame are the same in all steps.
    #[inline]
    pub fn is_fixed_plane(&self) -> bool {
        self.fixed_plane
    }

    /// Point and normal of a plane that never moves.
    #[inline]
    pub(crate) fn fixed_plane(&self) -> Option<(DVec3, DVec3)> {
        match self.shape {
            Shape::HalfSpace { point, normal } if self.fixed_plane => Some((point, normal)),
            _ => None,
        }
    }

    /// A piece of a surface, with two faces.
    pub fn is_sheet(&self) -> bool {
        self.shape.is_sheet()
    }

    /// A plane whose normal never turns: a lone contact with it has a closed form.
    #[inline]
    pub fn is_steady_plane(&self) -> bool {
        self.steady_plane
    }
}

/// A moving wall over a step.
#[derive(Clone, Copy, Debug, Default)]
struct Course {
    wall: u32,
    start: Instant,
    end: Instant,
    /// At the time that the shapes were placed at last.
    now: Instant,
    /// Rotation of the wall over the step.
    turn: DVec3,
}

/// Places of all walls in a step.
#[derive(Clone, Debug, Default)]
pub struct Walls {
    /// At t_n.
    pub start: Vec<Shape>,
    /// At the time of the gaps: t_{n+1}.
    pub now: Vec<Shape>,
    courses: Vec<Course>,
    span: Span,
}

impl Walls {
    pub fn new(model: &Model) -> Walls {
        let shapes: Vec<Shape> = model.walls.iter().map(|w| w.shape).collect();
        let walls = model.walls.iter().enumerate();
        let moving = walls.filter(|(_, w)| w.motion.is_some());
        let course = |(index, _)| Course {
            wall: index as u32,
            ..Course::default()
        };
        Walls {
            start: shapes.clone(),
            now: shapes,
            courses: moving.map(course).collect(),
            span: Span::default(),
        }
    }

    /// Moves the walls to a step. Fails with a message where a law gives no number.
    pub fn begin(&mut self, model: &Model, span: Span) -> Result<(), LoadError> {
        self.span = span;
        if self.courses.is_empty() {
            return Ok(());
        }
        for (index, wall) in model.walls.iter().enumerate() {
            let Some(motion) = &wall.motion else {
                continue;
            };
            let (from, start) = motion.at(span.start);
            let (to, end) = motion.at_end(span.end);
            let axis = motion.rotation.as_ref().map_or(DVec3::ZERO, |r| r.axis);
            self.start[index] = wall.shape.moved(&from);
            self.now[index] = wall.shape.moved(&to);
            self.courses[wall.slot as usize] = Course {
                wall: index as u32,
                start,
                end,
                now: end,
                turn: (end.angle - start.angle) * axis,
            };
            let slow =
                within_bounds(end.velocity, end.spin) && within_bounds(start.velocity, start.spin);
            if !(slow && end.centre.is_finite() && end.angle.is_finite()) {
                let text = format!(
                    "the motion of this wall is not finite, or faster than {FASTEST:e} m/s or rad/s, by t = {} s",
                    span.end
                );
                return Err(LoadError::on((model.spheres() + index) as u32, text));
            }
        }
        Ok(())
    }

    /// Puts the shapes of moving walls to another time of the step.
    pub fn place(&mut self, model: &Model, time: f64) {
        for course in &mut self.courses {
            let wall = &model.walls[course.wall as usize];
            if let Some(motion) = &wall.motion {
                let (by, now) = motion.at(time);
                self.now[course.wall as usize] = wall.shape.moved(&by);
                course.now = now;
            }
        }
    }

    /// Whether any wall moves.
    #[inline]
    pub fn any_moves(&self) -> bool {
        !self.courses.is_empty()
    }

    #[inline]
    fn course(&self, model: &Model, body: u32) -> Option<&Course> {
        if self.courses.is_empty() {
            return None;
        }
        let wall = model
            .walls
            .get((body as usize).wrapping_sub(model.spheres()))?;
        self.courses.get(wall.slot as usize)
    }

    /// How sphere `a` at `xa` meets wall `b`, where it stands now.
    #[inline]
    pub fn meet(&self, model: &Model, a: u32, b: u32, xa: DVec3) -> Proximity {
        meet(
            &self.now[b as usize - model.spheres()],
            xa,
            model.radius[a as usize],
        )
    }

    /// The same at t_n.
    #[inline]
    pub fn meet_at_start(&self, model: &Model, a: u32, b: u32, xa: DVec3) -> Proximity {
        meet(
            &self.start[b as usize - model.spheres()],
            xa,
            model.radius[a as usize],
        )
    }

    /// Displacement of the shape of wall `b` at the point `p` over the step.
    pub fn shift(&self, model: &Model, b: u32, p: DVec3) -> DVec3 {
        let Some(Course {
            start, end, turn, ..
        }) = self.course(model, b)
        else {
            return DVec3::ZERO;
        };
        (end.centre - start.centre) + turn.cross(p - 0.5 * (start.centre + end.centre))
    }

    /// Velocity of a contact's wall at the contact at t_n, with the sphere's centre of then; `None`: no moving wall.
    #[inline]
    pub fn start_twist(&self, model: &Model, c: &Contact, centre: DVec3) -> Option<WallTwist> {
        let course = self.course(model, c.b)?;
        Some(
            course
                .start
                .twist(centre - model.radius[c.a as usize] * c.n0),
        )
    }

    /// The same at t_{n+1}, with the corrected centre.
    #[inline]
    pub fn end_twist(&self, model: &Model, c: &Contact, centre: DVec3) -> Option<WallTwist> {
        let course = self.course(model, c.b)?;
        Some(course.end.twist(centre - model.radius[c.a as usize] * c.n1))
    }

    /// Velocity at a point of the moving wall `slot` where the shapes were placed last, and at t_{n+1}.
    pub fn twists(&self, slot: u32, point: DVec3) -> [WallTwist; 2] {
        let course = &self.courses[slot as usize];
        [course.now.twist(point), course.end.twist(point)]
    }

    /// Largest speed at which moving walls pass a point, now or at t_{n+1}.
    pub fn speed_at(&self, point: DVec3) -> f64 {
        let speed = |i: &Instant| i.twist(point).shape.length();
        let of = |c: &Course| speed(&c.now).max(speed(&c.end));
        self.courses.iter().map(of).fold(0.0, f64::max)
    }

    /// Displacement and rotation of the wall's material at the contact over the step, with the sphere's centre at t_n and after
    /// the smooth motion: exact to third order in the step, also where the contact moves over a wall that turns.
    #[inline(never)]
    pub fn displacement(
        &self,
        model: &Model,
        c: &Contact,
        from: DVec3,
        to: DVec3,
    ) -> Option<[DVec3; 2]> {
        let Course {
            start, end, turn, ..
        } = self.course(model, c.b)?;
        let h = self.span.h;
        let p = 0.5 * (from + to) - model.radius[c.a as usize] * c.n0;
        let middle = |a: DVec3, b: DVec3| 0.5 * (a + b);
        let shape = (end.centre - start.centre) + turn.cross(p - middle(start.centre, end.centre));
        let spin = middle(start.surface_spin, end.surface_spin);
        let along = middle(start.surface, end.surface)
            + spin.cross(p - middle(start.surface_centre, end.surface_centre));
        Some([shape + h * along, *turn + h * spin])
    }

    /// Impulse on every wall and its moment about the wall's place, added to `out`; returns the work of moving walls, J:
    /// impulse times the mean of the wall's velocities at both ends of the step.
    pub fn collect(
        &self,
        model: &Model,
        state: &State,
        position: &[DVec3],
        contacts: &[Contact],
        out: &mut [[DVec3; 2]],
    ) -> f64 {
        let mut work = 0.0;
        for c in contacts
            .iter()
            .filter(|c| c.is_wall(model) && c.lambda[0] != 0.0)
        {
            let i = c.a as usize;
            let on_ball = c.to_world(c.n1, &c.lambda);
            let x = position[i];
            let wall = c.b as usize - model.spheres();
            let lever = model.periodic.nearest(x - self.now[wall].place()) - model.radius[i] * c.n1;
            out[wall][0] -= on_ball.impulse;
            out[wall][1] -= lever.cross(on_ball.impulse) + on_ball.moment;
            let start = self.start_twist(model, c, state.position[i]);
            if let (Some(start), Some(end)) = (start, self.end_twist(model, c, x)) {
                let mean = start.mean(&end);
                let normal = c.lambda[0] * c.n1;
                work += normal.dot(mean.shape)
                    + (on_ball.impulse - normal).dot(mean.material)
                    + on_ball.moment.dot(mean.spin);
            }
        }
        work
    }
}

/// A shape that is no wall meets nobody.
#[inline]
fn meet(shape: &Shape, x: DVec3, r: f64) -> Proximity {
    // As in `Shape::meet`: planes are in every scene.
    if let Shape::HalfSpace { point, normal } = *shape {
        return sphere_plane(x, r, point, normal);
    }
    shape.meet(x, r).unwrap_or(Proximity {
        gap: f64::INFINITY,
        normal: DVec3::Z,
        curvature: 0.0,
        flat: DVec3::ZERO,
    })
}

/// Numbers the moving walls.
pub(crate) fn number(walls: &mut [Wall]) {
    let moving = walls.iter_mut().filter(|w| w.motion.is_some());
    for (slot, wall) in moving.enumerate() {
        wall.take(slot as u32);
    }
}
