//! When two bodies meet: their gap as polynomials of time, and the first fall of each.
//!
//! Where positions are polynomials of second degree a gap to a plane is one of second degree, the square of a distance from a
//! point or a line one of fourth, and what tells whether a circle is near one of eighth. Pieces of curves have more terms: `K` of the course, `S = 2K - 1` of
//! squares, `R = 4K - 3` of squares of these. A wall has features: faces, edges, corners, rims. Each is
//! looked at as if it had no end; whether the wall itself is there is asked of the geometry that the step uses.

use crate::roots::{deflated, falls};
use carom_geom::{Disc, Rectangle, Shape};
use glam::DVec3;

/// Place of a ball as a polynomial of the time since some moment, lowest coefficient first.
pub type Course<const K: usize> = [DVec3; K];

/// What counts as nothing: gap (m), speed (m/s), acceleration (m/s^2); and the time (s) below which a flight between two contacts is none.
#[derive(Clone, Copy, Debug)]
pub struct Nothing {
    pub gap: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub flight: f64,
}

/// A bound of a way is more by this (1): of its rounding.
const MORE: f64 = 1.0 + 1e-9;

/// How far a course can lead: the speed at its start, m/s, and a bound of the acceleration, m/s^2.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    pub speed: f64,
    pub most: f64,
}

impl Path {
    /// In a time (s), m.
    pub fn way(&self, time: f64) -> f64 {
        MORE * time * (self.speed + 0.5 * self.most * time)
    }
}

/// Share (1) of a time that its rounding may be off. Larger: grazing times are made worse.
const POLISH: f64 = 1e-9;

/// What becomes of a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meeting {
    Never,
    /// After a time, s.
    At(f64),
    /// It is closed, and stays so: forces press the bodies together.
    Pressed,
}

impl Meeting {
    /// The earlier one.
    fn or(self, other: Meeting) -> Meeting {
        match (self, other) {
            (Meeting::Never, m) | (m, Meeting::Never) => m,
            (Meeting::Pressed, _) | (_, Meeting::Pressed) => Meeting::Pressed,
            (Meeting::At(a), Meeting::At(b)) => Meeting::At(a.min(b)),
        }
    }
}

/// A gap that is closed now (within what counts as nothing) without its roots at 0, if it opens; else what becomes of it.
fn opened<const N: usize>(f: [f64; N], nothing: &Nothing) -> Result<[f64; N], Meeting> {
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
    Ok(if f[0] > nothing.acceleration {
        f
    } else {
        deflated(f)
    })
}

/// The first time in `end` seconds at which a gap closes where it is one. `touches`: it is closed now.
fn closes<const N: usize>(
    f: [f64; N],
    touches: bool,
    end: f64,
    nothing: &Nothing,
    is_there: impl Fn(f64) -> bool,
) -> Meeting {
    if !touches {
        let first = falls(f, end).find(|&t| is_there(t));
        return first.map_or(Meeting::Never, Meeting::At);
    }
    let rest = match opened(f, nothing) {
        Ok(rest) => rest,
        Err(meeting) => return meeting,
    };
    match falls(rest, end).find(|&t| is_there(t)) {
        Some(t) if t <= nothing.flight => Meeting::Pressed,
        Some(t) => Meeting::At(t),
        None => Meeting::Never,
    }
}

/// `|d|^2`.
#[inline]
pub fn square<const K: usize, const S: usize>(d: &Course<K>) -> [f64; S] {
    let mut f = [0.0; S];
    for i in 0..K {
        f[2 * i] += d[i].length_squared();
        for j in i + 1..K {
            f[i + j] += 2.0 * d[i].dot(d[j]);
        }
    }
    f
}

/// The gap of two balls, over the sum `reach` of their radii in its square: `(|x|^2 - reach^2)/(2 reach)`.
#[inline]
fn distance_gap<const K: usize, const S: usize>(d: &Course<K>, reach: f64) -> [f64; S] {
    let mut f = square(d);
    // Of squares that are alike the difference would be rounding.
    let distance = d[0].length();
    f[0] = (distance - reach) * (distance + reach);
    f.map(|c| 0.5 / reach * c)
}

/// The part of a course along a direction.
#[inline]
pub fn along<const K: usize>(course: &Course<K>, direction: DVec3) -> [f64; K] {
    course.map(|c| c.dot(direction))
}

/// Two balls: `between` is the place of one from the other.
pub fn balls<const K: usize, const S: usize>(
    between: &Course<K>,
    reach: f64,
    end: f64,
    nothing: &Nothing,
) -> Meeting {
    let f: [f64; S] = distance_gap(between, reach);
    closes(f, f[0] <= nothing.gap, end, nothing, |_| true)
}

