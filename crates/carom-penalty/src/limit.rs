//! The longest substep that a pair admits, and that loads admit.

use crate::bodies::Bodies;
use crate::elastic::Elastic;
use crate::pair::Pair;
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
    /// which it cannot touch. `shortest` is what others ask for already.
    #[inline]
    pub fn longest_substep(
        &self,
        elastic: &Elastic,
        bodies: &Bodies,
        resolution: f64,
        shortest: f64,
    ) -> f64 {
        let s = if self.closed {
            self.closing_speed(bodies)
        } else {
            self.fastest_closing(bodies)
        };
        let (speed, free) = if self.closed {
            (s, 0.0)
        } else {
            // The distance of centres is convex in time for straight motion: gap(t) >= gap - s t - a t^2/2.
            let (a, b) = (self.a as usize, self.b as usize);
            let between = bodies.acceleration[a] - bodies.acceleration[b];
            let accel = if b < bodies.position.len() {
                between.length()
            } else {
                (-self.normal.dot(between)).max(0.0)
            };
            let hit = (s * s + 2.0 * accel * self.gap).sqrt();
            let free = if s > 0.0 {
                2.0 * self.gap / (s + hit)
            } else if accel > 0.0 {
                (hit - s) / accel
            } else {
                f64::INFINITY
            };
            if free >= shortest {
                return free;
            }
            (hit, free)
        };
        // The energy of the collision, which stays the same over an elastic one; a contact at rest has that of its load.
        let mut pressed = self.force * -self.gap;
        let load = self.pressing(&bodies.smooth) / self.inv_mass;
        if load > self.force {
            pressed = load * elastic.indentation(self.stiffness, load);
        }
        let energy = 0.5 * speed * speed / self.inv_mass + elastic.energy(pressed, 1.0);
        let reference = self.touch.approach.max(speed);
        let damped = if self.closed && reference > 0.0 {
            1.0 + self.constants.damping * speed.max(0.0) / reference
        } else {
            1.0 + self.constants.damping
        };
        let v = (2.0 * energy * self.inv_mass).sqrt();
        let time = elastic.contact_time(self.stiffness, self.inv_mass, v, damped);
        let mut contact = time / resolution;
        // A damping that outruns the motion has a time of its own; not where the load holds the contact at rest.
        if self.closed && self.force > 2.0 * load && reference > 0.0 {
            let rate = self.constants.damping * self.force * self.inv_mass / reference;
            let share = (self.constants.damping * speed.abs() / reference).min(1.0);
            contact = contact.min(DAMPING_SHARE / (resolution * rate * share));
        }
        free.max(contact)
    }

    /// Acceleration by which loads press the pair together, m/s^2; 0 if they pull it apart.
    #[inline]
    pub fn pressing(&self, smooth: &[[DVec3; 2]]) -> f64 {
        let (a, b) = (self.a as usize, self.b as usize);
        self.normal.dot(smooth[b][0] - smooth[a][0]).max(0.0)
    }
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
