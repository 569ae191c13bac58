//! A list of neighbours that stays valid while bodies move little (Verlet's list with a reach per body).
//!
//! At a rebuild every body gets a reach `R_i = need_i + skin_i`, and the list holds every pair with
//! `gap <= R_a + R_b`. By the triangle inequality it still holds every pair with `gap <= need_a + need_b` while
//!
//! ```text
//! |x_i - x_ref,i| + need_i + r_i <= R_i + r_ref,i     for every body i
//! ```
//!
//! A wall is listed by its own distance, which changes by no more than the centre moves. One that has moved since is looked
//! at directly: the list holds as long as every sphere within its need of the wall is on it.
//! `need_i` (m) is what the caller must not miss: how far body `i` may travel before the next call, plus its share
//! of any gap that has to count as touching.

use super::cell_list::CellList;
use crate::pair::{sphere_sphere, Proximity};
use crate::shape::Shape;
use glam::DVec3;
use std::ops::ControlFlow;

/// Up to here all pairs are tried at a rebuild: less than sorting them into cells costs.
const BRUTE_FORCE: usize = 32;
/// Default skin, in radii: balls in a settled pile then hardly ever cause a rebuild, and a list holds about twice
/// the pairs that touch.
const SKIN: f64 = 0.3;
/// Default limit on the length of the list, per body and at least.
const PAIRS_PER_BODY: usize = 256;
const PAIRS_AT_LEAST: usize = 1 << 16;

/// Where a body was at the last rebuild.
#[derive(Clone, Copy, Debug)]
struct Reference {
    x: DVec3,
    /// `R_i + r_i` (m).
    extent: f64,
}

/// Two bodies within their needs: `a < b`, wall `w` is body `N + w`, the normal points from B to A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Index of sphere A.
    pub a: u32,
    /// Index of sphere B, or `N + w`.
    pub b: u32,
    /// Gap, normal and curvature at the given positions.
    pub proximity: Proximity,
}

/// Candidate pairs of `N` spheres and `P` walls, kept over many steps. See the module's page.
///
/// The content of [`Self::pairs`] beyond the guarantee depends on when the list was last rebuilt. Results must not:
/// go through [`Self::within`], whose answer is a function of its arguments alone. Then nothing here needs to be
/// saved, and a run resumed with a fresh list continues bit for bit.
#[derive(Debug)]
pub struct NeighbourList {
    pairs: Vec<(u32, u32)>,
    reference: Vec<Reference>,
    walls: Vec<Shape>,
    /// Which walls moved between the last two rebuilds: they are listed farther out.
    moving: Vec<bool>,
    skin: f64,
    limit: Option<usize>,
    rebuilds: u64,
    truncated: bool,
    valid: bool,
    cells: CellList,
    extent: Vec<f64>,
    raw: Vec<(u32, u32)>,
    start: Vec<u32>,
}

impl Default for NeighbourList {
    fn default() -> Self {
        Self::new()
    }
}

impl NeighbourList {
    /// An empty list; the first [`Self::refresh`] builds it.
    pub fn new() -> Self {
        Self {
            pairs: Vec::new(),
            reference: Vec::new(),
            walls: Vec::new(),
            moving: Vec::new(),
            skin: SKIN,
            limit: None,
            rebuilds: 0,
            truncated: false,
            valid: false,
            cells: CellList::new(),
            extent: Vec::new(),
            raw: Vec::new(),
            start: Vec::new(),
        }
    }

    /// Sets the least skin, in radii (default 0.3). Larger: fewer rebuilds, longer lists. Never changes
    /// what [`Self::within`] yields.
    pub fn set_skin(&mut self, radii: f64) {
        self.skin = radii.max(0.0);
        self.valid = false;
    }

    /// Sets the most pairs the list may hold (default 256 per body, at least 65 536).
    pub fn set_limit(&mut self, pairs: usize) {
        self.limit = Some(pairs);
        self.valid = false;
    }

    /// Makes the next [`Self::refresh`] rebuild.
    pub fn invalidate(&mut self) {
        self.valid = false;
    }

