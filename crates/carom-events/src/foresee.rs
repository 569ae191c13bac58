//! What will happen to a ball as it moves now: everything that may end its motion goes into the queue.

use crate::meet::{self, Course, Meeting, Nothing};
use crate::motion::Motion;
use crate::queue::{Queue, What};
use crate::roots::falls;
use carom_core::flow::Outlet;
use carom_core::{Model, State};
use carom_geom::Shape;
use glam::DVec3;

/// Gap over the smaller radius (1) of bodies that touch. Larger: they meet too early; smaller: rounding parts what touches.
const TOUCH: f64 = 1e-11;
/// Speeds and accelerations over those of the scene (1) that are rounding.
const ROUNDING: f64 = 1e-11;
/// Flight (s) between two contacts of the same bodies that is none: what bounces ever faster has come to rest then.
pub const FLIGHT: f64 = 1e-9;

/// What all predictions of a step are made with.
pub struct Foresight<'a> {
    pub model: &'a Model,
    pub state: &'a State,
    pub motions: &'a [Motion],
    pub now: f64,
    pub end: f64,
    /// Fastest speed of the scene, m/s.
    pub fastest: f64,
}

/// What counts as nothing for a body of radius `r`.
pub fn nothing(model: &Model, fastest: f64, r: f64) -> Nothing {
    Nothing {
        gap: TOUCH * r,
        speed: ROUNDING * fastest,
        acceleration: ROUNDING * (model.gravity.length() + fastest * fastest / r),
        flight: FLIGHT,
    }
}

impl Foresight<'_> {
    /// Course of a ball from now on, and how long it is known.
    fn course(&self, i: usize) -> (Course, f64) {
        let m = &self.motions[i];
        let [v, _] = m.velocities(self.now);
        let left = (m.start + m.holds).min(self.end) - self.now;
        ([m.place(self.now), v, m.x[2]], left)
    }

    /// Everything about ball `i`; `with` says with which other balls.
    pub fn ball(&self, i: usize, with: impl Fn(usize) -> bool, queue: &mut Queue) {
        let (course, left) = self.course(i);
        let m = &self.motions[i];
        let a = i as u32;
        if m.start + m.holds <= self.end {
            queue.push(m.start + m.holds, (a, a), What::Change);
        }
        self.walls(i, &course, left, queue);
        self.outlets(i, &course, left, queue);
        for j in 0..self.model.spheres() {
            if j == i || !self.state.present[j] || !with(j) {
                continue;
            }
            self.pair(i.min(j), i.max(j), queue);
        }
    }

    fn pair(&self, i: usize, j: usize, queue: &mut Queue) {
        let ((a, left_a), (b, left_b)) = (self.course(i), self.course(j));
        let (ra, rb) = (self.model.radius[i], self.model.radius[j]);
        let between = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let nothing = nothing(self.model, self.fastest, ra.min(rb));
        let met = meet::balls(&between, ra + rb, left_a.min(left_b), &nothing);
        self.push(met, (i as u32, j as u32), queue);
    }

    fn push(&self, met: Meeting, bodies: (u32, u32), queue: &mut Queue) {
        match met {
            Meeting::Never => {}
            Meeting::At(t) => queue.push(self.now + t, bodies, What::Meet),
            Meeting::Pressed => queue.push(self.now, bodies, What::Press),
        }
    }

    fn walls(&self, i: usize, course: &Course, left: f64, queue: &mut Queue) {
        let (n, r) = (self.model.spheres(), self.model.radius[i]);
        let nothing = nothing(self.model, self.fastest, r);
        for (w, wall) in self.model.walls.iter().enumerate() {
            let bodies = (i as u32, (n + w) as u32);
            if self.motions[i].support.is_some_and(|s| s.wall == bodies.1) {
                if let Some(t) = leaves(&wall.shape, course, left) {
                    queue.push(self.now + t, bodies, What::Edge);
                }
                continue;
            }
            let met = meet::wall(&wall.shape, course, r, left, &nothing);
            self.push(met, bodies, queue);
        }
    }

    fn outlets(&self, i: usize, course: &Course, left: f64, queue: &mut Queue) {
        let boxes = self.model.flow.outlets.iter();
        let first = boxes
            .filter_map(|o| passes(o, course, left))
            .fold(f64::INFINITY, f64::min);
        if first.is_finite() {
            queue.push(self.now + first, (i as u32, i as u32), What::Leave);
        }
    }
}

/// When a ball rolls or slides off the face of the wall that carries it.
fn leaves(shape: &Shape, [x, v, a]: &Course, left: f64) -> Option<f64> {
    let first = |f: Option<f64>, other: Option<f64>| match (f, other) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    };
    let mut found = None;
    match shape {
        Shape::Rectangle(wall) => {
            let across = wall.normal.cross(wall.side);
            for (axis, half) in [(wall.side, wall.half[0]), (across, wall.half[1])] {
                for axis in [axis, -axis] {
                    let f = [
                        half - (*x - wall.centre).dot(axis),
                        -v.dot(axis),
                        -a.dot(axis),
                    ];
                    found = first(found, falls(f, left).next());
                }
            }
        }
        Shape::Disc(wall) => {
            let flat = |d: DVec3| d - wall.normal * wall.normal.dot(d);
            let (x, v, a) = (flat(*x - wall.centre), flat(*v), flat(*a));
            let f = [
                wall.radius * wall.radius - x.length_squared(),
                -2.0 * x.dot(v),
                -v.length_squared() - 2.0 * x.dot(a),
                -2.0 * v.dot(a),
                -a.length_squared(),
            ];
            found = falls(f, left).next();
            if wall.hole > 0.0 {
                let mut inner = f.map(|c| -c);
                inner[0] = x.length_squared() - wall.hole * wall.hole;
                found = first(found, falls(inner, left).next());
            }
        }
        _ => {}
    }
    found
}

/// When a centre enters the box of an outlet, or leaves that which it has to stay in.
fn passes(outlet: &Outlet, [x, v, a]: &Course, left: f64) -> Option<f64> {
    let sides = (0..3).flat_map(|k| {
        let low = [x[k] - outlet.low[k], v[k], a[k]];
        let high = [outlet.high[k] - x[k], -v[k], -a[k]];
        [low, high]
    });
    if !outlet.inside {
        // Out through any side.
        return sides.filter_map(|f| falls(f, left).next()).reduce(f64::min);
    }
    let sides: Vec<[f64; 3]> = sides.collect();
    let value = |f: &[f64; 3], t: f64| f[0] + t * (f[1] + t * f[2]);
    let mut found = None;
    for (k, side) in sides.iter().enumerate() {
        // In through this one, where it is within all others.
        let within = |t: &f64| {
            let others = sides.iter().enumerate().filter(|(other, _)| *other != k);
            others.into_iter().all(|(_, f)| value(f, *t) >= 0.0)
        };
        let enters = falls(side.map(|c| -c), left).find(within);
        found = match (found, enters) {
            (Some(a), Some(b)) => Some(f64::min(a, b)),
            (a, b) => a.or(b),
        };
    }
    found
}
