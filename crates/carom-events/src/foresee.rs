//! What will happen to a ball as it moves now: everything that may end its motion goes into the queue.

use crate::curved::TERMS;
use crate::meet::{self, along, Course, Meeting, Nothing, Path};
use crate::motion::Motion;
use crate::queue::{Queue, What};
use crate::roots::{falls, value};
use carom_core::flow::Outlet;
use carom_core::{Model, State};
use carom_geom::Shape;
use glam::DVec3;

/// Gap of bodies that touch over what steps leave (1). Larger: they meet too early; below 1 what steps have left overlapping falls through.
const TOUCH: f64 = 2.0;
/// Speeds and accelerations over those of the scene (1) that are rounding.
const ROUNDING: f64 = 1e-11;
/// Flight (s) between two contacts of the same bodies that is none: what bounces ever faster has come to rest then.
pub const FLIGHT: f64 = 1e-9;

/// Terms of a parabola, and of the square of a curve.
const PLAIN: usize = 3;
const SQUARES: usize = 2 * TERMS - 1;

/// What all predictions of a step are made with.
pub struct Foresight<'a> {
    pub model: &'a Model,
    pub state: &'a State,
    pub motions: &'a mut [Motion],
    pub now: f64,
    pub end: f64,
    /// Fastest speed of the scene, m/s.
    pub fastest: f64,
}

/// Which bodies a ball may meet before its present mode ends. A slide in pieces asks no others, piece after piece.
#[derive(Default)]
pub struct Near {
    bodies: usize,
    is: Vec<bool>,
}

impl Near {
    pub fn begin(&mut self, spheres: usize, bodies: usize) {
        self.bodies = bodies;
        self.is.clear();
        self.is.resize(spheres * bodies, true);
    }

    fn of(&mut self, i: usize, body: usize) -> &mut bool {
        &mut self.is[i * self.bodies + body]
    }
}

/// What counts as nothing for a body of radius `r`.
pub fn nothing(model: &Model, fastest: f64, r: f64) -> Nothing {
    Nothing {
        gap: TOUCH * model.options.gap_tolerance * r,
        speed: ROUNDING * fastest,
        acceleration: ROUNDING * (model.gravity.length() + fastest * fastest / r),
        flight: FLIGHT,
    }
}

impl Foresight<'_> {
    /// How long the motion of a ball is known.
    fn left(&self, i: usize) -> f64 {
        self.motions[i].ends.min(self.end) - self.now
    }

    /// How long its mode may last.
    fn mode_left(&self, i: usize) -> f64 {
        let m = &self.motions[i];
        (m.start + m.lasts).min(self.end) - self.now
    }

    /// What ball `i` meets alone, where its mode is new or has gone on. Returns when its motion ends at the latest: nothing else that happens later
    /// will.
    pub fn alone(&self, i: usize, is_new: bool, near: &mut Near, queue: &mut Queue) -> f64 {
        let m = &self.motions[i];
        if m.ends <= self.end {
            queue.push(m.ends, (i as u32, i as u32), What::Change);
        }
        if m.terms <= PLAIN {
            self.surroundings::<PLAIN, 5, 9>(i, is_new, near, queue)
        } else {
            self.surroundings::<TERMS, SQUARES, { 2 * SQUARES - 1 }>(i, is_new, near, queue)
        }
    }

    /// Which other balls it meets; `with` says of which that is asked.
    pub fn others(
        &self,
        i: usize,
        is_new: bool,
        with: impl Fn(usize) -> bool,
        near: &mut Near,
        queue: &mut Queue,
    ) {
        let m = &self.motions[i];
        let here = (m.place(self.now), m.velocities(self.now)[0]);
        for j in 0..self.model.bodies() {
            if j == i || !self.state.present[j] || !with(j) {
                continue;
            }
            if is_new {
                let left = self.mode_left(i).min(self.mode_left(j));
                let is_near = !self.is_far_from(i, here, j, left);
                (*near.of(i, j), *near.of(j, i)) = (is_near, is_near);
            }
            let left = self.left(i).min(self.left(j));
            if !*near.of(i, j) || self.is_far_from(i, here, j, left) {
                continue;
            }
            let (i, j) = (i.min(j), i.max(j));
            let met = if self.motions[i].terms.max(self.motions[j].terms) <= PLAIN {
                self.pair::<PLAIN, 5>(i, j)
            } else {
                self.pair::<TERMS, SQUARES>(i, j)
            };
            self.push(met, (i as u32, j as u32), queue);
        }
    }

    /// Whether ball `i`, here with its velocity, cannot meet another in a time: what most pairs are asked, and no more.
    fn is_far_from(&self, i: usize, (x, v): (DVec3, DVec3), j: usize, left: f64) -> bool {
        let (a, b) = (&self.motions[i], &self.motions[j]);
        let between = x - b.place(self.now);
        let path = Path {
            speed: (v - b.velocities(self.now)[0]).length(),
            most: a.most + b.most,
        };
        let way = path.way(left);
        let reach = self.model.radius[i] + self.model.radius[j] + way;
        between.length_squared() > reach * reach
    }

    fn pair<const K: usize, const S: usize>(&self, i: usize, j: usize) -> Meeting {
        let mut between: Course<K> = self.motions[i].course(self.now);
        let other: Course<K> = self.motions[j].course(self.now);
        for (d, other) in between.iter_mut().zip(other) {
            *d -= other;
        }
        let (ra, rb) = (self.model.radius[i], self.model.radius[j]);
        let nothing = nothing(self.model, self.fastest, ra.min(rb));
        let left = self.left(i).min(self.left(j));
        meet::balls::<K, S>(&between, ra + rb, left, &nothing)
    }

    /// Walls and outlets. What is later than the first of them is not looked for.
    fn surroundings<const K: usize, const S: usize, const R: usize>(
        &self,
        i: usize,
        is_new: bool,
        near: &mut Near,
        queue: &mut Queue,
    ) -> f64 {
        let (course, mut left): (Course<K>, f64) = (self.motions[i].course(self.now), self.left(i));
        let path = Path {
            speed: course[1].length(),
            most: self.motions[i].most,
        };
        let (n, r, x) = (self.model.bodies(), self.model.radius[i], course[0]);
        let whole = path.way(self.mode_left(i));
        let nothing = nothing(self.model, self.fastest, r);
        for (w, wall) in self.model.walls.iter().enumerate() {
            let bodies = (i as u32, (n + w) as u32);
            if self.motions[i].support.is_some_and(|s| s.wall == bodies.1) {
                if let Some(t) = leaves::<K, S>(&wall.shape, &course, left) {
                    queue.push(self.now + t, bodies, What::Edge);
                    left = t;
                }
                continue;
            }
            let is_near = near.of(i, n + w);
            if !is_new && !*is_near {
                continue;
            }
            let clearance = wall.shape.clearance(x, r);
            if is_new {
                *is_near = clearance <= whole;
            }
            if clearance > path.way(left) {
                continue;
            }
            let met = meet::wall::<K, S, R>(&wall.shape, &course, &path, r, left, &nothing);
            self.push(met, bodies, queue);
            match met {
                Meeting::Never => {}
                Meeting::At(t) => left = t,
                Meeting::Pressed => left = 0.0,
            }
        }
        let boxes = self.model.flow.outlets.iter();
        let first = boxes
            .filter(|o| !is_far(o, x, path.way(left)))
            .filter_map(|o| passes(o, &course, left))
            .fold(f64::INFINITY, f64::min);
        if first.is_finite() {
            queue.push(self.now + first, (i as u32, i as u32), What::Leave);
            left = left.min(first);
        }
        self.now + left
    }

    fn push(&self, met: Meeting, bodies: (u32, u32), queue: &mut Queue) {
        match met {
            Meeting::Never => {}
            Meeting::At(t) => queue.push(self.now + t, bodies, What::Meet),
            Meeting::Pressed => queue.push(self.now, bodies, What::Press),
        }
    }
}

