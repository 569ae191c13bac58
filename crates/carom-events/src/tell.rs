//! The table of transitions: each row begins with the mode in which the last one of its ball has ended.

use crate::step::Run;
use carom_core::flow::exchange::take_out;
use carom_core::transition::{Kind, Mode, Transition};

impl Run<'_> {
    pub fn leave(&mut self, i: usize, t: f64) {
        self.note(t, Kind::Outlet, i, None, Mode::Gone);
        let at = (self.state.step + 1, self.span.start + t);
        take_out(self.model, self.state, i, at, &mut self.scratch.left);
        self.events.queue.forget(i);
        self.set_off(i, t, None, false);
    }

    /// What a step begins with: how balls move now is no news where no row was before.
    pub fn tell_begin(&mut self) {
        if self.events.is_first {
            self.state.told = self.events.motions.iter().map(|m| m.mode).collect();
        }
        self.tell_all(0.0);
    }

    /// What the rows of the table of transitions do not say yet.
    pub fn tell_all(&mut self, t: f64) {
        for i in self.free() {
            self.tell(t, None, i, None);
        }
    }

    /// What has set ball `i` off as it moves now: a row, if that is an event or its mode is another one.
    pub fn tell(&mut self, t: f64, kind: Option<Kind>, i: usize, other: Option<u32>) {
        let (motion, before) = (&self.events.motions[i], self.state.told[i]);
        let (after, other) = (motion.mode, other.or(motion.support.map(|s| s.wall)));
        let mut rows = self.scratch.transitions.iter();
        if kind.is_none()
            && t == 0.0
            && self.events.is_first
            && rows.all(|row| row.body != i as u32)
        {
            // It began like this, but for what is too weak for a row of impacts.
            self.state.told[i] = after;
            return;
        }
        let kind = kind.or_else(|| Kind::of(before, after));
        if let Some(kind) = kind {
            self.note(t, kind, i, other, after);
        }
    }

    /// A row of the table of transitions.
    pub fn note(&mut self, t: f64, kind: Kind, i: usize, other: Option<u32>, after: Mode) {
        let before = std::mem::replace(&mut self.state.told[i], after);
        self.scratch.transitions.push(Transition {
            step: self.state.step + 1,
            time: self.span.start + t,
            kind,
            body: i as u32,
            other,
            modes: [before, after],
            position: self.state.position[i],
            velocity: self.state.velocity[i],
        });
    }
}
