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
//! at directly: the list holds as long as every sphere within its need of the wall is on it. Triangles of a mesh are listed as
//! much farther as spheres are; the list holds as long as none has moved by more (`meshes.rs`).
//! Where a periodic box deforms, `x_ref` goes along with it. Distances of neighbours then grow as the box does: reaches of the
//! list count as shorter by as much.
//! A body with a negative need is absent: it has no pairs.
//! `need_i` (m) is what the caller must not miss: how far body `i` may travel before the next call, plus its share
//! of any gap that has to count as touching.

mod meshes;
mod search;

pub(super) use self::meshes::Meshes;
use super::cell_list::CellList;
use crate::pair::Proximity;
use crate::periodic::Periodic;
use crate::shape::Shape;
use glam::DVec3;
use std::ops::{ControlFlow, Range};

/// Up to here all pairs are tried at a rebuild: less than sorting them into cells costs.
const BRUTE_FORCE: usize = 32;
/// Skin of the first list, in radii; a list of a dense packing then holds about twice the pairs that touch. Later lists
/// have the skin that the motion asks for, within these bounds: little where nothing moves.
const SKIN: f64 = 0.3;
const SKIN_LEAST: f64 = 0.05;
const SKIN_MOST: f64 = 0.5;
/// A moving body has this many times its need as skin, at a skin of one radius: it stays valid for as many steps as those
/// at rest do.
const SKIN_IN_NEEDS: f64 = 10.0;
/// A rebuild costs about as much as passing over each pair so often; bodies with fewer pairs cost as if they had these.
const REBUILD_PER_PAIR: f64 = 8.0;
const FEW_PAIRS: f64 = 4.0;
/// Default limit on the length of the list, per body and at least; beyond the second number per body the skin is given up.
const PAIRS_PER_BODY: usize = 64;
const PAIRS_WITH_SKIN: usize = 24;
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
    meshes: Meshes,
    fixed_walls: bool,
    /// Bodies that have numbers between those of spheres and walls.
    between: usize,
    periodic: Periodic,
    /// The box at the last rebuild.
    listed: Periodic,
    /// Which walls moved between the last two rebuilds: they are listed farther out.
    moving: Vec<bool>,
    skin: f64,
    adapt: bool,
    limit: Option<usize>,
    rebuilds: u64,
    /// Calls of [`Self::refresh`] that the present list has served.
    served: u32,
    truncated: bool,
    valid: bool,
    cells: CellList,
    extent: Vec<f64>,
    /// Pairs as they are found, part by part of the search.
    raw: Vec<Vec<(u32, u32)>>,
    start: Vec<u32>,
    threads: usize,
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
            meshes: Meshes::default(),
            fixed_walls: false,
            between: 0,
            periodic: Periodic::default(),
            listed: Periodic::default(),
            moving: Vec::new(),
            skin: SKIN,
            adapt: true,
            limit: None,
            rebuilds: 0,
            served: 0,
            truncated: false,
            valid: false,
            cells: CellList::new(),
            extent: Vec::new(),
            raw: Vec::new(),
            start: Vec::new(),
            threads: 1,
        }
    }

    /// Sets a box in which bodies meet by their nearest images (default: none).
    pub fn set_periodic(&mut self, periodic: Periodic) {
        self.periodic = periodic;
        self.valid = false;
    }

    /// Sets what the box has deformed to.
    pub fn deform(&mut self, periodic: Periodic) {
        self.periodic = periodic;
    }

    /// Tells which walls are those of meshes (default: none), and how many of them, the first, are triangles. Triangles are listed, and
    /// searched by place; the others are not.
    pub fn set_meshes(&mut self, meshes: Vec<(Range<usize>, usize)>) {
        self.meshes = Meshes::new(meshes);
        self.valid = false;
    }

    /// Tells how many bodies have numbers between those of spheres and those of walls (default: 0).
    pub fn set_between(&mut self, count: usize) {
        self.between = count;
        self.valid = false;
    }

    /// Tells that walls never move (default: they may): no call compares them with those before.
    pub fn set_fixed_walls(&mut self, fixed: bool) {
        self.fixed_walls = fixed;
    }

    /// The need (m) of a body of this radius (m) that is not there: no pairs, and no rebuild as long as it stays away.
    #[inline]
    pub fn absent(radius: f64) -> f64 {
        -2.0 * radius
    }

    /// Sets whether a rebuild uses the pool of rayon that it runs on (above 1; default 1), and into how many shares it cuts the rows. The list is
    /// the same for any number.
    pub fn set_threads(&mut self, threads: usize) {
        self.threads = threads.max(1);
    }

    /// Fixes the least skin, in radii (default: 0.3 at first, then as the motion asks). Larger: fewer rebuilds, longer lists.
    /// Never changes what [`Self::within`] yields.
    pub fn set_skin(&mut self, radii: f64) {
        self.skin = radii.max(0.0);
        self.adapt = false;
        self.valid = false;
    }

    /// Sets the most pairs the list may hold (default 64 per body and one per triangle of meshes, at least 65 536).
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
        if self.still_valid(x, radius, walls, need) && !self.is_wasteful() {
            self.served = self.served.saturating_add(1);
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
        if self.periodic != self.listed {
            return self.follows_box(x, radius, need) && self.follows_walls(x, radius, walls, need);
        }
        let mut good = true;
        for (((x, r), need), reference) in x.iter().zip(radius).zip(need).zip(&self.reference) {
            let slack = reference.extent - need - r;
            good &= (slack >= 0.0) & ((*x - reference.x).length_squared() <= slack * slack);
        }
        good && self.follows_walls(x, radius, walls, need)
    }

    /// Whether the list still holds every pair of spheres in a box that has deformed.
    fn follows_box(&self, x: &[DVec3], radius: &[f64], need: &[f64]) -> bool {
        let back = self.periodic.lengthening(&self.listed);
        let mut bodies = x.iter().zip(radius).zip(need).zip(&self.reference);
        bodies.all(|(((x, r), need), reference)| {
            let slack = reference.extent / back - need - r;
            let from = self.listed.carried(reference.x, &self.periodic);
            *need < 0.0 || (slack >= 0.0 && (*x - from).length_squared() <= slack * slack)
        })
    }

    /// Whether it holds every pair of a sphere and a wall, where walls may have moved.
    #[inline]
    fn follows_walls(&self, x: &[DVec3], radius: &[f64], walls: &[Shape], need: &[f64]) -> bool {
        let moved = |w: usize| walls[w] != self.walls[w];
        let mut single = self.meshes.others(walls.len());
        self.fixed_walls
            || (single.all(|w| !moved(w) || self.covers(w, &walls[w], x, radius, need))
                && self.meshes.hold(&self.walls, walls))
    }

    /// Whether every sphere within its need of a wall that has moved is listed with it. A NaN is never covered.
    fn covers(&self, w: usize, wall: &Shape, x: &[DVec3], radius: &[f64], need: &[f64]) -> bool {
        let b = (x.len() + w) as u32;
        (0..x.len()).all(|i| {
            need[i] < 0.0
                || wall.clearance(x[i], radius[i]) > need[i]
                || self.pairs.binary_search(&(i as u32, b)).is_ok()
        })
    }

    #[cold]
    fn rebuild(&mut self, x: &[DVec3], radius: &[f64], walls: &[Shape], need: &[f64]) {
        self.rebuilds += 1;
        self.valid = true;
        self.listed = self.periodic;
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
        self.meshes.sort(walls, self.fixed_walls);
        let limit = self
            .limit
            .unwrap_or((PAIRS_PER_BODY * x.len() + self.meshes.triangles()).max(PAIRS_AT_LEAST));
        if x.len() <= BRUTE_FORCE {
            self.refer(x, radius, need, self.skin);
            self.try_all(radius, limit);
            return;
        }
        self.choose_skin();
        self.refer(x, radius, need, self.skin);
        let sparing = (PAIRS_WITH_SKIN * x.len() + self.meshes.triangles())
            .max(PAIRS_AT_LEAST)
            .min(limit);
        self.search(radius, sparing);
        if self.truncated {
            self.refer(x, radius, need, 0.0);
            self.search(radius, limit);
        }
    }

    /// What the skin has cost since the rebuild, over the cost of a rebuild.
    fn spent(&self) -> f64 {
        let pairs = self.pairs.len() as f64 / self.reference.len().max(1) as f64;
        // In a dense packing a skin of 0.3 radii doubles the pairs that touch.
        let surplus = pairs * self.skin / (SKIN + self.skin);
        f64::from(self.served + 1) * surplus / (REBUILD_PER_PAIR * pairs.max(FEW_PAIRS))
    }

    /// Nothing moves, and the skin has cost far more than a list with a smaller one.
    #[inline]
    fn is_wasteful(&self) -> bool {
        self.reference.len() > BRUTE_FORCE
            && self.adapt
            && self.skin > SKIN_LEAST
            && self.spent() > 4.0
    }

    /// The skin whose surplus of pairs, over the steps that the list serves, costs as much as a rebuild. From the history of
    /// the list alone, not from a clock.
    fn choose_skin(&mut self) {
        if self.adapt && self.rebuilds > 1 {
            let factor = (1.0 / self.spent().max(1e-3)).clamp(0.5, 1.25);
            self.skin = (self.skin * factor).clamp(SKIN_LEAST, SKIN_MOST);
        }
        self.served = 0;
    }

    /// Takes the reference positions and reaches. Bodies of all sizes move at like speeds: the skin of a large one is that of
    /// the mean radius.
    fn refer(&mut self, x: &[DVec3], radius: &[f64], need: &[f64], skin: f64) {
        let mean = radius.iter().sum::<f64>() / radius.len() as f64;
        self.meshes.margin = (skin * mean).max(0.0);
        let most = if mean > 0.0 { mean } else { f64::INFINITY };
        let in_needs = if skin > 0.0 {
            (SKIN_IN_NEEDS * skin).max(1.0)
        } else {
            0.0
        };
        self.reference.clear();
        self.reference
            .extend(x.iter().zip(radius).zip(need).map(|((&x, &r), &need)| {
                // Of an absent body: below 0, so that nothing reaches it, with a slack of 0.
                let skin = if need < 0.0 {
                    0.0
                } else {
                    (skin * r.min(most)).max(in_needs * need)
                };
                let extent = r + need + skin;
                Reference { x, extent }
            }));
    }

    /// All pairs in the order of the result.
    fn try_all(&mut self, radius: &[f64], limit: usize) {
        self.pairs.clear();
        let first = self.reference.len() + self.between;
        let there = |(_, r): &(usize, &Reference)| r.extent >= 0.0;
        for (a, ra) in self.reference.iter().enumerate().filter(there) {
            let others = self.reference.iter().enumerate().skip(a + 1);
            for (b, rb) in others.filter(there) {
                let reach = ra.extent + rb.extent;
                let between = self.periodic.nearest(ra.x - rb.x);
                if between.length_squared() <= reach * reach * (1.0 + 1e-12) {
                    self.pairs.push((a as u32, b as u32));
                }
            }
            let from = self.pairs.len();
            let _ = walls_of(
                ra,
                radius[a],
                &self.walls,
                &self.moving,
                &self.meshes,
                |w| {
                    self.pairs.push((a as u32, (first + w) as u32));
                    ControlFlow::Continue(())
                },
            );
            self.pairs[from..].sort_unstable();
        }
        self.truncated = self.pairs.len() > limit;
        self.pairs.truncate(limit);
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
        let (n, first, periodic) = (x.len(), x.len() + self.between, &self.periodic);
        self.pairs.iter().filter_map(move |&(a, b)| {
            let (i, j) = (a as usize, b as usize);
            if need[i] < 0.0 || need.get(j).is_some_and(|&need| need < 0.0) {
                return None;
            }
            let proximity = if j < n {
                let reach = radius[i] + radius[j] + (need[i] + need[j]);
                let between = periodic.nearest(x[i] - x[j]);
                if !(reach >= 0.0 && between.length_squared() <= reach * reach) {
                    return None;
                }
                periodic.sphere_sphere(x[i], radius[i], x[j], radius[j])
            } else {
                let p = walls[j - first].meet(x[i], radius[i]);
                if p.gap.is_nan() || p.gap > need[i] {
                    return None;
                }
                p
            };
            Some(Meeting { a, b, proximity })
        })
    }
}