    /// Rebuilds since [`Self::new`].
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// The list reached its limit and the guarantee of [`Self::refresh`] does not hold. Only absurd input gets
    /// here - all balls in one place, or needs of many diameters - and must end in an error, not in a list that fills
    /// the memory.
    pub fn is_truncated(&self) -> bool {
        self.truncated
    }

    /// The pairs `(a, b)`, `a < b`, sorted; wall `w` is body `N + w`.
    #[inline]
    pub fn pairs(&self) -> &[(u32, u32)] {
        &self.pairs
    }

    /// Makes the list valid at centres `x` (N) (m) and tells whether it had to be rebuilt for that.
    ///
    /// Given `radius` (N) (m), `walls` (P) and `need` (N) (m), afterwards
    /// [`Self::pairs`] holds every pair of spheres with `|x_a - x_b| - r_a - r_b <= need_a + need_b` and every
    /// sphere and wall with `gap <= need_a`, unless [`Self::is_truncated`]. A body with a NaN has no pairs.
    ///
    /// # Panics
    /// If `x`, `radius` and `need` differ in length.
    #[inline]
    pub fn refresh(&mut self, x: &[DVec3], radius: &[f64], walls: &[Shape], need: &[f64]) -> bool {
        assert!(
            x.len() == radius.len() && x.len() == need.len(),
            "one radius and one need per sphere"
        );
        if self.still_valid(x, radius, walls, need) {
            return false;
        }
        self.rebuild(x, radius, walls, need);
        true
    }

    #[inline]
    fn still_valid(&self, x: &[DVec3], radius: &[f64], walls: &[Shape], need: &[f64]) -> bool {
        if !self.valid || self.reference.len() != x.len() || self.walls.len() != walls.len() {
            return false;
        }
        // One answer for all bodies instead of a jump out of the loop: it nearly always runs to its end, and
        // without a jump it vectorises. A NaN compares false and so asks for a rebuild.
        let mut good = true;
        for (((x, r), need), reference) in x.iter().zip(radius).zip(need).zip(&self.reference) {
            let slack = reference.extent - need - r;
            good &= (slack >= 0.0) & ((*x - reference.x).length_squared() <= slack * slack);
        }
        good && (walls.iter().zip(&self.walls).enumerate())
            .all(|(w, (new, old))| new == old || self.covers(w, new, x, radius, need))
    }

    /// Whether every sphere within its need of a wall that has moved is listed with it. A NaN is never covered.
    fn covers(&self, w: usize, wall: &Shape, x: &[DVec3], radius: &[f64], need: &[f64]) -> bool {
        let b = (x.len() + w) as u32;
        (0..x.len()).all(|i| {
            wall.clearance(x[i], radius[i]) > need[i]
                || self.pairs.binary_search(&(i as u32, b)).is_ok()
        })
    }

    #[cold]
    fn rebuild(&mut self, x: &[DVec3], radius: &[f64], walls: &[Shape], need: &[f64]) {
        self.rebuilds += 1;
        self.valid = true;
        self.truncated = false;
        self.moving.clear();
        let old = self.walls.iter().map(Some).chain(std::iter::repeat(None));
        self.moving.extend(
            walls
                .iter()
                .zip(old)
                .map(|(w, old)| old.is_some_and(|o| o != w)),
        );
        self.walls.clear();
        self.walls.extend_from_slice(walls);
        self.reference.clear();
        self.reference
            .extend(x.iter().zip(radius).zip(need).map(|((&x, &r), &need)| {
                // A fast body doubles its need: half of that is travel before the next rebuild.
                Reference {
                    x,
                    extent: r + need + (self.skin * r).max(need),
                }
            }));
        let limit = self
            .limit
            .unwrap_or((PAIRS_PER_BODY * x.len()).max(PAIRS_AT_LEAST));
        if x.len() <= BRUTE_FORCE {
            self.try_all(radius, limit);
        } else {
            self.search(radius, limit);
        }
    }

