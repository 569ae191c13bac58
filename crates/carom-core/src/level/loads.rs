//! The loads of a step, solved once (`position_friction = "once"`; `docs/theory/algorithm.md` section 12): contacts that do not approach, with friction and
//! without restitution, where the smooth step ends. Positions follow the velocities that they give, `(h/2) W0`, and are corrected along normals alone.

use super::single;
use super::{closed_form, Task};
use crate::contact::Contact;
use crate::islands::Island;
use crate::level::speeds::Speeds;
use crate::model::Model;
use crate::pile::limits::fits;
use crate::workspace::On;
use crate::{impact, pile};

/// Whether the loads leave the gaps of an island as they should be: what they press closed, nothing overlapping.
#[inline]
pub(crate) fn are_enough(model: &Model, contacts: &[Contact], island: Island) -> bool {
    let tolerance = model.options.gap_tolerance;
    island.joints.is_empty()
        && island.contacts.iter().all(|&m| {
            let c = &contacts[m as usize];
            let gap = c.gap / c.length;
            gap >= -tolerance && (c.load[0] == 0.0 || gap <= tolerance)
        })
}

/// Solves the loads of one island; writes those of its contacts, and the jumps W0 of its bodies.
pub fn solve_island(on: &mut On) -> bool {
    let (model, island) = (on.task.model, on.island);
    if let ([m], true) = (island.contacts, island.is_free()) {
        if closed_form(model, &on.scratch.contacts[*m as usize]) {
            solve_single(on, *m);
            return true;
        }
    }
    if island.contacts.is_empty() {
        return true;
    }
    if fits(model, island) {
        return pile::solve_velocities(on);
    }
    impact::rows::solve_loads(on)
}

/// A lone contact of a sphere with a plane, in closed form.
fn solve_single(on: &mut On, m: u32) {
    let Task {
        model, state, span, ..
    } = *on.task;
    let scratch = &*on.scratch;
    let c = &scratch.contacts[m as usize];
    let i = c.a as usize;
    let [old, new] = single::wall_motion(on, c);
    let mut speeds = Speeds::default();
    speeds.add(model, state, scratch.linear[i].velocity, i);
    if let Some([old, new]) = (scratch.walls).twists(model, c, state, scratch.position[i]) {
        speeds.add_wall(&old, &new);
    }
    let load = speeds.load.max((new.normal - old.normal).abs());
    let tol = speeds.closing_tolerance(&model.options, span, 1, load);
    let (v, w) = (scratch.linear[i].velocity, scratch.angular[i].velocity);
    let mut z = single::motion(c, model.radius[i], v, w);
    z.subtract(&new);
    let resting = c.n0.dot(state.velocity[i]) - old.normal >= -tol;
    let mut given = ([0.0; 6], None);
    if resting && tol > 0.0 && z.normal < -tol {
        let s = single::problem(model, c, &z).solve();
        given = (single::pack(c, &s), Some(single::correction(model, c, &s)));
    }
    let target = &mut on.scratch.contacts[m as usize];
    (target.resting, target.load) = (resting, given.0);
    if let Some(jump) = given.1 {
        on.scratch.corrections.set(target.a, jump);
    }
}
