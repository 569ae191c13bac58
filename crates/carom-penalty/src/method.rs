//! The method and its memory: bodies, pairs, and the pairs' place in the neighbour list.

use crate::bodies::Bodies;
use crate::law::Laws;
use crate::pair::Pair;
use carom_core::force::total::{add_loads, power, pushed};
use carom_core::force::{LoadError, Motion};
use carom_core::wall::places::Walls;
use carom_core::{Model, State};
use carom_geom::NeighbourList;
use glam::DVec3;

/// Method `penalty`.
pub struct Penalty {
    pub bodies: Bodies,
    pub laws: Laws,
    /// Sorted by key.
    pub pairs: Vec<Pair>,
    merged: Vec<Pair>,
    pub need: Vec<f64>,
    /// Longest substep that the loads admit, s.
    pub load_limit: f64,
    wrench: Vec<[DVec3; 2]>,
    speed: Vec<f64>,
    /// Velocities and angular velocities at which loads are evaluated.
    ahead: [Vec<DVec3>; 2],
    /// Of the loads at their last evaluation: power of those without potential, W, and potential, J.
    pub power: f64,
    pub potential: f64,
    /// And what they push, N^2/kg (`force::total::pushed`).
    pub pushed: f64,
    /// Which spheres are there.
    pub present: Vec<bool>,
}

impl Penalty {
    pub fn new(model: &Model) -> Penalty {
        let (n, bodies) = (model.bodies(), model.bodies() + model.walls.len());
        let extended = |values: &[f64]| {
            let mut out = values.to_vec();
            out.resize(bodies, 0.0);
            out
        };
        Penalty {
            bodies: Bodies {
                walls: Walls::new(model),
                inv_mass: extended(&model.inv_mass),
                inv_inertia: extended(&model.inv_inertia),
                radius: extended(&model.radius),
                smooth: vec![[DVec3::ZERO; 2]; bodies],
                acceleration: vec![DVec3::ZERO; bodies],
                ..Bodies::default()
            },
            laws: Laws::new(model),
            pairs: Vec::new(),
            merged: Vec::new(),
            need: vec![0.0; n],
            load_limit: f64::INFINITY,
            wrench: vec![[DVec3::ZERO; 2]; n],
            speed: Vec::new(),
            ahead: Default::default(),
            power: 0.0,
            potential: 0.0,
            pushed: 0.0,
            present: Vec::new(),
        }
    }

    /// Takes over the state at the start of a step, with the contacts that are closed.
    pub fn take_state(&mut self, model: &Model, state: &State) {
        let b = &mut self.bodies;
        b.position.clone_from(&state.position);
        b.orientation.clone_from(&state.orientation);
        self.present.clone_from(&state.present);
        b.motion.clear();
        let velocities = state.velocity.iter().zip(&state.angular_velocity);
        b.motion.extend(velocities.map(|(v, w)| [*v, *w]));
        b.motion.resize(b.inv_mass.len(), [DVec3::ZERO; 2]);
        self.pairs.clear();
        for touch in &state.touches {
            let pair = Pair::new(model, &self.laws, b, touch.key, Some(*touch));
            self.pairs.push(pair);
        }
    }

    /// The state at the end of a step.
    pub fn write_state(&self, state: &mut State) {
        let b = &self.bodies;
        state.position.clone_from(&b.position);
        state.orientation.clone_from(&b.orientation);
        for (i, [v, w]) in b.motion[..state.position.len()].iter().enumerate() {
            state.velocity[i] = *v;
            state.angular_velocity[i] = *w;
        }
        state.touches.clear();
        let closed = self.pairs.iter().filter(|p| p.closed);
        state.touches.extend(closed.map(|p| p.touch));
    }

    /// Accelerations by gravity and loads at the present positions and at the velocities that `ahead` (s) of the present
    /// accelerations would add.
    pub fn load(&mut self, model: &Model, time: f64, ahead: f64) -> Result<(), LoadError> {
        let n = model.bodies();
        let b = &mut self.bodies;
        if model.loads.is_empty() {
            b.smooth[..n].fill([model.gravity, DVec3::ZERO]);
        } else {
            let [velocity, angular_velocity] = &mut self.ahead;
            velocity.clear();
            velocity.extend((0..n).map(|i| b.motion[i][0] + ahead * b.acceleration[i]));
            angular_velocity.clear();
            angular_velocity.extend((0..n).map(|i| b.motion[i][1] + ahead * b.smooth[i][1]));
            let at = Motion {
                time,
                position: &b.position,
                orientation: &b.orientation,
                velocity,
                angular_velocity,
            };
            self.wrench.fill([DVec3::ZERO; 2]);
            add_loads(model, &at, &mut self.wrench)?;
            self.power = power(model, &at)?;
            self.potential = model.loads.iter().map(|load| load.potential(&at)).sum();
            self.pushed = pushed(model, &at, &self.wrench);
            for (i, [force, moment]) in self.wrench.iter().enumerate() {
                b.smooth[i] = [
                    model.gravity + b.inv_mass[i] * *force,
                    b.inv_inertia[i] * *moment,
                ];
            }
        }
        // Absent spheres stand still.
        for (smooth, present) in b.smooth.iter_mut().zip(&self.present) {
            if !present {
                *smooth = [DVec3::ZERO; 2];
            }
        }
        Ok(())
    }

