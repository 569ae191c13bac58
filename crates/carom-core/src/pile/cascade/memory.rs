//! What a cascade keeps from step to step.

use crate::pile::cascade::batch::Batch;
use crate::pile::cascade::clusters::Clusters;
use crate::pile::cascade::contact_graph::{ContactGraph, Slots};
use std::sync::Mutex;

/// CascadeMemory of a cascade.
#[derive(Default)]
pub struct CascadeMemory {
    pub(super) graph: ContactGraph,
    pub(super) clusters: Clusters,
    pub(super) batches: Vec<Mutex<Batch>>,
    /// Closing contacts, as each thread's share of the moved spheres has them.
    pub(super) closing: Vec<Mutex<Slots>>,
    /// Contacts of the problem at hand, and their batches.
    pub(super) chosen: Vec<u32>,
    pub(super) firsts: Vec<usize>,
    /// How many contacts each problem left closing that had closed before.
    pub(super) again: Vec<usize>,
}
