//! The sweeps: a problem in the order in which it is swept, and what is asked of it.

use super::bodies::{ContactLanes, State};
use super::goal::{Norms, Projection};
use super::groups::{ContactBlock, Slots, Source};
use super::guided::{Guided, Parts};
use super::lanes::{vector, Column, Instructions, EMPTY, SWAPPED};
use super::layout::{Desk, Layout};
use super::momentum::Memory;
use super::pass::push;
use super::problem::{self, Body, Contact, Place, SpheresError};
use super::residual;
use super::rolls::{filled, sign};
use crate::team::{self, lock};
use std::sync::Mutex;

/// A problem in the order in which it is swept, with its impulses and velocity corrections (0 at first).
#[derive(Debug, Default)]
pub struct Sweeps {
    pub(super) layout: Layout,
    pub(super) states: Vec<State>,
    pub(super) blocks: Vec<ContactBlock>,
    pub(super) slots: Slots,
    pub(super) desk: Desk,
    pub(super) radius: Vec<f64>,
    pub(super) pairs: usize,
    /// Norms at the present impulses, by their penalty scale, once they were asked for.
    pub(super) norms: Option<(f64, Norms)>,
    pub(super) memory: Memory,
    /// Discs, but while a companion is swept.
    pub(super) law: Projection,
    /// Bodies that a guide lets move along one direction alone, and that direction; set before [`Sweeps::renew_from`]. Normals of their contacts are
    /// along it.
    pub guided: Vec<(u32, [f64; 3])>,
    pub(super) guided_bodies: Vec<Guided>,
    /// Threads of all that follows; changes no bit of any result.
    pub threads: usize,
    pub instructions: Instructions,
}

impl Sweeps {
    /// Sorts bodies and contacts into the order of the sweep. With `places` neighbours in space become neighbours in memory; without
    /// them the caller's order of the bodies is kept.
    pub fn new(
        bodies: &[Body],
        contacts: &[Contact],
        places: Option<&[Place]>,
        threads: usize,
    ) -> Result<Self, SpheresError> {
        let mut sweeps = Self::empty();
        sweeps.threads = threads;
        sweeps.renew_from(bodies, contacts, places, &vec![[0.0; 3]; contacts.len()])?;
        Ok(sweeps)
    }

    /// No bodies and no contacts: a place for [`Sweeps::renew_from`].
    pub fn empty() -> Self {
        Self {
            threads: 1,
            ..Self::default()
        }
    }

    /// A problem in the memory of this one, as for the next step of a simulation, started from impulses: new memory is a good part of
    /// the cost of `new`. After an error the problem is empty.
    pub fn renew_from(
        &mut self,
        bodies: &[Body],
        contacts: &[Contact],
        places: Option<&[Place]>,
        impulses: &[[f64; 3]],
    ) -> Result<(), SpheresError> {
        assert_eq!(impulses.len(), contacts.len(), "one impulse per contact");
        // Empty until all is well.
        let mut blocks = std::mem::take(&mut self.blocks);
        let mut layout = std::mem::take(&mut self.layout);
        self.radius.clear();
        self.guided_bodies.clear();
        self.pairs = 0;
        self.norms = None;
        problem::check(bodies, contacts.len(), places)?;
        layout.place(
            bodies,
            places,
            &mut self.states,
            &mut self.desk,
            self.threads,
        );
        self.slots.resize(contacts.len());
        let source = Source {
            contacts,
            impulses,
            slots: &self.slots,
        };
        layout.cut(
            source,
            &self.states,
            &mut blocks,
            &mut self.desk,
            self.threads,
        )?;
        let guide = |&g| Guided::new(bodies, &layout.state, contacts, g);
        self.guided_bodies = self.guided.iter().map(guide).collect();
        (self.blocks, self.layout) = (blocks, layout);
        self.radius.extend(bodies.iter().map(|b| b.radius));
        self.pairs = contacts.len();
        self.push();
        Ok(())
    }