/// Calls `found` for each wall that a sphere may meet, until it breaks.
fn walls_of(
    sphere: &Reference,
    radius: f64,
    walls: &[Shape],
    moving: &[bool],
    meshes: &Meshes,
    mut found: impl FnMut(usize) -> ControlFlow<()>,
) -> ControlFlow<()> {
    for w in meshes.others(walls.len()) {
        let ahead = if moving[w] { radius } else { 0.0 };
        if reaches_wall(sphere, radius, &walls[w], ahead) {
            found(w)?;
        }
    }
    meshes.around(sphere.x, sphere.extent, |w| {
        if reaches_wall(sphere, radius, &walls[w], meshes.margin) {
            found(w)?;
        }
        ControlFlow::Continue(())
    })
}

/// Is the gap within the reach? Generous by the rounding of the gap, so that no later plain comparison finds more. A wall
/// that moves is listed from `ahead` (m) more on: it comes nearer although the sphere stays.
#[inline]
fn reaches_wall(sphere: &Reference, radius: f64, wall: &Shape, ahead: f64) -> bool {
    let away = (sphere.x - wall.place()).abs().element_sum();
    let rounding = 4e-15 * (away + sphere.extent);
    sphere.extent >= 0.0
        && wall.clearance(sphere.x, radius) <= sphere.extent - radius + ahead + rounding
}