    /// Sets the need of every sphere (m), as the neighbour list takes it.
    pub fn set_needs(&mut self, model: &Model, need: impl Fn(&Bodies, usize) -> f64) {
        for i in 0..model.bodies() {
            self.need[i] = if self.present[i] {
                need(&self.bodies, i)
            } else {
                NeighbourList::absent(model.radius[i])
            };
        }
    }

    /// Accelerations of the centres from loads and elastic forces.
    pub fn accelerate(&mut self) {
        let b = &mut self.bodies;
        for (total, smooth) in b.acceleration.iter_mut().zip(&b.smooth) {
            *total = smooth[0];
        }
        for pair in self.pairs.iter().filter(|p| p.closed) {
            let force = pair.force * pair.normal;
            b.acceleration[pair.a as usize] += b.inv_mass[pair.a as usize] * force;
            b.acceleration[pair.b as usize] -= b.inv_mass[pair.b as usize] * force;
        }
    }

    /// Makes the pairs those of the list; pairs with something to report stay. Both are sorted by key.
    pub fn take_pairs(&mut self, model: &Model, listed: &[(u32, u32)]) {
        self.merged.clear();
        let mut old = self.pairs.drain(..).filter(Pair::has_record).peekable();
        let there = |body: u32| self.present.get(body as usize) != Some(&false);
        for &key in listed.iter().filter(|k| there(k.0) && there(k.1)) {
            while let Some(pair) = old.next_if(|p| p.key() < key) {
                self.merged.push(pair);
            }
            let known = old.next_if(|p| p.key() == key);
            let new = || Pair::new(model, &self.laws, &self.bodies, key, None);
            self.merged.push(known.unwrap_or_else(new));
        }
        self.merged.extend(old);
        std::mem::swap(&mut self.pairs, &mut self.merged);
        self.cover(model);
        // At the start of a run bodies may touch already.
        for pair in self.pairs.iter_mut().filter(|p| !p.closed && p.touches()) {
            pair.close(&self.bodies);
            pair.damping_of_approach(model);
        }
    }

    /// Finds which walls others cover, as cohesion does: springs add up as well.
    pub fn cover(&mut self, model: &Model) {
        let bodies = &self.bodies;
        let walls = &bodies.walls;
        let on_wall = |p: &Pair| p.gap < 0.0 && p.b as usize >= model.bodies();
        for row in self.pairs.chunk_by_mut(|p, q| p.a == q.a) {
            if row.iter().filter(|p| on_wall(p)).count() < 2 {
                continue;
            }
            let mut near: Vec<&mut Pair> = row.iter_mut().filter(|p| on_wall(p)).collect();
            near.sort_by(|p, q| p.gap.total_cmp(&q.gap));
            for k in (0..near.len()).rev() {
                let pair = near.remove(k);
                let (point, of) = (pair.point(bodies), (pair.b, pair.gap));
                let covers = |p: &&mut &mut Pair| walls.covers(model, p.a, (p.b, p.gap), of, point);
                match near.iter_mut().find(covers) {
                    Some(other) => other.take_over(pair),
                    None => near.insert(k, pair),
                }
            }
        }
    }

    /// Lets contacts that touched when a collision reached them take its speed, from body to body.
    pub fn join_collisions(&mut self, model: &Model, dt: f64) {
        loop {
            self.speed.clear();
            self.speed.resize(model.bodies(), 0.0);
            for pair in &self.pairs {
                let Some(v) = pair.collision_speed(&self.laws.elastic) else {
                    continue;
                };
                for body in [pair.a, pair.b] {
                    if let Some(speed) = self.speed.get_mut(body as usize) {
                        *speed = v.max(*speed);
                    }
                }
            }
            let mut joined = false;
            for pair in &mut self.pairs {
                let at = |body: u32| self.speed.get(body as usize).copied().unwrap_or(0.0);
                let speed = at(pair.a).max(at(pair.b));
                joined |= pair.join(model, speed, dt);
            }
            if !joined {
                return;
            }
        }
    }
}