    /// New normals, slips and friction of the same pairs of bodies; impulses stay, velocity corrections follow. After an error some
    /// contacts are new and some are not.
    pub fn set_contacts(&mut self, contacts: &[Contact]) -> Result<(), SpheresError> {
        if contacts.len() != self.pairs {
            return Err(SpheresError::Changed {
                contact: self.pairs.min(contacts.len()),
            });
        }
        let set = |block: &mut ContactBlock| {
            let mut bad = usize::MAX;
            for (group, ids) in block.groups.iter_mut().zip(&block.ids) {
                for (lane, index, swapped) in filled(ids) {
                    let contact = &contacts[index];
                    if contact.check(index).is_err() {
                        bad = bad.min(index);
                    }
                    group.set_contact(lane, contact, swapped);
                }
            }
            bad
        };
        let bad = team::map(self.threads, self.blocks.iter_mut().collect(), set);
        self.refresh();
        let bad = bad.into_iter().min().unwrap_or(usize::MAX);
        contacts.get(bad).map_or(Ok(()), |c| c.check(bad))
    }

    /// Asks for at least these normal impulses, N s, until the contacts are renewed.
    pub fn set_least(&mut self, least: &[f64]) {
        assert_eq!(least.len(), self.pairs, "one impulse per contact");
        self.norms = None;
        for block in &mut self.blocks {
            block.least.clear();
            block.least.extend(block.ids.iter().map(|ids| {
                let mut own = Column::default();
                for (lane, index, _) in filled(ids) {
                    own[lane] = least[index];
                }
                own
            }));
        }
    }

    /// Starts from impulses on the bodies `a`, N s: `u` follows from them.
    pub fn warm_start(&mut self, impulses: &[[f64; 3]]) {
        assert_eq!(impulses.len(), self.pairs, "one impulse per contact");
        let set = |block: &mut ContactBlock| {
            for (group, ids) in block.groups.iter_mut().zip(&block.ids) {
                for (lane, index, swapped) in filled(ids) {
                    group.set_impulse(lane, impulses[index], swapped);
                }
            }
        };
        team::map(self.threads, self.blocks.iter_mut().collect(), set);
        self.refresh();
    }

    /// Computes `u = M^-1 G^T r` anew: clears what rounding has left after very many sweeps.
    pub fn refresh(&mut self) {
        for state in &mut self.states {
            state.linear[..3].fill(0.0);
            state.surface[..3].fill(0.0);
        }
        self.push();
    }

    /// Adds `M^-1 G^T r` to bodies at rest.
    fn push(&mut self) {
        self.norms = None;
        let instructions = self.instructions;
        self.stages(1, |block, left, right| {
            push(instructions, block, left, right)
        });
        self.guide();
    }

    /// Takes off what the contacts have given guided bodies across their directions. Within a sweep that stands in their states: contacts make
    /// smaller changes by it, and the last ones are 0.
    pub(super) fn guide(&mut self) {
        for guided in &self.guided_bodies {
            guided.keep_along(&mut self.states, 0);
        }
    }

    /// A step of the shared bodies ([`Guided::settle`]); momentum is forgotten.
    pub(super) fn settle_guided(&mut self) {
        let mut parts = Parts {
            state: &self.layout.state,
            slots: &self.slots,
            blocks: &mut self.blocks,
            states: &mut self.states,
        };
        let mut changed = false;
        for guided in self.guided_bodies.iter().filter(|g| g.shared) {
            changed |= guided.settle(&mut parts);
        }
        if changed {
            self.norms = None;
            self.restart();
        }
    }

    /// Norms of eq. 44 at the present impulses. Momentum balance holds by construction (see [`Sweeps::refresh`]), so the residual is that
    /// of the contacts. Sums are taken in the order of the blocks, whatever the threads.
    pub fn norms(&self, penalty_scale: f64) -> Norms {
        let chunks: Vec<&[State]> = self.states.chunks(self.layout.stride).collect();
        let parts = team::map(
            self.threads,
            self.blocks.iter().collect(),
            |block: &ContactBlock| {
                let (left, right) = (chunks[block.left as usize], chunks[block.right as usize]);
                self.instructions.run(residual::NormsOf {
                    block,
                    left,
                    right,
                    penalty_scale,
                    law: self.law,
                })
            },
        );
        let mut sum = residual::Sums::default();
        for part in &parts {
            sum.add(part);
        }
        let momenta = team::map(self.threads, chunks, residual::momentum);
        let momentum = momenta.iter().sum::<f64>().sqrt();
        Norms {
            residual: sum.residual.sqrt(),
            terms: 2.0 * momentum + sum.projected.sqrt() + sum.impulse.sqrt(),
            closing: sum.closing,
        }
    }

