//! A model from its description: every number is checked, and every refusal names the entry.

use super::clumps::{self, owners, Bodies};
use super::{flow, ModelInput};
use crate::clump::body::quaternion;
use crate::force::{Dependence, Load};
use crate::held_apart::HeldApart;
use crate::joint::{Joint, RowKind, GROUND};
use crate::model::{ContactLaw, InitialState, Link, LinkKind, Model};
use crate::options::Options;
use crate::outcome::{Entry, ModelError};
use crate::wall::{self, checked, FreeWall, MeshWall, Shape, Wall};
use carom_solve::Bounds;
use glam::{DQuat, DVec3};
use std::sync::Arc;

impl Model {
    /// Checks and compiles. Every refusal names the entry.
    pub fn new(input: &ModelInput, options: Options) -> Result<(Model, InitialState), ModelError> {
        options.validate()?;
        let n = input.radius.len();
        if n == 0 {
            return Err(ModelError::Empty);
        }
        check_lengths(input, n)?;
        for i in 0..n {
            let sphere = Entry("sphere", i);
            let refused = |why| sphere.refused(why);
            wall::size("radius", input.radius[i]).map_err(refused)?;
            sphere.positive("mass", input.mass[i])?;
            sphere.positive("inertia", input.inertia[i])?;
            sphere.finite("position", &input.position[i])?;
            wall::place("position", input.position[i].into()).map_err(refused)?;
            sphere.finite("velocity", &input.velocity[i])?;
            sphere.finite("angular_velocity", &input.angular_velocity[i])?;
            sphere.unit(&input.orientation[i])?;
        }
        Entry("world", 0).finite("gravity", &input.gravity)?;
        let (mut walls, meshes) = compile_walls(input)?;
        let free = compile_free_walls(input, &mut walls)?;
        let periodic = super::periodic::compile(input, &walls)?;
        super::periodic::check_deformation(input, &options)?;
        let clumps = clumps::compile(input, &options)?;
        let flow = flow::compile(input)?;
        let (laws, law_table, materials) = compile_laws(input)?;
        let (joints, loads) = clumps::carry(input, &clumps);
        let links = compile_links(input, &joints, &loads)?;
        let bodies = Bodies::new(input, &free, &clumps);
        // Balls of clumps have none.
        let inverse = |m: &f64| if *m > 0.0 { 1.0 / m } else { 0.0 };
        let model = Model {
            gravity: DVec3::from(input.gravity),
            inv_mass: bodies.mass.iter().map(inverse).collect(),
            inv_inertia: bodies.inertia.iter().map(inverse).collect(),
            radius: bodies.radius,
            mass: bodies.mass,
            inertia: bodies.inertia,
            material: input.material.clone(),
            free_walls: free,
            clump_of: owners(&clumps, n),
            held_apart: HeldApart::new(&input.joints, &input.radius, &clumps),
            clumps,
            drop_impacts: input.drop_impacts,
            every_impact: input.every_impact && !input.drop_impacts,
            courses: input.courses && !input.drop_impacts,
            record_walls: input.record_walls
                || !input.free_walls.is_empty()
                || walls.iter().any(|w| w.motion.is_some()),
            walls,
            meshes,
            periodic,
            deformation: input.deformation.clone(),
            flow,
            laws,
            law_table,
            materials,
            joints,
            loads,
            links,
            options,
        };
        let initial = initial(input, &model);
        Ok((model, initial))
    }
}

/// Where all bodies are at the start, and how they move: balls, clumps, free walls.
fn initial(input: &ModelInput, model: &Model) -> InitialState {
    let vectors = |v: &[[f64; 3]]| v.iter().map(|x| DVec3::from(*x)).collect::<Vec<_>>();
    let mut initial = InitialState {
        position: vectors(&input.position),
        orientation: input.orientation.iter().map(|q| quaternion(*q)).collect(),
        velocity: vectors(&input.velocity),
        angular_velocity: vectors(&input.angular_velocity),
    };
    for given in &input.clumps {
        initial.position.push(DVec3::from(given.position));
        initial.orientation.push(quaternion(given.orientation));
        initial.velocity.push(DVec3::from(given.velocity));
        let turning = DVec3::from(given.angular_velocity);
        initial.angular_velocity.push(turning);
    }
    for (wall, given) in model.free_walls.iter().zip(&input.free_walls) {
        initial.position.push(DVec3::ZERO);
        initial.orientation.push(DQuat::IDENTITY);
        initial.velocity.push(given.velocity * wall.normal);
        initial.angular_velocity.push(DVec3::ZERO);
    }
    initial
}

