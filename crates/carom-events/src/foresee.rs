//! What will happen to a ball as it moves now: everything that may end its motion goes into the queue.

use crate::meet::{self, along, Course, Meeting, Nothing, Off, Reach, JOINS};
use crate::motion::Motion;
use crate::near::Near;
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

/// How far a ball may be off its course where it meets something, over its radius (1): the rounding of places some metres from the origin.
const OFF: f64 = 3e-14;

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

/// What counts as nothing for a body of radius `r`.
pub fn nothing(model: &Model, fastest: f64, r: f64) -> Nothing {
    Nothing {
        gap: TOUCH * model.options.gap_tolerance * r,
        off: OFF * r,
        speed: f64::max(ROUNDING * fastest, model.options.moves_nothing(r)),
        acceleration: ROUNDING * (model.gravity.length() + fastest * fastest / r),
        flight: FLIGHT,
    }
}

impl Foresight<'_> {
    /// How long the motion of a ball is known.
    fn left(&self, i: usize) -> f64 {
        self.motions[i].ends.min(self.end) - self.now
    }

    /// What ball `i`, that sets off now, meets alone. Returns when its motion ends at the latest: nothing else that happens later will.
    pub fn alone(&self, i: usize, near: &mut Near, queue: &mut Queue) -> f64 {
        let m = &self.motions[i];
        if m.ends <= self.end {
            queue.push(m.ends, (i as u32, i as u32), What::Change);
        }
        let (course, off, mut left) = (m.course(self.now), m.off(self.now), self.left(i));
        let (n, r) = (self.model.bodies(), self.model.radius[i]);
        let mut reach = Reach::new(&course, &off, m.most, left);
        let nothing = nothing(self.model, self.fastest, r);
        let soonest = |left: f64, met: Meeting| match met {
            Meeting::Never => left,
            Meeting::At(t) | Meeting::Closer(t) => t,
            Meeting::Pressed => 0.0,
        };
        // What stands meets nothing that stands, and asks no wall.
        let moves = course[1] != DVec3::ZERO || course[2] != DVec3::ZERO;
        let walls = match moves {
            true => near.walls(self.model, reach.middle, r, reach.radius + JOINS * r),
            false => &[],
        };
        for &w in walls {
            let wall = &self.model.walls[w];
            let bodies = (i as u32, (n + w) as u32);
            let (met, what) = if m.support.is_some_and(|s| s.wall == bodies.1) {
                let time = leaves(&wall.shape, &course, &off, left, &nothing);
                (known(time, &off, &nothing), What::Edge)
            } else if wall.shape.clearance(reach.middle, r) > reach.radius {
                continue;
            } else {
                let course = (&course, &off, m.most);
                let carried = m.support.map(|s| s.normal);
                let met = meet::wall(&wall.shape, course, carried, r, left, &nothing);
                (met, What::Meet)
            };
            self.push(met, bodies, what, queue);
            if met != Meeting::Never {
                left = soonest(left, met);
                reach = Reach::new(&course, &off, m.most, left);
            }
        }
        let boxes = self.model.flow.outlets.iter();
        let first = boxes
            .filter(|o| !is_far(o, &reach))
            .filter_map(|o| passes(o, &course, &off, left, &nothing))
            .reduce(f64::min);
        let met = known(first, &off, &nothing);
        self.push(met, (i as u32, i as u32), What::Leave, queue);
        self.now + soonest(left, met)
    }

    /// Which other balls it meets; `with` says of which that is asked.
    pub fn others(&self, i: usize, with: impl Fn(usize) -> bool, queue: &mut Queue) {
        let here = self.motions[i].course(self.now);
        for j in 0..self.model.bodies() {
            if j == i || !self.state.present[j] || !with(j) {
                continue;
            }
            let (a, b) = (&self.motions[i], &self.motions[j]);
            let left = self.left(i).min(self.left(j));
            let other = b.course(self.now);
            let between: Course = std::array::from_fn(|k| here[k] - other[k]);
            let (of_a, of_b) = (a.off(self.now), b.off(self.now));
            let off: Off = std::array::from_fn(|k| of_a[k] + of_b[k]);
            let (ra, rb) = (self.model.radius[i], self.model.radius[j]);
            let reach = Reach::new(&between, &off, a.most + b.most, left);
            let far = ra + rb + reach.radius;
            // What most pairs are asked, and no more.
            if reach.middle.length_squared() > far * far {
                continue;
            }
            let nothing = nothing(self.model, self.fastest, ra.min(rb));
            let met = meet::balls(&between, ra + rb, &off, left, &nothing);
            self.push(met, (i.min(j) as u32, i.max(j) as u32), What::Meet, queue);
        }
    }

    fn push(&self, met: Meeting, bodies: (u32, u32), what: What, queue: &mut Queue) {
        match met {
            Meeting::Never => {}
            Meeting::At(t) => queue.push(self.now + t, bodies, what),
            Meeting::Closer(t) => queue.push(self.now + t, bodies, What::Closer),
            Meeting::Pressed => queue.push(self.now, bodies, What::Press),
        }
    }
}

