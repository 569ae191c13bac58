//! When two bodies meet: their gap as polynomials of time, and the first fall of each.
//!
//! Where positions are polynomials of second degree a gap to a plane is one of second degree, the square of a distance from a
//! point or a line one of fourth, and what tells whether a circle is near one of eighth. A ball whose place is known within a bound is looked at as one that
//! swells by it, with a term of third degree: what it meets then it may meet later, and has to be looked at closer from there.
//! A wall has features: faces, edges, corners, rims. Each is looked at as if it had no end; whether the wall itself is there is asked of
//! the geometry that the step uses.

use crate::roots::{deflated, falls, first_fall, shifted, value};
use carom_geom::{Disc, Proximity, Rectangle, Shape};
use glam::DVec3;

/// Place of a ball as a polynomial of the time since some moment, lowest coefficient first.
pub type Course = [DVec3; 3];
/// How far a ball may be off its course, m, in the same way.
pub type Off = [f64; 4];

/// What counts as nothing: gap and how far off a course (m), speed (m/s), acceleration (m/s^2); and the time (s) below which a flight between two contacts is none.
#[derive(Clone, Copy, Debug)]
pub struct Nothing {
    pub gap: f64,
    pub off: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub flight: f64,
}

/// Gap over the smaller radius (1) up to which contacts join the group of an impact.
pub const JOINS: f64 = 1e-9;

/// A bound of a way is more by this (1): of its rounding.
const MORE: f64 = 1.0 + 1e-9;

/// A ball of space that a course does not leave in some time.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    pub middle: DVec3,
    pub radius: f64,
}

impl Reach {
    /// Of `end` seconds from now on, with a bound of the acceleration, m/s^2.
    pub fn new(course: &Course, off: &Off, most: f64, end: f64) -> Reach {
        let half = 0.5 * end;
        let speed = (course[1] + end * course[2]).length();
        Reach {
            middle: course[0] + half * (course[1] + half * course[2]),
            radius: MORE * (half * (speed + 0.5 * most * half) + value(off, end)),
        }
    }
}

/// Share (1) of a time that its rounding may be off. Larger: grazing times are made worse.
const POLISH: f64 = 1e-9;

/// Rate of a gap over the speed (1) up to which a ball goes along a wall. Larger: what it meets at a small angle is passed over. Smaller: rounding counts, and
/// what runs past the end of a wall meets the line in which that lies, event after event.
const ALONG: f64 = 1e-3;

/// What the farthest point of a rim has at least, over the square of its radius (1): beside the axis all points are as near. At 0 nothing is a scale there;
/// larger, what touches a rim beside its axis is taken to touch it from farther away.
const MIDDLE: f64 = 1e-3;

/// What becomes of a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meeting {
    Never,
    /// After a time, s.
    At(f64),
    /// Perhaps, after a time (s): a course has to be known better from then on.
    Closer(f64),
    /// It is closed, and stays so: forces press the bodies together.
    Pressed,
}

impl Meeting {
    /// Of what begins after `start` seconds.
    fn after(self, start: f64) -> Meeting {
        match self {
            Meeting::At(t) => Meeting::At(start + t),
            Meeting::Closer(t) => Meeting::Closer(start + t),
            other => other,
        }
    }

    /// The earlier one.
    fn or(self, other: Meeting) -> Meeting {
        match (self, other) {
            (Meeting::Never, m) | (m, Meeting::Never) => m,
            (Meeting::Pressed, _) | (_, Meeting::Pressed) => Meeting::Pressed,
            (Meeting::At(a) | Meeting::Closer(a), Meeting::At(b) | Meeting::Closer(b)) => {
                match a < b {
                    true => self,
                    false => other,
                }
            }
        }
    }
}

/// A gap that is closed now (within what counts as nothing) without its roots at 0, if it opens; else what becomes of it.
fn opened<const N: usize>(f: [f64; N], off: &Off, nothing: &Nothing) -> Result<[f64; N], Meeting> {
    if f[1] < -nothing.speed {
        return Err(Meeting::At(0.0));
    }
    let f = deflated(f);
    if f[0] > nothing.speed {
        return Ok(f);
    }
    let f = deflated(f);
    if f[0] < -nothing.acceleration {
        return Err(Meeting::Pressed);
    }
    if f[0] > nothing.acceleration {
        return Ok(f);
    }
    match off[3] > 0.0 {
        // What a course does then is within its bound: until that is a gap.
        true => Err(Meeting::Closer((nothing.gap / off[3]).cbrt())),
        false => Ok(deflated(f)),
    }
}

