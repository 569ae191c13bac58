//! Where walls are in a step: places, velocities, and the impulses on them.

use crate::contact::Contact;
use crate::deformation::course::BoxCourse;
use crate::force::LoadError;
use crate::model::Model;
use crate::options::Method;
use crate::outcome::{within_bounds, FASTEST};
use crate::state::State;
use crate::stepper::Span;
use crate::wall::motion::{Instant, WallTwist};
use carom_geom::{Displacement, Proximity, Shape, ROUNDING};
use glam::{DQuat, DVec3, IVec3};
use std::ops::Range;

/// A moving wall over a step.
#[derive(Clone, Copy, Debug, Default)]
struct Course {
    /// The walls that move so: those of a mesh, or one.
    first: u32,
    count: u32,
    /// Displacement of the shapes at t_n, at t_{n+1}, and as they were placed at last.
    from: Displacement,
    to: Displacement,
    by: Displacement,
    start: Instant,
    end: Instant,
    /// At the time that the shapes were placed at last.
    now: Instant,
    /// Rotation of the wall over the step.
    turn: DVec3,
    /// It has been taken away.
    gone: bool,
}

impl Course {
    fn walls(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Velocities at both ends of the step, at a point that goes along with the centre of the turn and is here once a share `passed` of it has.
    fn passing(&self, point: DVec3, passed: f64) -> [WallTwist; 2] {
        let way = self.end.centre - self.start.centre;
        [
            self.start.twist(point - passed * way),
            self.end.twist(point + (1.0 - passed) * way),
        ]
    }
}

/// Places of all walls in a step.
#[derive(Clone, Debug, Default)]
pub struct Walls {
    /// At t_n.
    pub start: Vec<Shape>,
    /// At the time of the gaps: t_{n+1}.
    pub now: Vec<Shape>,
    courses: Vec<Course>,
    /// The periodic box, whose images move where it deforms.
    pub periodic: BoxCourse,
    span: Span,
}

impl Walls {
    pub fn new(model: &Model) -> Walls {
        let shapes: Vec<Shape> = model.walls.iter().map(|w| w.shape).collect();
        let mut courses: Vec<Course> = Vec::new();
        for (index, wall) in model.walls.iter().enumerate() {
            match wall.slot().map(|slot| courses.get_mut(slot as usize)) {
                None => {}
                Some(Some(course)) => course.count += 1,
                Some(None) => courses.push(Course {
                    first: index as u32,
                    count: 1,
                    ..Course::default()
                }),
            }
        }
        Walls {
            start: shapes.clone(),
            now: shapes,
            courses,
            periodic: BoxCourse::new(model),
            span: Span::default(),
        }
    }

    /// Moves the walls to a step. Fails with a message where a law gives no number.
    pub fn begin(&mut self, model: &Model, span: Span) -> Result<(), LoadError> {
        self.span = span;
        let course = self.periodic.begin(model, span);
        course.map_err(|text| LoadError {
            text,
            ..LoadError::default()
        })?;
        for course in &mut self.courses {
            let index = course.first as usize;
            let Some(motion) = &model.walls[index].motion else {
                continue;
            };
            let (from, start) = motion.at(span.start);
            let (to, end) = motion.at_end(span.end);
            let axis = motion.rotation.as_ref().map_or(DVec3::ZERO, |r| r.axis);
            for index in course.walls() {
                self.start[index] = model.walls[index].shape.moved(&from);
                self.now[index] = model.walls[index].shape.moved(&to);
            }
            *course = Course {
                from,
                to,
                by: to,
                start,
                end,
                now: end,
                turn: (end.angle - start.angle) * axis,
                gone: motion.is_over(span.start, span.h),
                ..*course
            };
            let slow =
                within_bounds(end.velocity, end.spin) && within_bounds(start.velocity, start.spin);
            if !(slow && end.centre.is_finite() && end.angle.is_finite()) {
                let text = format!(
                    "the motion of this wall is not finite, or faster than {FASTEST:e} m/s or rad/s, by t = {} s",
                    span.end
                );
                return Err(LoadError::on((model.first_wall() + index) as u32, text));
            }
        }
        Ok(())
    }

