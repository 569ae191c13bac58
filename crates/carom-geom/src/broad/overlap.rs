//! Start-up check: which bodies of a scene are inside one another?

use super::cell_list::CellList;
use super::verlet::Meshes;
use crate::periodic::Periodic;
use crate::shape::Shape;
use glam::DVec3;
use std::ops::{ControlFlow, Range};

/// Two bodies that overlap: `a < b`, wall `w` is body `N + w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// The sphere with the smaller index.
    pub a: u32,
    /// The other sphere or wall.
    pub b: u32,
    /// Gap (m), negative (eq. 33).
    pub gap: f64,
}

/// All pairs with `gap < -tol r_c`, where `r_c = min(r_a, r_b)` (`r_a` at a wall), sorted by `(a, b)`, but no
/// more than `cap` of them.
///
/// Centres `x` (N) (m), radii (N) (m), walls (P), by nearest images in a periodic box; `meshes` as in
/// [`super::NeighbourList::set_meshes`]. O(N P) and O(N) for spheres that are not piled into one another. Where `cap` cuts the list, which pairs remain is deterministic but not meaningful.
/// The contract takes a gap within `tol = 1e-9` as touching.
pub fn overlaps(
    x: &[DVec3],
    radius: &[f64],
    walls: &[Shape],
    meshes: Vec<(Range<usize>, usize)>,
    periodic: &Periodic,
    tol: f64,
    cap: usize,
) -> Vec<Overlap> {
    assert_eq!(x.len(), radius.len());
    let mut found = Vec::new();
    let mut keep = |a: u32, b: u32, gap: f64, r: f64| {
        if gap < -tol * r && found.len() < cap {
            found.push(Overlap { a, b, gap });
        }
        if found.len() < cap {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    };
    let mut cells = CellList::new();
    cells.build(x.iter().copied(), radius, periodic);
    let spheres = cells.pairs(|a, b| {
        let (i, j) = (a as usize, b as usize);
        let p = periodic.sphere_sphere(x[i], radius[i], x[j], radius[j]);
        keep(a, b, p.gap, radius[i].min(radius[j]))
    });
    if spheres.is_continue() {
        let mut meshes = Meshes::new(meshes);
        meshes.sort(walls, true);
        // Breaking out only saves work: the list is full.
        let _ = x
            .iter()
            .zip(radius)
            .enumerate()
            .try_for_each(|(i, (&x, &r))| {
                let mut look = |w: usize| {
                    let gap = walls[w].meet(x, r).gap;
                    keep(i as u32, (radius.len() + w) as u32, gap, r)
                };
                meshes.others(walls.len()).try_for_each(&mut look)?;
                meshes.around(x, r, look)
            });
    }
    found.sort_unstable_by_key(|o| (o.a, o.b));
    found.dedup_by_key(|o| (o.a, o.b));
    found
}