/// The first time in `end` seconds at which a gap closes where it is one. `touches`: it is closed now. A course without a bound has the first `M` terms.
fn closes<const N: usize, const M: usize>(
    f: [f64; N],
    touches: bool,
    end: f64,
    off: &Off,
    nothing: &Nothing,
    is_there: impl Fn(f64) -> bool,
) -> Meeting {
    if off[3] > 0.0 {
        return first_close(f, touches, end, off, nothing, is_there);
    }
    let f: [f64; M] = std::array::from_fn(|k| f[k]);
    first_close(f, touches, end, off, nothing, is_there)
}

fn first_close<const N: usize>(
    f: [f64; N],
    touches: bool,
    end: f64,
    off: &Off,
    nothing: &Nothing,
    is_there: impl Fn(f64) -> bool,
) -> Meeting {
    // A look closer may end within a gap that counts as none: then the root is there, ahead.
    let touches = touches && !(off[3] > 0.0 && f[0] > 0.0 && f[1] < -nothing.speed);
    let rest = match touches {
        true if off[0] > nothing.off => return Meeting::Closer(0.0),
        true => match opened(f, off, nothing) {
            Ok(rest) => rest,
            Err(Meeting::Closer(t)) if t > end => return Meeting::Never,
            // What moves so shortly comes to rest.
            Err(Meeting::Pressed) if end <= nothing.flight => return Meeting::Never,
            Err(meeting) => return meeting,
        },
        false => f,
    };
    match falls(rest, end).find(|&t| is_there(t)) {
        Some(t) if value(off, t) > nothing.off => Meeting::Closer(t),
        Some(t) if touches && t <= nothing.flight => Meeting::Pressed,
        Some(t) => Meeting::At(t),
        None => Meeting::Never,
    }
}

/// `|d|^2`.
#[inline]
fn square(d: &Course) -> [f64; 7] {
    let cross = |i: usize, j: usize| 2.0 * d[i].dot(d[j]);
    [
        d[0].length_squared(),
        cross(0, 1),
        d[1].length_squared() + cross(0, 2),
        cross(1, 2),
        d[2].length_squared(),
        0.0,
        0.0,
    ]
}

/// What swelling by `sign off` adds to the square of a radius.
#[inline]
fn swollen(f: &mut [f64; 7], size: f64, sign: f64, off: &Off) {
    if off[3] == 0.0 {
        return;
    }
    for (i, a) in off.iter().enumerate() {
        f[i] += 2.0 * sign * size * a;
        for (j, b) in off.iter().enumerate() {
            f[i + j] += a * b;
        }
    }
}

/// The gap of two balls, over the sum `reach` of their radii in its square: `(|x|^2 - reach^2)/(2 reach)`.
#[inline]
pub fn distance_gap(d: &Course, reach: f64, sign: f64, off: &Off) -> [f64; 7] {
    let mut f = square(d);
    // Of squares that are alike the difference would be rounding.
    let distance = d[0].length();
    f[0] = (distance - reach) * (distance + reach);
    let mut more = [0.0; 7];
    swollen(&mut more, reach, sign, off);
    for (f, more) in f.iter_mut().zip(more) {
        *f = 0.5 / reach * (*f - more);
    }
    f
}

/// The part of a course along a direction, less how far off it one may be.
#[inline]
pub fn along(course: &Course, direction: DVec3, off: &Off) -> [f64; 4] {
    let c = course.map(|c| c.dot(direction));
    [c[0] - off[0], c[1] - off[1], c[2] - off[2], -off[3]]
}

/// Two balls: `between` is the place of one from the other.
pub fn balls(between: &Course, reach: f64, off: &Off, end: f64, nothing: &Nothing) -> Meeting {
    let f = distance_gap(between, reach, 1.0, off);
    closes::<7, 5>(f, f[0] <= nothing.gap, end, off, nothing, |_| true)
}

/// A ball of radius `r` and a wall that does not move. `carried`: the normal of a surface along which the ball goes.
pub fn wall(
    shape: &Shape,
    (course, off, most): (&Course, &Off, f64),
    carried: Option<DVec3>,
    r: f64,
    end: f64,
    nothing: &Nothing,
) -> Meeting {
    let met = shape.meet(course[0], r);
    let touches = met.gap <= nothing.gap + off[0];
    let mut look = Look {
        shape,
        course,
        off,
        reach: Reach::new(course, off, most, end),
        along: [carried, touches.then_some(met.normal)],
        r,
        end,
        nothing,
        touches,
        rate: met.normal.dot(course[1]),
        found: Meeting::Never,
    };
    look.all();
    look.found
}

struct Look<'a> {
    shape: &'a Shape,
    course: &'a Course,
    off: &'a Off,
    reach: Reach,
    /// Normals of surfaces along which the ball goes: the one that carries it, and this wall.
    along: [Option<DVec3>; 2],
    r: f64,
    /// What is later is not looked for: the end, or the first meeting found.
    end: f64,
    nothing: &'a Nothing,
    touches: bool,
    /// How fast it leaves the wall now, m/s.
    rate: f64,
    found: Meeting,
}

