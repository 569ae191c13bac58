"""From the tree to what the core takes: arrays without names, and every ball of every generator."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.areas import sides
from carom.scene.assembly.bodies import Bodies, expand
from carom.scene.assembly.mechanics import MECHANICS, joints_for_core, loads_for_core, numbers, references
from carom.scene.assembly.placing import Placed, motion_for_core, placed_walls
from carom.scene.tables.balls import Lattice, Rack, Sphere
from carom.scene.tables.joints import default_name
from carom.scene.tables.laws import LawValue, as_core
from carom.scene.tables.model import Contact, Scenario
from carom.scene.tables.packing import Packing
from carom.scene.tables.walls import MESH, PLANE, WALLS

EXPANDED = 10_000
"""A resolved scenario holds the balls of its generators one by one up to this number, the generators beyond it."""

LAW_KEYS = tuple(name for name in Contact.model_fields if name != "between")
"""Numbers of a contact law: all keys of its table but the pair that it is of."""

GENERATED = ("sphere", "rack", "lattice", "clump", "inflow")
"""Sections of balls when packings are expanded, in the order of the arrays."""

COHESION = ("cohesion", "rupture_distance")
"""Those of pairs that attract each other; left out where none do, as in all scenes of older runs."""

VARYING = ("friction", "restitution")
"""Those that may be laws of a speed."""


def bodies(tree: Scenario) -> Bodies:
    """All balls of a scenario."""
    tree = with_packings_expanded(tree)
    entries = {name: list(enumerate(getattr(tree, name))) for name in GENERATED}
    return expand(entries, [m.name for m in tree.material])


def walls(tree: Scenario) -> list[Placed]:
    """All walls of a scenario, in the order of the core."""
    return placed_walls({name: list(enumerate(getattr(tree, name))) for name in WALLS})


def to_arrays(tree: Scenario) -> dict[str, Any] | None:
    """The argument of `carom._core.Simulation` (`_core.pyi` has names, units and shapes); None if a material is unknown."""
    materials = {m.name: i for i, m in enumerate(tree.material)}
    surfaces = walls(tree)
    used = {wall.material for wall in surfaces} | {name for c in tree.contact for name in c.between}
    balls = bodies(tree)
    if not used <= set(materials) or balls.material.min(initial=0) < 0:
        return None
    mechanics = _mechanics(tree, balls)
    if mechanics is None:
        return None
    laws = tree.contact
    planes = [wall for wall in surfaces if wall.kind == PLANE]
    return {
        "gravity": np.array(tree.world.gravity),
        "radius": balls.radius,
        "mass": balls.mass,
        "inertia": balls.inertia,
        "position": balls.position,
        "velocity": balls.velocity,
        "angular_velocity": balls.angular_velocity,
        "orientation": balls.orientation,
        "material": balls.material,
        "plane_point": _rows([p.point for p in planes]),
        "plane_normal": _rows([p.shape[1] for p in planes]),
        "plane_material": np.array([materials[p.material] for p in planes], dtype=np.int64),
        "law_a": np.array([materials[c.between[0]] for c in laws], dtype=np.int64),
        "law_b": np.array([materials[c.between[1]] for c in laws], dtype=np.int64),
        **without_idle_cohesion(law_arrays(tree)),
        **mechanics,
        **_surfaces(surfaces, len(planes), materials, tree.world.periodic),
        **_clumps(tree, balls),
        **_world(tree, balls),
        "options": tree.run.options(),
    }


def law_arrays(tree: Scenario) -> dict[str, F64]:
    """The numbers of the contact laws, one row per law."""
    laws = tree.contact
    return {key: np.array([_constant(getattr(c, key)) for c in laws], dtype=np.float64) for key in LAW_KEYS}


def without_idle_cohesion(model: dict[str, Any]) -> dict[str, Any]:
    """The same without `COHESION` where no pair attracts."""
    idle = COHESION if not np.any(model["cohesion"]) else ()
    return {key: value for key, value in model.items() if key not in idle}


def _constant(value: LawValue) -> float:
    """The number of a contact law, 0 where a law takes its place."""
    return 0.0 if isinstance(value, dict) else value


def _mechanics(tree: Scenario, balls: Bodies) -> dict[str, Any] | None:
    """Joints, loads and laws of contacts, each only if there are any; None if a name or a function is unknown."""
    found: dict[str, Any] = {}
    for name in VARYING:
        values = [getattr(c, name) for c in tree.contact]
        if any(isinstance(value, dict) for value in values):
            found[f"{name}_law"] = [as_core(value) if isinstance(value, dict) else None for value in values]
    if not (tree.joint or tree.load or tree.spring or tree.drag or tree.load_function):
        return found
    number = numbers(balls)
    entries = {name: list(enumerate(getattr(tree, name))) for name in MECHANICS}
    named = (reference.name for reference in references(entries))
    if any(f.function is None for f in tree.load_function) or not all(name in number for name in named):
        return None
    joints = joints_for_core(tree.joint, balls, number)
    loads = loads_for_core(tree.load, tree.spring, tree.drag, tree.load_function, balls, number)
    return found | {key: rows for key, rows in (("joints", joints), ("loads", loads)) if rows}


def _surfaces(
    surfaces: list[Placed], planes: int, materials: dict[str, int], periods: Sequence[float] | None
) -> dict[str, Any]:
    """Walls that are no half-spaces, and how walls move, each only if there are any."""
    shapes, meshes = [], []
    for wall in surfaces[planes:]:
        about = {"point": list(wall.point), "material": materials[wall.material]}
        if wall.kind == MESH:
            made = wall.shape[1]
            meshes.append(about | {"vertices": made.vertices, "triangles": made.corners})
        else:
            shapes.append({"shape": wall.shape} | about)
    motions = [(k, motion_for_core(wall)) for k, wall in enumerate(surfaces) if wall.motion is not None]
    free = [
        wall.free.for_core(k, sides(k, surfaces, periods) if wall.free.follows() else ())
        for k, wall in enumerate(surfaces)
        if wall.free is not None
    ]
    found = (("walls", shapes), ("meshes", meshes), ("wall_motion", motions), ("free_walls", free))
    return {key: rows for key, rows in found if rows}


def _clumps(tree: Scenario, balls: Bodies) -> dict[str, Any]:
    """Clumps, if there are any."""
    first = [k for s in balls.segments if s.each for k in range(s.start, s.stop, s.each)]
    made = [clump.for_core(k) for clump, k in zip(tree.clumps(), first, strict=True)]
    return {"clumps": made} if made else {}


def _world(tree: Scenario, balls: Bodies) -> dict[str, Any]:
    """Periods, inflows, outlets and the wishes on what to record, each only if there are any."""
    found: dict[str, Any] = {"record_walls": True} if tree.record.walls else {}
    if not tree.record.impacts:
        found["drop_impacts"] = True
    if isinstance(tree.record.impacts, str):
        found["every_impact"] = True
    if tree.record.impacts == "history":
        found["courses"] = True
    if tree.world.periodic is not None and any(tree.world.periodic):
        found["periodic"] = np.array(tree.world.periodic)
        found["periodic_origin"] = np.array(tree.world.origin)
        if tree.world.deformation is not None and (deforms := tree.world.deformation.for_core()):
            found["deformation"] = deforms
    if tree.inflow:
        coming = [s for s in balls.segments if s.section == "inflow"]
        clump = balls.clump
        first = [len(clump) + int(clump[s.start]) if s.each else s.start for s in coming]
        found["inflow"] = [table.as_core(k) for table, k in zip(tree.inflow, first, strict=True)]
    if tree.outlet:
        found["outlet"] = [table.as_core() for table in tree.outlet]
    return found


def _rows(vectors: Sequence[Sequence[float]]) -> F64:
    return np.array(vectors, dtype=np.float64).reshape(len(vectors), 3)


def with_packings_expanded(tree: Scenario) -> Scenario:
    """The same scenario with the balls of its packings behind its single spheres; `PackingError` if one cannot be had."""
    if not tree.packing:
        return tree
    packed = [sphere for packing in tree.packing for sphere in packing.spheres()]
    return tree.model_copy(update={"sphere": [*tree.sphere, *packed], "packing": []})


def with_generators_expanded(tree: Scenario) -> Scenario:
    """The same scenario with single spheres in place of all generators, in the same order and of the same bits."""
    generators: list[Packing | Rack | Lattice] = [*tree.packing, *tree.rack, *tree.lattice]
    if not generators or sum(g.size() for g in generators) > EXPANDED:
        return tree
    tree = with_packings_expanded(tree)
    balls = bodies(tree)
    spheres = list(tree.sphere)
    for segment in balls.segments[len(spheres) :]:
        if segment.section in ("clump", "inflow"):
            continue  # clumps are kept whole, and what enters later is no sphere of the start
        table = getattr(tree, segment.section)[segment.index]
        same = table.model_dump(
            include={"material", "radius", "mass", "density", "inertia"}, exclude_none=True
        )
        for k in range(segment.start, segment.stop):
            position, velocity = balls.position[k].tolist(), balls.velocity[k].tolist()
            spheres.append(Sphere(name=balls.names[k], position=position, velocity=velocity, **same))
    return tree.model_copy(update={"sphere": spheres, "rack": [], "lattice": []})


def resolved_tree(tree: Scenario) -> Scenario:
    """The same scenario with generators expanded, the default names of joints, the points of meshes and the
    masses of clumps written down.
    """
    tree = with_generators_expanded(tree)
    named = [j.name or default_name(i) for i, j in enumerate(tree.joint)]
    joints = [j.model_copy(update={"name": name}) for j, name in zip(tree.joint, named, strict=True)]
    meshes = [mesh.resolved() for mesh in tree.mesh]
    clumps = [clump.resolved() for clump in tree.clump]
    return tree.model_copy(update={"joint": joints, "mesh": meshes, "clump": clumps})


def identify(model: Mapping[str, Any]) -> str:
    """SHA-256 of everything a state depends on: the arrays and options of the model, threads aside."""
    digest = hashlib.sha256()

    def feed(name: str, value: Any) -> None:
        if name == "/deformation":  # laws and numbers of axes
            digest.update(f"{name} {sorted(value.items())!r}".encode())
        elif isinstance(value, Mapping):
            for key in sorted(value):
                feed(f"{name}/{key}", value[key])
        elif name == "/meshes":
            for k, mesh in enumerate(value):
                feed(f"{name}/{k}", mesh)
        elif isinstance(value, list):  # joints, loads, laws: numbers and texts; functions show their names
            digest.update(f"{name} {value!r}".encode())
        elif name != "/options/threads":
            array = np.asarray(value)
            digest.update(f"{name} {array.dtype.kind} {array.shape}".encode())
            digest.update(repr(array.tolist()).encode() if array.dtype.kind in "OU" else array.tobytes())

    feed("", model)
    return digest.hexdigest()