    /// Impulse on body `a` of each contact, N s.
    pub fn impulses(&self) -> Vec<[f64; 3]> {
        let mut impulses = Vec::new();
        self.impulses_into(&mut impulses);
        impulses
    }

    /// [`Sweeps::impulses`] in memory that is there.
    pub fn impulses_into(&self, out: &mut Vec<[f64; 3]>) {
        self.gather(out, |block, group, lane| {
            vector(&block.groups[group].impulse, lane).to_array()
        });
    }

    /// Corrections of velocity, m/s, and angular velocity, 1/s, of each body.
    pub fn velocities(&self) -> Vec<[f64; 6]> {
        let mut velocities = Vec::new();
        self.velocities_into(&mut velocities);
        velocities
    }

    /// [`Sweeps::velocities`] in memory that is there.
    pub fn velocities_into(&self, out: &mut Vec<[f64; 6]>) {
        out.resize(self.radius.len(), [0.0; 6]);
        team::fill(self.threads, out, |body| {
            let State {
                linear: v,
                surface: s,
            } = self.states[self.layout.state[body] as usize];
            // A body without lever arm is never turned.
            let radius = self.radius[body];
            let turn = if radius > 0.0 { 1.0 / radius } else { 0.0 };
            [v[0], v[1], v[2], turn * s[0], turn * s[1], turn * s[2]]
        });
    }

    /// Vectors on the bodies `a` of all contacts, of `vector(block, group, lane)` on the sides as they are swept.
    pub(super) fn gather(
        &self,
        out: &mut Vec<[f64; 3]>,
        vector: impl Fn(&ContactBlock, usize, usize) -> [f64; 3] + Sync,
    ) {
        out.resize(self.pairs, [0.0; 3]);
        team::fill(self.threads, out, |contact| {
            let (block, group, lane) = self.slots.of(contact);
            let block = &self.blocks[block];
            let sign = sign(block.ids[group][lane] & SWAPPED != 0);
            vector(block, group, lane).map(|x| sign * x)
        });
    }

    /// Bytes a sweep moves at least: groups and bodies in, impulses and bodies out.
    pub fn traffic(&self) -> usize {
        let groups: usize = self.blocks.iter().map(|b| b.groups.len()).sum();
        let impulses = std::mem::size_of::<[Column; 3]>();
        let states = 2 * std::mem::size_of_val(&self.states[..]);
        groups * (std::mem::size_of::<ContactLanes>() + impulses) + states
    }

    /// How the problem is cut.
    pub fn shape(&self) -> Shape {
        let filled = |blocks: &[ContactBlock]| {
            let ids = blocks.iter().flat_map(|b| b.ids.iter().flatten());
            ids.filter(|&&id| id != EMPTY).count()
        };
        Shape {
            chunks: self.layout.chunks,
            blocks: self.blocks.len(),
            stages: self.layout.stages.len() - 1,
            groups: self.blocks.iter().map(|b| b.groups.len()).sum(),
            between: filled(&self.blocks[self.layout.chunks..]),
        }
    }

    /// `work(block, left chunk, right chunk)` of every block, `count` times, stage by stage.
    fn stages(
        &mut self,
        count: usize,
        work: impl Fn(&mut ContactBlock, &mut [State], Option<&mut [State]>) + Sync,
    ) {
        let threads = self.threads;
        let chunks: Vec<_> = self
            .states
            .chunks_mut(self.layout.stride)
            .map(Mutex::new)
            .collect();
        let blocks: Vec<_> = self.blocks.iter_mut().map(Mutex::new).collect();
        team::run(threads, count, &self.layout.stages, |index| {
            let block = &mut **lock(&blocks[index]);
            let left = &mut **lock(&chunks[block.left as usize]);
            if block.left == block.right {
                work(block, left, None);
            } else {
                work(
                    block,
                    left,
                    Some(&mut **lock(&chunks[block.right as usize])),
                );
            }
        });
    }
}

/// How a problem is cut for the sweeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Sets of bodies.
    pub chunks: usize,
    /// Sets of contacts, and the stages in which they are swept.
    pub blocks: usize,
    pub stages: usize,
    /// Groups of contacts.
    pub groups: usize,
    /// Contacts between chunks.
    pub between: usize,
}
