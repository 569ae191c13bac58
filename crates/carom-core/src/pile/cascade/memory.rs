//! What a cascade keeps from step to step.

use crate::pile::cascade::front::{Front, Slots};
use crate::pile::cascade::little::Batch;
use crate::pile::cascade::parts::Parts;
use std::sync::Mutex;

/// CascadeMemory of a cascade.
#[derive(Default)]
pub struct CascadeMemory {
    pub(super) front: Front,
    pub(super) parts: Parts,
    pub(super) batches: Vec<Mutex<Batch>>,
    /// Closing contacts, as each thread's share of the moved spheres has them.
    pub(super) closing: Vec<Mutex<Slots>>,
    /// Contacts of the problem at hand, and their batches.
    pub(super) chosen: Vec<u32>,
    pub(super) firsts: Vec<usize>,
    /// How many contacts each problem left closing that had closed before.
    pub(super) again: Vec<usize>,
}
