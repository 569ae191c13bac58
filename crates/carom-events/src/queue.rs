//! What happens next: predictions in the order of their times, and of keys where those are equal.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// What a prediction says of its bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum What {
    /// The closed form of a ball ends.
    Change,
    /// The surface that carries a ball ends.
    Edge,
    /// They meet, the second body may be a wall.
    Meet,
    /// They may: how they move has to be known better.
    Closer,
    /// Forces press them together.
    Press,
    /// A ball enters (or leaves) the box of an outlet.
    Leave,
}

#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// s, since the start of the step.
    pub time: f64,
    pub bodies: (u32, u32),
    pub what: What,
    /// How often the motions of both had changed when it was foreseen.
    counts: [u32; 2],
}

impl Event {
    /// Of all at one time what presses is first: an impact of what is stepped knows its loads.
    fn key(&self) -> (bool, (u32, u32), What) {
        (self.what != What::Press, self.bodies, self.what)
    }
}

impl PartialEq for Event {
    fn eq(&self, other: &Event) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Event {}
impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Event) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Event {
    fn cmp(&self, other: &Event) -> Ordering {
        (self.time.total_cmp(&other.time)).then_with(|| self.key().cmp(&other.key()))
    }
}

#[derive(Debug, Default)]
pub struct Queue {
    heap: BinaryHeap<Reverse<Event>>,
    /// How often the motion of each ball has changed.
    counts: Vec<u32>,
}

impl Queue {
    pub fn begin(&mut self, spheres: usize) {
        self.heap.clear();
        self.counts.clear();
        self.counts.resize(spheres, 0);
    }

    fn count(&self, body: u32) -> u32 {
        self.counts.get(body as usize).copied().unwrap_or(0)
    }

    /// What was foreseen for a ball does not hold any more.
    pub fn forget(&mut self, ball: usize) {
        self.counts[ball] += 1;
    }

    pub fn push(&mut self, time: f64, bodies: (u32, u32), what: What) {
        let counts = [self.count(bodies.0), self.count(bodies.1)];
        self.heap.push(Reverse(Event {
            time,
            bodies,
            what,
            counts,
        }));
    }

    /// The bodies that press one another now.
    pub fn pressing(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let events = self.heap.iter().map(|Reverse(event)| event);
        let holds = |e: &&Event| e.what == What::Press && self.still_holds(e);
        events.filter(holds).map(|e| e.bodies)
    }

    fn still_holds(&self, event: &Event) -> bool {
        let (a, b) = event.bodies;
        event.counts == [self.count(a), self.count(b)]
    }

    /// The next one that still holds, if it is due by a time.
    pub fn next(&mut self, end: f64) -> Option<Event> {
        while let Some(Reverse(event)) = self.heap.peek().copied() {
            if event.time > end {
                return None;
            }
            self.heap.pop();
            if self.still_holds(&event) {
                return Some(event);
            }
        }
        None
    }
}
