//! When two bodies meet: their gap as polynomials of time, and the first fall of each.
//!
//! Between events positions are polynomials of second degree, so that a gap to a plane is one of second degree, the square of a distance from a
//! point or a line one of fourth, and what tells whether a circle is near one of eighth. A wall has features: faces, edges, corners, rims. Each is
//! looked at as if it had no end; whether the wall itself is there is asked of the geometry that the step uses.

use crate::roots::{deflated, falls};
use carom_geom::{Disc, Rectangle, Shape};
use glam::DVec3;

/// Place of a ball as a polynomial of the time since some moment: `x[0] + x[1] t + x[2] t^2`.
pub type Course = [DVec3; 3];

/// What counts as nothing: gap (m), speed (m/s), acceleration (m/s^2); and the time (s) below which a flight between two contacts is none.
#[derive(Clone, Copy, Debug)]
pub struct Nothing {
    pub gap: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub flight: f64,
}

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

/// The gap of two balls, over the sum `reach` of their radii in its square: `(|x|^2 - reach^2)/(2 reach)`.
#[inline]
fn distance_gap(d: &Course, reach: f64) -> [f64; 5] {
    let scale = 0.5 / reach;
    let [x, v, a] = *d;
    [
        // Of squares that are alike the difference would be rounding.
        (x.length() - reach) * (x.length() + reach) * scale,
        2.0 * x.dot(v) * scale,
        (v.length_squared() + 2.0 * x.dot(a)) * scale,
        2.0 * v.dot(a) * scale,
        a.length_squared() * scale,
    ]
}

/// Two balls: `between` is the place of one from the other.
pub fn balls(between: &Course, reach: f64, end: f64, nothing: &Nothing) -> Meeting {
    let [x, v, a] = *between;
    let way = end * (v.length() + end * a.length());
    if x.length() - reach > way {
        return Meeting::Never;
    }
    let f = distance_gap(between, reach);
    closes(f, f[0] <= nothing.gap, end, nothing, |_| true)
}

/// A ball of radius `r` and a wall that does not move.
pub fn wall(shape: &Shape, course: &Course, r: f64, end: f64, nothing: &Nothing) -> Meeting {
    let [x, v, a] = *course;
    let way = end * (v.length() + end * a.length());
    if shape.clearance(x, r) > way {
        return Meeting::Never;
    }
    let mut look = Look {
        shape,
        course,
        r,
        end,
        nothing,
        touches: shape.meet(x, r).is_some_and(|p| p.gap <= nothing.gap),
        found: Meeting::Never,
    };
    look.all();
    look.found
}

struct Look<'a> {
    shape: &'a Shape,
    course: &'a Course,
    r: f64,
    end: f64,
    nothing: &'a Nothing,
    touches: bool,
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
            // Refused before (`check.rs`): a cone, and what is no wall.
            Shape::Cone(_) | Shape::Sphere { .. } => {}
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
        let [x, v, a] = *self.course;
        self.feature([
            (x - point).dot(normal) - self.r,
            v.dot(normal),
            a.dot(normal),
        ]);
    }

    /// A ball of radius `size`, or a point.
    fn point(&mut self, centre: DVec3, size: f64) {
        let [x, v, a] = *self.course;
        self.feature(distance_gap(&[x - centre, v, a], self.r + size));
    }

    /// A cylinder of radius `size` without end, or a line.
    fn line(&mut self, point: DVec3, axis: DVec3, size: f64) {
        self.feature(distance_gap(&self.across(point, axis), self.r + size));
    }

    /// The inside of a ball, or of a cylinder about an axis.
    fn inside(&mut self, centre: DVec3, axis: Option<DVec3>, size: f64) {
        let [x, v, a] = *self.course;
        let from = match axis {
            Some(axis) => self.across(centre, axis),
            None => [x - centre, v, a],
        };
        if size > self.r {
            self.feature(distance_gap(&from, size - self.r).map(|c| -c));
        }
    }

    /// The course across an axis.
    fn across(&self, point: DVec3, axis: DVec3) -> Course {
        let [x, v, a] = *self.course;
        [x - point, v, a].map(|d| d - axis * axis.dot(d))
    }

    /// A circle: with `s = |x|^2 + size^2 - r^2` and `p` the place in its plane, `s^2 = 4 size^2 |p|^2` where the ball touches it.
    fn rim(&mut self, centre: DVec3, normal: DVec3, size: f64) {
        let [x, v, a] = *self.course;
        let d = [x - centre, v, a];
        let p = self.across(centre, normal);
        let square = |d: &Course| {
            let [x, v, a] = *d;
            [
                x.length_squared(),
                2.0 * x.dot(v),
                v.length_squared() + 2.0 * x.dot(a),
                2.0 * v.dot(a),
                a.length_squared(),
            ]
        };
        let (mut s, q) = (square(&d), square(&p));
        s[0] += size * size - self.r * self.r;
        let scale = 1.0 / (8.0 * size * size * self.r);
        let mut f = [0.0; 9];
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
            let [x, v, a] = *self.course;
            let met = self.shape.meet(x + t * (v + t * a), self.r);
            met.is_some_and(|p| p.gap <= self.nothing.gap)
        };
        let touches = self.touches && f[0].abs() <= self.nothing.gap;
        let meeting = closes(f, touches, self.end, self.nothing, near);
        self.found = self.found.or(meeting);
    }
}