impl Look<'_> {
    fn all(&mut self) {
        match *self.shape {
            Shape::HalfSpace { point, normal } => self.plane(point, normal),
            Shape::Rectangle(ref wall) => self.rectangle(wall),
            Shape::Disc(ref wall) => self.disc(wall),
            Shape::Ball(wall) if wall.inside => self.inside(wall.centre, None, wall.radius),
            Shape::Ball(wall) => self.point(wall.centre, wall.radius),
            Shape::Cylinder(wall) => {
                let sheet = wall.half.is_finite();
                if sheet || wall.inside {
                    self.inside(wall.centre, Some(wall.axis), wall.radius);
                }
                if sheet || !wall.inside {
                    self.line(wall.centre, wall.axis, wall.radius);
                }
                if sheet {
                    for end in [wall.half, -wall.half] {
                        self.rim(wall.centre + end * wall.axis, wall.axis, wall.radius);
                    }
                }
            }
            // Refused before (`check.rs`): a cone, a mesh.
            Shape::Cone(_) | Shape::Triangle(_) | Shape::Sheet(_) | Shape::Line(_) => {}
        }
    }

    fn rectangle(&mut self, wall: &Rectangle) {
        let across = wall.normal.cross(wall.side);
        self.faces(wall.centre, wall.normal);
        let [along, over] = wall.half;
        for sign in [1.0, -1.0] {
            self.line(wall.centre + sign * along * wall.side, across, 0.0);
            self.line(wall.centre + sign * over * across, wall.side, 0.0);
            for other in [1.0, -1.0] {
                let corner = sign * along * wall.side + other * over * across;
                self.point(wall.centre + corner, 0.0);
            }
        }
    }

    fn disc(&mut self, wall: &Disc) {
        self.faces(wall.centre, wall.normal);
        self.rim(wall.centre, wall.normal, wall.radius);
        if wall.hole > 0.0 {
            self.rim(wall.centre, wall.normal, wall.hole);
        }
    }

    /// Both sides of a sheet.
    fn faces(&mut self, point: DVec3, normal: DVec3) {
        self.plane(point, normal);
        self.plane(point, -normal);
    }

    fn plane(&mut self, point: DVec3, normal: DVec3) {
        let mut f = along(self.course, normal, self.off);
        f[0] = (self.course[0] - point).dot(normal) - self.r - self.off[0];
        self.feature::<4, 3>(f);
    }

    /// The course from a point.
    fn from(&self, point: DVec3) -> Course {
        let mut d = *self.course;
        d[0] -= point;
        d
    }

    /// The course across an axis.
    fn across(&self, point: DVec3, axis: DVec3) -> Course {
        self.from(point).map(|d| d - axis * axis.dot(d))
    }

    /// A ball of radius `size`, or a point.
    fn point(&mut self, centre: DVec3, size: f64) {
        self.outside(&self.from(centre), size);
    }

    /// A cylinder of radius `size` without end, or a line.
    fn line(&mut self, point: DVec3, axis: DVec3, size: f64) {
        self.outside(&self.across(point, axis), size);
    }

    fn outside(&mut self, from: &Course, size: f64) {
        let reach = self.r + size;
        if (self.along.iter().flatten()).any(|&n| self.passes(n, from, reach)) {
            return;
        }
        let middle = from[0] + 0.5 * self.end * (from[1] + 0.5 * self.end * from[2]);
        if middle.length() <= reach + self.reach.radius {
            self.feature::<7, 5>(distance_gap(from, reach, 1.0, self.off));
        }
    }

    /// Whether a ball that goes along a surface with this normal stays `reach` away from a place: it passes over what lies in the surface.
    fn passes(&self, n: DVec3, from: &Course, reach: f64) -> bool {
        let [a, b, c] = from.map(|of| n.dot(of));
        let at = |t: f64| a + t * (b + t * c);
        let nearest = (-0.5 * b / c).max(0.0).min(self.end);
        // No `clamp`: an end that rounding has before now would be a panic.
        let nearest = if c > 0.0 { nearest } else { 0.0 };
        let least = at(0.0).min(at(self.end)).min(at(nearest));
        least - value(self.off, self.end) >= reach - self.nothing.gap
    }

    /// The inside of a ball, or of a cylinder about an axis.
    fn inside(&mut self, centre: DVec3, axis: Option<DVec3>, size: f64) {
        let from = match axis {
            Some(axis) => self.across(centre, axis),
            None => self.from(centre),
        };
        if size > self.r {
            let f = distance_gap(&from, size - self.r, -1.0, self.off);
            self.feature::<7, 5>(f.map(|c| -c));
        }
    }

    /// A circle, while the ball is about it: of a polynomial of eighth degree over a long flight rounding is more than what closes.
    fn rim(&mut self, centre: DVec3, normal: DVec3, size: f64) {
        let near = distance_gap(&self.from(centre), 2.0 * (self.r + size), 1.0, self.off);
        let is_near = (near[0] <= 0.0).then_some(0.0);
        for start in is_near.into_iter().chain(falls(near, self.end)) {
            if self.end < start {
                return;
            }
            let mut away = shifted(near, start).map(|c| -c);
            away[0] = away[0].max(0.0);
            let rest = self.end - start;
            let [x, v, a] = *self.course;
            let mut stay = Look {
                course: &[x + start * (v + start * a), v + 2.0 * start * a, a],
                off: &shifted(*self.off, start),
                end: first_fall(&away, rest).unwrap_or(rest),
                touches: self.touches && start == 0.0,
                found: Meeting::Never,
                ..*self
            };
            stay.circle(centre, normal, size);
            self.takes(stay.found.after(start));
        }
    }

    /// With `s = |x|^2 + size^2 - r^2` and `p` the place in its plane, `s^2 = 4 size^2 |p|^2` where the ball touches it.
    fn circle(&mut self, centre: DVec3, normal: DVec3, size: f64) {
        let mut s = square(&self.from(centre));
        let q = square(&self.across(centre, normal));
        s[0] += size * size - self.r * self.r;
        let mut more = [0.0; 7];
        swollen(&mut more, self.r, 1.0, self.off);
        for (s, more) in s.iter_mut().zip(more) {
            *s -= more;
        }
        // Over `2 r` times what the farthest point of the circle has, which is less than this where they touch, it is the gap of the nearest one.
        let farthest = (s[0] + 2.0 * size * q[0].sqrt()).min(4.0 * size * (size + self.r));
        let scale = 0.5 / (self.r * farthest.max(MIDDLE * size * size));
        let mut f = [0.0; 13];
        for (i, a) in s.iter().enumerate() {
            for (j, b) in s.iter().enumerate() {
                f[i + j] += scale * a * b;
            }
            f[i] -= scale * 4.0 * size * size * q[i];
        }
        self.feature::<13, 9>(f);
        if self.r > size {
            // On the axis that touches 0 and does not fall; what has `s` below 0 holds the whole circle.
            self.feature::<7, 5>(s.map(|s| 0.5 / self.r * s));
        }
    }

    /// Takes in when the ball meets a feature, the first time that the wall itself is there.
    fn feature<const N: usize, const M: usize>(&mut self, f: [f64; N]) {
        let near = |t: f64| {
            let (met, rate) = self.at(t);
            let slope = (1..N).rev().fold(0.0, |sum, k| sum * t + k as f64 * f[k]);
            met.gap <= self.nothing.gap + value(self.off, t) && !self.is_elsewhere(t, rate, slope)
        };
        let elsewhere = self.touches && self.is_elsewhere(0.0, self.rate, f[1]);
        let touches = self.touches && !elsewhere && f[0].abs() <= self.nothing.gap;
        let mut gap = f;
        if touches && f[1] < -self.nothing.speed {
            // Just over an edge the face closes, too, where it is no more: of what is closed the wall itself says how fast.
            gap[1] = f[1].max(self.rate - self.off[1]);
        }
        let meeting = match closes::<N, M>(gap, touches, self.end, self.off, self.nothing, near) {
            Meeting::At(t) if t > 0.0 => Meeting::At(self.polished(t)),
            other => other,
        };
        self.takes(meeting);
    }

    fn takes(&mut self, meeting: Meeting) {
        self.found = self.found.or(meeting);
        match self.found {
            Meeting::Never => {}
            Meeting::At(t) | Meeting::Closer(t) => self.end = t,
            Meeting::Pressed => self.end = 0.0,
        }
    }

    /// Whether the ball goes along the wall, which it touches at another place, while it meets a feature where the wall is no more: how fast the gap of the
    /// wall opens, and that of the feature, m/s.
    fn is_elsewhere(&self, t: f64, wall: f64, feature: f64) -> bool {
        let least = -ALONG * (self.course[1] + 2.0 * t * self.course[2]).length();
        wall > least && feature < 10.0 * least
    }

    /// Where the ball is nearest to the wall after a time, and how fast it leaves it, m/s.
    fn at(&self, t: f64) -> (Proximity, f64) {
        let [x, v, a] = *self.course;
        let met = self.shape.meet(x + t * (v + t * a), self.r);
        let speed = met.normal.dot(v + 2.0 * t * a);
        (met, speed)
    }

    /// A time of meeting once more by the gap itself: polynomials of high degree round where it does not.
    fn polished(&self, t: f64) -> f64 {
        let (met, speed) = self.at(t);
        let by = met.gap / speed;
        // Where it grazes the rate of the gap means nothing.
        if by.abs() <= POLISH * t {
            (t - by).clamp(0.0, self.end)
        } else {
            t
        }
    }
}
