//! The order of impact problems in a step: loads first (rule R2, the default), as printed, and one-shot. It is the same for contacts
//! that are held as rows ([`crate::impact::rows`]) and as spheres ([`crate::pile`]).

use super::energy::Admit;
use super::law::Law;
use crate::contact::Contact;
use crate::options::Problems;
use crate::report::StepReport;

/// What a solve starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    Nothing,
    /// What the loads gave in the last step.
    LastLoads,
    /// What they gave in this one.
    Loads,
    /// What the position level tells of a sequence that was cut short.
    Positions,
}

/// The closed contacts of an island in its impact problems. A slot is the place of a contact among them.
pub trait ImpactIsland: Sync {
    type Solution;
    fn slots(&self) -> usize;
    /// A contact closes below minus this normal velocity, m/s.
    fn closing_tolerance(&self, slot: usize) -> f64;
    /// Normal velocity of a contact at t_n, and after the problems so far, m/s.
    fn speed_before(&self, slot: usize) -> f64;
    fn speed(&self, slot: usize) -> f64;
    /// Whether a contact approaches at t_n.
    fn approaches(&self, slot: usize) -> bool {
        self.speed_before(slot) < -self.closing_tolerance(slot)
    }
    fn contact(&self, slot: usize) -> &Contact;
    /// Whether no joint and no clump is in it: at each contact alone a normal impulse changes no slip.
    fn is_of_balls(&self) -> bool;
    /// Whether the loads of this step have been solved before positions were.
    fn again(&self) -> bool;
    /// Whether the loads are solved with a contact.
    fn is_resting(&self, slot: usize) -> bool {
        if self.again() {
            self.contact(slot).resting
        } else {
            !self.approaches(slot)
        }
    }
    /// Whether it closes after the problems so far.
    fn closes(&self, slot: usize) -> bool {
        self.speed(slot) < -self.closing_tolerance(slot)
    }
    /// Whether the loads of this step are known already.
    fn has_loads(&self) -> bool {
        self.again() && (0..self.slots()).any(|slot| self.contact(slot).load[0] > 0.0)
    }
    /// Whether a contact has an impulse.
    fn is_pressed(&self, slot: usize) -> bool;
    /// `test` of every slot.
    fn flags(&self, test: impl Fn(usize) -> bool + Sync) -> Vec<bool>;
    fn choose(&mut self, select: impl Fn(usize) -> bool);
    /// Solves the chosen contacts with all present impulses fixed. Problem 0 is that of the loads.
    #[must_use]
    fn solve(&mut self, law: Law, problem: u32, start: Start) -> bool;
    /// Solves them once more without restitution.
    #[must_use]
    fn solve_without_restitution(&mut self, problem: u32) -> bool;
    /// Impulses that stop the chosen contacts from the velocities before the step; whether any has restitution. Nothing: not solved.
    fn compress(&mut self) -> Option<bool>;
    /// Adds the solution at hand to the impulses.
    fn add(&mut self, problem: u32);
    /// Whether the energy safeguard of the options looks at the island.
    fn has_safeguard(&self) -> bool;
    /// How far each node may go from the solution at hand towards one `with` restitution (none: the one at hand has it), from the velocities that the
    /// loads (in later problems: all problems before) have left; nothing if no group of contacts gains energy beyond what is admitted.
    fn limits(&self, with: Option<&Self::Solution>, admit: Admit) -> Option<Vec<f64>>;
    /// Tolerance of its solver.
    fn tolerance(&self) -> f64;
    /// Solves the problem at hand once more from its solution, which stays if it is not found more finely.
    fn solve_finely(&mut self, problem: u32);
    /// Makes the velocities of the solution at hand those of its impulses, where a solver leaves a difference: it would be energy.
    fn balance(&mut self) {}
    /// The solution at hand, for [`Self::mix`].
    fn take_solution(&mut self) -> Self::Solution;
    /// Goes from the solution at hand towards `with` as far as these say of each node; all the way without them.
    fn mix(&mut self, with: Self::Solution, limits: Option<Vec<f64>>);
    /// Says of the solution at hand that it has no restitution although the law has.
    fn give_up_restitution(&mut self);
    /// Forgets the impulses of the chosen contacts, which the next problem solves anew.
    fn drop_chosen(&mut self);
    /// Forgets all impulses, and what `problem` told.
    fn forget_all(&mut self, problem: u32);
    /// What was solved so far are the loads: restitution does not act on their jump (eq. 27).
    fn mark_loads(&mut self);
    /// Whether the impulses so far have given a group of contacts energy.
    fn gains_energy(&self) -> bool;
    /// Problems `first`, ... of what closes, until nothing does (rule 26) or a bound is reached: whether nothing closes any more.
    /// Nothing: a problem was not solved.
    fn later(&mut self, law: Law, first: u32) -> Option<bool>;
    /// How far a sequence goes on.
    fn bounds(&self) -> Problems;
    fn report(&mut self) -> &mut StepReport;
}

/// Solves the chosen contacts by `law` with all present impulses fixed, takes restitution from groups that gain energy, and adds what is left.
/// Without restitution where that is not solved: wedged spheres may have no velocities that Newton's law asks for.
#[must_use]
pub fn solve_problem(island: &mut impl ImpactIsland, law: Law, problem: u32, start: Start) -> bool {
    let admit = Admit::Tolerance(island.tolerance());
    solve_within(island, (law, admit), problem, start)
}

