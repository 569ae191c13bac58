//! The neighbour list against brute force: random, moving, mixed, and absurd configurations.

mod common;

use carom_geom::{
    overlaps, sphere_sphere, DVec3, Displacement, NeighbourList, Periodic, Shape, Shear,
};
use common::{vector, wall};
use glam::DQuat;
use proptest::prelude::*;
use std::collections::BTreeSet;

#[derive(Clone, Debug, Default)]
struct Scene {
    periodic: Periodic,
    x: Vec<DVec3>,
    radius: Vec<f64>,
    walls: Vec<Shape>,
    need: Vec<f64>,
}

impl Scene {
    /// The definition: every pair within its needs.
    fn brute_force(&self) -> Vec<(u32, u32)> {
        let n = self.x.len();
        let mut pairs = Vec::new();
        for a in 0..n {
            for b in a + 1..n {
                let reach = self.radius[a] + self.radius[b] + (self.need[a] + self.need[b]);
                if self
                    .periodic
                    .nearest(self.x[a] - self.x[b])
                    .length_squared()
                    <= reach * reach
                {
                    pairs.push((a as u32, b as u32));
                }
            }
            for (w, wall) in self.walls.iter().enumerate() {
                if wall.meet(self.x[a], self.radius[a]).gap <= self.need[a] {
                    pairs.push((a as u32, (n + w) as u32));
                }
            }
        }
        pairs
    }

    fn refresh(&self, list: &mut NeighbourList) -> bool {
        list.refresh(&self.x, &self.radius, &self.walls, &self.need)
    }

    /// Sorted, complete, and exact after filtering.
    fn check(&self, list: &NeighbourList) {
        assert!(
            list.pairs().windows(2).all(|w| w[0] < w[1]),
            "sorted, no duplicates"
        );
        assert!(list.pairs().iter().all(|(a, b)| a < b));
        let wanted = self.brute_force();
        let listed: BTreeSet<_> = list.pairs().iter().copied().collect();
        for pair in &wanted {
            assert!(
                listed.contains(pair),
                "missing {pair:?} of {}",
                wanted.len()
            );
        }
        let mut within = Vec::new();
        for m in list.within(&self.x, &self.radius, &self.walls, &self.need) {
            within.push((m.a, m.b));
            let (i, j) = (m.a as usize, m.b as usize);
            let expected = match j.checked_sub(self.x.len()) {
                None => (self.periodic).sphere_sphere(
                    self.x[i],
                    self.radius[i],
                    self.x[j],
                    self.radius[j],
                ),
                Some(w) => self.walls[w].meet(self.x[i], self.radius[i]),
            };
            assert_eq!(m.proximity, expected);
        }
        assert_eq!(within, wanted);
    }
}

fn half_space(point: DVec3, normal: DVec3) -> Shape {
    Shape::HalfSpace { point, normal }
}

/// Up to 300 spheres with radii of 0.02 to `0.02 ratio`, in a box that makes them crowded or sparse.
fn scene(largest: usize, ratio: f64) -> impl Strategy<Value = Scene> {
    (1..=largest, 0.1..3.0f64).prop_flat_map(move |(n, size)| {
        (
            prop::collection::vec(vector(size), n),
            prop::collection::vec(0.02..0.02 * ratio, n),
            prop::collection::vec(prop_oneof![4 => 0.0..0.02f64, 1 => 0.0..0.5f64], n),
            prop::collection::vec(wall(), 0..5),
        )
            .prop_map(|(x, radius, need, walls)| Scene {
                x,
                radius,
                need,
                walls,
                ..Scene::default()
            })
    })
}