    /// Puts the shapes of moving walls to another time of the step.
    pub fn place(&mut self, model: &Model, time: f64) {
        self.periodic.place(model, time);
        for course in &mut self.courses {
            if let Some(motion) = &model.walls[course.first as usize].motion {
                (course.by, course.now) = motion.at(time);
                for index in course.walls() {
                    self.now[index] = model.walls[index].shape.moved(&course.by);
                }
            }
        }
    }

    /// Looks at the shapes of walls, and the periodic box, as they are at t_n.
    pub(crate) fn at_start<R>(&mut self, look: impl FnOnce(&Walls) -> R) -> R {
        let now = std::mem::replace(&mut self.periodic.now, self.periodic.start);
        std::mem::swap(&mut self.start, &mut self.now);
        let found = look(self);
        std::mem::swap(&mut self.start, &mut self.now);
        self.periodic.now = now;
        found
    }

    /// Puts free walls where they are, by their displacements, or back to where they were given.
    pub fn place_free(&mut self, model: &Model, displacements: Option<&[DVec3]>) {
        for (index, now) in self.now[..model.free_walls.len()].iter_mut().enumerate() {
            *now = model.walls[index].shape;
            if let Some(by) = displacements {
                *now = now.moved(&Displacement {
                    turn: DQuat::IDENTITY,
                    about: DVec3::ZERO,
                    shift: by[index],
                });
            }
        }
    }