/// What happens at a time, if the course is known so well.
fn known(time: Option<f64>, off: &Off, nothing: &Nothing) -> Meeting {
    match time {
        None => Meeting::Never,
        Some(t) if value(off, t) > nothing.off => Meeting::Closer(t),
        Some(t) => Meeting::At(t),
    }
}

/// When a ball passes a border of which `f` is the distance; now, where it stands on it and goes on.
fn passed<const N: usize>(f: [f64; N], left: f64, nothing: &Nothing) -> Option<f64> {
    match f[0].abs() <= nothing.off && f[1] < -nothing.speed {
        true => Some(0.0),
        false => falls(f, left).next(),
    }
}

/// When a ball may roll or slide off the face of the wall that carries it.
fn leaves(shape: &Shape, course: &Course, off: &Off, left: f64, nothing: &Nothing) -> Option<f64> {
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
                let mut f = along(&from, -direction, off);
                f[0] += half;
                passed(f, left, nothing)
            });
            falls.reduce(f64::min)
        }
        Shape::Disc(wall) => {
            let flat = from.map(|d| d - wall.normal * wall.normal.dot(d));
            let outer = meet::distance_gap(&flat, wall.radius, -1.0, off).map(|c| -c);
            let leaves = passed(outer, left, nothing);
            if wall.hole == 0.0 {
                return leaves;
            }
            let inner = meet::distance_gap(&flat, wall.hole, 1.0, off);
            leaves
                .into_iter()
                .chain(passed(inner, left, nothing))
                .reduce(f64::min)
        }
        _ => None,
    }
}

/// Whether a centre cannot come through a side of the box of an outlet.
fn is_far(outlet: &Outlet, reach: &Reach) -> bool {
    let x = reach.middle;
    if outlet.inside {
        let from = x - x.clamp(outlet.low, outlet.high);
        return from.length_squared() > reach.radius * reach.radius;
    }
    (x - outlet.low).min(outlet.high - x).min_element() > reach.radius
}

/// When a centre may enter the box of an outlet, or leave that which it has to stay in.
fn passes(
    outlet: &Outlet,
    course: &Course,
    off: &Off,
    left: f64,
    nothing: &Nothing,
) -> Option<f64> {
    let inwards = if outlet.inside { 1.0 } else { -1.0 };
    // How far it is from passing each side, on the other side below 0.
    let side = |out: DVec3, at: DVec3| {
        let mut f = along(course, inwards * out, off);
        f[0] -= inwards * out.dot(at);
        f
    };
    let sides: [[f64; 4]; 6] = std::array::from_fn(|k| match k % 2 {
        0 => side(-DVec3::AXES[k / 2], outlet.low),
        _ => side(DVec3::AXES[k / 2], outlet.high),
    });
    // It may stand there already, or on the border.
    let mut out = sides
        .iter()
        .map(|f| f[0] <= nothing.off && (f[1] < 0.0 || f[0] < -nothing.off));
    if outlet.inside && out.all(|is_out| is_out) || !outlet.inside && out.any(|is_out| is_out) {
        return Some(0.0);
    }
    let passed = sides.iter().enumerate().filter_map(|(k, f)| {
        // In through one, where it is within all others; out through any.
        let within = |t: &f64| {
            let mut others = sides.iter().enumerate().filter(|(other, _)| *other != k);
            !outlet.inside || others.all(|(_, f)| value(f, *t) <= 0.0)
        };
        falls(*f, left).find(within)
    });
    passed.reduce(f64::min)
}