/// Moves, changes needs and pushes and turns walls by amounts that sometimes cause a rebuild and often do not.
fn advance(scene: &mut Scene, moves: &[DVec3], step: usize) {
    let n = scene.x.len();
    for i in 0..n {
        scene.x[i] += moves[(i + step) % moves.len()];
        scene.need[i] = (scene.need[i] * (0.7 + 0.1 * ((i + step) % 7) as f64)).max(1e-6);
    }
    for (w, wall) in scene.walls.iter_mut().enumerate() {
        // The first stays, the second is pushed, the third turns too.
        let by = Displacement {
            turn: DQuat::from_scaled_axis(0.002 * (w / 2) as f64 * moves[0].normalize_or_zero()),
            about: moves[step % moves.len()],
            shift: w as f64 * moves[step % moves.len()],
        };
        if w > 0 {
            *wall = wall.moved(&by);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn complete_over_many_moving_steps(
        mut scene in scene(300, 5.0),
        moves in prop::collection::vec(vector(0.004), 1..40),
    ) {
        let mut list = NeighbourList::new();
        prop_assert!(scene.refresh(&mut list));
        scene.check(&list);
        for step in 0..12 {
            advance(&mut scene, &moves, step);
            let rebuilt = scene.refresh(&mut list);
            scene.check(&list);
            prop_assert!(!scene.refresh(&mut list), "a second refresh finds nothing to do ({rebuilt})");
        }
    }

    #[test]
    fn strongly_mixed_radii(scene in scene(200, 400.0)) {
        let mut list = NeighbourList::new();
        scene.refresh(&mut list);
        scene.check(&list);
    }

    #[test]
    fn one_flown_away(mut scene in scene(150, 3.0), direction in vector(1.0), far in 3.0..16.0f64, near in vector(0.05)) {
        // A pair far out must still be found, and the rest with it.
        let there = direction * 10f64.powf(far);
        scene.x[0] = there;
        if scene.x.len() > 1 {
            scene.x[1] = there + near;
        }
        let mut list = NeighbourList::new();
        scene.refresh(&mut list);
        scene.check(&list);
    }

    #[test]
    fn two_heaps_far_apart(mut scene in scene(300, 2.0), shift in vector(1e9)) {
        let half = scene.x.len() / 2;
        for x in &mut scene.x[..half] {
            *x += shift;
        }
        let mut list = NeighbourList::new();
        scene.refresh(&mut list);
        scene.check(&list);
    }

    #[test]
    fn the_answer_does_not_depend_on_the_history(
        mut scene in scene(120, 3.0),
        moves in prop::collection::vec(vector(0.01), 1..20),
    ) {
        let mut old = NeighbourList::new();
        for step in 0..8 {
            scene.refresh(&mut old);
            advance(&mut scene, &moves, step);
        }
        scene.refresh(&mut old);
        let (mut fresh, mut wide) = (NeighbourList::new(), NeighbourList::new());
        wide.set_skin(2.0);
        scene.refresh(&mut fresh);
        scene.refresh(&mut wide);
        let of = |list: &NeighbourList| {
            list.within(&scene.x, &scene.radius, &scene.walls, &scene.need).collect::<Vec<_>>()
        };
        prop_assert_eq!(of(&old), of(&fresh));
        prop_assert_eq!(of(&wide), of(&fresh));
    }

    #[test]
    fn images_across_the_border(
        mut scene in scene(150, 8.0),
        length in prop::array::uniform3(prop_oneof![Just(0.0), 0.7..3.0f64]),
        origin in vector(5.0),
        shift in vector(40.0),
        moves in prop::collection::vec(vector(0.01), 1..20),
    ) {
        scene.periodic = Periodic::new(DVec3::from(length), origin);
        for x in scene.x.iter_mut().step_by(3) {
            *x += (shift / 7.0).round() * DVec3::from(length);
        }
        let mut list = NeighbourList::new();
        list.set_periodic(scene.periodic);
        list.set_threads(2);
        for step in 0..6 {
            scene.refresh(&mut list);
            scene.check(&list);
            advance(&mut scene, &moves, step);
        }
        let found = overlaps(&scene.x, &scene.radius, &scene.walls, Vec::new(), &scene.periodic, 0.5, usize::MAX);
        prop_assert!(found.windows(2).all(|w| (w[0].a, w[0].b) < (w[1].a, w[1].b)));
        let n = scene.x.len() as u32;
        let mut at_contact = scene.clone();
        at_contact.need.fill(0.0);
        let deep = at_contact.brute_force().into_iter().filter(|&(a, b)| {
            let (i, j) = (a as usize, b as usize);
            b < n && {
                let (ri, rj) = (scene.radius[i], scene.radius[j]);
                scene.periodic.sphere_sphere(scene.x[i], ri, scene.x[j], rj).gap < -0.5 * ri.min(rj)
            }
        });
        prop_assert_eq!(
            found.iter().map(|o| (o.a, o.b)).filter(|p| p.1 < n).collect::<Vec<_>>(),
            deep.collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_box_that_deforms(
        mut scene in scene(150, 8.0),
        length in prop::array::uniform3(0.9..3.0f64),
        rates in prop::array::uniform4(-0.08..0.08f64),
        axes in 0..6usize,
        moves in prop::collection::vec(vector(0.01), 1..20),
    ) {
        // Walls do not change along what deforms; these would.
        scene.walls.clear();
        let (flow, gradient) = [(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)][axes];
        let at = |step: usize| {
            let share = |k: usize| 1.0 + rates[k] * step as f64;
            let length = DVec3::from(length) * DVec3::new(share(0), share(1), share(2));
            let offset = 2.0 * rates[3] * step as f64;
            Periodic::new(length, -0.5 * length).sheared(Shear { flow, gradient, offset })
        };
        let mut list = NeighbourList::new();
        scene.periodic = at(0);
        list.set_periodic(scene.periodic);
        list.set_threads(2);
        for step in 1..8 {
            scene.refresh(&mut list);
            scene.check(&list);
            advance(&mut scene, &moves, step);
            let now = at(step);
            for x in &mut scene.x {
                *x = scene.periodic.carried(*x, &now);
            }
            scene.periodic = now;
            list.deform(now);
        }
    }

    #[test]
    fn overlaps_are_all_found(scene in scene(200, 4.0)) {
        let found = overlaps(&scene.x, &scene.radius, &scene.walls, Vec::new(), &Periodic::default(), 1e-9, usize::MAX);
        let mut at_contact = scene.clone();
        at_contact.need.fill(0.0);
        let inside = |&(a, b): &(u32, u32)| {
            let (i, j) = (a as usize, b as usize);
            let (gap, r) = match j.checked_sub(scene.x.len()) {
                None => (
                    sphere_sphere(scene.x[i], scene.radius[i], scene.x[j], scene.radius[j]).gap,
                    scene.radius[i].min(scene.radius[j]),
                ),
                Some(w) => (
                    scene.walls[w].meet(scene.x[i], scene.radius[i]).gap,
                    scene.radius[i],
                ),
            };
            gap < -1e-9 * r
        };
        let wanted: Vec<_> = at_contact.brute_force().into_iter().filter(inside).collect();
        prop_assert_eq!(found.iter().map(|o| (o.a, o.b)).collect::<Vec<_>>(), wanted);
    }
}

/// A cubic lattice of touching balls of radius 0.03 m.
fn lattice(side: usize) -> Scene {
    let n = side * side * side;
    let at = |i: usize| {
        DVec3::new(
            (i % side) as f64,
            (i / side % side) as f64,
            (i / side / side) as f64,
        )
    };
    Scene {
        x: (0..n).map(|i| 0.06 * at(i)).collect(),
        radius: vec![0.03; n],
        walls: vec![half_space(DVec3::new(0.0, 0.0, -0.03), DVec3::Z)],
        need: vec![1e-4; n],
        ..Scene::default()
    }
}

#[test]
fn a_box_that_was_not_sheared_brings_balls_together() {
    let whole = Periodic::new(DVec3::ONE, DVec3::splat(-0.5));
    let mut scene = Scene {
        x: vec![DVec3::ZERO, DVec3::new(-0.08, 0.04, 0.0)],
        radius: vec![0.03; 2],
        need: vec![1e-4; 2],
        periodic: whole,
        ..Scene::default()
    };
    let mut list = NeighbourList::new();
    list.set_periodic(whole);
    for step in 0..10 {
        scene.refresh(&mut list);
        scene.check(&list);
        assert!(step > 0 || list.pairs().is_empty());
        let now = whole.sheared(Shear {
            flow: 0,
            gradient: 1,
            offset: 0.2 * f64::from(step + 1),
        });
        for x in &mut scene.x {
            *x = scene.periodic.carried(*x, &now);
        }
        scene.periodic = now;
        list.deform(now);
    }
}

#[test]
fn a_little_strain_keeps_the_list() {
    let mut scene = lattice(6);
    let box_at = |offset: f64| {
        Periodic::new(DVec3::splat(6.0), DVec3::splat(-0.5)).sheared(Shear {
            flow: 0,
            gradient: 1,
            offset,
        })
    };
    let mut list = NeighbourList::new();
    list.set_periodic(box_at(0.0));
    scene.periodic = box_at(0.0);
    assert!(scene.refresh(&mut list));
    let mut rebuilt = 0;
    for step in 1..=100 {
        let now = box_at(0.03 * f64::from(step));
        for x in &mut scene.x {
            *x = scene.periodic.carried(*x, &now);
        }
        scene.periodic = now;
        list.deform(now);
        rebuilt += i32::from(scene.refresh(&mut list));
        scene.check(&list);
    }
    // A strain of 1/2.
    assert!((1..15).contains(&rebuilt), "{rebuilt}");
}

#[test]
fn lattice_has_three_contacts_per_ball() {
    let scene = lattice(12);
    let mut list = NeighbourList::new();
    scene.refresh(&mut list);
    let within = list
        .within(&scene.x, &scene.radius, &scene.walls, &scene.need)
        .count();
    assert_eq!(within, 3 * 12 * 12 * 11 + 12 * 12);
}

#[test]
fn a_bullet_and_an_escapee_cost_nothing_much() {
    // One ball that may travel 50 m, one a thousand million metres out: neither may make the search quadratic.
    // 27 000 balls tried against each other would be 4e8 pairs; a second is generous for what should take 20 ms.
    let mut scene = lattice(30);
    scene.need[17] = 50.0;
    scene.x[40] = DVec3::new(1e9, -1e9, 3e8);
    let clock = std::time::Instant::now();
    let mut list = NeighbourList::new();
    scene.refresh(&mut list);
    assert!(clock.elapsed().as_secs_f64() < 1.0, "{:?}", clock.elapsed());
    let of_bullet = list
        .pairs()
        .iter()
        .filter(|(a, b)| *a == 17 || *b == 17)
        .count();
    assert_eq!(
        of_bullet,
        27_000 - 2 + 1,
        "all but itself and the escapee, and the plane"
    );
    assert!(!list.is_truncated());
}

#[test]
fn a_lattice_without_contacts_is_found_empty() {
    // Regular spacing, far larger than a cell: the worst case for tables indexed by coordinates modulo their size.
    let mut scene = lattice(30);
    scene.walls.clear();
    for x in &mut scene.x {
        *x *= 64.0;
    }
    let clock = std::time::Instant::now();
    let mut list = NeighbourList::new();
    scene.refresh(&mut list);
    assert!(list.pairs().is_empty());
    assert!(clock.elapsed().as_secs_f64() < 1.0, "{:?}", clock.elapsed());
}

#[test]
fn absurd_needs_stop_at_the_limit() {
    let mut scene = lattice(20);
    scene.need.fill(1e300);
    let mut list = NeighbourList::new();
    list.set_limit(100_000);
    scene.refresh(&mut list);
    assert!(list.is_truncated());
    assert_eq!(list.pairs().len(), 100_000);
    scene.need.fill(1e-4);
    list.invalidate();
    scene.refresh(&mut list);
    assert!(!list.is_truncated());
    scene.check(&list);
}

#[test]
fn infinite_needs_and_nans_do_no_harm() {
    for n in [6, 60] {
        let mut scene = Scene {
            x: (0..n).map(|i| DVec3::new(i as f64, 0.0, 0.0)).collect(),
            radius: vec![0.5; n],
            walls: vec![half_space(DVec3::new(0.0, 0.0, -0.5), DVec3::Z)],
            need: vec![0.0; n],
            ..Scene::default()
        };
        scene.need[3] = f64::INFINITY;
        let mut list = NeighbourList::new();
        scene.refresh(&mut list);
        scene.check(&list);
        scene.x[2] = DVec3::NAN;
        scene.x[4].y = f64::NAN;
        scene.need[5] = f64::NAN;
        assert!(scene.refresh(&mut list), "NaN asks for a rebuild");
        let broken = |i: u32| [2, 4].contains(&i);
        assert!(list
            .within(&scene.x, &scene.radius, &scene.walls, &scene.need)
            .all(|m| !broken(m.a) && !broken(m.b)));
        scene.walls[0] = half_space(DVec3::NAN, DVec3::Z);
        assert!(scene.refresh(&mut list));
    }
}

#[test]
fn the_list_is_the_same_for_any_number_of_threads() {
    let mut scene = lattice(30);
    scene.radius[100] = 0.5;
    scene.need[17] = 0.3;
    let lists = [1, 2, 3, 8].map(|threads| {
        let mut list = NeighbourList::new();
        list.set_threads(threads);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| scene.refresh(&mut list));
        list.pairs().to_vec()
    });
    assert!(lists[0].len() > 3 * 27_000);
    assert!(lists.iter().all(|pairs| *pairs == lists[0]));
    let mut list = NeighbourList::new();
    list.set_threads(3);
    list.set_limit(1000);
    scene.refresh(&mut list);
    assert!(list.is_truncated());
    assert_eq!(list.pairs().len(), 1000);
}

/// Balls that shake about their places by `amplitude` radii, for 400 calls; pairs a ball in the last list, and rebuilds.
fn shake(amplitude: f64) -> (f64, u64) {
    let mut scene = lattice(12);
    let sites = scene.x.clone();
    let n = sites.len();
    let mut list = NeighbourList::new();
    for step in 0..400 {
        for (i, (x, site)) in scene.x.iter_mut().zip(&sites).enumerate() {
            let phase = 0.1 * step as f64 + i as f64;
            *x = *site + 0.03 * amplitude * DVec3::new(phase.sin(), phase.cos(), 0.0);
        }
        scene.refresh(&mut list);
    }
    scene.check(&list);
    (list.pairs().len() as f64 / n as f64, list.rebuilds())
}

#[test]
fn the_skin_follows_the_motion() {
    let ((still, few), (wild, many)) = (shake(1e-3), shake(1.0));
    assert!(
        few <= 4,
        "what does not move is listed again to save pairs, and then kept: {few}"
    );
    assert!(many > 5 && many < 200, "{many} rebuilds in 400 steps");
    assert!(still < 3.2 && wild > 4.0, "{still} and {wild} pairs a ball");
    let (some, rebuilds) = shake(0.2);
    assert!(
        rebuilds < 40 && some <= wild,
        "{rebuilds}, {some} and {wild} pairs a ball"
    );
}

#[test]
fn a_giant_in_dust_keeps_a_list_of_the_dust_it_touches() {
    // A giant of 20 radii in a lattice of dust: its skin is that of the dust, not a share of its own radius.
    let mut scene = lattice(30);
    scene.walls.clear();
    let centre = DVec3::splat(0.06 * 14.5);
    let giant = 20.0 * 0.03;
    scene.x.retain(|x| x.distance(centre) > giant + 0.03);
    scene.x.push(centre);
    let n = scene.x.len();
    scene.radius = vec![0.03; n];
    scene.radius[n - 1] = giant;
    scene.need = vec![1e-4; n];
    let mut list = NeighbourList::new();
    scene.refresh(&mut list);
    let of_giant = list
        .pairs()
        .iter()
        .filter(|p| p.1 as usize == n - 1)
        .count();
    // Dust with a centre in a shell of twice 0.3 small radii and what the lattice leaves.
    let shell = 4.0 * std::f64::consts::PI * 21.0f64.powi(2) * 0.65 / 8.0;
    assert!((of_giant as f64) < 1.2 * shell, "{of_giant}, shell {shell}");
}

#[test]
fn nothing_at_all() {
    let mut list = NeighbourList::default();
    assert!(Scene::default().refresh(&mut list));
    assert!(!Scene::default().refresh(&mut list));
    assert!(list.pairs().is_empty());
}

#[test]
fn rebuilds_only_when_it_must() {
    for side in [3, 4] {
        let mut scene = lattice(side);
        let mut list = NeighbourList::new();
        list.set_skin(0.3);
        assert!(scene.refresh(&mut list));
        // Skin 0.3 r = 9 mm; need 0.1 mm. Body 1 may move 9 mm.
        scene.x[1].x += 0.0089;
        assert!(!scene.refresh(&mut list));
        scene.x[1].x += 0.0002;
        assert!(scene.refresh(&mut list));
        // The floor may sink for ever, and rise or tilt until a ball that is not listed with it is near: the second layer, 60 mm
        // up, of which the skin takes nothing here.
        let floor = |z: f64| half_space(DVec3::new(0.0, 0.0, z), DVec3::Z);
        for z in [-5.0, -0.031, 0.0, 0.0298] {
            scene.walls[0] = floor(z);
            assert!(!scene.refresh(&mut list), "{z}");
        }
        scene.walls[0] = floor(0.03);
        assert!(scene.refresh(&mut list), "the second layer is reached");
        scene.walls[0] = half_space(DVec3::new(0.0, 0.0, -1.0), DVec3::new(0.0, 0.6, 0.8));
        assert!(!scene.refresh(&mut list), "a tilt, away from all");
        scene.radius[2] += 0.0092;
        assert!(scene.refresh(&mut list), "growth");
        scene.radius[2] -= 0.0092;
        assert!(!scene.refresh(&mut list), "shrinking");
        scene.need[0] = 0.0093;
        assert!(scene.refresh(&mut list), "a larger need");
        assert!(scene.refresh(&mut { NeighbourList::new() }));
        scene.x.pop();
        scene.radius.pop();
        scene.need.pop();
        assert!(scene.refresh(&mut list), "a body less");
        scene.check(&list);
        assert_eq!(list.rebuilds(), 6);
    }
}
