//! Gaps and normals of a pile at the position level, as linear measures of spheres.

use super::chunks;
use crate::contact::Contact;
use crate::model::Model;
use crate::pile::limits::node;
use crate::pile::memory::Pile;
use crate::rows::halves;
use crate::wall::places::{proximity, Walls};
use carom_geom::Proximity;
use carom_solve::rows::WORLD;
use carom_solve::spheres;
use glam::DVec3;

/// The measures of a contact at 0 that are those of `p` where its sides have moved by `u` against each other.
fn state(z: &mut spheres::Contact, p: &Proximity, u: DVec3) {
    let n = p.normal;
    (z.normal, z.slip) = (n.to_array(), ((p.gap - n.dot(u)) * n).to_array());
}

/// Position measures of an island, to be linearised.
pub(super) struct Linearisation<'a> {
    pub threads: usize,
    pub model: &'a Model,
    pub walls: &'a Walls,
    pub contacts: &'a [Contact],
    pub members: &'a [u32],
    pub node_of: &'a [u32],
    pub position: &'a [DVec3],
    /// What the loads have moved along normals, kg m: positions are corrected from there.
    pub of_loads: &'a [f64],
}

impl Linearisation<'_> {
    /// Contacts with gaps and normals where the loads have brought the spheres.
    pub fn write(&self, out: &mut Vec<spheres::Contact>) {
        chunks::refill(self.threads, out, self.members.len(), |k| {
            let c = &self.contacts[self.members[k] as usize];
            let [a, b] = [c.a, c.b].map(|body| node(self.model, self.node_of, body));
            let at = |body: u32| self.position.get(body as usize).copied();
            let [xa, xb] = [c.a, c.b].map(|body| at(body).unwrap_or_default());
            let p = proximity(self.model, self.walls, c, xa, xb);
            let mut z = spheres::Contact {
                a,
                b,
                ..Default::default()
            };
            state(&mut z, &p, DVec3::ZERO);
            z
        });
    }

    /// Takes off the sweeps' corrections what the loads have moved, `M^-1 G_N^T` of it with the normals as they are.
    pub fn take_off(&self, pile: &mut Pile) {
        let Pile {
            contacts,
            taken,
            bodies,
            ..
        } = pile;
        taken.clear();
        taken.resize(bodies.len(), DVec3::ZERO);
        for (z, &of_load) in contacts.iter().zip(self.of_loads) {
            let push = of_load * DVec3::from(z.normal);
            for (node, sign) in [(z.a, 1.0), (z.b, -1.0)] {
                if node != WORLD {
                    taken[node as usize] += sign * bodies[node as usize].inv_mass * push;
                }
            }
        }
        let taken = &*taken;
        let of = |node: u32| taken.get(node as usize).copied().unwrap_or(DVec3::ZERO);
        chunks::each(self.threads, contacts, |_, z| {
            let n = DVec3::from(z.normal);
            let slip = DVec3::from(z.slip) - n.dot(of(z.a) - of(z.b)) * n;
            z.slip = slip.to_array();
        });
    }

    /// Contacts with gaps and normals at the corrections `pile.corrections`, as measures at 0.
    fn rewrite(&self, pile: &mut Pile) {
        let Pile {
            taken,
            contacts,
            places,
            bodies,
            corrections,
            ..
        } = pile;
        let moved = |node: u32| {
            let u = corrections.get(node as usize);
            let u = u.map_or(DVec3::ZERO, |u| halves(u)[0]);
            taken.get(node as usize).map_or(u, |taken| u - *taken)
        };
        let any_free = !self.model.free_walls.is_empty();
        let centre = |node: u32| DVec3::from(places[node as usize]) + moved(node);
        chunks::each(self.threads, contacts, |k, z| {
            let (ua, ub) = (moved(z.a), moved(z.b));
            let contact = || &self.contacts[self.members[k] as usize];
            let guided = any_free && contact().is_guided(self.model);
            let p = if z.a == WORLD || z.b == WORLD || guided {
                let c = contact();
                let at = |body: u32, u: DVec3| match self.position.get(body as usize) {
                    Some(x) => *x + u,
                    None => DVec3::ZERO,
                };
                proximity(self.model, self.walls, c, at(c.a, ua), at(c.b, ub))
            } else {
                let [ra, rb] = [z.a, z.b].map(|node| bodies[node as usize].radius);
                let periodic = &self.walls.periodic.now;
                periodic.sphere_sphere(centre(z.a), ra, centre(z.b), rb)
            };
            state(z, &p, ua - ub);
        });
    }

    /// Linearises where the sweeps have come to. False: the problem has numbers that cannot be used.
    pub fn follow(&self, pile: &mut Pile) -> bool {
        pile.sweeps.velocities_into(&mut pile.corrections);
        self.rewrite(pile);
        self.take_off(pile);
        pile.sweeps.set_contacts(&pile.contacts).is_ok()
    }
}