/// Free walls, which are marked as such.
fn compile_free_walls(input: &ModelInput, walls: &mut [Wall]) -> Result<Vec<FreeWall>, ModelError> {
    let gravity = DVec3::from(input.gravity);
    let mut free = Vec::with_capacity(input.free_walls.len());
    for (index, given) in input.free_walls.iter().enumerate() {
        let of_wall = |why| Entry("free wall", index).refused(why);
        Entry("free wall", index).positive("mass", given.mass)?;
        if given.wall as usize != index || index >= walls.len() {
            let text = format!("is {}; free walls are the first ones, in order", given.wall);
            return Err(of_wall(("wall", text)));
        }
        let world = (gravity, input.periodic);
        free.push(FreeWall::new(walls, given, world).map_err(of_wall)?);
        walls[index].set_free();
    }
    Ok(free)
}

/// Checks joints and loads and lists what they join.
fn compile_links(
    input: &ModelInput,
    on_movers: &[Joint],
    loads: &[Arc<dyn Load>],
) -> Result<Vec<Link>, ModelError> {
    let n = input.radius.len();
    let mut links = Vec::new();
    let missing = |kind, index, body: u32| {
        let text = format!("is {body}; there are {n} spheres");
        Entry(kind, index).refused(("body", text))
    };
    for (index, (j, on_mover)) in input.joints.iter().zip(on_movers).enumerate() {
        for body in [j.a, j.b] {
            if body as usize >= n && !(body == GROUND && body == j.b) {
                return Err(missing("joint", index, body));
            }
        }
        let of_joint = |why| Entry("joint", index).refused(why);
        if j.a == j.b {
            return Err(of_joint(("body", "joins a sphere with itself".to_owned())));
        }
        if on_mover.a == on_mover.b {
            let text = "joins two spheres of one clump, which are one body".to_owned();
            return Err(of_joint(("body", text)));
        }
        let leading = |kind| (kind != RowKind::Rotation) as usize;
        let translational = j.rows.iter().take_while(|r| leading(r.kind) == 1).count();
        let sorted = j.rows[translational..].iter().all(|r| leading(r.kind) == 0);
        if j.rows.is_empty() || j.rows.len() > 6 || !sorted || translational != j.translational {
            let text = "must be 1 to 6, points and distances before rotations".to_owned();
            return Err(of_joint(("rows", text)));
        }
        wall::size("length", j.length).map_err(of_joint)?;
        for row in &j.rows {
            // Where a ball may be, its points may be: distances and levers are squared.
            for arm in [row.arm_a, row.arm_b] {
                wall::place("arms", arm).map_err(of_joint)?;
            }
            let unit = (row.direction.length() - 1.0).abs() < 1e-9;
            if row.kind != RowKind::Distance && !unit {
                return Err(of_joint(("direction", "must be a unit vector".to_owned())));
            }
            let law = row.law.check_slope_at_start();
            law.map_err(|text| of_joint(("law", text)))?;
        }
        links.push(Link {
            a: on_mover.a,
            b: if on_mover.grounded() {
                on_mover.a
            } else {
                on_mover.b
            },
            kind: LinkKind::Joint(index as u32),
        });
    }
    for (index, (load, on_mover)) in input.loads.iter().zip(loads).enumerate() {
        let bodies = load.bodies();
        if let Some(body) = bodies.into_iter().flatten().find(|&b| b as usize >= n) {
            return Err(missing("load", index, body));
        }
        load.check()
            .map_err(|why| Entry("load", index).refused(why))?;
        if let Dependence::Motion(a, b) = on_mover.dependence() {
            links.push(Link {
                a,
                b: b.unwrap_or(a),
                kind: LinkKind::Load(index as u32),
            });
        }
    }
    Ok(links)
}

fn check_lengths(input: &ModelInput, n: usize) -> Result<(), ModelError> {
    let planes = input.plane_point.len();
    for (name, found, expected) in [
        ("mass", input.mass.len(), n),
        ("inertia", input.inertia.len(), n),
        ("material", input.material.len(), n),
        ("position", input.position.len(), n),
        ("orientation", input.orientation.len(), n),
        ("velocity", input.velocity.len(), n),
        ("angular_velocity", input.angular_velocity.len(), n),
        ("plane_normal", input.plane_normal.len(), planes),
        ("plane_material", input.plane_material.len(), planes),
    ] {
        if found != expected {
            return Err(ModelError::Length {
                name,
                found,
                expected,
            });
        }
    }
    Ok(())
}

