//! What happens to a ball between and at the events of a method that has them.

use glam::DVec3;

/// What a ball does between two events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    #[default]
    Flight,
    Slide,
    Roll,
    /// In place, about the normal.
    Spin,
    Rest,
    /// It is in no closed form: the default scheme makes steps.
    Stepped,
    /// It has left.
    Gone,
}

impl Mode {
    /// In the order of their numbers.
    pub const ALL: [Mode; 7] = [
        Mode::Flight,
        Mode::Slide,
        Mode::Roll,
        Mode::Spin,
        Mode::Rest,
        Mode::Stepped,
        Mode::Gone,
    ];
}

/// What changed the motion of a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    Impact,
    /// The slip ends.
    SlipEnd,
    /// Its centre stops.
    RollEnd,
    /// The spin about the normal ends.
    SpinEnd,
    /// The surface that carried it ends.
    Edge,
    /// An outlet takes it.
    Outlet,
    /// It presses another body: it is handed to steps.
    Press,
    /// Nothing presses any more.
    Release,
}

impl Kind {
    /// What has made one mode of a closed form another, where nothing else says it; none where they are the same.
    pub fn of(before: Mode, after: Mode) -> Option<Kind> {
        let kind = match (before, after) {
            (_, Mode::Flight) => Kind::Edge,
            (Mode::Slide, _) => Kind::SlipEnd,
            (Mode::Roll, Mode::Spin | Mode::Rest) => Kind::RollEnd,
            (Mode::Spin, Mode::Rest) => Kind::SpinEnd,
            _ => Kind::Impact,
        };
        (before != after).then_some(kind)
    }
}

/// A ball whose motion changed at an event, of methods that have such.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    pub step: u64,
    /// s.
    pub time: f64,
    pub kind: Kind,
    pub body: u32,
    /// The body that did it, if one did.
    pub other: Option<u32>,
    /// Before and after.
    pub modes: [Mode; 2],
    /// Where the centre is then, m, and its velocity afterwards, m/s.
    pub position: DVec3,
    pub velocity: DVec3,
}