/// When a ball rolls or slides off the face of the wall that carries it.
fn leaves<const K: usize, const S: usize>(
    shape: &Shape,
    course: &Course<K>,
    left: f64,
) -> Option<f64> {
    let mut from = *course;
    from[0] -= shape.place();
    match shape {
        Shape::Rectangle(wall) => {
            let across = wall.normal.cross(wall.side);
            let sides = [(wall.side, wall.half[0]), (across, wall.half[1])];
            let sides = sides
                .into_iter()
                .flat_map(|(d, half)| [(d, half), (-d, half)]);
            let falls = sides.filter_map(|(direction, half)| {
                let mut f = along(&from, -direction);
                f[0] += half;
                falls(f, left).next()
            });
            falls.reduce(f64::min)
        }
        Shape::Disc(wall) => {
            let flat = from.map(|d| d - wall.normal * wall.normal.dot(d));
            let inner: [f64; S] = meet::square(&flat);
            let mut outer = inner.map(|c| -c);
            outer[0] += wall.radius * wall.radius;
            let leaves = falls(outer, left).next();
            if wall.hole == 0.0 {
                return leaves;
            }
            let mut inner = inner;
            inner[0] -= wall.hole * wall.hole;
            leaves
                .into_iter()
                .chain(falls(inner, left).next())
                .reduce(f64::min)
        }
        _ => None,
    }
}

/// Whether a centre at `x` cannot come through a side of the box of an outlet in a way so long.
fn is_far(outlet: &Outlet, x: DVec3, way: f64) -> bool {
    if outlet.inside {
        return (x - x.clamp(outlet.low, outlet.high)).length_squared() > way * way;
    }
    (x - outlet.low).min(outlet.high - x).min_element() > way
}

/// When a centre enters the box of an outlet, or leaves that which it has to stay in.
fn passes<const K: usize>(outlet: &Outlet, course: &Course<K>, left: f64) -> Option<f64> {
    let sides: Vec<[f64; K]> = (0..3)
        .flat_map(|k| {
            let mut low = course.map(|c| c[k]);
            let mut high = low.map(|c| -c);
            low[0] -= outlet.low[k];
            high[0] += outlet.high[k];
            [low, high]
        })
        .collect();
    if !outlet.inside {
        // Out through any side.
        return sides
            .into_iter()
            .filter_map(|f| falls(f, left).next())
            .reduce(f64::min);
    }
    // In through one, where it is within all others.
    let entries = sides.iter().enumerate().filter_map(|(k, side)| {
        let within = |t: &f64| {
            let mut others = sides.iter().enumerate().filter(|(other, _)| *other != k);
            others.all(|(_, f)| value(f, *t) >= 0.0)
        };
        falls(side.map(|c| -c), left).find(within)
    });
    entries.reduce(f64::min)
}