    /// The walls as bodies, of meshes the triangles alone: what they have besides is nearest where triangles are.
    pub fn listed<'m>(&self, model: &'m Model) -> impl Iterator<Item = u32> + 'm {
        let first = |(walls, count): (Range<usize>, usize)| walls.start..walls.start + count;
        let triangles = model.mesh_spans().into_iter().flat_map(first);
        (0..model.simple_walls())
            .chain(triangles)
            .map(|w| (model.first_wall() + w) as u32)
    }

    /// Whether any wall moves, or image of a periodic box.
    #[inline]
    pub fn any_moves(&self) -> bool {
        !self.courses.is_empty() || self.periodic.deforms
    }

    #[inline]
    fn course(&self, model: &Model, body: u32) -> Option<&Course> {
        if self.courses.is_empty() {
            return None;
        }
        let wall = model
            .walls
            .get((body as usize).wrapping_sub(model.first_wall()))?;
        self.courses.get(wall.slot as usize)
    }

    /// Whether wall `b` has been taken away.
    #[inline]
    fn is_gone(&self, model: &Model, b: u32) -> bool {
        self.course(model, b).is_some_and(|c| c.gone)
    }

    /// How sphere `a` at `xa` meets wall `b`, where it stands now; a free one where it was given, and `xa` is counted from its displacement.
    #[inline(always)]
    pub fn meet(&self, model: &Model, a: u32, b: u32, xa: DVec3) -> Proximity {
        if self.is_gone(model, b) {
            return NOWHERE;
        }
        self.now[b as usize - model.first_wall()].meet(xa, model.radius[a as usize])
    }

    /// Whether a wall, where it stands now, covers another one for sphere `a`, both with their gaps (m): the `point` of the other that is nearest to the
    /// sphere lies on it as well, and it is nearer, or as near and has the lower number. The point is counted from the displacement of a free wall.
    pub fn covers(
        &self,
        model: &Model,
        a: u32,
        (by, gap): (u32, f64),
        (other, least): (u32, f64),
        point: DVec3,
    ) -> bool {
        let r = model.radius[a as usize];
        let tie = ROUNDING * (point.abs().max_element() + r);
        let nearer = gap < least - tie || (gap <= least + tie && by < other);
        nearer && self.now[by as usize - model.first_wall()].holds(point, r)
    }

    /// The same at t_n.
    #[inline]
    pub fn meet_at_start(&self, model: &Model, a: u32, b: u32, xa: DVec3) -> Proximity {
        if self.is_gone(model, b) {
            return NOWHERE;
        }
        self.start[b as usize - model.first_wall()].meet(xa, model.radius[a as usize])
    }

    /// The same at t_{n+1}.
    pub fn meet_at_end(&self, model: &Model, a: u32, b: u32, xa: DVec3) -> Proximity {
        match self.course(model, b) {
            Some(course) if !course.gone => {
                let shape = model.wall(b).shape.moved(&course.to);
                shape.meet(xa, model.radius[a as usize])
            }
            _ => self.meet(model, a, b, xa),
        }
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

    /// Velocity that an image of body B has on top of that of B; `None`: it is no image.
    #[inline]
    pub(crate) fn image_twist(&self, model: &Model, c: &Contact) -> Option<WallTwist> {
        if c.image == IVec3::ZERO {
            return None;
        }
        let velocity = (self.periodic).velocity(model, c.image.as_dvec3());
        Some(WallTwist {
            shape: velocity,
            material: velocity,
            spin: DVec3::ZERO,
        })
    }

    /// Velocity of what moves a contact's body B, as prescribed, at the contact at t_n: a wall, with the sphere's centre of then, or an image in a
    /// periodic box that deforms. `None`: nothing moves it.
    #[inline]
    pub fn start_twist(&self, model: &Model, c: &Contact, centre: DVec3) -> Option<WallTwist> {
        if self.periodic.deforms && !c.meets_wall(model) {
            return self.image_twist(model, c);
        }
        let point = centre - model.radius[c.a as usize] * c.n0;
        Some(self.course(model, c.b)?.start.twist(point))
    }

    /// The same at t_n and at t_{n+1} as the laws of the contact take them. The shape at the place of the normal, that of the corrected centre `end` (with
    /// Moreau-Jean that half-way), which goes along with the wall's point: at the place of the other time a round wall that turns about its own axis
    /// would move along the normal. The material where the ball is at either time.
    #[inline]
    pub fn twists(
        &self,
        model: &Model,
        c: &Contact,
        state: &State,
        end: DVec3,
    ) -> Option<[WallTwist; 2]> {
        if !self.any_moves() {
            return None;
        }
        if self.periodic.deforms && !c.meets_wall(model) {
            return Some([self.image_twist(model, c)?; 2]);
        }
        let (a, course) = (c.a as usize, self.course(model, c.b)?);
        let point = |centre: DVec3| centre - model.radius[a] * c.n1;
        let from = state.position[a];
        let (of_normal, passed, to) = match model.options.method {
            Method::MoreauJean => {
                let way = self.span.h * state.velocity[a];
                (from + 0.5 * way, 0.5, from + way)
            }
            // Once the smooth step may have left the surface: it is the surface that moves.
            _ if model.options.loads_once() => (end - c.gap * c.n1, 1.0, end - c.gap * c.n1),
            _ => (end, 1.0, end),
        };
        let mut both = course.passing(point(of_normal), passed);
        // With the velocity at one place what a turning wall carries would spiral outwards.
        both[0].material = course.start.twist(point(from)).material;
        both[1].material = course.end.twist(point(to)).material;
        Some(both)
    }

    /// What moves body B at t_{n+1} as the works of loads take it that are solved once: where they act, half-way between the centres at both ends of the
    /// step. Where the normal of the end is a round wall that turns would move along theirs.
    pub fn twist_half_way(
        &self,
        model: &Model,
        c: &Contact,
        [from, to]: [DVec3; 2],
    ) -> Option<WallTwist> {
        if self.periodic.deforms && !c.meets_wall(model) {
            return self.image_twist(model, c);
        }
        let point = 0.5 * (from + to) - model.radius[c.a as usize] * c.middle_normal();
        Some(self.course(model, c.b)?.passing(point, 0.5)[1])
    }

    /// Velocity at a point of the moving wall `slot` where the shapes were placed last, and at t_{n+1}.
    pub fn twists_of(&self, slot: u32, point: DVec3) -> [WallTwist; 2] {
        let course = &self.courses[slot as usize];
        [course.now.twist(point), course.end.twist(point)]
    }

    /// Largest speed at which moving walls pass a point, now or at t_{n+1}.
    pub fn speed_at(&self, point: DVec3) -> f64 {
        let speed = |i: &Instant| i.twist(point).shape.length();
        let of = |c: &Course| speed(&c.now).max(speed(&c.end));
        self.courses.iter().map(of).fold(0.0, f64::max)
    }

    /// How far a moving wall may go past a sphere of radius `r` in the step, m: a fast one is beyond it at the end. None up to half the radius.
    pub(crate) fn swept(&self, point: DVec3, r: f64) -> f64 {
        let way = self.speed_at(point) * self.span.h;
        if way > 0.5 * r {
            way
        } else {
            0.0
        }
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
        if self.periodic.deforms && c.image != IVec3::ZERO {
            return Some([self.periodic.way(c.image.as_dvec3()), DVec3::ZERO]);
        }
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

    /// What a sphere at `x` may touch of a listed wall within `reach` (m): the wall itself, of a triangle a part of its mesh.
    pub fn part(&self, model: &Model, (a, b): (u32, u32), x: DVec3, reach: f64) -> Option<u32> {
        let (wall, r) = (b as usize - model.first_wall(), model.radius[a as usize]);
        if wall < model.simple_walls() {
            return Some(b);
        }
        let mesh = model.mesh_of(b)?;
        let (first, placed) = (mesh.walls.start, &self.now[mesh.walls.clone()]);
        let met = mesh.mesh.met(placed, wall - first, x, r, reach)?;
        Some((model.first_wall() + first + met) as u32)
    }

    /// Point that moments on wall `b` are about, where it is now.
    pub(crate) fn point(&self, model: &Model, b: u32) -> DVec3 {
        match (model.mesh_of(b), self.course(model, b)) {
            (None, _) => self.now[b as usize - model.first_wall()].place(),
            (Some(mesh), Some(course)) => course.by.point(mesh.point),
            (Some(mesh), None) => mesh.point,
        }
    }

    /// From that point to one at `x`, by the nearest image.
    pub fn arm(&self, model: &Model, b: u32, x: DVec3) -> DVec3 {
        self.periodic.now.nearest(x - self.point(model, b))
    }

    /// That point at t_n.
    fn point_at_start(&self, model: &Model, b: u32) -> DVec3 {
        match (model.mesh_of(b), self.course(model, b)) {
            (None, _) => self.start[b as usize - model.first_wall()].place(),
            (Some(mesh), Some(course)) => course.from.point(mesh.point),
            (Some(mesh), None) => mesh.point,
        }
    }

    /// Where impulses on a wall act: those of impacts at the end of the step; loads and all that Moreau-Jean has half-way through it, where with the
    /// levers of the end they would turn what they only press.
    pub(crate) fn levers(
        &self,
        model: &Model,
        c: &Contact,
        state: &State,
        to: &[DVec3],
    ) -> [Lever; 2] {
        let (a, radius) = (c.a as usize, model.radius[c.a as usize]);
        let (start, end) = (self.point_at_start(model, c.b), self.point(model, c.b));
        let from = state.position[a] - displacement(&state.position, c.b) - start;
        let to = to[a] - displacement(to, c.b) - end;
        let centre = self.periodic.now.nearest(to);
        let (passed, way) = match model.options.method {
            // As angular momentum asks for: with theta = 1/2 where the normal is.
            Method::MoreauJean => {
                let passed = 1.0 - model.options.theta;
                let velocity = state.velocity[a] - displacement(&state.velocity, c.b);
                (passed, passed * (self.span.h * velocity - (end - start)))
            }
            _ => (0.5, 0.5 * (to - from)),
        };
        let at_end = Lever {
            arm: centre - radius * c.n1,
            point: end,
            passed: 1.0,
        };
        let half_way = Lever {
            arm: centre - (to - from) + way - radius * c.middle_normal(),
            point: start + passed * (end - start),
            passed,
        };
        [at_end, half_way]
    }

    /// Impulse on every wall and its moment about the wall's place, added to `out`; returns the work of moving walls, J.
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
            .filter(|c| c.meets_wall(model) && c.lambda != [0.0; 6])
        {
            let (on_ball, normal) = c.impulse();
            let [at_end, half_way] = self.levers(model, c, state, position);
            let then = match model.options.method {
                Method::MoreauJean => [on_ball.impulse, normal],
                _ => c.impulse_of_loads(),
            };
            let impact = [on_ball.impulse - then[0], normal - then[1]];
            let on_wall = &mut out[model.wall(c.b).given as usize];
            on_wall[0] -= on_ball.impulse;
            on_wall[1] -= on_ball.moment;
            for (lever, [impulse, normal]) in [(at_end, impact), (half_way, then)] {
                on_wall[1] -= lever.arm.cross(impulse);
                work += self.mean_twist(model, c, &lever).map_or(0.0, |mean| {
                    normal.dot(mean.shape) + (impulse - normal).dot(mean.material)
                });
            }
            let mean = self.mean_twist(model, c, &at_end);
            work += mean.map_or(0.0, |mean| on_ball.moment.dot(mean.spin));
        }
        work
    }

    /// The mean of what a moving wall has at both ends of the step, there: what turns at a constant rate does its work by moment and turn.
    pub(crate) fn mean_twist(&self, model: &Model, c: &Contact, at: &Lever) -> Option<WallTwist> {
        let [start, end] = self
            .course(model, c.b)?
            .passing(at.point + at.arm, at.passed);
        Some(start.mean(&end))
    }
}

