//! Impulses and work of a contact over some time.

use glam::DVec3;

/// Impulses on A and work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// N s.
    pub impulse: DVec3,
    /// N m s.
    pub moment: DVec3,
    /// Normals times the sizes of their impulses, N s: its direction is the mean normal.
    pub weighed_normal: DVec3,
    /// Normal, sliding, rolling, spinning, J.
    pub work: [f64; 4],
}

impl Sums {
    pub fn add(&mut self, other: &Sums) {
        self.impulse += other.impulse;
        self.moment += other.moment;
        self.weighed_normal += other.weighed_normal;
        for (a, b) in self.work.iter_mut().zip(other.work) {
            *a += b;
        }
    }
}