fn compile_walls(input: &ModelInput) -> Result<(Vec<Wall>, Vec<MeshWall>), ModelError> {
    let mut walls = Vec::with_capacity(input.plane_point.len() + input.walls.len());
    for (p, ((point, normal), material)) in input
        .plane_point
        .iter()
        .zip(&input.plane_normal)
        .zip(&input.plane_material)
        .enumerate()
    {
        let plane = Shape::HalfSpace {
            point: DVec3::from(*point),
            normal: DVec3::from(*normal),
        };
        let plane = checked(&plane).map_err(|why| Entry("plane", p).refused(why))?;
        walls.push(Wall::new(plane, *material, p as u32));
    }
    for (w, (shape, material)) in input.walls.iter().enumerate() {
        let shape = checked(shape).map_err(|why| Entry("wall", w).refused(why))?;
        walls.push(Wall::new(shape, *material, walls.len() as u32));
    }
    let (simple, mut meshes) = (walls.len(), Vec::new());
    for (k, (mesh, point, material)) in input.meshes.iter().enumerate() {
        wall::place("point", *point).map_err(|why| Entry("mesh", k).refused(why))?;
        let (first, given) = (walls.len(), (simple + k) as u32);
        let parts = mesh.walls().iter();
        walls.extend(parts.map(|shape| Wall::new(*shape, *material, given)));
        meshes.push(MeshWall {
            mesh: Arc::clone(mesh),
            point: *point,
            walls: first..walls.len(),
        });
    }
    for (index, (wall, motion)) in input.wall_motion.iter().enumerate() {
        let of_motion = |why| Entry("wall motion", index).refused(why);
        motion.check().map_err(of_motion)?;
        let count = simple + meshes.len();
        if *wall as usize >= count {
            let text = format!("is {wall}; there are {count} walls");
            return Err(of_motion(("wall", text)));
        }
        let motion = Arc::new(motion.clone());
        for target in walls.iter_mut().filter(|w| w.given == *wall) {
            target.motion = Some(Arc::clone(&motion));
        }
    }
    crate::wall::number(&mut walls);
    Ok((walls, meshes))
}

type LawTable = (Vec<ContactLaw>, Vec<u32>, usize);

fn compile_laws(input: &ModelInput) -> Result<LawTable, ModelError> {
    let used = input.material.iter().chain(&input.plane_material).copied();
    let used = used.chain(input.walls.iter().map(|w| w.1));
    let used = used.chain(input.meshes.iter().map(|m| m.2));
    let named = input.laws.iter().flat_map(|(a, b, _)| [*a, *b]);
    let materials = used.chain(named).max().map_or(0, |m| m as usize + 1);
    if materials > 4096 {
        let text = format!("ids go up to {materials}; at most 4096 are admitted");
        return Err(Entry("world", 0).refused(("material", text)));
    }
    let mut table = vec![0u32; materials * materials];
    let mut laws = Vec::with_capacity(input.laws.len());
    let varying = [
        ("friction", "friction_law", &input.friction_law),
        ("restitution", "restitution_law", &input.restitution_law),
    ];
    let expected = input.laws.len();
    for (_, name, list) in varying {
        if !list.is_empty() && list.len() != expected {
            return Err(ModelError::Length {
                name,
                found: list.len(),
                expected,
            });
        }
    }
    for (index, (a, b, values)) in input.laws.iter().enumerate() {
        let [mu, e_n, e_t, rho, delta] = *values;
        let of_law = Entry("contact law", index);
        of_law.finite("coefficients", values)?;
        let stiffness = input.stiffness_ratio.get(index).copied().unwrap_or(1.0);
        let stiff = stiffness > 0.0 && stiffness.is_finite();
        let of = |list: &[f64]| list.get(index).copied().unwrap_or(0.0);
        let (cohesion, rupture) = (of(&input.cohesion), of(&input.rupture_distance));
        let attracts = cohesion >= 0.0 && cohesion.is_finite();
        let reaches = rupture.is_finite() && rupture >= 0.0 && (rupture > 0.0 || cohesion == 0.0);
        #[rustfmt::skip]
        let ranges = [
            ("friction", mu, mu >= 0.0, "not be negative"),
            ("rolling_radius", rho, rho >= 0.0, "not be negative"),
            ("spinning_radius", delta, delta >= 0.0, "not be negative"),
            ("restitution", e_n, (0.0..=1.0).contains(&e_n), "lie in [0, 1]"),
            ("tangential_restitution", e_t, -1.0 < e_t && e_t <= 1.0, "lie in (-1, 1]"),
            ("stiffness_ratio", stiffness, stiff, "be finite and above 0"),
            ("cohesion", cohesion, attracts, "be finite and not negative"),
            ("rupture_distance", rupture, reaches, "be finite and above 0 where there is cohesion"),
        ];
        if let Some((quantity, value, _, must)) = ranges.into_iter().find(|range| !range.2) {
            let text = format!("is {value}; it must {must}");
            return Err(of_law.refused((quantity, text)));
        }
        let mut functions = [None, None];
        for (function, (quantity, _, list)) in functions.iter_mut().zip(varying) {
            *function = list.get(index).cloned().flatten();
            if let Some(law) = function {
                law.check()
                    .map_err(|text| of_law.refused((quantity, text)))?;
            }
        }
        let [friction_law, restitution_law] = functions;
        let id = laws.len() as u32 + 1;
        table[*a as usize * materials + *b as usize] = id;
        table[*b as usize * materials + *a as usize] = id;
        laws.push(ContactLaw {
            bounds: Bounds {
                sliding: mu,
                rolling: rho,
                spinning: delta,
            },
            friction_law,
            restitution: e_n,
            restitution_law,
            stiffness,
            tangential_restitution: e_t,
            cohesion,
            rupture_distance: rupture,
        });
    }
    Ok((laws, table, materials))
}
