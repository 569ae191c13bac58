//! An impact: of which bodies, and what becomes of them.

use crate::meet::JOINS;
use crate::step::{Events, Run};
use carom_core::contact::ContactKey;
use carom_core::moment::impact;
use carom_core::outcome::{within_bounds, BlowUp, Failure, Level};
use carom_core::transition::Kind;

impl Run<'_> {
    /// An impact: of all bodies that touch, from these two on. Where some are stepped the others join them: whether that is so.
    pub fn meet(&mut self, pair: ContactKey, t: f64) -> Result<bool, Failure> {
        self.gather(pair, t);
        let (group, touching) = (&self.events.group, &self.events.touching);
        if group.iter().any(|&i| self.is_stepped(i)) {
            let other = |i: usize| {
                let pairs = [pair].into_iter().chain(touching.iter().copied());
                pairs
                    .filter_map(|(a, b)| match i as u32 {
                        i if i == a => Some(b),
                        i if i == b => Some(a),
                        _ => None,
                    })
                    .next()
            };
            let free = group.iter().filter(|&&i| !self.is_stepped(i));
            let joins: Vec<_> = free.filter_map(|&i| Some((i, other(i)?))).collect();
            return self.join(&joins, t).map(|()| true);
        }
        let group = std::mem::take(&mut self.events.group);
        for &i in &group {
            self.bring(i, t);
        }
        let before = self.scratch.impacts.len();
        let (motions, largest) = (&self.events.motions, self.report.largest_island);
        impact(
            self.model,
            self.state,
            self.scratch,
            &self.events.touching,
            self.span.start + t,
            |i| motions[i].support.map(|s| s.wall),
            self.report,
        )?;
        self.report.largest_island = self.report.largest_island.max(largest);
        for i in &group {
            let (v, w) = (self.state.velocity[*i], self.state.angular_velocity[*i]);
            if !within_bounds(v, w) {
                let touching = self.events.touching.iter().copied();
                let what = BlowUp::of(Level::Velocity, *i as u32, v, touching);
                return Err(Failure::BlowUp(what));
            }
        }
        let (model, state, scratch) = (self.model, &*self.state, &mut *self.scratch);
        let impacts = scratch.impacts.len();
        scratch.impact_times.resize(impacts, self.span.start + t);
        self.events.sums.add(&scratch.contacts);
        if model.record_walls {
            let (contacts, impulses) = (&scratch.contacts, &mut scratch.wall_impulse);
            (scratch.walls).collect(model, state, &state.position, contacts, impulses);
        }
        let carrier = |&i: &usize| self.events.motions[i].support.map(|s| s.wall);
        let carriers: Vec<_> = group.iter().map(carrier).collect();
        self.go_on(&group, t);
        for (&i, carrier) in group.iter().zip(carriers) {
            // What is too weak for a row of impacts may change the mode: the last of ever shorter bounces.
            let hit = self.hit(i, carrier, before);
            self.tell(t, hit.map(|_| Kind::Impact), i, hit);
        }
        self.events.group = group;
        Ok(false)
    }

    /// What hit ball `i` hardest in the impacts from row `first` on; the surface that carries it only where nothing else did.
    fn hit(&self, i: usize, carrier: Option<u32>, first: usize) -> Option<u32> {
        let rows = &self.scratch.impacts[first..];
        let hits = rows.iter().filter_map(|row| {
            let other = match i as u32 {
                i if i == row.a => row.b,
                i if i == row.b => row.a,
                _ => return None,
            };
            Some((Some(other) != carrier, row.impulse.length(), other))
        });
        let hardest = hits.max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        hardest.map(|(.., other)| other)
    }

    /// Which balls have a part in an impact, and all contacts of theirs, by their keys.
    fn gather(&mut self, (a, b): ContactKey, t: f64) {
        let (model, n) = (self.model, self.model.bodies());
        let Events {
            motions,
            curves,
            near,
            group,
            touching,
            ..
        } = &mut *self.events;
        group.clear();
        touching.clear();
        touching.push((a, b));
        group.push(a as usize);
        if (b as usize) < n {
            group.push(b as usize);
        }
        let mut next = 0;
        while let Some(&i) = group.get(next) {
            next += 1;
            let r = model.radius[i];
            let x = motions[i].exact_place(r, &curves[i], t);
            for &w in near[i].walls(model, x, r, JOINS * r) {
                let wall = &model.walls[w];
                let joins = wall.shape.clearance(x, r) <= JOINS * r
                    && wall.shape.meet(x, r).gap <= JOINS * r;
                if joins && model.law_of(i, n + w).is_some() {
                    touching.push((i as u32, (n + w) as u32));
                }
            }
            for j in (0..n).filter(|&j| j != i && self.state.present[j]) {
                let (reach, s) = (r + model.radius[j], model.radius[j]);
                let joins = reach + JOINS * r.min(s);
                let other = &motions[j];
                let near = joins + other.off(t)[0];
                let joins = (other.place(t) - x).length_squared() <= near * near
                    && (other.exact_place(s, &curves[j], t) - x).length_squared() <= joins * joins;
                if joins && model.law_of(i, j).is_some() {
                    touching.push((i.min(j) as u32, i.max(j) as u32));
                    if !group.contains(&j) {
                        group.push(j);
                    }
                }
            }
        }
        touching.sort_unstable();
        touching.dedup();
        group.sort_unstable();
    }
}
