//! Gaps, normals and tangential increments of a pile at the position level, as linear measures of spheres.

use super::chunks;
use crate::contact::Contact;
use crate::model::Model;
use crate::pile::limits::node;
use crate::pile::memory::Pile;
use crate::pile::turning::Turning;
use crate::state::State;
use crate::stepper::generalized_alpha::Prediction;
use crate::wall::places::{proximity, Walls};
use carom_geom::Proximity;
use carom_solve::rows::WORLD;
use carom_solve::spheres;
use glam::DVec3;

/// The measures of a contact at 0 that are those of `p` where its sides have moved by `u` against each other.
fn state(z: &mut spheres::Contact, p: &Proximity, u: DVec3, slide: DVec3) {
    let n = p.normal;
    let slip = (p.gap - n.dot(u)) * n + slide - n.dot(slide) * n;
    (z.normal, z.slip) = (n.to_array(), slip.to_array());
}

/// Position measures of an island, to be linearised.
pub(super) struct Linearisation<'a> {
    pub threads: usize,
    pub model: &'a Model,
    pub state: &'a State,
    pub walls: &'a Walls,
    pub contacts: &'a [Contact],
    pub members: &'a [u32],
    pub node_of: &'a [u32],
    pub position: &'a [DVec3],
    pub linear: &'a [Prediction],
    pub angular: &'a [Prediction],
    /// What loads that are solved once have moved along normals, kg m: positions are corrected from there, along normals alone.
    pub of_loads: Option<&'a [f64]>,
}

impl Linearisation<'_> {
    /// Contacts with gaps and normals after the smooth step.
    pub fn write(&self, slides: &[[f64; 3]], out: &mut Vec<spheres::Contact>) {
        chunks::refill(self.threads, out, self.members.len(), |k| {
            let c = &self.contacts[self.members[k] as usize];
            let [a, b] = [c.a, c.b].map(|body| node(self.model, self.node_of, body));
            let at = |body: u32| self.position.get(body as usize).copied();
            let [xa, xb] = [c.a, c.b].map(|body| at(body).unwrap_or_default());
            let p = proximity(self.model, self.walls, c, xa, xb);
            let mut z = spheres::Contact {
                a,
                b,
                friction: match self.of_loads {
                    Some(_) => 0.0,
                    None => c.bounds.sliding,
                },
                ..Default::default()
            };
            state(&mut z, &p, DVec3::ZERO, self.slide_of(slides, k));
            z
        });
    }

    /// Takes off the sweeps' corrections what the loads have moved, `M^-1 G_N^T` of it with the normals as they are.
    pub fn take_off(&self, pile: &mut Pile) {
        let Some(of_loads) = self.of_loads else {
            return;
        };
        let Pile {
            contacts,
            taken,
            bodies,
            ..
        } = pile;
        taken.clear();
        taken.resize(bodies.len(), DVec3::ZERO);
        for (z, &of_load) in contacts.iter().zip(of_loads) {
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
            slides,
            places,
            bodies,
            corrections,
            ..
        } = pile;
        let moved = |node: u32| {
            let u = corrections.get(node as usize);
            let u = u.map_or(DVec3::ZERO, |u| DVec3::new(u[0], u[1], u[2]));
            taken.get(node as usize).map_or(u, |taken| u - *taken)
        };
        let centre = |node: u32| DVec3::from(places[node as usize]) + moved(node);
        chunks::each(self.threads, contacts, |k, z| {
            let (ua, ub) = (moved(z.a), moved(z.b));
            let p = if z.a == WORLD || z.b == WORLD {
                let c = &self.contacts[self.members[k] as usize];
                let at = |body: u32, u: DVec3| match self.position.get(body as usize) {
                    Some(x) => *x + u,
                    None => DVec3::ZERO,
                };
                proximity(self.model, self.walls, c, at(c.a, ua), at(c.b, ub))
            } else {
                let [ra, rb] = [z.a, z.b].map(|node| bodies[node as usize].radius);
                let periodic = &self.model.periodic;
                periodic.sphere_sphere(centre(z.a), ra, centre(z.b), rb)
            };
            state(z, &p, ua - ub, self.slide_of(slides, k));
        });
    }

    fn slide_of(&self, slides: &[[f64; 3]], k: usize) -> DVec3 {
        match slides.get(k) {
            _ if self.of_loads.is_some() => DVec3::ZERO,
            Some(slide) => DVec3::from(*slide),
            None => self.slide(&self.contacts[self.members[k] as usize]),
        }
    }

    /// Linearises where the sweeps have come to. False: the problem has numbers that cannot be used.
    pub fn follow(&self, pile: &mut Pile, rolls: bool) -> bool {
        pile.sweeps.velocities_into(&mut pile.corrections);
        self.rewrite(pile);
        self.take_off(pile);
        if pile.sweeps.set_contacts(&pile.contacts).is_err() {
            return false;
        }
        if rolls {
            self.write_rolls(&pile.contacts, &mut pile.rolls);
            return pile.sweeps.change_rolls(&pile.rolls).is_ok();
        }
        true
    }

    /// Rolling and spinning friction of the contacts as just written: the relative rotation over the smooth step, rolling and
    /// spinning as at t_n, in the frame of the end.
    pub fn write_rolls(&self, contacts: &[spheres::Contact], out: &mut Vec<spheres::Roll>) {
        out.clear();
        out.extend(self.members.iter().zip(contacts).map(|(&m, z)| {
            let c = &self.contacts[m as usize];
            let part = |body: u32| {
                let prediction = self.angular.get(body as usize);
                prediction.map_or(DVec3::ZERO, |p| p.displacement)
            };
            let (i, mut of_b) = (c.a as usize, part(c.b));
            let (from, to) = (self.state.position[i], self.position[i]);
            if let Some([_, turn]) = self.walls.displacement(self.model, c, from, to) {
                of_b = turn;
            }
            let psi = part(c.a) - of_b;
            let (n, spin) = (DVec3::from(z.normal), c.n0.dot(psi));
            let across = psi - spin * c.n0;
            let turn = across - n.dot(across) * n + spin * n;
            Turning::new(c, [DVec3::ZERO; 2]).stated(turn)
        }));
    }

    /// Tangential increment over the smooth step (eq. 37) in the plane of t_n.
    pub fn slide(&self, c: &Contact) -> DVec3 {
        let part = |body: u32| match self.linear.get(body as usize) {
            Some(p) => {
                let i = body as usize;
                (
                    p.displacement,
                    self.model.radius[i] * self.angular[i].displacement,
                )
            }
            None => (DVec3::ZERO, DVec3::ZERO),
        };
        let ((xa, sa), (mut xb, sb)) = (part(c.a), part(c.b));
        let i = c.a as usize;
        let (from, to) = (self.state.position[i], self.position[i]);
        if let Some([way, _]) = self.walls.displacement(self.model, c, from, to) {
            xb = way;
        }
        let d = xa - xb + c.n0.cross(sa + sb);
        d - c.n0.dot(d) * c.n0
    }
}
