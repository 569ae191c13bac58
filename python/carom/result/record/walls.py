"""Walls as the static tables of a results file, from the model that the core gets."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

#: Columns that the parameters of each shape go to, in their order; `axis` is the normal of a flat one.
PARAMETERS = {
    "rectangle": ("axis", "side", "size"),
    "disc": ("axis", "radius", "hole"),
    "cylinder": ("axis", "radius", "length", "inside"),
    "sphere": ("radius", "inside"),
    "cone": ("axis", "radius", "radius_end", "length", "inside"),
    "mesh": (),
}
WIDTHS = {"axis": 3, "side": 3, "size": 2, "radius": 1, "hole": 1, "radius_end": 1, "length": 1}


def tables(names: Sequence[str], model: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """`planes`, and if there are any `walls` and the tables of meshes; `names` are those of all walls, in
    the order of the core.
    """
    moving = {int(k): json.dumps(motion) for k, motion in model.get("wall_motion", ())}
    motion = [moving.get(k, "") for k in range(len(names))]
    count = len(model["plane_point"])
    planes = {"name": names[:count], **{k: model[f"plane_{k}"] for k in ("point", "normal", "material")}}
    if any(motion[:count]):
        planes["motion"] = motion[:count]
    free = [json.dumps(wall) for wall in model.get("free_walls", ())]
    if free:
        planes["free"] = [*free, *[""] * (count - len(free))]
    found: dict[str, dict[str, Any]] = {"planes": planes}
    meshes = model.get("meshes", ())
    others = [*model.get("walls", ()), *({"shape": ("mesh",), **mesh} for mesh in meshes)]
    if meshes:
        first = len(names) - len(meshes)
        for table, name, rows in (("points", "position", "vertices"), ("triangles", "corners", "triangles")):
            found[f"mesh_{table}"] = {
                "wall": np.repeat(np.arange(first, len(names)), [len(mesh[rows]) for mesh in meshes]),
                name: np.concatenate([mesh[rows] for mesh in meshes]),
            }
    if others:
        found["walls"] = {
            "name": names[count:],
            "shape": [wall["shape"][0] for wall in others],
            "point": np.array([wall["point"] for wall in others]),
            **_parameters([wall["shape"] for wall in others]),
            "material": np.array([wall["material"] for wall in others], dtype=np.int64),
            "motion": motion[count:],
        }
    return found


def _parameters(shapes: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """A column for each parameter, not a number where a shape has none of that name."""
    found = {
        name: np.full((len(shapes), width) if width > 1 else len(shapes), np.nan)
        for name, width in WIDTHS.items()
    }
    inside = np.zeros(len(shapes), dtype=bool)
    for k, (kind, *values) in enumerate(shapes):
        for name, value in zip(PARAMETERS[kind], values, strict=True):
            if name == "inside":
                inside[k] = value
            else:
                found[name][k] = value
    return {**found, "inside": inside}