/// The same, with no more energy than `admit` lets it have.
#[must_use]
fn solve_within(
    island: &mut impl ImpactIsland,
    (law, admit): (Law, Admit),
    problem: u32,
    start: Start,
) -> bool {
    let before = *island.report();
    if !island.solve(law, problem, start) {
        if !law.has_restitution() {
            return false;
        }
        // What was tried is no part of the step.
        *island.report() = before;
        island.report().fallbacks += 1;
        if !island.solve(Law::Plastic, problem, start) {
            return false;
        }
        island.give_up_restitution();
        // Also where nothing is left to tell of it.
        island.report().restitution_scale = 0.0;
    } else if law.has_restitution() && island.has_safeguard() && gains(island, problem, admit) {
        let with = island.take_solution();
        if !island.solve_without_restitution(problem) {
            return false;
        }
        island.balance();
        let limits = island.limits(Some(&with), admit);
        island.mix(with, limits);
    }
    island.add(problem);
    true
}

/// Whether the solution at hand gives a group of contacts energy beyond what its residual explains. Where that may explain it the problem is
/// solved more finely to tell. What a collective impact may have only the solution without restitution tells.
fn gains(island: &mut impl ImpactIsland, problem: u32, admit: Admit) -> bool {
    if matches!(admit, Admit::Returned(_)) {
        island.balance();
        return true;
    }
    if island.limits(None, Admit::Rounding).is_none() {
        return false;
    }
    if island.limits(None, Admit::Explained).is_none() {
        island.solve_finely(problem);
    }
    island.balance();
    island.limits(None, admit).is_some()
}

/// Rule R2: loads first, then impacts. `docs/theory/algorithm.md` section 5 has it stage by stage.
#[must_use]
pub fn loads_first(island: &mut impl ImpactIsland) -> bool {
    let Some([resting, loaded]) = loads(island) else {
        return false;
    };
    // Stage 1: contacts that close now, together with the resting ones that the load closes.
    let closing = island.flags(|slot| island.closes(slot));
    if !closing.contains(&true) {
        return true;
    }
    let chosen = |slot: usize| closing[slot] || loaded[slot];
    island.choose(chosen);
    island.drop_chosen();
    if !solve_problem(island, Law::First, 1, Start::Loads) {
        return false;
    }
    let keeps = (0..closing.len()).any(|slot| !chosen(slot) && island.is_pressed(slot));
    if keeps && island.gains_energy() {
        // Kept impulses of the loads held one another. All of the loads together with the impact, then.
        island.report().fallbacks += 1;
        island.forget_all(1);
        island.choose(|slot| closing[slot] || resting[slot]);
        if !solve_problem(island, Law::First, 1, Start::Loads) {
            return false;
        }
    }
    let later = island.later(Law::Later, 2);
    end(island, Law::Later, later)
}

/// Stage 0: the load of this step on contacts that were not approaching, without restitution. Which contacts these are, and which of
/// them the loads close; nothing if they were not solved.
pub fn loads(island: &mut impl ImpactIsland) -> Option<[Vec<bool>; 2]> {
    let resting = island.flags(|slot| island.is_resting(slot));
    let loaded = island.flags(|slot| resting[slot] && island.closes(slot));
    if loaded.contains(&true) || island.has_loads() {
        island.choose(|slot| resting[slot]);
        let mut solved = solve_problem(island, Law::Plastic, 0, Start::LastLoads);
        if solved && island.gains_energy() {
            // Forces that hold one another, beyond what the tolerance tells of the loads: from nothing, then. (Or a wall turns what its weight pulls
            // off: then nothing changes by it.)
            island.forget_all(0);
            solved = solve_problem(island, Law::Plastic, 0, Start::Nothing);
            let helped = !island.gains_energy();
            island.report().fallbacks += u32::from(helped);
        }
        if !solved {
            return None;
        }
        island.mark_loads();
    }
    Some([resting, loaded])
}

/// The paper's own sequence (eqs. 24-29): strictly closing contacts from the first problem on.
#[must_use]
pub fn as_printed(island: &mut impl ImpactIsland) -> bool {
    let later = island.later(Law::Printed, 1);
    end(island, Law::Plastic, later)
}

/// Newton's law on all closed contacts at once. Where the loads have been solved before positions were, they come first, and are all
/// there is if nothing approached or still closes.
#[must_use]
pub fn one_shot(island: &mut impl ImpactIsland) -> bool {
    let mut start = Start::Nothing;
    if island.again() {
        if loads(island).is_none() {
            return false;
        }
        let hits = |slot: usize| island.approaches(slot) || island.closes(slot);
        if !island.flags(hits).contains(&true) {
            return true;
        }
        start = Start::Loads;
    }
    island.choose(|_| true);
    island.drop_chosen();
    solve_problem(island, Law::First, 1, start)
}

/// What a sequence that does not die out leaves is one collective impact, of all contacts: then nothing closes. A light ball that bounces between two
/// heavy ones closes fast and takes next to nothing to turn back, and pushes what it meets. So it gives back no more energy than contacts by themselves
/// would. `later` as [`ImpactIsland::later`] has it.
pub fn end(island: &mut impl ImpactIsland, law: Law, later: Option<bool>) -> bool {
    if later != Some(false) {
        return later.is_some();
    }
    island.report().truncated += 1;
    island.choose(|_| true);
    let number = island.bounds().most + 1;
    let admit = Admit::Returned(island.tolerance());
    solve_within(island, (law, admit), number, Start::Positions)
}
