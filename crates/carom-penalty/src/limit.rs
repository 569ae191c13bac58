//! The longest substep that a pair admits, and that loads admit.

use crate::bodies::Bodies;
use crate::law::{damping, Laws};
use crate::pair::{Pair, FILLS};
use carom_core::force::total::motion_of;
use carom_core::joint::Block6;
use carom_core::{Model, State};
use glam::DVec3;

/// Substep over the time scales 1/omega and m/c of loads. From 2 on the scheme is unstable in them.
const LOAD_SHARE: f64 = 0.1;
/// Substep over the time constant of the damping at the default resolution of 50: with 0.1 a rebound has e to 1e-3,
/// and ten times more leaves its damping unresolved.
const DAMPING_SHARE: f64 = 50.0 * 0.1;

impl Pair {
    /// The longest substep that this pair admits: a share of its contact time once it touches, and before that the time in
    /// which it cannot touch. `shortest` is what others ask for already, `most` what is left of the step.
    #[inline]
    pub fn longest_substep(
        &self,
        laws: &Laws,
        bodies: &Bodies,
        model: &Model,
        shortest: f64,
        most: f64,
    ) -> f64 {
        // Its wall has been taken away, and it opens; or another pair of the sphere touches.
        if self.gap == f64::INFINITY || self.covered {
            return f64::INFINITY;
        }
        let (elastic, mut chi) = (&laws.elastic, self.constants.damping);
        let (speed, free) = if self.closed {
            (self.closing_speed(bodies), 0.0)
        } else {
            let (hit, free) = self.flight(bodies, most);
            if free >= shortest {
                return free;
            }
            if let (true, Some(law)) = (self.constants.varies, self.law) {
                chi = damping(&model.options, &model.laws[law as usize], hit);
            }
            (hit, free)
        };
        let resolution = f64::from(model.options.penalty_resolution);
        // The energy of the collision, which stays the same over an elastic one; a contact at rest has that of its load.
        let mut pressed = self.force * -self.gap;
        let load = self.pressing(bodies) / self.inv_mass;
        if load > self.force {
            pressed = load * elastic.indentation(self.stiffness, load);
        }
        let energy = 0.5 * speed * speed / self.inv_mass + elastic.energy(pressed, 1.0);
        let reference = self.touch.approach.max(speed);
        let damped = if self.closed && reference > 0.0 {
            1.0 + chi * speed.max(0.0) / reference
        } else {
            1.0 + chi
        };
        let v = (2.0 * energy * self.inv_mass).sqrt();
        let time = elastic.contact_time(self.stiffness, self.inv_mass, v, damped);
        let mut contact = self.shear_time * time / resolution;
        // A damping that outruns the motion has a time of its own; not where the load holds the contact at rest.
        if self.closed && self.force > 2.0 * load && reference > 0.0 {
            let rate = chi * self.force * self.inv_mass / reference;
            let share = (chi * speed.abs() / reference).min(1.0);
            contact = contact.min(DAMPING_SHARE / (resolution * rate * share));
        }
        free.max(contact)
    }

    /// Speed at which a pair that is apart can meet, m/s, and the time in which it cannot, s; below `most`.
    #[inline]
    fn flight(&self, bodies: &Bodies, most: f64) -> (f64, f64) {
        let s = self.fastest_closing(bodies);
        if self.gap <= 0.0 {
            return (s, 0.0);
        }
        let (a, b) = (self.a as usize, self.b as usize);
        let between = bodies.acceleration[a] - bodies.acceleration[b];
        if b < bodies.position.len() {
            // The distance of centres is convex in time for straight motion: gap(t) >= gap - s t - a t^2/2.
            return meeting(self.gap, s, between.length());
        }
        let (mut way, mut turning) = (0.0f64, 0.0f64);
        for [u, turns] in self.against_wall(bodies) {
            (way, turning) = (way.max(self.bent(u)), turning.max(turns.length()));
        }
        let way = way.sqrt();
        let accel = (turning - self.normal.dot(between)).max(0.0);
        if self.hollow == 0.0 {
            return meeting(self.gap, s, accel);
        }
        // The ball about the centre of curvature that touches the wall is free. In it straight flight meets when
        // v^2 t^2/2 = (gap + gap^2 k/2 - s t)/k; a curved one is no farther from its start than |v| t + |a| t^2/2.
        let share = 1.0 / (1.0 + 0.5 * self.hollow * self.gap);
        let bend = 1.0 / (1.0 / self.hollow + 0.5 * self.gap);
        let (_, straight) = meeting(self.gap, share * s, bend * way * way);
        let way = way + 0.5 * (between.length() + turning) * straight.min(most);
        meeting(self.gap, share * s, bend * way * way + share * accel)
    }

