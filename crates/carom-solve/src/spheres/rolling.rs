//! Sweeps with rolling and spinning friction: their problem in, their moments out ([`super::rolls`] is the data).

use super::groups::ContactBlock;
use super::lanes::vector;
use super::problem::{Body, Contact, SpheresError};
use super::rolls::{filled, sign, Roll, Rolls};
use super::sweeps::Sweeps;
use crate::team;

impl Sweeps {
    /// Adds rolling and spinning friction to the contacts of the problem, with the moments on the bodies `a` to start from, N m s.
    /// `bodies` and `contacts` are those of [`Sweeps::renew_from`]; velocity corrections follow.
    pub fn set_rolls(
        &mut self,
        bodies: &[Body],
        contacts: &[Contact],
        rolls: &[Roll],
        moments: &[[f64; 3]],
    ) -> Result<(), SpheresError> {
        assert_eq!(contacts.len(), self.pairs, "the contacts of the problem");
        assert_eq!(moments.len(), self.pairs, "one moment per contact");
        self.check_rolls(rolls)?;
        self.each_block(|block| {
            block.rolls.clear();
            block.rolls.extend(block.ids.iter().map(|ids| {
                let mut own = Rolls::new(bodies, contacts, ids);
                for (lane, index, swapped) in filled(ids) {
                    own.set(lane, &rolls[index], swapped);
                    own.any |= rolls[index].rolling > 0.0 || rolls[index].spinning > 0.0;
                    for k in 0..3 {
                        own.moment[k][lane] = sign(swapped) * moments[index][k];
                    }
                }
                own
            }));
        });
        self.refresh();
        Ok(())
    }

    /// New measures of the same contacts with the same bounds; moments stay.
    pub fn change_rolls(&mut self, rolls: &[Roll]) -> Result<(), SpheresError> {
        self.check_rolls(rolls)?;
        self.norms = None;
        self.each_block(|block| {
            for (own, ids) in block.rolls.iter_mut().zip(&block.ids) {
                for (lane, index, swapped) in filled(ids) {
                    own.set(lane, &rolls[index], swapped);
                }
            }
        });
        Ok(())
    }

    /// Moment on body `a` of each contact, N m s; zeros where nothing rolls.
    pub fn moments(&self) -> Vec<[f64; 3]> {
        let mut moments = Vec::new();
        self.moments_into(&mut moments);
        moments
    }

    /// [`Sweeps::moments`] in memory that is there.
    pub fn moments_into(&self, out: &mut Vec<[f64; 3]>) {
        if self.blocks.iter().all(|block| block.rolls.is_empty()) {
            out.clear();
            out.resize(self.pairs, [0.0; 3]);
            return;
        }
        self.gather(out, |block, group, lane| {
            vector(&block.rolls[group].moment, lane).to_array()
        });
    }

    fn each_block(&mut self, work: impl Fn(&mut ContactBlock) + Sync) {
        team::map(self.threads, self.blocks.iter_mut().collect(), work);
    }

    fn check_rolls(&self, rolls: &[Roll]) -> Result<(), SpheresError> {
        if rolls.len() != self.pairs {
            return Err(SpheresError::Changed {
                contact: self.pairs.min(rolls.len()),
            });
        }
        match rolls.iter().position(|r| !r.is_good()) {
            Some(contact) => Err(SpheresError::Roll { contact }),
            None => Ok(()),
        }
    }
}