/// A ball of radius `r` and a wall that does not move.
pub fn wall<const K: usize, const S: usize, const R: usize>(
    shape: &Shape,
    course: &Course<K>,
    path: &Path,
    r: f64,
    end: f64,
    nothing: &Nothing,
) -> Meeting {
    let mut look = Look::<K, S, R> {
        shape,
        course,
        path,
        r,
        end,
        nothing,
        touches: shape
            .meet(course[0], r)
            .is_some_and(|p| p.gap <= nothing.gap),
        found: Meeting::Never,
    };
    look.all();
    look.found
}

struct Look<'a, const K: usize, const S: usize, const R: usize> {
    shape: &'a Shape,
    course: &'a Course<K>,
    path: &'a Path,
    r: f64,
    /// What is later is not looked for: the end, or the first meeting found.
    end: f64,
    nothing: &'a Nothing,
    touches: bool,
    found: Meeting,
}

impl<const K: usize, const S: usize, const R: usize> Look<'_, K, S, R> {
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
            // Refused before (`check.rs`): a cone, a mesh, and what is no wall.
            Shape::Cone(_) | Shape::Sphere { .. } => {}
            Shape::Triangle(_) | Shape::Sheet(_) | Shape::Line(_) => {}
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
        let mut f = along(self.course, normal);
        f[0] = (self.course[0] - point).dot(normal) - self.r;
        self.feature(f);
    }

    /// The course from a point.
    fn from(&self, point: DVec3) -> Course<K> {
        let mut d = *self.course;
        d[0] -= point;
        d
    }

    /// The course across an axis.
    fn across(&self, point: DVec3, axis: DVec3) -> Course<K> {
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

    fn outside(&mut self, from: &Course<K>, size: f64) {
        let reach = self.r + size;
        if from[0].length() - reach <= self.path.way(self.end) {
            let f: [f64; S] = distance_gap(from, reach);
            self.feature(f);
        }
    }

    /// The inside of a ball, or of a cylinder about an axis.
    fn inside(&mut self, centre: DVec3, axis: Option<DVec3>, size: f64) {
        let from = match axis {
            Some(axis) => self.across(centre, axis),
            None => self.from(centre),
        };
        if size > self.r {
            let f: [f64; S] = distance_gap(&from, size - self.r);
            self.feature(f.map(|c| -c));
        }
    }

    /// A circle: with `s = |x|^2 + size^2 - r^2` and `p` the place in its plane, `s^2 = 4 size^2 |p|^2` where the ball touches it.
    fn rim(&mut self, centre: DVec3, normal: DVec3, size: f64) {
        let mut s: [f64; S] = square(&self.from(centre));
        let q: [f64; S] = square(&self.across(centre, normal));
        s[0] += size * size - self.r * self.r;
        let scale = 1.0 / (8.0 * size * size * self.r);
        let mut f = [0.0; R];
        for (i, a) in s.iter().enumerate() {
            for (j, b) in s.iter().enumerate() {
                f[i + j] += scale * a * b;
            }
            f[i] -= scale * 4.0 * size * size * q[i];
        }
        self.feature(f);
    }

    /// Takes in when the ball meets a feature, the first time that the wall itself is there.
    fn feature<const N: usize>(&mut self, f: [f64; N]) {
        let near = |t: f64| {
            let x = self
                .course
                .iter()
                .rev()
                .fold(DVec3::ZERO, |x, c| x * t + *c);
            let met = self.shape.meet(x, self.r);
            met.is_some_and(|p| p.gap <= self.nothing.gap)
        };
        let touches = self.touches && f[0].abs() <= self.nothing.gap;
        let meeting = match closes(f, touches, self.end, self.nothing, near) {
            Meeting::At(t) if t > 0.0 => Meeting::At(self.polished(t)),
            other => other,
        };
        self.found = self.found.or(meeting);
        match self.found {
            Meeting::Never => {}
            Meeting::At(t) => self.end = t,
            Meeting::Pressed => self.end = 0.0,
        }
    }

    /// A time of meeting once more by the gap itself: polynomials of high degree round where it does not.
    fn polished(&self, t: f64) -> f64 {
        let terms = self.course.iter().enumerate().rev();
        let (x, v) = terms.fold((DVec3::ZERO, DVec3::ZERO), |(x, v), (k, c)| {
            let slope = if k > 0 { v * t + k as f64 * *c } else { v };
            (x * t + *c, slope)
        });
        let by = self
            .shape
            .meet(x, self.r)
            .map_or(0.0, |p| p.gap / p.normal.dot(v));
        // Where it grazes the rate of the gap means nothing.
        if by.abs() <= POLISH * t {
            (t - by).clamp(0.0, self.end)
        } else {
            t
        }
    }
}