    /// All pairs in the order of the result.
    fn try_all(&mut self, radius: &[f64], limit: usize) {
        self.pairs.clear();
        let n = self.reference.len();
        for (a, ra) in self.reference.iter().enumerate() {
            for (b, rb) in self.reference.iter().enumerate().skip(a + 1) {
                let reach = ra.extent + rb.extent;
                if (ra.x - rb.x).length_squared() <= reach * reach * (1.0 + 1e-12) {
                    self.pairs.push((a as u32, b as u32));
                }
            }
            for (w, (wall, moving)) in self.walls.iter().zip(&self.moving).enumerate() {
                if reaches_wall(ra, radius[a], wall, *moving) {
                    self.pairs.push((a as u32, (n + w) as u32));
                }
            }
        }
        self.truncated = self.pairs.len() > limit;
        self.pairs.truncate(limit);
    }

    /// Cells, then a counting sort by `a`, then each short row by `b`.
    fn search(&mut self, radius: &[f64], limit: usize) {
        let n = self.reference.len();
        self.extent.clear();
        self.extent.extend(self.reference.iter().map(|r| r.extent));
        let reference = &self.reference;
        self.cells
            .build(reference.iter().map(|r| r.x), &self.extent);
        let raw = &mut self.raw;
        raw.clear();
        let mut push = |a: u32, b: u32| {
            if raw.len() == limit {
                return ControlFlow::Break(());
            }
            raw.push((a, b));
            ControlFlow::Continue(())
        };
        let mut end = self.cells.pairs(&mut push);
        for (w, (wall, moving)) in self.walls.iter().zip(&self.moving).enumerate() {
            for (a, r) in reference.iter().enumerate() {
                if end.is_continue() && reaches_wall(r, radius[a], wall, *moving) {
                    end = push(a as u32, (n + w) as u32);
                }
            }
        }
        self.truncated = end.is_break();

        self.start.clear();
        self.start.resize(n + 1, 0);
        for (a, _) in &self.raw {
            self.start[*a as usize] += 1;
        }
        let mut sum = 0;
        for s in &mut self.start {
            sum += std::mem::replace(s, sum);
        }
        self.pairs.clear();
        self.pairs.resize(self.raw.len(), (0, 0));
        for &(a, b) in &self.raw {
            let to = &mut self.start[a as usize];
            self.pairs[*to as usize] = (a, b);
            *to += 1;
        }
        let mut first = 0;
        for end in &self.start[..n] {
            self.pairs[first..*end as usize].sort_unstable_by_key(|pair| pair.1);
            first = *end as usize;
        }
    }

    /// The pairs that meet within their needs, sorted by `(a, b)`: exactly those the guarantee of
    /// [`Self::refresh`] names, whatever else the list holds. Arguments as in the last `refresh`.
    ///
    /// Spheres are compared by squared distances, `|x_a - x_b|^2 <= (r_a + r_b + need_a + need_b)^2`, which saves
    /// the root for the others; a pair with a negative sum of radii and needs does not meet.
    #[inline]
    pub fn within<'a>(
        &'a self,
        x: &'a [DVec3],
        radius: &'a [f64],
        walls: &'a [Shape],
        need: &'a [f64],
    ) -> impl Iterator<Item = Meeting> + 'a {
        let n = x.len();
        self.pairs.iter().filter_map(move |&(a, b)| {
            let (i, j) = (a as usize, b as usize);
            let proximity = if j < n {
                let reach = radius[i] + radius[j] + (need[i] + need[j]);
                if !(reach >= 0.0 && (x[i] - x[j]).length_squared() <= reach * reach) {
                    return None;
                }
                sphere_sphere(x[i], radius[i], x[j], radius[j])
            } else {
                let p = walls[j - n].meet(x[i], radius[i])?;
                if p.gap.is_nan() || p.gap > need[i] {
                    return None;
                }
                p
            };
            Some(Meeting { a, b, proximity })
        })
    }
}

/// Is the gap within the reach? Generous by the rounding of the gap, so that no later plain comparison finds more. A wall
/// that moves is listed with a radius more: it comes nearer although the sphere stays.
#[inline]
fn reaches_wall(sphere: &Reference, radius: f64, wall: &Shape, moving: bool) -> bool {
    let away = (sphere.x - wall.place()).abs().element_sum();
    let rounding = 4e-15 * (away + sphere.extent);
    let ahead = if moving { radius } else { 0.0 };
    wall.clearance(sphere.x, radius) <= sphere.extent - radius + ahead + rounding
}
