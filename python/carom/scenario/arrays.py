"""From the tree to what the core takes: arrays without names, and every ball of every generator."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.scenario.bodies import F64, Bodies, expand
from carom.scenario.model import Scenario, Sphere
from carom.scenario.vectors import scaled

EXPANDED = 10_000
"""A resolved scenario holds the balls of its generators one by one up to this number, the generators beyond it."""

LAW_KEYS = ("friction", "restitution", "tangential_restitution", "rolling_radius", "spinning_radius")


def bodies(tree: Scenario) -> Bodies:
    """All balls of a scenario."""
    entries = {name: list(enumerate(getattr(tree, name))) for name in ("sphere", "rack", "lattice")}
    return expand(entries, [m.name for m in tree.material])


def to_arrays(tree: Scenario) -> dict[str, Any] | None:
    """The argument of `carom._core.Simulation` (`_core.pyi` has names, units and shapes); None if a material is unknown."""
    materials = {m.name: i for i, m in enumerate(tree.material)}
    used = {p.material for p in tree.plane} | {name for c in tree.contact for name in c.between}
    balls = bodies(tree)
    if not used <= set(materials) or balls.material.min(initial=0) < 0:
        return None
    laws = tree.contact
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
        "plane_point": _rows([p.point for p in tree.plane]),
        "plane_normal": _rows([scaled(p.normal) for p in tree.plane]),
        "plane_material": np.array([materials[p.material] for p in tree.plane], dtype=np.int64),
        "law_a": np.array([materials[c.between[0]] for c in laws], dtype=np.int64),
        "law_b": np.array([materials[c.between[1]] for c in laws], dtype=np.int64),
        **{key: np.array([getattr(c, key) for c in laws], dtype=np.float64) for key in LAW_KEYS},
        "options": tree.run.options(),
    }


def _rows(vectors: list[tuple[float, ...]]) -> F64:
    return np.array(vectors, dtype=np.float64).reshape(len(vectors), 3)


def with_generators_expanded(tree: Scenario) -> Scenario:
    """The same scenario with single spheres in place of racks and lattices, in the same order and of the same bits."""
    generators = [*tree.rack, *tree.lattice]
    if not generators or sum(g.size() for g in generators) > EXPANDED:
        return tree
    balls = bodies(tree)
    spheres = list(tree.sphere)
    for segment in balls.segments[len(spheres) :]:
        table = getattr(tree, segment.section)[segment.index]
        same = table.model_dump(
            include={"material", "radius", "mass", "density", "inertia"}, exclude_none=True
        )
        for k in range(segment.start, segment.stop):
            position, velocity = balls.position[k].tolist(), balls.velocity[k].tolist()
            spheres.append(Sphere(name=balls.names[k], position=position, velocity=velocity, **same))
    return tree.model_copy(update={"sphere": spheres, "rack": [], "lattice": []})