/// Where an impulse on a wall acts.
#[derive(Clone, Copy)]
pub(crate) struct Lever {
    /// From the wall's place, m.
    pub arm: DVec3,
    point: DVec3,
    /// The share of the step that has passed.
    passed: f64,
}

/// What meets nobody.
const NOWHERE: Proximity = Proximity {
    gap: f64::INFINITY,
    normal: DVec3::Z,
    curvature: 0.0,
    flat: DVec3::ZERO,
};

/// Where body B of a contact is: its centre, the displacement of a free wall from where it was given, 0 of other walls.
#[inline(always)]
pub fn displacement(position: &[DVec3], b: u32) -> DVec3 {
    position.get(b as usize).copied().unwrap_or(DVec3::ZERO)
}

/// Gap, normal and curvature of a contact with centres at `xa` and (for spheres, by nearest images) `xb`, walls where they are now; of a free
/// wall `xb` is its displacement.
#[inline(always)]
pub fn proximity(model: &Model, walls: &Walls, c: &Contact, xa: DVec3, xb: DVec3) -> Proximity {
    if c.meets_wall(model) {
        walls.meet(model, c.a, c.b, xa - xb)
    } else {
        let (ra, rb) = (model.radius[c.a as usize], model.radius[c.b as usize]);
        walls.periodic.now.sphere_sphere(xa, ra, xb, rb)
    }
}

/// The same with the spheres at `position`.
#[inline(always)]
pub fn proximity_at(model: &Model, walls: &Walls, c: &Contact, position: &[DVec3]) -> Proximity {
    let xb = displacement(position, c.b);
    proximity(model, walls, c, position[c.a as usize], xb)
}