    /// Velocity of the centre against its wall, m/s, and acceleration of the wall there by its turning, m/s^2: at both times for which its motion is known.
    #[inline]
    fn against_wall(&self, bodies: &Bodies) -> [[DVec3; 2]; 2] {
        let (v, x) = (
            bodies.motion[self.a as usize][0],
            bodies.position[self.a as usize],
        );
        let Some(slot) = self.driven else {
            return [[v, DVec3::ZERO]; 2];
        };
        let here = bodies.walls.twists_of(slot, x);
        std::array::from_fn(|k| {
            let u = v - here[k].shape;
            // A twist is linear in the point: omega x (v + u).
            let there = bodies.walls.twists_of(slot, x + v + u)[k];
            [u, there.shape - here[k].shape]
        })
    }

    /// Square of a velocity, m^2/s^2, without its part along which the wall is straight.
    #[inline]
    fn bent(&self, u: DVec3) -> f64 {
        (u.length_squared() - u.dot(self.flat).powi(2)).max(0.0)
    }

    /// Acceleration by which loads, and the bend of a hollow wall, press the pair together, m/s^2; 0 if they pull it apart.
    #[inline]
    pub fn pressing(&self, bodies: &Bodies) -> f64 {
        let (a, b) = (self.a as usize, self.b as usize);
        let by_loads = self.normal.dot(bodies.smooth[b][0] - bodies.smooth[a][0]);
        if b < bodies.position.len() || (self.hollow == 0.0 && self.driven.is_none()) {
            return by_loads.max(0.0);
        }
        let hollow = self.hollow.min(1.0 / (FILLS * self.length));
        let by_wall = |[u, turning]: [DVec3; 2]| {
            let across = u - u.dot(self.normal) * self.normal;
            by_loads + hollow * self.bent(across) + self.normal.dot(turning)
        };
        (self.against_wall(bodies).map(by_wall).into_iter()).fold(0.0, f64::max)
    }
}

/// When `gap - s t - a t^2/2 = 0`, s, and at which speed, m/s.
#[inline]
fn meeting(gap: f64, s: f64, accel: f64) -> (f64, f64) {
    let hit = (s * s + 2.0 * accel * gap).sqrt();
    let free = if s > 0.0 {
        2.0 * gap / (s + hit)
    } else if accel > 0.0 {
        (hit - s) / accel
    } else {
        f64::INFINITY
    };
    (hit, free)
}

/// Longest substep that the loads admit: the scheme is explicit in them, and has to resolve their springs and dampers. From
/// the tangents at the start of the step.
pub fn load_limit(model: &Model, state: &State, time: f64) -> f64 {
    if model.loads.is_empty() {
        return f64::INFINITY;
    }
    let mut tangents = Vec::new();
    let at = motion_of(state, time);
    for load in &model.loads {
        load.tangent(&at, &mut tangents);
    }
    // Several loads on one sphere add up. Over the roots of mass and moment, no entry has a length in its unit.
    let mut sums = vec![[Block6::default(); 2]; model.bodies()];
    for t in tangents.iter().filter(|t| t.of == t.over) {
        let i = t.of as usize;
        let root = |k: usize| match k {
            0..3 => model.inv_mass[i].sqrt(),
            _ => model.inv_inertia[i].sqrt(),
        };
        for (sum, block) in sums[i].iter_mut().zip([&t.position, &t.velocity]) {
            for (k, l) in (0..36).map(|at| (at / 6, at % 6)) {
                sum[k][l] += root(k) * root(l) * block[k][l];
            }
        }
    }
    let mut limit = f64::INFINITY;
    for [stiffness, damping] in sums.iter().map(|of| of.each_ref().map(largest)) {
        // Two spheres on one spring swing against each other: twice the square of the frequency.
        limit = limit.min(LOAD_SHARE / (2.0 * stiffness).sqrt());
        limit = limit.min(LOAD_SHARE / (2.0 * damping));
    }
    limit
}

/// The largest factor by which a matrix makes a vector longer, up to 6 % more: by the trace of a power of `A^T A`, which is the same along all axes.
fn largest(block: &Block6) -> f64 {
    let times = |a: &Block6, b: &Block6| -> Block6 {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..6).map(|k| a[i][k] * b[k][j]).sum()))
    };
    let size = block
        .iter()
        .flatten()
        .fold(0.0f64, |most, x| most.max(x.abs()));
    if size == 0.0 || !size.is_finite() {
        return size;
    }
    let unit = block.map(|row| row.map(|x| x / size));
    let turned: Block6 = std::array::from_fn(|i| std::array::from_fn(|j| unit[j][i]));
    let mut power = times(&turned, &unit);
    for _ in 0..4 {
        power = times(&power, &power);
    }
    let trace: f64 = (0..6).map(|k| power[k][k]).sum();
    size * trace.powf(1.0 / 32.0)
}
